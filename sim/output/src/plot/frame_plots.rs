//! Power of one frame over time, stacked by part, and energy of each frame, measured and true.

use power_model::Part;

use super::axis::{Along, Axis, is_drawable};
use super::legend::{Key, LEGEND_LINE, legend_column, legend_lines};
use super::palette::{BACKGROUND, INK, MEASURED, MUTED, TRUTH, part_colour};
use super::panel::{BELOW, Panel, aside};
use super::picture::{Look, Picture, Text, text};
use super::series::means;
use crate::MeanSd;
use crate::table::{si, si_mean_sd};

/// A part of the power of a frame. Power that does not depend on activity is grey, at the bottom.
#[derive(Clone, Debug)]
pub struct PowerPart {
    /// The part.
    pub part: Part,
    /// Mean power of each bin, W.
    pub power_w: Vec<f64>,
}

/// Power of one frame over time.
#[derive(Clone, Debug)]
pub struct FramePowerPlot<'a> {
    /// Scene, GPU and platform, for the line below the title.
    pub subject: &'a str,
    /// The number of the frame.
    pub frame: u64,
    /// Length of a bin in seconds.
    pub bin_s: f64,
    /// Parts; their sum is the total. Missing bins count as 0 W.
    pub parts: Vec<PowerPart>,
    /// Samples of the trace in this frame: time from its start, s, and power, W.
    pub samples: &'a [(f64, f64)],
    /// Energy from its start to the next start, idle time included, J; `None` if unknown.
    pub frame_j: Option<f64>,
}

/// Largest number of columns.
const MAX_COLUMNS: usize = 480;
/// Largest number of bins with a line for the total; with more, it would be a black band.
const MAX_BINS_OUTLINED: usize = 160;
/// Width of the legend, and the smallest width of a picture with room for it beside the panel.
const LEGEND: f64 = 240.0;
const BESIDE: f64 = 760.0;

