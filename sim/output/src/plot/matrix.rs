//! Matrix of costs or errors: methods by test cases, as shaded cells.

use super::palette::{BACKGROUND, INK, MUTED, heat};
use super::picture::{Across, Look, Picture, Point, Text, text};
use super::text::shortened;
use super::text::text_width;

/// Shaded cells; a larger number is worse. Example: cost relative to the best of the column.
#[derive(Clone, Debug)]
pub struct Matrix<'a> {
    /// The title.
    pub title: &'a str,
    /// The line below the title.
    pub subject: &'a str,
    /// Meaning of the lightest shade (1 and below) and of the darkest (32 and above).
    pub scale: [&'a str; 2],
    /// Names of the columns.
    pub columns: Vec<&'a str>,
    /// Blocks of rows, from top to bottom, with the same columns.
    pub panels: Vec<MatrixPanel<'a>>,
}

/// A block of rows.
#[derive(Clone, Debug)]
pub struct MatrixPanel<'a> {
    /// Title of the block.
    pub name: &'a str,
    /// Rows: name and cells. A cell without a value is white.
    pub rows: Vec<(&'a str, Vec<Option<f64>>)>,
}

/// Least and greatest width of a cell.
const CELL: [f64; 2] = [38.0, 120.0];
const ROW: f64 = 26.0;
const HEADING: f64 = 34.0;
/// Room for the names of columns, which are rotated.
const NAMES: f64 = 150.0;
/// Value of the darkest shade; larger values have it too.
const DARKEST: f64 = 32.0;

impl Matrix<'_> {
    /// Draws the blocks from top to bottom, with the names of columns below the last.
    pub fn picture(&self, look: &Look) -> Picture {
        let rows: usize = self.panels.iter().map(|panel| panel.rows.len()).sum();
        let names = self.panels.iter().flat_map(|panel| panel.rows.iter().map(|(name, _)| *name));
        let left = names.map(|name| text_width(name, 13.0, false)).fold(60.0, f64::max) + 40.0;
        let columns = self.columns.len().max(1) as f64;
        let usual = (left + CELL[1] * columns + 24.0).clamp(760.0, 1410.0);
        let least = left + CELL[0] * columns + 24.0;
        let mut picture = Picture::titled(look, (usual, least), [self.title, self.subject]);
        if rows == 0 || self.columns.is_empty() {
            return picture.nothing("nothing to compare");
        }
        let width = ((picture.width() - picture.margin() - left) / columns).clamp(CELL[0] - 2.0, CELL[1]);
        let mut top = picture.height + 4.0;
        scale(self.scale, (left, top + 10.0), &mut picture);
        top += 26.0;
        for panel in &self.panels {
            picture.text(Text { bold: true, ..text(panel.name, (left, top + 0.5 * HEADING)) });
            top += HEADING;
            for (name, cells) in &panel.rows {
                draw_cells(name, cells, (left, top), width, &mut picture);
                top += ROW;
            }
        }
        for (index, name) in self.columns.iter().enumerate() {
            let at = (left + (index as f64 + 0.5) * width, top + 0.5 * NAMES);
            let name = shortened(name, 13.0, NAMES - 16.0);
            picture.text(Text { across: Across::Centre, upwards: true, ..text(&name, at) });
        }
        picture.height = top + NAMES;
        picture
    }
}

fn draw_cells(name: &str, cells: &[Option<f64>], (left, top): Point, width: f64, picture: &mut Picture) {
    let middle = top + 0.5 * ROW;
    picture.text(Text { across: Across::Right, ..text(name, (left - 10.0, middle)) });
    for (index, value) in cells.iter().enumerate() {
        let Some(value) = value.filter(|value| value.is_finite()) else { continue };
        let left = left + index as f64 * width;
        let shade = shade(value);
        picture.rect((left + 1.0, top + 1.0), (left + width - 1.0, top + ROW - 1.0), heat(shade));
        let colour = if shade > 0.55 { BACKGROUND } else { INK };
        let at = (left + 0.5 * width, middle);
        picture.text(Text { across: Across::Centre, colour, size: 11.5, ..text(&number(value), at) });
    }
}

/// Position of a cost on the scale of shades, which is logarithmic.
fn shade(over_best: f64) -> f64 {
    (libm::log2(over_best.max(1.0)) / libm::log2(DARKEST)).clamp(0.0, 1.0)
}

/// A cost in at most four characters.
fn number(value: f64) -> String {
    if value < 1.995 {
        format!("{value:.2}")
    } else if value < 9.95 {
        format!("{value:.1}")
    } else if value < 9_999.5 {
        format!("{value:.0}")
    } else {
        format!("{:.0}k", value / 1000.0)
    }
}

/// Draws the scale of shades from `left` on.
fn scale([least, most]: [&str; 2], (left, middle): Point, picture: &mut Picture) {
    let note = |text: Text| Text { size: 12.0, colour: MUTED, ..text };
    picture.text(note(text(least, (left, middle))));
    let left = left + text_width(least, 12.0, false) + 8.0;
    for step in 0..60 {
        let from = left + f64::from(step) * 2.0;
        picture.rect((from, middle - 6.0), (from + 2.0, middle + 6.0), heat(f64::from(step) / 59.0));
    }
    picture.text(note(text(most, (left + 128.0, middle))));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shades_double_with_each_octave() {
        assert_eq!(shade(1.0), 0.0);
        assert!((shade(4.0) - 0.4).abs() < 1e-12);
        assert_eq!(shade(1e9), 1.0);
        assert_eq!(
            [number(1.0), number(12.34), number(9999.0), number(123_456.0)],
            ["1.00", "12", "9999", "123k"]
        );
    }

    #[test]
    fn nothing_is_said_and_cells_are_there() {
        let empty = Matrix { title: "t", subject: "s", scale: ["a", "b"], columns: vec![], panels: vec![] };
        assert!(empty.picture(&Look::default()).svg().unwrap().contains("nothing to compare"));
        let rows = vec![("one", vec![Some(1.0), None]), ("two", vec![Some(77.0), Some(f64::NAN)])];
        let panels = vec![MatrixPanel { name: "all", rows }];
        let svg = Matrix { title: "t", subject: "s", scale: ["a", "b"], columns: vec!["a", "b"], panels }
            .picture(&Look::default())
            .svg()
            .unwrap();
        assert!(svg.contains("77") && svg.contains("one"), "{svg}");
    }
}
