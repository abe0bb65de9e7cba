//! Continuous collision detection with a conservative rasterizer in screen and time (thesis, Paper VI,
//! section 3.2).
//!
//! Two objects collide if, at some time in [0, 1], a triangle of each shares a point. Every vertex moves on a
//! straight line, touching counts, and only surfaces count. The result is a *potentially colliding set*: it
//! contains every pair that collides, and may contain pairs that do not.
//!
//! Objects are drawn orthographically along each of the three axes. A contact lies, at its time, in a tile
//! that both objects touch, within the intervals of time and depth of both. If the intervals overlap in no
//! tile, the objects are apart, for any size of tiles and time bins. Otherwise the remaining space and time
//! bound every contact, and can be searched again with smaller tiles.
//!
//! - [`Object`]: moving triangles of a mesh; [`components`] splits a mesh.
//! - [`Bounds`]: boxes of space and time, swept and exact.
//! - [`candidates`]: the broad phase, pairs whose swept boxes touch.
//! - [`Search`], [`Method`]: parameters of a search; [`Verdict`]: its result.
//! - [`detect`]: all pairs of a case.
//! - [`Sweeps`]: the method of the paper for many objects, in two sweeps over all of them.
//! - [`PlainPasses`]: the passes of the paper for two objects, without narrowing on the CPU.
//! - [`families`]: test cases with known ground truth.
//! - [`job`]: the passes as a workload of the modelled hardware.

mod bounds;
mod contact_probe;
mod detect;
pub mod families;
mod job;
mod object;
mod on_gpu;
mod pair;
mod pass;
mod plain;

pub use bounds::Bounds;
pub use detect::{Answer, candidates, detect, detect_each};
pub(crate) use job::FLAGS;
pub use job::{CollisionOptions, job};
pub use object::{CaseFiles, CollisionCase, Object, components, load_cases};
pub use pair::{Method, Search, Verdict};
pub use plain::{CollidingSet, PlainPasses, PlainResult, Sweeps};
