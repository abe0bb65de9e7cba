//! Units of one frame over time, a lane for each: how busy they were, and what they waited for.

use super::axis::{Along, Axis, is_drawable};
use super::legend::{Key, legend_lines};
use super::palette::{INK, MUTED, STATES, heat, named_unit_colour};
use super::panel::{BELOW, Panel};
use super::picture::{Across, Look, Picture, Text, shortened, text, text_width};
use super::series::means;
use crate::table::si;

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
    pub fn picture(&self, look: &Look) -> Picture {
        let title = format!("How busy the units were in frame {}", self.frame);
        let bins = self.units.iter().map(|unit| unit.busy.len()).max().unwrap_or(0);
        let duration_s = bins as f64 * self.bin_s;
        let subtitle = format!("{} – {bins} bins of {}", self.subject, si(self.bin_s, "s"));
        let mut picture = Picture::titled(look, (1200.0, 300.0), [&title, &subtitle]);
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
pub(super) struct Lanes {
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
    pub fn picture(&self, look: &Look) -> Picture {
        let title = format!("What the units waited for in frame {}", self.frame);
        let intervals = self.units.iter().map(|unit| unit.shares.len()).max().unwrap_or(0);
        let duration_s = intervals as f64 * self.bin_s;
        let mut picture = Picture::titled(look, (1200.0, 300.0), [&title, self.subject]);
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
