//! Many frames from few: which frames of an animation to simulate, and what they say of the others.
//!
//! Frames are put in the order of a cheap *signature* and cut into strata; some of each are chosen at random and simulated
//! whole. A regression on the signature says what the others would have taken, and how sure that is.
//!
//! - [`Design`]: strata and representatives (Cochran 1977, chapter 5).
//! - [`Estimate`]: totals, single frames and their intervals (Cochran 1977, sections 7.10 and 5.4).
//! - [`student_t`]: how wide an interval has to be for few representatives.
//!
//! What it comes from: representatives of phases of a program, found by their signatures (SimPoint: Sherwood, Perelman,
//! Hamerly and Calder 2002), and sampling whose error is known from the samples themselves (SMARTS: Wunderlich, Wenisch,
//! Falsafi and Hoe 2003).
//!
//! The mathematics knows no frame: units are numbered from 0, values are in whatever unit the caller likes.

mod design;
mod estimate;
mod student;

pub use design::{Design, Stratum};
pub use estimate::{Estimate, Interval};
pub use student::student_t;
