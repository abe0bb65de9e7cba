//! The command `quintile`: arguments, progress, exit codes. What it does is in the crates it calls: [`run`], [`experiments`],
//! [`traces`], [`output`].

pub mod cli;
