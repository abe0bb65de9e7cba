//! Where the units' time went over one frame, and which of them held it up.

use super::axis::{Axis, is_drawable};
use super::palette::{INK, part_colour};
use super::panel::{Key, Panel, legend_line, shortened};
use super::picture::{Across, Picture, Text, text};

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

const PITCH: f64 = 44.0;
const TOP: f64 = 104.0;
const KEYS: [&str; 3] = ["busy", "starved", "blocked"];

impl StallLanes<'_> {
    /// A lane for each unit, filled from below by what it did, underlined where it is the bottleneck.
    pub fn picture(&self) -> Picture {
        let title = format!("What the units waited for in frame {}", self.frame);
        let intervals = self.units.iter().map(|unit| unit.shares.len()).max().unwrap_or(0);
        let duration_s = intervals as f64 * self.interval_s;
        let bottom = TOP + PITCH * self.units.len() as f64;
        let mut picture = Picture::new(1200.0, bottom + 80.0, &title, self.subject);
        if intervals == 0 || !(duration_s > 0.0 && is_drawable(0.0, duration_s)) {
            return picture.nothing("no units to show");
        }
        let keys =
            KEYS.iter().enumerate().map(|(at, name)| (Key::Dot(part_colour(at, false)), (*name).to_owned()));
        let keys: Vec<_> = keys.chain([(Key::Dot(INK), "underlined: the bottleneck".to_owned())]).collect();
        legend_line(&mut picture, (150.0, 84.0), &keys);
        let (x, y) = (Axis::new("time in the frame", "s", 0.0, duration_s), Axis::new("", "", 0.0, 1.0));
        let panel = Panel { left: 150.0, top: TOP, right: 1170.0, bottom, x, y };
        for (at, unit) in self.units.iter().enumerate() {
            lane(unit, intervals, &panel, TOP + PITCH * at as f64, &mut picture);
        }
        panel.axis_across(&mut picture, 4.0);
        picture
    }
}

fn lane(unit: &StallLane<'_>, intervals: usize, panel: &Panel, top: f64, picture: &mut Picture) {
    let width = (panel.right - panel.left) / intervals as f64;
    let (floor, height) = (top + PITCH - 8.0, PITCH - 12.0);
    for (at, shares) in unit.shares.iter().enumerate() {
        let (from, to) = (panel.left + at as f64 * width, panel.left + (at + 1) as f64 * width);
        let mut base = floor;
        for (kind, share) in shares.iter().enumerate().filter(|(_, share)| **share > 0.0) {
            let next = base - share * height;
            picture.rect((from, next), (to, base), part_colour(kind, false));
            base = next;
        }
        if unit.bottleneck.get(at).copied().unwrap_or(false) {
            picture.rect((from, floor + 1.0), (to, floor + 4.0), INK);
        }
    }
    let name = shortened(unit.name, 13.0, panel.left - 30.0);
    let middle = top + PITCH / 2.0;
    picture.text(Text { across: Across::Right, ..text(&name, (panel.left - 10.0, middle)) });
}
