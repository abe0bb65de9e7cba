//! What a run leaves behind: files in one folder, and lines on the terminal.
//!
//! - [`dir`]: the folder; results appear in it when all of them are whole.
//! - [`image`]: frames as PNG and EXR, thumbnails.
//! - [`plot`]: the plots, each drawn once into SVG and PNG with the letters of [`font`].
//! - [`perfetto`]: a timeline that the Perfetto viewer opens, written with [`protobuf`].
//! - [`report`]: one HTML page that shows it all and needs no network.
//! - [`table`]: numbers with SI prefixes and aligned tables.
//! - [`progress`]: bars on a terminal, silence in a pipe.
//! - [`terminal`]: errors, warnings and notes on standard error.
//!
//! Every part takes plain input structs of its own, so it knows nothing of the run that fills them. What is written
//! depends on these inputs alone, byte for byte.

pub mod dir;
pub mod font;
pub mod image;
pub mod perfetto;
pub mod plot;
pub mod progress;
pub mod protobuf;
pub mod report;
mod stats;
pub mod table;
pub mod terminal;

pub use dir::{Claim, Destination, OutDir, OutputError};
pub use stats::MeanSd;
