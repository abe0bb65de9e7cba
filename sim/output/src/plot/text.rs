//! Text in pictures: the embedded font, text width, and shortening of text that is too wide.
//!
//! The font is a subset of DejaVu Sans, so no system font is needed.

use std::sync::OnceLock;

use plotters::style::{FontFamily, FontStyle, IntoFont, register_font};

/// Resolution of text measurement and SVG over that of the picture; PNG is drawn with it and then halved.
pub(super) const SCALE: f64 = 2.0;

/// Font size of `plotters` over the em of the font.
pub(super) const SIZE_OVER_EM: f64 = 1.24;

/// Registers the embedded fonts with `plotters`, once. Returns whether this succeeded.
pub(super) fn register() -> bool {
    static DONE: OnceLock<bool> = OnceLock::new();
    *DONE.get_or_init(|| {
        register_font(FAMILY, FontStyle::Normal, REGULAR).is_ok()
            && register_font(FAMILY, FontStyle::Bold, BOLD).is_ok()
    })
}

/// The font with an em of `size` steps of the backend.
pub(super) fn plotters_font(size: f64, bold: bool) -> plotters::style::FontDesc<'static> {
    let style = if bold { FontStyle::Bold } else { FontStyle::Normal };
    (FontFamily::Name(FAMILY), size * SIZE_OVER_EM, style).into_font()
}

/// The width in pixels of `text` in letters of `size`.
pub(super) fn text_width(text: &str, size: f64, bold: bool) -> f64 {
    // A damaged font is reported when the picture is rendered; until then about half an em a letter will do.
    let guess = text.chars().count() as f64 * size * 0.6;
    if !register() {
        return guess;
    }
    plotters_font(size * SCALE, bold).box_size(text).map_or(guess, |(width, _)| f64::from(width) / SCALE)
}

/// Breaks `label` between words into lines of at most `room` pixels.
pub(super) fn wrapped(label: &str, size: f64, bold: bool, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in label.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_width(&format!("{line} {word}"), size, bold) <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Shortens `label` with `…` if it is wider than `room` pixels.
pub(super) fn shortened(label: &str, size: f64, room: f64) -> String {
    let mut short: Vec<char> = label.chars().collect();
    if text_width(label, size, false) <= room {
        return label.to_owned();
    }
    while !short.is_empty() {
        short.pop();
        let candidate: String = short.iter().chain(['…'].iter()).collect();
        if text_width(&candidate, size, false) <= room {
            return candidate;
        }
    }
    String::new()
}

/// Regular font with Latin-1, Latin Extended-A and the symbols of plots. See `assets/README.md`.
pub(super) const REGULAR: &[u8] = include_bytes!("../../assets/DejaVuSans-subset.ttf");

/// Bold font with the same characters.
pub(super) const BOLD: &[u8] = include_bytes!("../../assets/DejaVuSans-Bold-subset.ttf");

/// Font family in SVG: DejaVu if installed, otherwise fonts of similar width.
pub(super) const FAMILY: &str = "DejaVu Sans, Verdana, Segoe UI, Helvetica, Arial, sans-serif";

/// Characters of the subset beyond the Latin letters.
const SYMBOLS: &str = "–—…→←−≤≥≈ΩσμΔ∞";

/// Whether the subset has `letter`.
fn has(letter: char) -> bool {
    matches!(letter, ' '..='~' | '\u{a0}'..='\u{17f}') || SYMBOLS.contains(letter)
}

/// The first character of `text` that pictures cannot show.
pub fn undrawable(text: &str) -> Option<char> {
    text.chars().find(|letter| !has(*letter))
}

/// Replaces every character that the subset lacks with `?`.
pub(super) fn drawable(text: &str) -> String {
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
        assert_eq!([undrawable("Größe 中文"), undrawable("Größe")], [Some('中'), None]);
    }
}
