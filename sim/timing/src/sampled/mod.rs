//! Sampled simulation: which frames of an animation to simulate, and estimates of the others.
//!
//! Frames are sorted by a cheap *signature* and split into strata. Some frames of each stratum are drawn at
//! random and simulated. A regression on the signature estimates the others, with confidence intervals.
//!
//! - [`Design`]: strata and representatives (Cochran 1977, chapter 5).
//! - [`Estimate`]: totals, single frames and their intervals (Cochran 1977, sections 7.10 and 5.4).
//! - [`student_t`]: width of an interval from few representatives.
//!
//! The method combines representatives found by the signatures of program phases (SimPoint: Sherwood,
//! Perelman, Hamerly and Calder 2002) with sampling whose error is estimated from the samples themselves
//! (SMARTS: Wunderlich, Wenisch, Falsafi and Hoe 2003).
//!
//! The module is independent of frames: units are numbered from 0, and values have any unit.

mod design;
mod estimate;
mod student;

pub use design::{Design, Stratum};
pub use estimate::{Estimate, Interval};
pub use student::student_t;
