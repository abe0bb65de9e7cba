//! The whole run: power over time, and energy of each frame, measured and true.

use super::axis::{Along, Axis, is_drawable};
use super::panel::{BELOW, Key, Panel, aside, legend_lines};
use super::picture::{Across, Picture, PlotStyle, Text, text};
use super::series::{Extremes, extremes, moving_mean};
use super::{Colour, INK, MARK, MEASURED, MUTED, TRUTH};
use crate::MeanSd;
use crate::table::{si, si_mean_sd};

/// Sampled power of a run, with frame starts.
#[derive(Clone, Copy, Debug)]
pub struct PowerRun<'a> {
    /// Scene, GPU and platform, for the line below the title.
    pub subject: &'a str,
    /// Samples per second.
    pub rate_hz: f64,
    /// Time of the first sample in seconds.
    pub start_s: f64,
    /// Samples, W. Values that are not finite are omitted.
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

/// If frames cover less of the run than this, the idle time before and after them is not shown.
const SPARSE: f64 = 0.6;
/// Time shown before the first start and after the last, in frames.
const MARGIN: [f64; 2] = [0.6, 1.6];

impl PowerRun<'_> {
    /// Draws the lowest and highest sample per column of pixels, so that every spike is visible, a mean over
    /// about one frame, the marked window, and lanes of frame starts. If frames cover little of the run, only
    /// their part is shown.
    pub fn picture(&self, plot_style: &PlotStyle) -> Picture {
        let rate = format!("{} samples at {}", self.power_w.len(), si(self.rate_hz, "Hz"));
        let shown = self.shown();
        let cut = match shown {
            Some(shown) if shown.power_w.len() < self.power_w.len() => {
                format!(
                    " – {} of {} shown",
                    si(shown.end_s() - shown.start_s, "s"),
                    si(self.end_s() - self.start_s, "s")
                )
            }
            _ => String::new(),
        };
        let subject = format!("{} – {rate}{cut}", self.subject);
        let mut picture = Picture::titled(plot_style, (1200.0, 300.0), ["Power over the run", &subject]);
        let drawn = shown.and_then(|shown| Some((shown, shown.panel(&picture)?)));
        let Some((shown, mut panel)) = drawn else { return picture.nothing("no samples to show") };
        let (top, height) = (picture.height + 10.0, panel.bottom - panel.top);
        let mean = shown.mean(&panel);
        let legend = legend_lines(&mut picture, top, &self.legend(mean.as_ref().map(|mean| mean.0)));
        (panel.top, panel.bottom) = (top + legend, top + legend + height);
        shown.mark(&panel, &mut picture);
        panel.grid(&mut picture);
        shown.samples(&panel, &mut picture);
        if let Some((_, mean)) = mean {
            let points: Vec<_> = mean.into_iter().map(|(time_s, mean_w)| panel.at(time_s, mean_w)).collect();
            // Thin strokes: what is below them is seen.
            picture.dashed(&points, INK, 1.2, [6.0, 4.0]);
        }
        let lanes = shown.lanes(&panel, &mut picture);
        panel.axes(&mut picture, lanes);
        picture.height = panel.bottom + lanes + BELOW + 4.0;
        picture
    }

    fn end_s(&self) -> f64 {
        self.start_s + self.power_w.len() as f64 / self.rate_hz
    }

    /// The part of the run that is shown; `None` for a run without duration.
    fn shown(&self) -> Option<Self> {
        if !(self.rate_hz > 0.0 && is_drawable(self.start_s, self.end_s())) {
            return None;
        }
        Some(self.around_frames().unwrap_or(*self))
    }

    /// The part with frames, if they cover little of the run.
    fn around_frames(&self) -> Option<Self> {
        let starts = if self.true_starts_s.is_empty() { self.found_starts_s } else { self.true_starts_s };
        let inside = |start: &&f64| (self.start_s..self.end_s()).contains(*start);
        let first = starts.iter().filter(inside).copied().reduce(f64::min)?;
        let last = starts.iter().filter(inside).copied().reduce(f64::max)?;
        let frame_s = self.typical_frame_s()?;
        let sample = |time_s: f64| {
            let place = libm::round((time_s - self.start_s) * self.rate_hz);
            place.clamp(0.0, self.power_w.len() as f64) as usize
        };
        let (from, to) = (sample(first - MARGIN[0] * frame_s), sample(last + MARGIN[1] * frame_s));
        let sparse = to > from && ((to - from) as f64) < SPARSE * self.power_w.len() as f64;
        sparse.then(|| Self {
            start_s: self.start_s + from as f64 / self.rate_hz,
            power_w: &self.power_w[from..to],
            ..*self
        })
    }

    /// Panel at the top of the picture.
    fn panel(&self, picture: &Picture) -> Option<Panel> {
        let finite = || self.power_w.iter().copied().filter(|power| power.is_finite());
        let (low, high) = (finite().reduce(f64::min)?, finite().reduce(f64::max)?);
        if !is_drawable(low, high) {
            return None;
        }
        let height = if picture.is_narrow() { 190.0 } else { 400.0 };
        let along = Along::up(height);
        let y = if low < 0.0 {
            Axis::new("power", "W", (low, high), along)
        } else {
            Axis::from_zero("power", "W", high, along)
        };
        let (left, right) =
            (picture.margin() + aside(&y).max(46.0), picture.width() - picture.margin() - 6.0);
        let x = Axis::new("time", "s", (self.start_s, self.end_s()), Along::across(right - left));
        Some(Panel { left, top: 0.0, right, bottom: height, x, y })
    }

    fn mark(&self, panel: &Panel, picture: &mut Picture) {
        if let Some((begin, end)) =
            self.mark_s.filter(|(begin, end)| *end > panel.x.low && *begin < panel.x.high)
        {
            let left = panel.x_px(begin);
            let right = panel.x_px(end).max(left + 2.0);
            picture.rect((left, panel.top), (right, panel.bottom), MARK.alpha(0.45));
        }
    }

    fn samples(&self, panel: &Panel, picture: &mut Picture) {
        let columns = extremes(self.power_w, (panel.right - panel.left) as usize);
        let width = (panel.right - panel.left) / columns.len() as f64;
        let mut first = 0;
        for segment in columns.split(Option::is_none) {
            let values: Vec<Extremes> = segment.iter().flatten().copied().collect();
            let left = panel.left + first as f64 * width;
            first += segment.len() + 1;
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

    /// Window of the low-pass line, and its points; `None` for a window of one sample.
    fn mean(&self, panel: &Panel) -> Option<(f64, Vec<(f64, f64)>)> {
        let wanted_s = self.typical_frame_s().unwrap_or((self.end_s() - self.start_s) / 60.0);
        let width = (libm::round(wanted_s * self.rate_hz) as usize).min(self.power_w.len());
        if width < 2 {
            return None;
        }
        let means = moving_mean(self.power_w, width, (panel.right - panel.left) as usize);
        let points = means.into_iter().map(|(sample, mean)| (self.start_s + sample / self.rate_hz, mean));
        Some((width as f64 / self.rate_hz, points.collect()))
    }

    /// Median distance of starts, found or true.
    fn typical_frame_s(&self) -> Option<f64> {
        let starts = if self.found_starts_s.len() > 1 { self.found_starts_s } else { self.true_starts_s };
        let mut gaps: Vec<f64> = starts.windows(2).map(|pair| pair[1] - pair[0]).collect();
        gaps.retain(|gap| gap.is_finite() && *gap > 0.0);
        gaps.sort_by(f64::total_cmp);
        gaps.get(gaps.len() / 2).copied()
    }

    /// Draws a lane of ticks for each kind of start. Returns their height.
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

/// For fewer samples than columns of pixels: a line through the samples, with dots if there is room.
fn draw_each(panel: &Panel, values: &[Extremes], left: f64, width: f64, picture: &mut Picture) {
    let places = values.iter().enumerate();
    let points: Vec<_> =
        places.map(|(i, value)| (left + (i as f64 + 0.5) * width, panel.y_px(value.low))).collect();
    if width > 5.0 || points.len() == 1 {
        points.iter().for_each(|point| picture.dot(*point, 2.5, MEASURED));
    }
    picture.polyline(points, MEASURED, 1.5);
}

/// Outline of columns from lowest to highest value. Each is at least a pixel high and touches its neighbours,
/// so that a jump between two samples is a line.
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

/// Energy of one frame.
#[derive(Clone, Copy, Debug)]
pub struct FrameEnergyPoint {
    /// The number of the frame.
    pub frame: u64,
    /// Energy measured in the trace, J; `None` if the frame was not found.
    pub measured_j: Option<f64>,
    /// Ground truth of the simulator, J; `None` for a recording.
    pub true_j: Option<f64>,
}

/// Energy of each frame of a run.
#[derive(Clone, Copy, Debug)]
pub struct FrameEnergyPlot<'a> {
    /// Scene, GPU and platform, for the line below the title.
    pub subject: &'a str,
    /// The frames in order.
    pub frames: &'a [FrameEnergyPoint],
    /// Mean and standard deviation of the measured energies, J, over the frames that count.
    pub measured_j: Option<MeanSd>,
    /// Pixels of a frame, for the axis in joules per pixel; 0 for no such axis.
    pub pixels: u64,
}

impl FrameEnergyPlot<'_> {
    /// Draws points and lines over frame numbers, with the mean and its band.
    pub fn picture(&self, plot_style: &PlotStyle) -> Picture {
        let mut picture = Picture::titled(plot_style, (1200.0, 300.0), ["Energy per frame", self.subject]);
        let Some(mut panel) = self.panel(&picture) else { return picture.nothing("no frames to show") };
        let top = picture.height + 10.0;
        let legend = legend_lines(&mut picture, top, &self.legend());
        let height = panel.bottom - panel.top;
        (panel.top, panel.bottom) = (top + legend, top + legend + height);
        let per_pixel = (self.pixels > 0).then(|| {
            let [low, high] = [panel.y.low, panel.y.high].map(|energy_j| energy_j / self.pixels as f64);
            Axis::new("energy per pixel", "J", (low, high), Along::up(height))
        });
        panel.right -= per_pixel.as_ref().map_or(0.0, aside);
        self.band(&panel, &mut picture);
        panel.grid(&mut picture);
        let series = [(true, TRUTH), (false, MEASURED)];
        for (truth, colour) in series {
            self.series(truth, colour, &panel, &mut picture);
        }
        panel.axes(&mut picture, 0.0);
        if let Some(axis) = &per_pixel {
            panel.right_axis(&mut picture, axis);
        }
        picture.height = panel.bottom + BELOW + 4.0;
        picture
    }

    fn values(&self, truth: bool) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.frames.iter().filter_map(move |point| {
            let energy = if truth { point.true_j } else { point.measured_j }?;
            energy.is_finite().then_some((point.frame as f64, energy))
        })
    }

    /// Panel at the top of the picture.
    fn panel(&self, picture: &Picture) -> Option<Panel> {
        let all = || self.values(true).chain(self.values(false));
        let (first, last) = (all().map(|p| p.0).reduce(f64::min)?, all().map(|p| p.0).reduce(f64::max)?);
        let bounds = self.measured_j.iter().flat_map(|stats| {
            let sd = stats.sd.unwrap_or(0.0);
            [stats.mean - sd, stats.mean + sd]
        });
        let energies =
            || all().map(|point| point.1).chain(bounds.clone()).filter(|energy| energy.is_finite());
        let (low, high) = (energies().reduce(f64::min)?, energies().reduce(f64::max)?);
        if !is_drawable(low, high) {
            return None;
        }
        // Differences of a percent are to be seen, so the axis need not start at 0; its labels say where it does.
        let margin = (0.12 * (high - low)).max(0.002 * high.abs());
        let height = if picture.is_narrow() { 210.0 } else { 430.0 };
        let y = Axis::new("energy per frame", "J", (low - margin, high + margin), Along::up(height));
        let (left, right) = (picture.margin() + aside(&y), picture.width() - picture.margin() - 4.0);
        let x = Axis::whole("frame", (first - 0.5, last + 0.5), Along::across(right - left - 70.0));
        Some(Panel { left, top: 0.0, right, bottom: height, x, y })
    }

    fn band(&self, panel: &Panel, picture: &mut Picture) {
        let Some(stats) = self.measured_j.filter(|s| s.mean.is_finite()) else { return };
        let sd = stats.sd.filter(|sd| sd.is_finite()).unwrap_or(0.0);
        let (top, bottom) = (panel.y_px(stats.mean + sd), panel.y_px(stats.mean - sd));
        picture.rect((panel.left, top), (panel.right, bottom), MEASURED.alpha(0.13));
        let y = panel.y_px(stats.mean);
        picture.line((panel.left, y), (panel.right, y), MEASURED.alpha(0.6), 1.0);
    }

    fn series(&self, truth: bool, colour: Colour, panel: &Panel, picture: &mut Picture) {
        let points: Vec<_> = self.values(truth).map(|(frame, energy)| panel.at(frame, energy)).collect();
        let radius = if truth { 4.5 } else { 3.0 };
        let dots = points.len() <= 300;
        if points.len() > 1 {
            picture.polyline(points.clone(), colour.alpha(0.55), 1.5);
        }
        for point in points.into_iter().filter(|_| dots) {
            picture.dot(point, radius, colour);
        }
    }

    fn legend(&self) -> Vec<(Key, String)> {
        let mut entries = Vec::new();
        if self.values(false).next().is_some() {
            entries.push((Key::Dot(MEASURED), "measured, start to start".to_owned()));
        }
        if self.values(true).next().is_some() {
            entries.push((Key::Dot(TRUTH), "true, by the simulator".to_owned()));
        }
        if let Some(stats) = self.measured_j.filter(|_| self.values(false).nth(1).is_some()) {
            let label = format!("mean and deviation of the measured: {}", si_mean_sd(stats, "J"));
            entries.push((Key::Area(MEASURED.alpha(0.25)), label));
        }
        entries
    }
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
        let shapes = run(&power_w).picture(&PlotStyle::default()).shapes;
        let polygon = shapes.iter().find_map(|shape| match shape {
            Shape::Polygon { points, .. } => Some(points),
            _ => None,
        });
        let heights = || polygon.unwrap().iter().map(|point| point.1);
        let (top, bottom) = (heights().fold(f64::INFINITY, f64::min), heights().fold(0.0, f64::max));
        // The axis goes from 0 to 106, over 400 pixels: from 10 to 100 are 340.
        assert!((bottom - top - 400.0 * 90.0 / 106.0).abs() <= 1.0, "{top} {bottom}");
    }

    #[test]
    fn what_is_not_finite_leaves_a_gap() {
        let mut power_w = vec![10.0; 100_000];
        power_w[40_000..60_000].fill(f64::NAN);
        let polygons = run(&power_w).picture(&PlotStyle::default()).shapes;
        let polygons = polygons.iter().filter(|shape| matches!(shape, Shape::Polygon { .. })).count();
        assert_eq!(polygons, 2);
    }

    /// Four frames in a long recording: the idle time around them is not shown.
    #[test]
    fn frames_fill_the_axis_however_long_the_lead_in() {
        let power_w = vec![1.0; 28_333];
        let starts = [0.25, 0.2667, 0.2833, 0.3];
        let run = PowerRun { found_starts_s: &starts, true_starts_s: &starts, ..run(&power_w) };
        let shown = run.shown().unwrap();
        let frames_s = 0.3 - 0.25 + 0.0167;
        assert!(frames_s > 0.6 * (shown.end_s() - shown.start_s), "{} to {}", shown.start_s, shown.end_s());
        assert!(run.picture(&PlotStyle::default()).svg().unwrap().contains(" of 567 ms shown"));
        let short = PowerRun { power_w: &power_w[..5000], start_s: 0.24, ..run };
        assert_eq!(short.shown().unwrap().power_w.len(), 5000, "frames all over are shown with all there is");
    }
}
