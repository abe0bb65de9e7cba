//! Continuous collision detection with a conservative rasterizer in screen and time (thesis, Paper VI, section 3.2).
//!
//! Two objects collide when at some time in [0, 1] a triangle of each shares a point; every vertex moves on a straight line,
//! touching counts, and only surfaces count. What is answered is a *potentially colliding set*: a pair that is not in it does not
//! collide, one that is may.
//!
//! Objects are drawn orthographically along each of the three axes. A point of contact lies, at its time, in a tile that both
//! touch, within the intervals of time and depth that the rasterizer promises for both. Where no tile has intervals that overlap there
//! is no contact, whatever the size of tiles and bins. What is left of space and time bounds every contact, so that it can be looked at
//! again, closer.
//!
//! - [`Object`]: triangles that move, from meshes; [`components`] takes a mesh apart.
//! - [`Bounds`]: boxes of space and time, swept and exact.
//! - [`candidates`]: the pairs whose swept boxes touch.
//! - [`Method`], [`Search`]: how closely a pair is looked at; [`Verdict`]: what is found.
//! - [`detect`]: all pairs of a case.
//! - [`PlainPasses`]: the passes of the paper alone, without any narrowing on the CPU.
//! - [`families`]: cases whose truth is known.
//! - [`job`]: the passes as a workload of the modelled hardware.

mod bounds;
mod buffer;
mod candidates;
mod cases;
mod closer;
mod compare;
mod crossing;
mod depth_only;
mod detect;
mod easel;
pub mod families;
mod frame;
mod glance;
mod job;
mod object;
mod pair;
mod pass;
mod picture;
mod plain;
mod run;
mod search;
mod window;

pub use bounds::Bounds;
pub use candidates::candidates;
pub use cases::{CaseFiles, CollisionCase, load_cases};
pub use detect::{Answer, detect, detect_each};
pub(crate) use job::FLAGS;
pub use job::{Options, job};
pub use object::{Object, components};
pub use plain::{Drawn, PlainPasses};
pub use search::{Method, Search, Verdict};
