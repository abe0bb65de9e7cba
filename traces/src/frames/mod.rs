//! Frame starts from one marked frame (the thesis' Paper III, section 3.1): a window of power around the mark is
//! compared with every stretch of the trace by summed squared difference; a threshold chosen from the trace itself
//! tells starts from the rest, and where it cannot, the result carries a [`Warning`](crate::Warning).

mod assess;
mod find;
mod first;
mod flags;
mod marks;
mod minima;
pub mod profile;
mod refine;
mod regularity;
mod split;
mod threshold;

pub use find::{find, Found, FrameSpan, FrameStart};
pub use flags::{Flag, Flags};
pub use marks::{default_window, MarkError, Marks, Window};
pub use threshold::{Population, Rule, Threshold};
