//! Bands, lines, dots and bars over plain axes.

use super::axis::{Axis, is_drawable};
use super::palette::{Colour, INK, MEASURED, MUTED, TRUTH, part_colour};
use super::panel::{Key, Panel, legend_line};
use super::picture::{Picture, Point, Text, text};

/// Something to draw.
#[derive(Clone, Debug)]
pub enum Mark {
    /// From a lowest to a highest value at each place, as a filled strip.
    Band(Vec<(f64, f64, f64)>),
    /// A line through points.
    Line(Vec<(f64, f64)>),
    /// Many faint lines.
    Faint(Vec<Vec<(f64, f64)>>),
    /// Dots, each with a name that may be empty.
    Dots(Vec<(f64, f64, String)>),
    /// Crosses that reach so far to either side, `(x, y, dx, dy)`.
    Crosses(Vec<(f64, f64, f64, f64)>),
    /// Bars from zero, `(from, to, height)`.
    Bars(Vec<(f64, f64, f64)>),
}

/// A named mark.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// What is drawn.
    pub mark: Mark,
}

/// A picture of some series.
#[derive(Clone, Debug)]
pub struct Lines<'a> {
    /// The title.
    pub title: &'a str,
    /// The line below it.
    pub subject: &'a str,
    /// What goes across, and its unit.
    pub x: (&'a str, &'a str),
    /// What goes up, and its unit.
    pub y: (&'a str, &'a str),
    /// What is drawn, the first at the bottom.
    pub series: Vec<Series>,
}

const WIDTH: f64 = 1200.0;
const HEIGHT: f64 = 560.0;

impl Lines<'_> {
    /// The picture; one that says so where nothing finite is there.
    pub fn picture(&self) -> Picture {
        let mut picture = Picture::new(WIDTH, HEIGHT, self.title, self.subject);
        let Some((x, y)) = self.ranges() else { return picture.nothing("nothing to show") };
        let panel = Panel {
            left: 110.0,
            top: 100.0,
            right: WIDTH - 40.0,
            bottom: HEIGHT - 70.0,
            x: Axis::new(self.x.0, self.x.1, x.0, x.1),
            y: Axis::new(self.y.0, self.y.1, y.0, y.1),
        };
        panel.grid(&mut picture);
        let colours = self.series.iter().enumerate().map(|(index, _)| colour(index));
        for (series, colour) in self.series.iter().zip(colours.clone()) {
            series.mark.draw(&panel, colour, &mut picture);
        }
        panel.axes(&mut picture, 0.0);
        let keys: Vec<(Key, String)> = self
            .series
            .iter()
            .zip(colours)
            .map(|(series, colour)| (series.mark.key(colour), series.name.clone()))
            .collect();
        legend_line(&mut picture, (110.0, 78.0), &keys);
        picture
    }

    fn ranges(&self) -> Option<((f64, f64), (f64, f64))> {
        let points: Vec<Point> = self.series.iter().flat_map(|series| series.mark.extent()).collect();
        let ends = |of: fn(&Point) -> f64| {
            let low = points.iter().map(of).reduce(f64::min)?;
            let high = points.iter().map(of).reduce(f64::max)?;
            is_drawable(low, high).then_some((low, high))
        };
        let (x, y) = (ends(|p| p.0)?, ends(|p| p.1)?);
        let pad = 0.04 * (y.1 - y.0);
        let low = if y.0 >= 0.0 && y.0 - pad < 0.3 * y.1 { 0.0 } else { y.0 - pad };
        Some((x, (low, y.1 + pad)))
    }
}

fn colour(index: usize) -> Colour {
    match index {
        0 => MEASURED,
        1 => TRUTH,
        _ => part_colour(index, false),
    }
}

impl Mark {
    fn extent(&self) -> Vec<Point> {
        let points: Vec<Point> = match self {
            Self::Band(band) => band.iter().flat_map(|&(x, low, high)| [(x, low), (x, high)]).collect(),
            Self::Line(line) => line.clone(),
            Self::Faint(lines) => lines.concat(),
            Self::Dots(dots) => dots.iter().map(|&(x, y, _)| (x, y)).collect(),
            Self::Crosses(crosses) => {
                crosses.iter().flat_map(|&(x, y, dx, dy)| [(x - dx, y - dy), (x + dx, y + dy)]).collect()
            }
            Self::Bars(bars) => bars.iter().flat_map(|&(from, to, y)| [(from, 0.0), (to, y)]).collect(),
        };
        points.into_iter().filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
    }

    fn key(&self, colour: Colour) -> Key {
        match self {
            Self::Band(_) | Self::Bars(_) => Key::Area(colour),
            Self::Line(_) | Self::Faint(_) | Self::Crosses(_) => Key::Line(colour),
            Self::Dots(_) => Key::Dot(colour),
        }
    }

