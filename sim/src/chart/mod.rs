//! Charts of the book: each measured, drawn and written in one go. One file or folder for each.

/// The charts there are, each with a line that says what it shows.
pub const CHARTS: [(&str, &str); 1] =
    [("sampling", "image error over samples per pixel and over host time, for every sample table")];
