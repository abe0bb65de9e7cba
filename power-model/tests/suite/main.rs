//! Tests of the whole crate, by what they promise.

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
mod system;
