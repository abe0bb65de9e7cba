//! Occlusion queries in five dimensions (thesis, Paper VI, section 3).
//!
//! Is an object hidden behind what was drawn, at all times and from everywhere on the lens? A *sampled* query draws the box about it and
//! counts the samples that pass the depth test. A query by *intervals* touches no sample: over a tile the tile test leaves a box
//! of lens and time and an interval of depth, which is compared with the farthest depth stored for each box of lens and time of the
//! tile. Both answer for the samples there are.
//!
//! - [`Pyramid`]: the farthest depths of tiles, by boxes of lens and time, level by level.
//! - [`MovingBox`]: the box about an object, at both ends of the shutter.
//! - [`Queries`]: the query by intervals. *It never calls hidden what a sample sees.*
//! - [`Samples`]: the query by samples.
//! - [`Yard`]: walls, whole or in slats, with boxes behind them.

mod job;
mod pyramid;
mod query;
mod sampled;
mod yard;

pub(crate) use job::FLAGS;
pub use job::{HALF_COVERED, Options, job};
pub use pyramid::Pyramid;
pub use query::{Answer, MovingBox, Queries};
pub use sampled::{Samples, Seen, depths};
pub use yard::{Yard, YardSpec};
