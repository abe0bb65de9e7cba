//! How busy each unit was over one frame.

use super::axis::{Axis, is_drawable};
use super::columns::means;
use super::palette::{MUTED, heat};
use super::panel::{Panel, shortened};
use super::picture::{Across, Picture, Text, text};
use crate::output::table::si;

/// A unit's busy fraction over time.
#[derive(Clone, Debug)]
pub struct UnitLane<'a> {
    /// The unit.
    pub name: &'a str,
    /// The fraction of each bin in which it was serving work, 0 to 1.
    pub busy: Vec<f64>,
}

/// The units of one frame over time.
#[derive(Clone, Debug)]
pub struct UnitBusy<'a> {
    /// What was run, for the line below the title: scene, GPU, platform.
    pub subject: &'a str,
    /// The number of the frame.
    pub frame: u64,
    /// Length of a bin in seconds.
    pub bin_s: f64,
    /// The units, top to bottom; bins that a lane lacks count as idle.
    pub units: Vec<UnitLane<'a>>,
}

/// Shades of the scale from idle to busy.
const SHADES: f64 = 32.0;

impl UnitBusy<'_> {
    /// A lane for each unit, shaded by how busy it was, with its mean to the right.
    pub fn picture(&self) -> Picture {
        let title = format!("How busy the units were in frame {}", self.frame);
        let bins = self.units.iter().map(|unit| unit.busy.len()).max().unwrap_or(0);
        let duration_s = bins as f64 * self.bin_s;
        let subtitle = format!("{} – {bins} bins of {}", self.subject, si(self.bin_s, "s"));
        let pitch = 34.0_f64.min(900.0 / self.units.len().max(1) as f64);
        let height = 170.0 + (pitch * self.units.len() as f64).max(120.0);
        let mut picture = Picture::new(1200.0, height.ceil(), &title, &subtitle);
        if bins == 0 || !(duration_s > 0.0 && is_drawable(0.0, duration_s)) {
            return picture.nothing("no units to show");
        }
        let x = Axis::new("time in the frame", "s", 0.0, duration_s);
        let bottom = 92.0 + pitch * self.units.len() as f64;
        let y = Axis::new("", "", 0.0, 1.0);
        let panel = Panel { left: 150.0, top: 92.0, right: 1110.0, bottom, x, y };
        for (index, unit) in self.units.iter().enumerate() {
            lane(unit, bins, &panel, (92.0 + pitch * index as f64, pitch), &mut picture);
        }
        panel.axis_across(&mut picture, 4.0);
        scale(&panel, &mut picture);
        picture
    }
}

fn lane(unit: &UnitLane<'_>, bins: usize, panel: &Panel, (top, pitch): (f64, f64), picture: &mut Picture) {
    let mut busy: Vec<f64> = unit.busy.iter().map(|busy| busy.clamp(0.0, 1.0)).collect();
    busy.resize(bins, 0.0);
    let columns = means(&busy, 320);
    let width = (panel.right - panel.left) / columns.len() as f64;
    let (top, bottom, middle) = (top + 2.0, top + pitch - 2.0, top + pitch / 2.0);
    let shade = |busy: f64| (busy * SHADES + 0.5) as u32;
    let mut first = 0;
    for run in columns.chunk_by(|a, b| shade(*a) == shade(*b)) {
        let from = panel.left + first as f64 * width;
        let to = from + run.len() as f64 * width;
        picture.rect((from, top), (to, bottom), heat(f64::from(shade(run[0])) / SHADES));
        first += run.len();
    }
    let name = shortened(unit.name, 13.0, panel.left - 30.0);
    picture.text(Text { across: Across::Right, ..text(&name, (panel.left - 10.0, middle)) });
    let mean = columns.iter().sum::<f64>() / columns.len() as f64;
    let label = format!("{:.1} %", mean * 100.0);
    picture.text(Text { across: Across::Right, colour: MUTED, ..text(&label, (1172.0, middle)) });
}

/// The scale of shades, above the lanes.
fn scale(panel: &Panel, picture: &mut Picture) {
    let (left, top) = (panel.right - 260.0, 70.0);
    for step in 0..100 {
        let from = left + f64::from(step) * 2.0;
        picture.rect((from, top), (from + 2.0, top + 12.0), heat(f64::from(step) / 99.0));
    }
    let note = |text: Text| Text { size: 12.0, colour: MUTED, ..text };
    picture.text(note(Text { across: Across::Right, ..text("idle", (left - 8.0, top + 6.0)) }));
    picture.text(note(text("busy", (left + 208.0, top + 6.0))));
    picture.text(note(Text { across: Across::Right, ..text("mean", (1172.0, top + 6.0)) }));
}
