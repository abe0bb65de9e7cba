//! Stereo and multi-view images with motion and defocus in one pass (thesis, Paper VI, section 8).
//!
//! The camera line is a wide lens, of which each view samples a part. One pass renders all samples. A shaded
//! value serves all views, the whole lens and the shutter, through the shading cache.
//!
//! - [`Layout`]: views on the camera line, as two small lenses or with overlapping box filters.
//! - [`Rig`]: all views in [one pass](Rig::one_pass), and for comparison [view by view](Rig::view_by_view),
//!   by [accumulation](Rig::accumulated), and with [separate cameras](Rig::own_cameras), the ground truth of
//!   shading.
//! - [`Panel`]: interlacing for a display behind lenticular lenses.
//! - [`job()`]: the workload.

mod job;
mod layout;
mod rig;

pub(crate) use job::FLAGS;
pub use job::{MAX_RUNS_OVER_INFINITE_CACHE, MAX_VIEW_ANGLE_DEG, MultiView, MultiViewOptions, Show, job};
pub use layout::{Layout, Panel};
pub use rig::{Rig, Target, Views};
