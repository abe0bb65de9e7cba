//! Output: files in a folder of results, and lines on the terminal.
//!
//! - [`dir`]: the folder of results; results appear together when all are complete.
//! - [`image`]: frames as PNG and EXR, thumbnails.
//! - [`plot`]: the plots as SVG and PNG, with an embedded font.
//! - [`perfetto`]: a timeline that the Perfetto viewer opens, written with [`protobuf`].
//! - [`report`]: one HTML page that works without network.
//! - [`table`]: numbers with SI prefixes and aligned tables.
//! - [`progress`]: progress bars, only on a terminal.
//! - [`terminal`]: errors, warnings and notes on standard error.
//!
//! Every part has input structs of its own and does not depend on the crate `run`. The bytes written depend
//! only on these inputs.

pub mod dir;
pub mod image;
pub mod perfetto;
pub mod plot;
pub mod progress;
pub mod protobuf;
pub mod report;
pub mod table;
pub mod terminal;

pub use dir::{Claim, Destination, OutDir, OutputError};
pub use table::MeanSd;