    fn draw(&self, panel: &Panel, colour: Colour, picture: &mut Picture) {
        let path = |line: &[(f64, f64)]| line.iter().map(|&(x, y)| panel.at(x, y)).collect::<Vec<_>>();
        match self {
            Self::Band(band) => {
                for (index, &(_, low, high)) in band.iter().enumerate() {
                    let (top, bottom) = (panel.y_px(high), panel.y_px(low));
                    let (left, right) = width_px(band, index, panel);
                    picture.rect((left, top - 0.5), (right, bottom.max(top) + 0.5), colour.alpha(0.55));
                }
            }
            Self::Line(line) => picture.polyline(path(line), colour, 1.6),
            Self::Faint(lines) => {
                let alpha = (3.0 / lines.len().max(1) as f64).clamp(0.04, 0.6);
                lines.iter().for_each(|line| picture.polyline(path(line), colour.alpha(alpha), 1.0));
            }
            Self::Dots(dots) => {
                for (x, y, name) in dots {
                    let at = panel.at(*x, *y);
                    picture.dot(at, 3.0, colour);
                    if !name.is_empty() {
                        let ink = if colour == TRUTH { INK } else { MUTED };
                        picture.text(Text {
                            size: 11.0,
                            colour: ink,
                            ..text(name, (at.0 + 6.0, at.1 - 8.0))
                        });
                    }
                }
            }
            Self::Crosses(crosses) => {
                for &(x, y, dx, dy) in crosses {
                    picture.polyline(path(&[(x - dx, y), (x + dx, y)]), colour, 1.0);
                    picture.polyline(path(&[(x, y - dy), (x, y + dy)]), colour, 1.0);
                }
            }
            Self::Bars(bars) => {
                for &(from, to, y) in bars {
                    picture.rect(
                        panel.at(from, y),
                        (panel.x_px(to) - 1.0, panel.y_px(0.0)),
                        colour.alpha(0.8),
                    );
                }
            }
        }
    }
}

/// From where to where a place of a band is drawn: halfway to its neighbours, and never thinner than a pixel, so that a
/// lone spike is still seen.
fn width_px(band: &[(f64, f64, f64)], index: usize, panel: &Panel) -> (f64, f64) {
    let x_px = |index: usize| band.get(index).map(|place| panel.x_px(place.0));
    let x = panel.x_px(band[index].0);
    let before = index.checked_sub(1).and_then(x_px).map(|before| 0.5 * (x - before));
    let after = x_px(index + 1).map(|after| 0.5 * (after - x));
    let reach = |side: Option<f64>, other: Option<f64>| side.or(other).unwrap_or(0.0).max(0.5);
    ((x - reach(before, after)).max(panel.left), (x + reach(after, before)).min(panel.right))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mark_is_drawn_and_nothing_says_so() {
        let lines = |series| Lines { title: "t", subject: "s", x: ("time", "s"), y: ("power", "W"), series };
        let series = |mark| Series { name: "a".to_owned(), mark };
        let all = vec![
            series(Mark::Band(vec![(0.0, 1.0, 2.0)])),
            series(Mark::Line(vec![(0.0, 1.0), (1.0, 2.0)])),
            series(Mark::Faint(vec![vec![(0.0, 1.0), (1.0, 2.0)]])),
            series(Mark::Dots(vec![(0.5, 1.5, "named".to_owned())])),
            series(Mark::Bars(vec![(0.0, 1.0, 3.0)])),
            series(Mark::Crosses(vec![(0.5, 1.5, 0.1, 0.2)])),
        ];
        assert!(lines(all).picture().svg().unwrap().contains("named"));
        assert!(lines(vec![]).picture().svg().unwrap().contains("nothing to show"));
    }

    #[test]
    fn places_of_a_band_touch_however_few_there_are() {
        let panel = |right: f64| Panel {
            left: 0.0,
            top: 0.0,
            right,
            bottom: 100.0,
            x: Axis::new("time", "s", 0.0, 4.0),
            y: Axis::new("power", "W", 0.0, 1.0),
        };
        let band = [(1.0, 0.0, 1.0), (2.0, 0.0, 1.0), (3.0, 0.0, 1.0)];
        let ends: Vec<_> = (0..3).map(|index| width_px(&band, index, &panel(400.0))).collect();
        assert_eq!(ends, [(50.0, 150.0), (150.0, 250.0), (250.0, 350.0)]);
        let (left, right) = width_px(&band[..1], 0, &panel(400.0));
        assert_eq!(right - left, 1.0);
        let (left, right) = width_px(&band, 1, &panel(1.0));
        assert!(right - left >= 0.75, "{left} {right}");
    }
}
