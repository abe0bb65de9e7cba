//! The native format: Parquet with the columns `time_ns`, `voltage_V` and `current_A`, and one JSON text under the
//! key `trace` in the file's metadata.

mod write;

#[cfg(test)]
pub(crate) use write::bare;
pub use write::{save, write};
