//! The letters of the plots: a subset of DejaVu Sans inside the command, so that no system font is needed.

/// The letters of Latin-1 and Latin Extended-A and the few signs plots use, regular. See `assets/README.md`.
pub const REGULAR: &[u8] = include_bytes!("../assets/DejaVuSans-subset.ttf");

/// The same, bold.
pub const BOLD: &[u8] = include_bytes!("../assets/DejaVuSans-Bold-subset.ttf");

/// The family named in SVG: DejaVu where the reader has it, else something of about the same width.
pub const FAMILY: &str = "DejaVu Sans, Verdana, Segoe UI, Helvetica, Arial, sans-serif";

/// The characters beyond the Latin letters that the subset has.
const SYMBOLS: &str = "–—…→←−≤≥≈ΩσμΔ∞";

/// Whether the subset has `letter`: ASCII, Latin-1, Latin Extended-A and [`SYMBOLS`].
fn has(letter: char) -> bool {
    matches!(letter, ' '..='~' | '\u{a0}'..='\u{17f}') || SYMBOLS.contains(letter)
}

/// `text` with every character that the subset lacks replaced by `?`, so that pictures show a sign and not a box.
pub fn drawable(text: &str) -> String {
    text.chars().map(|c| if has(c) { c } else { '?' }).collect()
}

#[cfg(test)]
mod tests {
    use ab_glyph::{Font, FontRef};

    use super::*;

    #[test]
    fn the_subset_has_every_letter_it_says() {
        for font in [REGULAR, BOLD].map(|bytes| FontRef::try_from_slice(bytes).unwrap()) {
            let named = |letter: char| font.glyph_id(letter).0 != 0;
            let lacking: String =
                ('\0'..'\u{3000}').filter(|&letter| has(letter) && !named(letter)).collect();
            assert_eq!(lacking, "");
            assert!(!has('\u{4e2d}') && !named('\u{4e2d}'));
        }
        assert_eq!(drawable("Größe Łódź 中"), "Größe Łódź ?");
    }
}
