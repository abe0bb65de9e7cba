//! Power over the whole run.

use super::axis::{Axis, is_drawable};
use super::columns::{Extremes, extremes, moving_mean};
use super::palette::{BACKGROUND, INK, MARK, MEASURED, MUTED, TRUTH};
use super::panel::{Key, Panel, legend_line};
use super::picture::{Across, Picture, Text, text};
use crate::output::table::si;

/// The sampled power of a run, with where its frames start.
#[derive(Clone, Copy, Debug)]
pub struct PowerRun<'a> {
    /// What was run, for the line below the title: scene, GPU, platform.
    pub subject: &'a str,
    /// Samples per second.
    pub rate_hz: f64,
    /// The time of the first sample in seconds.
    pub start_s: f64,
    /// The samples; what is not finite is left out.
    pub power_w: &'a [f64],
    /// Frame starts found by the analysis, in seconds.
    pub found_starts_s: &'a [f64],
    /// Frame starts known to the simulator, in seconds; empty for a recording.
    pub true_starts_s: &'a [f64],
    /// Begin and end of the marked window, in seconds.
    pub mark_s: Option<(f64, f64)>,
}

/// Height of a lane of frame starts in pixels.
const LANE: f64 = 15.0;

impl PowerRun<'_> {
    /// Every spike of the run: lowest and highest sample per column of pixels, with a mean over about one frame, the
    /// marked window, and lanes below for the starts of frames.
    pub fn picture(&self) -> Picture {
        let rate = format!("{} samples at {}", self.power_w.len(), si(self.rate_hz, "Hz"));
        let mut picture =
            Picture::new(1200.0, 600.0, "Power over the run", &format!("{} – {rate}", self.subject));
        let Some(panel) = self.panel() else { return picture.nothing("no samples to show") };
        self.mark(&panel, &mut picture);
        panel.grid(&mut picture);
        self.samples(&panel, &mut picture);
        let mean_s = self.mean(&panel, &mut picture);
        let lanes = self.lanes(&panel, &mut picture);
        panel.axes(&mut picture, lanes);
        legend_line(&mut picture, (panel.left, 78.0), &self.legend(mean_s));
        picture
    }

    fn end_s(&self) -> f64 {
        self.start_s + self.power_w.len() as f64 / self.rate_hz
    }

    fn panel(&self) -> Option<Panel> {
        let finite = || self.power_w.iter().copied().filter(|power| power.is_finite());
        let (low, high) = (finite().reduce(f64::min)?, finite().reduce(f64::max)?);
        if !(self.rate_hz > 0.0 && is_drawable(self.start_s, self.end_s()) && is_drawable(low, high)) {
            return None;
        }
        let x = Axis::new("time", "s", self.start_s, self.end_s());
        let y =
            if low < 0.0 { Axis::new("power", "W", low, high) } else { Axis::from_zero("power", "W", high) };
        Some(Panel { left: 90.0, top: 100.0, right: 1170.0, bottom: 500.0, x, y })
    }

    fn mark(&self, panel: &Panel, picture: &mut Picture) {
        if let Some((begin, end)) = self.mark_s {
            let left = panel.x_px(begin);
            let right = panel.x_px(end).max(left + 2.0);
            picture.rect((left, panel.top), (right, panel.bottom), MARK.alpha(0.45));
        }
    }

    fn samples(&self, panel: &Panel, picture: &mut Picture) {
        let columns = extremes(self.power_w, (panel.right - panel.left) as usize);
        let width = (panel.right - panel.left) / columns.len() as f64;
        let mut first = 0;
        for stretch in columns.split(Option::is_none) {
            let values: Vec<Extremes> = stretch.iter().flatten().copied().collect();
            let left = panel.left + first as f64 * width;
            first += stretch.len() + 1;
            if values.is_empty() {
                continue;
            }
            if columns.len() == self.power_w.len() {
                draw_each(panel, &values, left, width, picture);
            } else {
                picture.polygon(outline(panel, &values, left, width), MEASURED);
            }
        }
    }

    /// Draws the low-pass line and returns the window it is a mean over; no line where that would be one sample.
    fn mean(&self, panel: &Panel, picture: &mut Picture) -> Option<f64> {
        let wanted_s = self.typical_frame_s().unwrap_or((self.end_s() - self.start_s) / 60.0);
        let width = (libm::round(wanted_s * self.rate_hz) as usize).min(self.power_w.len());
        if width < 2 {
            return None;
        }
        let means = moving_mean(self.power_w, width, (panel.right - panel.left) as usize);
        let points: Vec<_> = means
            .into_iter()
            .map(|(sample, mean)| panel.at(self.start_s + sample / self.rate_hz, mean))
            .collect();
        if points.len() > 1 {
            // White below it keeps the line apart from samples of any density.
            picture.polyline(points.clone(), BACKGROUND.alpha(0.75), 4.0);
            picture.polyline(points, INK, 1.5);
        }
        Some(width as f64 / self.rate_hz)
    }

    /// The median distance of starts, found or true.
    fn typical_frame_s(&self) -> Option<f64> {
        let starts = if self.found_starts_s.len() > 1 { self.found_starts_s } else { self.true_starts_s };
        let mut gaps: Vec<f64> = starts.windows(2).map(|pair| pair[1] - pair[0]).collect();
        gaps.retain(|gap| gap.is_finite() && *gap > 0.0);
        gaps.sort_by(f64::total_cmp);
        gaps.get(gaps.len() / 2).copied()
    }

    /// Draws a lane of ticks for each kind of start and returns the height they take.
    fn lanes(&self, panel: &Panel, picture: &mut Picture) -> f64 {
        let mut top = panel.bottom + 9.0;
        let lanes = [("true", self.true_starts_s, TRUTH), ("found", self.found_starts_s, MEASURED)];
        for (name, starts, colour) in lanes.into_iter().filter(|lane| !lane.1.is_empty()) {
            let at = (panel.left - 8.0, top + LANE / 2.0);
            picture.text(Text { size: 11.0, across: Across::Right, colour: MUTED, ..text(name, at) });
            let inside = |start: &&f64| **start >= panel.x.low && **start <= panel.x.high;
            for x in starts.iter().filter(inside).map(|start| panel.x_px(*start)) {
                picture.line((x, top + 1.0), (x, top + LANE - 2.0), colour, 1.5);
            }
            top += LANE;
        }
        top - panel.bottom
    }

    fn legend(&self, mean_s: Option<f64>) -> Vec<(Key, String)> {
        let mut entries = vec![(Key::Area(MEASURED), "samples (columns: lowest to highest)".to_owned())];
        if let Some(mean_s) = mean_s {
            entries.push((Key::Line(INK), format!("mean over {}", si(mean_s, "s"))));
        }
        if self.mark_s.is_some() {
            entries.push((Key::Area(MARK.alpha(0.45)), "marked window".to_owned()));
        }
        if !self.true_starts_s.is_empty() {
            entries.push((Key::Tick(TRUTH), format!("true starts ({})", self.true_starts_s.len())));
        }
        if !self.found_starts_s.is_empty() {
            entries.push((Key::Tick(MEASURED), format!("found starts ({})", self.found_starts_s.len())));
        }
        entries
    }
}

