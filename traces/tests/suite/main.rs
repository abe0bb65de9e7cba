//! Tests of the whole crate, a subject in each file.
#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

mod common;
mod corpus;
mod failure_files;
mod foreign_jls;
mod foreign_parquet;
mod jls_layout;
mod jls_write;
mod oracle_frames;
mod perfetto;
mod property_energy;
mod roundtrip_files;
