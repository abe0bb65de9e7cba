//! The command `quintile`: arguments, progress, exit codes. The work is done by the crates [`run`],
//! [`experiments`], [`traces`], [`output`].

pub mod cli;
