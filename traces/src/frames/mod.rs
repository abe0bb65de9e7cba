//! Frame starts from one marked frame (the thesis' Paper III, section 3.1): a window of power around the mark is
//! compared with every stretch of the trace by summed squared difference; a threshold chosen from the trace itself
//! tells starts from the rest, and where it cannot, the result carries a [`Warning`](crate::Warning).

mod alike;
mod alternate;
mod assess;
mod auto;
mod beat;
mod correlate;
mod find;
mod first;
mod flags;
mod flat;
mod found;
mod lock;
mod marks;
mod matched;
mod method;
mod minima;
mod normalized;
pub mod profile;
mod propose;
mod refine;
mod register;
mod regularity;
mod rest;
mod settle;
mod spans;
mod split;
mod stretch;
mod threshold;
mod track;
mod tracked;
mod uncovered;
mod unrested;

pub use find::{Options, find, find_with, marked_only};
pub use flags::{Flag, Flags};
pub use found::{Found, FrameSpan, FrameStart};
pub use marks::{MarkError, Marks, Window, default_window};
pub use method::Method;
pub use propose::{Proposal, propose};
pub use threshold::{Population, Rule, Threshold};

// For the analysis of files in pieces.
pub(crate) use assess::{conclude_at, confidence};
pub(crate) use flat::flat_mark;
pub(crate) use marks::{Placed, Placement};
pub(crate) use matched::{misalignment_w2, noise_deviation, start_after_idle};
pub(crate) use refine::vertex;
pub(crate) use regularity::regularity;
pub(crate) use threshold::choose;
