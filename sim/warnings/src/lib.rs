//! Warnings: results are there, but a method is weak for this input, or something that a file asks for was ignored.
//!
//! A [`Warning`] has a [`Code`] that never changes its meaning, and a message for people. All codes are declared in one place, with
//! what they mean and the section of the book that explains them.
//!
//! ```
//! use warnings::{Code, Warning};
//!
//! let light = |node| {
//!     let what = "ignored: only one directional light is used";
//!     Warning::about(Code::LightIgnored, "point light", what, format!("node {node}"))
//! };
//! let folded = Warning::fold([light(4), light(7)]);
//! assert_eq!(folded[0].message, "2 point lights ignored: only one directional light is used");
//! assert_eq!(folded[0].code.name(), "light-ignored");
//! ```

mod code;

pub use code::{Code, Section, Warning};
