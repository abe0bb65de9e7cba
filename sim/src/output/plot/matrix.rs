//! Costs or errors of methods by what they were tried on, as shaded cells.

use super::palette::{BACKGROUND, INK, MUTED, heat};
use super::panel::shortened;
use super::picture::{Across, Picture, Text, text};

/// Cells of rows by columns, each a number of which more is worse: a cost over that of the best of its column, say.
#[derive(Clone, Debug)]
pub struct Matrix<'a> {
    /// The title.
    pub title: &'a str,
    /// The line below the title.
    pub subject: &'a str,
    /// What the lightest shade stands for, 1 and all below, and the darkest, 32 and all above.
    pub scale: [&'a str; 2],
    /// Names of the columns.
    pub columns: Vec<&'a str>,
    /// One block of rows below the other, all with the same columns.
    pub panels: Vec<MatrixPanel<'a>>,
}

/// A block of rows.
#[derive(Clone, Debug)]
pub struct MatrixPanel<'a> {
    /// What the block shows.
    pub name: &'a str,
    /// Name of each row with its cells; a cell without a value stays white.
    pub rows: Vec<(&'a str, Vec<Option<f64>>)>,
}

const LEFT: f64 = 170.0;
const RIGHT: f64 = 1380.0;
const ROW: f64 = 26.0;
const HEADING: f64 = 34.0;
/// Room for the columns' names, which read upwards.
const NAMES: f64 = 150.0;
/// The darkest shade stands for this and all above.
const DARKEST: f64 = 32.0;

impl Matrix<'_> {
    /// The blocks from top to bottom, columns named below the last.
    pub fn picture(&self) -> Picture {
        let rows: usize = self.panels.iter().map(|panel| panel.rows.len()).sum();
        let height = 100.0 + HEADING * self.panels.len() as f64 + ROW * rows as f64 + NAMES;
        let mut picture = Picture::new(1410.0, height, self.title, self.subject);
        if rows == 0 || self.columns.is_empty() {
            return picture.nothing("nothing to compare");
        }
        scale(self.scale, &mut picture);
        let mut top = 92.0;
        for panel in &self.panels {
            picture.text(Text { bold: true, ..text(panel.name, (LEFT, top + 0.5 * HEADING)) });
            top += HEADING;
            for (name, cells) in &panel.rows {
                self.row(name, cells, top, &mut picture);
                top += ROW;
            }
        }
        for (index, name) in self.columns.iter().enumerate() {
            let at = (LEFT + (index as f64 + 0.5) * self.width(), top + 0.5 * NAMES);
            let name = shortened(name, 13.0, NAMES - 16.0);
            picture.text(Text { across: Across::Centre, upwards: true, ..text(&name, at) });
        }
        picture
    }

    fn width(&self) -> f64 {
        ((RIGHT - LEFT) / self.columns.len() as f64).min(120.0)
    }

    fn row(&self, name: &str, cells: &[Option<f64>], top: f64, picture: &mut Picture) {
        let (width, middle) = (self.width(), top + 0.5 * ROW);
        picture.text(Text { across: Across::Right, ..text(name, (LEFT - 10.0, middle)) });
        for (index, value) in cells.iter().enumerate() {
            let Some(value) = value.filter(|value| value.is_finite()) else { continue };
            let left = LEFT + index as f64 * width;
            let shade = shade(value);
            picture.rect((left + 1.0, top + 1.0), (left + width - 1.0, top + ROW - 1.0), heat(shade));
            let colour = if shade > 0.55 { BACKGROUND } else { INK };
            let at = (left + 0.5 * width, middle);
            picture.text(Text { across: Across::Centre, colour, size: 11.5, ..text(&number(value), at) });
        }
    }
}

/// The place of a cost on the scale of shades: as the logarithm.
fn shade(over_best: f64) -> f64 {
    (libm::log2(over_best.max(1.0)) / libm::log2(DARKEST)).clamp(0.0, 1.0)
}

/// A cost in at most four letters.
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

fn scale([least, most]: [&str; 2], picture: &mut Picture) {
    let (left, top) = (RIGHT - 330.0, 70.0);
    for step in 0..100 {
        let from = left + f64::from(step) * 2.0;
        picture.rect((from, top), (from + 2.0, top + 12.0), heat(f64::from(step) / 99.0));
    }
    let note = |text: Text| Text { size: 12.0, colour: MUTED, ..text };
    picture.text(note(Text { across: Across::Right, ..text(least, (left - 8.0, top + 6.0)) }));
    picture.text(note(text(most, (left + 208.0, top + 6.0))));
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
        assert!(empty.picture().svg().unwrap().contains("nothing to compare"));
        let rows = vec![("one", vec![Some(1.0), None]), ("two", vec![Some(77.0), Some(f64::NAN)])];
        let panels = vec![MatrixPanel { name: "all", rows }];
        let svg = Matrix { title: "t", subject: "s", scale: ["a", "b"], columns: vec!["a", "b"], panels }
            .picture()
            .svg()
            .unwrap();
        assert!(svg.contains("77") && svg.contains("one"), "{svg}");
    }
}
