//! Stereo and multi-view images with motion and defocus in one pass (thesis, Paper VI, section 8).
//!
//! The camera line is a wide lens of which each view samples a part. One pass renders all samples; what is shaded once serves every
//! view, the whole lens and the shutter, by way of the shading cache.
//!
//! - [`Layout`]: views on the camera line, apart as two small lenses or with overlapping box filters.
//! - [`Rig`]: all views in [one pass](Rig::one_pass), and the rivals: [view by view](Rig::view_by_view), by
//!   [accumulation](Rig::accumulated), and with [cameras of their own](Rig::own_cameras) as the truth about shading.
//! - [`Panel`]: interlacing for a display behind lenticular lenses.
//! - [`job`]: all of it as a job.

mod job;
mod layout;
mod lenticular;
mod rig;
mod rivals;
mod samples;

pub(crate) use job::FLAGS;
pub use job::{MOST_DEG, MOST_RUNS, MultiView, Options, Show, job};
pub use layout::Layout;
pub use lenticular::Panel;
pub use rig::{Rig, Target, Views};
