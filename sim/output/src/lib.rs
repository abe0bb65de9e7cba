//! Output: files in a folder of results, and lines on the terminal.
//!
//! - [`dir`]: the folder of results; results appear together when all are complete.
//! - [`image`]: frames as PNG and EXR, thumbnails.
//! - [`plot`]: the plots as SVG and PNG, with an embedded font.
//! - [`report`]: one HTML page that works without network.
//! - [`table`]: numbers with SI prefixes and aligned tables.
//! - [`terminal`]: errors, warnings and notes on standard error, and progress bars, only on a terminal.
//!
//! Every part has input structs of its own and does not depend on the crate `run`. The bytes written depend
//! only on these inputs.
//!
//! ```
//! use output::table::si;
//! use output::{Claim, Destination};
//!
//! assert_eq!(si(0.01234, "J"), "12.3 mJ");
//!
//! let folder = std::env::temp_dir().join(format!("quintile-{}", std::process::id()));
//! let mut results = Destination::new(&folder).open([Claim::new("example").files(["sums.json"])])?;
//! results.write_json("sums.json", &[1, 2, 3])?;
//! // Until here the folder has none of the new files.
//! results.publish()?;
//! assert!(folder.join("sums.json").exists());
//! # std::fs::remove_dir_all(folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod dir;
pub mod image;
pub mod plot;
pub mod report;
pub mod table;
pub mod terminal;

pub use dir::{Claim, Destination, OutDir, OutputError};
pub use table::MeanSd;
