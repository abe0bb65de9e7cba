//! Frame starts from one marked frame (the thesis' Paper III, section 3.1). A window of power around the mark
//! is compared with every window of the trace by summed squared difference. A threshold chosen from the trace
//! itself separates starts from the rest; where it cannot, the result carries a [`Warning`](warnings::Warning).
//!
//! Constants of the finder have their reason beside them. Those that state none were tuned on the synthetic scenes and
//! seeds of `docs/finding.md`, section *Flags*, which also has the result on seeds that were not used.

mod assess;
mod find;
mod found;
mod idle_gap;
mod marks;
mod matched;
mod periodicity;
pub mod profile;
mod refine;
mod register;
mod spans;
mod split_frames;
mod start_refinement;
mod threshold;
mod track;
mod tracked;
mod vsync;

pub(crate) use assess::{conclude_at, confidence};
pub use find::{Options, Proposal, find, find_with, marked_only, propose};
pub use found::{Flag, Flags, Found, FrameSpan, FrameStart, Method};
pub use marks::{MarkError, Marks, Window, default_window};
pub(crate) use marks::{Placed, Placement, flat_mark};
pub(crate) use matched::{misalignment_w2, noise_deviation, start_after_idle};
pub(crate) use periodicity::regularity;
pub(crate) use refine::vertex;
pub(crate) use threshold::choose;
pub use threshold::{Population, Rule, Threshold};
