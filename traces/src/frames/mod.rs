//! Frame starts from one marked frame (the thesis' Paper III, section 3.1): a window of power around the mark is
//! compared with every stretch of the trace by summed squared difference; a threshold chosen from the trace itself
//! tells starts from the rest, and where it cannot, the result carries a [`Warning`](crate::Warning).

mod assess;
mod correlate;
mod find;
mod first;
mod flags;
mod marks;
mod method;
mod minima;
pub mod profile;
mod refine;
mod register;
mod regularity;
mod split;
mod threshold;
mod track;

pub use find::{Found, FrameSpan, FrameStart, Options, find, find_with, marked_only};
pub use flags::{Flag, Flags};
pub use marks::{MarkError, Marks, Window, default_window};
pub use method::Method;
pub use threshold::{Population, Rule, Threshold};
