//! Tests of the whole crate, by kind.

#[cfg(test)]
mod analytic;
#[cfg(test)]
mod common;
#[cfg(test)]
mod derivations;
#[cfg(test)]
mod failure;
#[cfg(test)]
mod property;
#[cfg(test)]
mod structure;
#[cfg(test)]
mod system;