/// Fewer samples than columns of pixels: a line from sample to sample, with dots while there is room for them.
fn draw_each(panel: &Panel, values: &[Extremes], left: f64, width: f64, picture: &mut Picture) {
    let places = values.iter().enumerate();
    let points: Vec<_> =
        places.map(|(i, value)| (left + (i as f64 + 0.5) * width, panel.y_px(value.low))).collect();
    if width > 5.0 || points.len() == 1 {
        points.iter().for_each(|point| picture.dot(*point, 2.5, MEASURED));
    }
    picture.polyline(points, MEASURED, 1.5);
}

/// The outline of columns from their lowest to their highest value, each at least a pixel high and touching its
/// neighbours, so that a jump between two samples shows as a line.
fn outline(panel: &Panel, values: &[Extremes], left: f64, width: f64) -> Vec<(f64, f64)> {
    let mut upper = Vec::with_capacity(values.len() * 4);
    let mut lower = Vec::with_capacity(values.len() * 2);
    for (index, column) in values.iter().enumerate() {
        let before = index.checked_sub(1).map_or(*column, |before| values[before]);
        let (high, low) = (panel.y_px(column.high.max(before.low)), panel.y_px(column.low.min(before.high)));
        let middle = (high + low) / 2.0;
        let (high, low) = (high.min(middle - 0.5), low.max(middle + 0.5));
        let (from, to) = (left + index as f64 * width, left + (index + 1) as f64 * width);
        upper.extend([(from, high), (to, high)]);
        lower.extend([(from, low), (to, low)]);
    }
    upper.extend(lower.into_iter().rev());
    upper
}

#[cfg(test)]
mod tests {
    use super::super::picture::Shape;
    use super::*;

    fn run(power_w: &[f64]) -> PowerRun<'_> {
        PowerRun {
            subject: "tiny",
            rate_hz: 50_000.0,
            start_s: 0.0,
            power_w,
            found_starts_s: &[],
            true_starts_s: &[],
            mark_s: None,
        }
    }

    #[test]
    fn a_single_spike_in_a_million_samples_reaches_its_height() {
        let mut power_w = vec![10.0; 1_000_000];
        power_w[654_321] = 100.0;
        let run = run(&power_w);
        let panel = run.panel().unwrap();
        let shapes = run.picture().shapes;
        let polygon = shapes.iter().find_map(|shape| match shape {
            Shape::Polygon { points, .. } => Some(points),
            _ => None,
        });
        let top = polygon.unwrap().iter().map(|point| point.1).fold(f64::INFINITY, f64::min);
        assert!((top - panel.y_px(100.0)).abs() <= 0.5, "{top}");
    }

    #[test]
    fn what_is_not_finite_leaves_a_gap() {
        let mut power_w = vec![10.0; 100_000];
        power_w[40_000..60_000].fill(f64::NAN);
        let polygons = run(&power_w).picture().shapes;
        let polygons = polygons.iter().filter(|shape| matches!(shape, Shape::Polygon { .. })).count();
        assert_eq!(polygons, 2);
    }
}
