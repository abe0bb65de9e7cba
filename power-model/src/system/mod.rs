//! What surrounds the GPU and shows in a recording: the state after launch, a blocking finish, the operating system.
//!
//! All of it is extra power over stretches of time, on top of what [`crate::pace`] made: it does not delay frames.

mod pulse;
mod surround;

pub use pulse::{Cause, Pulse, overlay};
pub use surround::{Circumstances, Surrounded, SurroundedFrame};
