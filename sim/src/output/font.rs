//! The letters of the plots: a subset of DejaVu Sans inside the command, so that no system font is needed.

/// Printable ASCII and the few signs plots use, regular. See `assets/README.md`.
pub const REGULAR: &[u8] = include_bytes!("../../assets/DejaVuSans-subset.ttf");

/// The same, bold.
pub const BOLD: &[u8] = include_bytes!("../../assets/DejaVuSans-Bold-subset.ttf");

/// The family named in SVG: DejaVu where the reader has it, else something of about the same width.
pub const FAMILY: &str = "DejaVu Sans, Verdana, Segoe UI, Helvetica, Arial, sans-serif";

/// The characters beyond ASCII that the subset has.
pub const SYMBOLS: &str = "°±²³µ·×–—…→←−≤≥≈ΩσμΔ∞";

/// `text` with every character that the subset lacks replaced by `?`, so that pictures show a sign and not a box.
pub fn drawable(text: &str) -> String {
    text.chars().map(|c| if (' '..='~').contains(&c) || SYMBOLS.contains(c) { c } else { '?' }).collect()
}
