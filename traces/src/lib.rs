//! Power traces, recorded or synthetic: reading and sampling them, finding frames in them, and the energy of
//! every frame.
//!
//! No simulator is needed. A recording of voltage and current, one marked frame start and the end of the last
//! frame are enough:
//!
//! 1. [`io`] reads a [`Trace`] from a file and writes it, in any of the [formats](io::FORMATS); the crate
//!    [`jls`] can be used alone;
//! 2. [`frames`] finds every frame that begins like the marked one, with the confidence of each start, and
//!    warns of results that may be wrong; [`stream`] does so for files that do not fit into memory, and
//!    [`search`] chooses between the two;
//! 3. [`energy`] integrates from start to start by one rule, so that the frames add up to the whole, and
//!    evaluates runs, passes, idle power, warm-up and outliers;
//! 4. [`pareto`] compares settings by time and energy, [`align`] puts time stamps of another clock onto a trace, and
//!    [`energy::score`] compares found frames with the ground truth.
//!
//! The other way round, [`device`] turns a noise-free power [`Curve`] into the trace that a recorder would
//! have written, and [`synth`] makes such curves with frames whose starts and energies are known. [`units`],
//! [`times`] and [`table`] read the small files around a measurement; [`pyramid`] gives overviews of long
//! traces.
//!
//! ```
//! use traces::{device::{Device, DeviceSpec}, energy::PowerIntegral, frames, Curve, CurveBuilder};
//!
//! // Ten frames at 100 Hz: 4 ms busy at 20 W, then idle at 5 W.
//! let mut builder = CurveBuilder::new(0.0)?;
//! builder.push(0.01, 5.0)?;
//! for _ in 0..10 {
//!     builder.push(0.004, 20.0)?;
//!     builder.push(0.006, 5.0)?;
//! }
//! let curve: Curve = builder.build()?;
//! let device = Device::new(DeviceSpec::default())?;
//! let trace = device.sample(&curve, 0.0, curve.end_s())?.trace;
//!
//! let window = frames::default_window(0.01, trace.rate_hz());
//! let found = frames::find(&trace, &frames::Marks::one(0.03, window, 0.11))?;
//! let energies = PowerIntegral::new(&trace).frames(&found);
//! assert_eq!(energies.len(), 10);
//! assert!((energies[4].energy_j - 0.11).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Guarantees
//! - The same input gives the same bytes: noise is a pure function of seed and sample, sums have a fixed order, and
//!   transcendental functions are those of `libm`.
//! - Sample `i` starts at `start + i / rate` (left edge) and is the mean over its period, everywhere.
//! - Input that is not a trace is an error that names file and row; nothing panics, and nothing is repaired silently.

pub mod align;
mod clock;
pub mod curve;
pub mod device;
pub mod energy;
pub mod frames;
pub mod io;
mod pairing;
pub mod pareto;
pub mod pyramid;
pub mod search;
pub mod stats;
pub mod stream;
pub mod synth;
pub mod table;
pub mod times;
pub mod trace;
pub mod units;

pub use curve::{Curve, CurveBuilder, CurveError};
pub use trace::{Mark, MarkKind, Metadata, Trace, TraceError};
