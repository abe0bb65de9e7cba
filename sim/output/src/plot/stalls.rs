//! Where the units' time went over one frame, and which of them held it up.

use super::axis::is_drawable;
use super::legend::{Key, legend_lines};
use super::look::Look;
use super::palette::{INK, STATES};
use super::panel::{BELOW, Panel};
use super::picture::Picture;
use super::unit_busy::Lanes;

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

/// The units of one frame.
#[derive(Clone, Debug)]
pub struct StallLanes<'a> {
    /// What was run.
    pub subject: &'a str,
    /// The number of the frame.
    pub frame: u64,
    /// Length of an interval in seconds.
    pub interval_s: f64,
    /// The units, top to bottom.
    pub units: Vec<StallLane<'a>>,
}

const KEYS: [&str; 3] = ["busy", "starved", "blocked"];

impl StallLanes<'_> {
    /// A lane for each unit, filled from below by what it did, underlined where it is the bottleneck.
    pub fn picture(&self, look: &Look) -> Picture {
        let title = format!("What the units waited for in frame {}", self.frame);
        let intervals = self.units.iter().map(|unit| unit.shares.len()).max().unwrap_or(0);
        let duration_s = intervals as f64 * self.interval_s;
        let mut picture = Picture::titled(look, (1200.0, 300.0), [&title, self.subject]);
        if intervals == 0 || !(duration_s > 0.0 && is_drawable(0.0, duration_s)) {
            return picture.nothing("no units to show");
        }
        let keys = KEYS.iter().zip(STATES).map(|(name, colour)| (Key::Area(colour), (*name).to_owned()));
        let keys: Vec<_> = keys.chain([(Key::Line(INK), "underlined: the bottleneck".to_owned())]).collect();
        let top = picture.height + 10.0;
        let top = top + legend_lines(&mut picture, top, &keys);
        let pitch = if picture.is_narrow() { 30.0 } else { 44.0 };
        let lanes = Lanes::new(&picture, self.units.iter().map(|unit| unit.name), (top, pitch));
        let panel = lanes.panel(duration_s, self.units.len(), 0.0);
        for (index, unit) in self.units.iter().enumerate() {
            lane(unit, intervals, &panel, &lanes, index, &mut picture);
        }
        panel.axis_across(&mut picture, 4.0);
        picture.height = panel.bottom + BELOW + 10.0;
        picture
    }
}

fn lane(
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