impl FramePowerPlot<'_> {
    /// Draws stacked areas in the order of parts, power without activity first, and the samples over them.
    pub fn picture(&self, look: &Look) -> Picture {
        let title = format!("Power of frame {} by part", self.frame);
        let bins = self.parts.iter().map(|part| part.power_w.len()).max().unwrap_or(0);
        let duration_s = bins as f64 * self.bin_s;
        let subtitle = format!("{} – {bins} bins of {}", self.subject, si(self.bin_s, "s"));
        let mut picture = Picture::titled(look, (1200.0, 300.0), [&title, &subtitle]);
        if bins == 0 || !(duration_s > 0.0 && duration_s.is_finite()) {
            return picture.nothing("no power to show");
        }
        let layers = self.layers(bins);
        let Some(panel) = self.panel(&picture, duration_s, &layers) else {
            return picture.nothing("no power to show");
        };
        panel.grid(&mut picture);
        draw_layers(&layers, &panel, duration_s, &mut picture);
        if bins <= MAX_BINS_OUTLINED {
            let total = layers.last().map(|layer| steps(&panel, duration_s, &layer.top));
            picture.polyline(total.unwrap_or_default(), INK, 1.0);
        }
        self.draw_samples(&panel, &mut picture);
        panel.axes(&mut picture, 0.0);
        self.legend(&layers, duration_s, &panel, &mut picture);
        picture
    }

    /// Draws dots with a white rim, visible on any colour.
    fn draw_samples(&self, panel: &Panel, picture: &mut Picture) {
        let per_px = self.samples.len() as f64 / (panel.right - panel.left);
        let radius = if per_px > 1.0 {
            0.7
        } else if per_px > 0.2 {
            1.0
        } else {
            2.0
        };
        let finite = self.samples.iter().filter(|(time, power)| time.is_finite() && power.is_finite());
        let places: Vec<_> = finite.map(|(time_s, power_w)| panel.at(*time_s, *power_w)).collect();
        places.iter().for_each(|&at| picture.dot(at, radius + 0.7, BACKGROUND.alpha(0.7)));
        places.iter().for_each(|&at| picture.dot(at, radius, INK));
    }

    /// Layers from bottom to top, power without activity first. Each has its mean power over the frame, its mean power per column
    /// and the top of the layer below.
    fn layers(&self, bins: usize) -> Vec<Layer> {
        let columns = bins.min(MAX_COLUMNS);
        let mut floor = vec![0.0; columns];
        let mut layers = Vec::new();
        for overhead in [true, false] {
            for part in self.parts.iter().filter(|part| is_overhead(part.part) == overhead) {
                let mut power = part.power_w.clone();
                power.resize(bins, 0.0);
                let own = means(&power, columns);
                let top: Vec<f64> = floor.iter().zip(&own).map(|(below, power)| below + power).collect();
                let mean_w = own.iter().sum::<f64>() / columns as f64;
                layers.push(Layer { part: part.part, mean_w, floor, top: top.clone() });
                floor = top;
            }
        }
        layers
    }

    fn panel(&self, picture: &Picture, duration_s: f64, layers: &[Layer]) -> Option<Panel> {
        let sampled = self.samples.iter().map(|(_, power)| *power);
        let tops = layers.iter().flat_map(|layer| layer.top.iter().copied());
        let high = tops.chain(sampled).filter(|power| power.is_finite()).reduce(f64::max)?;
        if !(is_drawable(0.0, high) && is_drawable(0.0, duration_s)) {
            return None;
        }
        let beside = if picture.width() >= BESIDE { LEGEND + 30.0 } else { 0.0 };
        let height = if picture.is_narrow() { 200.0 } else { 440.0 };
        let y = Axis::from_zero("power", "W", high.max(0.0), Along::up(height));
        let left = picture.margin() + aside(&y);
        let right = picture.width() - picture.margin() - beside - 6.0;
        let x = Axis::new("time in the frame", "s", (0.0, duration_s), Along::across(right - left));
        let top = picture.height + 12.0;
        Some(Panel { left, top, right, bottom: top + height, x, y })
    }

    /// Draws the legend beside the panel if there is room, otherwise below it.
    fn legend(&self, layers: &[Layer], duration_s: f64, panel: &Panel, picture: &mut Picture) {
        let joules = |watts: f64| si(watts * duration_s, "J");
        let mut entries: Vec<_> = layers
            .iter()
            .rev()
            .map(|layer| {
                (Key::Area(part_colour(layer.part)), layer.part.name().to_owned(), joules(layer.mean_w))
            })
            .collect();
        if !self.samples.is_empty() {
            entries.insert(0, (Key::Dot(INK), "samples".to_owned(), self.samples.len().to_string()));
        }
        let right = picture.width() - picture.margin();
        let is_beside = picture.width() >= BESIDE;
        let (left, top) = if is_beside {
            (right - LEGEND, panel.top)
        } else {
            (picture.margin(), panel.bottom + BELOW + 14.0)
        };
        let heading = |words: &str, y: f64| Text { size: 12.5, bold: true, ..text(words, (left, y)) };
        picture.text(heading("energy while busy", top));
        let busy = joules(layers.iter().map(|layer| layer.mean_w).sum());
        let mut sums = vec![("all parts", busy)];
        sums.extend(self.frame_j.map(|frame_j| ("whole frame, with idle", si(frame_j, "J"))));
        // Below the panel in two columns, as the page is narrow but long.
        let columns = if is_beside { 1 } else { 2 };
        let width = (right - left) / columns as f64;
        let rows = entries.len().div_ceil(columns);
        let height = if is_beside {
            panel.bottom - top - 26.0 - LEGEND_LINE * sums.len() as f64
        } else {
            f64::INFINITY
        };
        for (column, entries) in entries.chunks(rows).enumerate() {
            let from = (left + width * column as f64, top + 24.0);
            let right = from.0 + width - if column + 1 < columns { 8.0 } else { 0.0 };
            legend_column(picture, from, right, height, entries);
        }
        let pitch = (height / rows as f64).min(LEGEND_LINE);
        let mut y = top + 30.0 + pitch * rows as f64;
        for (name, value) in sums {
            picture.text(Text { size: 12.5, ..text(name, (left, y)) });
            let across = super::picture::Across::Right;
            picture.text(Text { size: 12.5, colour: MUTED, across, ..text(&value, (right, y)) });
            y += LEGEND_LINE;
        }
        picture.height = (panel.bottom + BELOW + 4.0).max(y);
    }
}

/// Whether the power of a part does not depend on activity.
fn is_overhead(part: Part) -> bool {
    !matches!(part, Part::Unit(_))
}

struct Layer {
    part: Part,
    mean_w: f64,
    floor: Vec<f64>,
    top: Vec<f64>,
}

fn draw_layers(layers: &[Layer], panel: &Panel, duration_s: f64, picture: &mut Picture) {
    for layer in layers.iter().filter(|layer| layer.mean_w != 0.0) {
        let mut points = steps(panel, duration_s, &layer.top);
        points.extend(steps(panel, duration_s, &layer.floor).into_iter().rev());
        picture.polygon(points, part_colour(layer.part));
    }
}

/// Columns of constant value as a staircase.
fn steps(panel: &Panel, duration_s: f64, values: &[f64]) -> Vec<(f64, f64)> {
    let time = |index: usize| duration_s * index as f64 / values.len() as f64;
    let stair = values.iter().enumerate();
    stair.flat_map(|(i, value)| [panel.at(time(i), *value), panel.at(time(i + 1), *value)]).collect()
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
    pub fn picture(&self, look: &Look) -> Picture {
        let mut picture = Picture::titled(look, (1200.0, 300.0), ["Energy per frame", self.subject]);
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

    fn series(&self, truth: bool, colour: super::palette::Colour, panel: &Panel, picture: &mut Picture) {
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
