//! One frame over time: its power, stacked by part, and a lane for each unit: how busy it was, and what it
//! waited for.

use power_model::Part;

use super::axis::{Along, Axis, is_drawable};
use super::panel::{BELOW, Key, LEGEND_LINE, Panel, aside, legend_column, legend_lines};
use super::picture::{Across, Picture, PlotStyle, Text, shortened, text, text_width};
use super::series::means;
use super::{BACKGROUND, INK, MUTED, STATES, heat, named_unit_colour, part_colour};
use crate::table::si;

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
    pub fn picture(&self, plot_style: &PlotStyle) -> Picture {
        let title = format!("Power of frame {} by part", self.frame);
        let bins = self.parts.iter().map(|part| part.power_w.len()).max().unwrap_or(0);
        let duration_s = bins as f64 * self.bin_s;
        let subtitle = format!("{} – {bins} bins of {}", self.subject, si(self.bin_s, "s"));
        let mut picture = Picture::titled(plot_style, (1200.0, 300.0), [&title, &subtitle]);
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

    /// Layers from bottom to top, power without activity first. Each has its mean power over the frame, its
    /// mean power per column and the top of the layer below.
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
            let across = Across::Right;
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

/// A unit's busy fraction over time.
#[derive(Clone, Debug)]
pub struct UnitLane<'a> {
    /// The unit.
    pub name: &'a str,
    /// Busy fraction of each bin, 0 to 1.
    pub busy: Vec<f64>,
}

/// The units of one frame over time, with lanes of [`UnitLane`] or of [`StallLane`].
#[derive(Clone, Debug)]
pub struct UnitPlot<'a, Lane> {
    /// Scene, GPU and platform, for the line below the title.
    pub subject: &'a str,
    /// The number of the frame.
    pub frame: u64,
    /// Length of a bin in seconds.
    pub bin_s: f64,
    /// Units from top to bottom. Missing bins count as idle.
    pub units: Vec<Lane>,
}

/// Shades of the scale from idle to busy.
const SHADES: f64 = 32.0;

impl UnitPlot<'_, UnitLane<'_>> {
    /// Draws a lane for each unit, shaded by its busy fraction, with the mean on the right.
    pub fn picture(&self, plot_style: &PlotStyle) -> Picture {
        let title = format!("How busy the units were in frame {}", self.frame);
        let bins = self.units.iter().map(|unit| unit.busy.len()).max().unwrap_or(0);
        let duration_s = bins as f64 * self.bin_s;
        let subtitle = format!("{} – {bins} bins of {}", self.subject, si(self.bin_s, "s"));
        let mut picture = Picture::titled(plot_style, (1200.0, 300.0), [&title, &subtitle]);
        if bins == 0 || !(duration_s > 0.0 && is_drawable(0.0, duration_s)) {
            return picture.nothing("no units to show");
        }
        let usual = if picture.is_narrow() { 22.0 } else { 34.0 };
        let pitch = f64::min(usual, 900.0 / self.units.len().max(1) as f64);
        let top = picture.height + 30.0;
        let lanes = Lanes::new(&picture, self.units.iter().map(|unit| unit.name), top, pitch);
        let panel = lanes.panel(duration_s, self.units.len(), MEAN);
        for (index, unit) in self.units.iter().enumerate() {
            lane(unit, bins, &panel, &lanes, index, &mut picture);
        }
        panel.axis_across(&mut picture, 4.0);
        scale(&panel, top - 16.0, &mut picture);
        picture.height = panel.bottom + BELOW + 10.0;
        picture
    }
}

/// Room for the mean, right of the lanes.
const MEAN: f64 = 60.0;

/// Layout of lanes, one below the other. Names and colours of units are on the left.
struct Lanes {
    left: f64,
    right: f64,
    top: f64,
    pub pitch: f64,
}

impl Lanes {
    /// Lanes `pitch` pixels apart from `top` on, which leave room for the names.
    pub fn new<'a>(picture: &Picture, names: impl Iterator<Item = &'a str>, top: f64, pitch: f64) -> Self {
        let widest = names.map(|name| text_width(name, 13.0, false)).fold(40.0, f64::max);
        let left = picture.margin() + widest.min(0.32 * picture.width()) + 20.0;
        Self { left, right: picture.width() - picture.margin() - 6.0, top, pitch }
    }

    /// Area of `lanes` over a time, which leaves `aside` free on the right.
    pub fn panel(&self, duration_s: f64, lanes: usize, aside: f64) -> Panel {
        let right = self.right - aside;
        let x = Axis::new("time in the frame", "s", (0.0, duration_s), Along::across(right - self.left));
        let y = Axis::new("", "", (0.0, 1.0), Along::up(self.pitch));
        Panel { left: self.left, top: self.top, right, bottom: self.top + self.pitch * lanes as f64, x, y }
    }

    /// Top of lane `index`.
    pub fn top(&self, index: usize) -> f64 {
        self.top + self.pitch * index as f64
    }

    /// Draws the name of lane `index` and the colour of its unit.
    pub fn name(&self, picture: &mut Picture, index: usize, name: &str) {
        let (top, bottom) = (self.top(index) + 2.0, self.top(index) + self.pitch - 2.0);
        if let Some(colour) = named_unit_colour(name) {
            picture.rect((self.left - 8.0, top), (self.left - 3.0, bottom), colour);
        }
        let name = shortened(name, 13.0, self.left - picture.margin() - 14.0);
        let at = (self.left - 13.0, 0.5 * (top + bottom));
        picture.text(Text { across: Across::Right, ..text(&name, at) });
    }
}

