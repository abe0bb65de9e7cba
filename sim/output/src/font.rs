//! Font of the plots: an embedded subset of DejaVu Sans, so that no system font is needed.

/// Regular font with Latin-1, Latin Extended-A and the symbols of plots. See `assets/README.md`.
pub const REGULAR: &[u8] = include_bytes!("../assets/DejaVuSans-subset.ttf");

/// Bold font with the same characters.
pub const BOLD: &[u8] = include_bytes!("../assets/DejaVuSans-Bold-subset.ttf");

/// Font family in SVG: DejaVu if installed, otherwise fonts of similar width.
pub const FAMILY: &str = "DejaVu Sans, Verdana, Segoe UI, Helvetica, Arial, sans-serif";

/// Characters of the subset beyond the Latin letters.
const SYMBOLS: &str = "–—…→←−≤≥≈ΩσμΔ∞";

/// Whether the subset has `letter`.
fn has(letter: char) -> bool {
    matches!(letter, ' '..='~' | '\u{a0}'..='\u{17f}') || SYMBOLS.contains(letter)
}

/// Replaces every character that the subset lacks with `?`.
pub fn drawable(text: &str) -> String {
    text.chars().map(|c| if has(c) { c } else { '?' }).collect()
}

#[cfg(test)]
mod tests {
    use ab_glyph::{Font, FontRef};

    use super::*;

    #[test]
    fn the_subset_has_all_declared_letters() {
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