fn lane(unit: &UnitLane<'_>, bins: usize, panel: &Panel, lanes: &Lanes, index: usize, picture: &mut Picture) {
    let mut busy: Vec<f64> = unit.busy.iter().map(|busy| busy.clamp(0.0, 1.0)).collect();
    busy.resize(bins, 0.0);
    let columns = means(&busy, 320);
    let width = (panel.right - panel.left) / columns.len() as f64;
    let (top, bottom) = (lanes.top(index) + 2.0, lanes.top(index) + lanes.pitch - 2.0);
    let shade = |busy: f64| (busy * SHADES + 0.5) as u32;
    let mut first = 0;
    for run in columns.chunk_by(|a, b| shade(*a) == shade(*b)) {
        let from = panel.left + first as f64 * width;
        let to = from + run.len() as f64 * width;
        picture.rect((from, top), (to, bottom), heat(f64::from(shade(run[0])) / SHADES));
        first += run.len();
    }
    lanes.name(picture, index, unit.name);
    let mean = columns.iter().sum::<f64>() / columns.len() as f64;
    let label = format!("{:.1} %", mean * 100.0);
    let at = (panel.right + MEAN, 0.5 * (top + bottom));
    picture.text(Text { across: Across::Right, colour: MUTED, ..text(&label, at) });
}

/// The scale of shades, above the lanes.
fn scale(panel: &Panel, middle: f64, picture: &mut Picture) {
    let width = f64::min(200.0, 0.4 * (panel.right - panel.left));
    let left = panel.right - width - 46.0;
    for step in 0..100 {
        let from = left + width * f64::from(step) / 100.0;
        picture.rect(
            (from, middle - 6.0),
            (from + width / 100.0, middle + 6.0),
            heat(f64::from(step) / 99.0),
        );
    }
    let note = |text: Text| Text { size: 12.0, colour: MUTED, ..text };
    picture.text(note(Text { across: Across::Right, ..text("idle", (left - 8.0, middle)) }));
    picture.text(note(text("busy", (left + width + 8.0, middle))));
    picture.text(note(Text { across: Across::Right, ..text("mean", (panel.right + MEAN, middle)) }));
}

/// Shares of a unit's time in each interval: busy, starved, blocked; the rest is idle.
#[derive(Clone, Debug)]
pub struct StallLane<'a> {
    /// The unit.
    pub name: &'a str,
    /// The shares, interval by interval.
    pub shares: Vec<[f64; 3]>,
    /// Whether it is the busiest of all, interval by interval.
    pub bottleneck: Vec<bool>,
}

const KEYS: [&str; 3] = ["busy", "starved", "blocked"];

impl UnitPlot<'_, StallLane<'_>> {
    /// Draws a lane for each unit, filled by the shares of its states, and underlined where it is the bottleneck.
    pub fn picture(&self, plot_style: &PlotStyle) -> Picture {
        let title = format!("What the units waited for in frame {}", self.frame);
        let intervals = self.units.iter().map(|unit| unit.shares.len()).max().unwrap_or(0);
        let duration_s = intervals as f64 * self.bin_s;
        let mut picture = Picture::titled(plot_style, (1200.0, 300.0), [&title, self.subject]);
        if intervals == 0 || !(duration_s > 0.0 && is_drawable(0.0, duration_s)) {
            return picture.nothing("no units to show");
        }
        let keys = KEYS.iter().zip(STATES).map(|(name, colour)| (Key::Area(colour), (*name).to_owned()));
        let keys: Vec<_> = keys.chain([(Key::Line(INK), "underlined: the bottleneck".to_owned())]).collect();
        let top = picture.height + 10.0;
        let top = top + legend_lines(&mut picture, top, &keys);
        let pitch = if picture.is_narrow() { 30.0 } else { 44.0 };
        let lanes = Lanes::new(&picture, self.units.iter().map(|unit| unit.name), top, pitch);
        let panel = lanes.panel(duration_s, self.units.len(), 0.0);
        for (index, unit) in self.units.iter().enumerate() {
            stall_lane(unit, intervals, &panel, &lanes, index, &mut picture);
        }
        panel.axis_across(&mut picture, 4.0);
        picture.height = panel.bottom + BELOW + 10.0;
        picture
    }
}

fn stall_lane(
    unit: &StallLane<'_>,
    intervals: usize,
    panel: &Panel,
    lanes: &Lanes,
    index: usize,
    picture: &mut Picture,
) {
    let width = (panel.right - panel.left) / intervals as f64;
    let (floor, height) = (lanes.top(index) + lanes.pitch - 8.0, lanes.pitch - 12.0);
    for (at, shares) in unit.shares.iter().enumerate() {
        let (from, to) = (panel.left + at as f64 * width, panel.left + (at + 1) as f64 * width);
        let mut base = floor;
        for (share, colour) in shares.iter().zip(STATES).filter(|(share, _)| **share > 0.0) {
            let next = base - share * height;
            picture.rect((from, next), (to, base), colour);
            base = next;
        }
        if unit.bottleneck.get(at).copied().unwrap_or(false) {
            picture.rect((from, floor + 1.0), (to, floor + 4.0), INK);
        }
    }
    lanes.name(picture, index, unit.name);
}
