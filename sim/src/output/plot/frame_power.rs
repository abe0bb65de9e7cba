//! One frame's power over time, stacked by part.

use super::axis::{Axis, is_drawable};
use super::columns::means;
use super::palette::{INK, TRUTH, part_colour};
use super::panel::{Key, Panel, legend_column};
use super::picture::{Picture, Text, text};
use crate::output::table::si;

/// A part of a frame's power.
#[derive(Clone, Debug)]
pub struct PowerPart<'a> {
    /// Its name: a unit, `constant`, `leakage`, `clock tree`.
    pub name: &'a str,
    /// Whether it is spent whether or not any unit works; such parts are drawn in greys, at the bottom.
    pub overhead: bool,
    /// Its mean power in each bin of time.
    pub power_w: Vec<f64>,
}

/// The power of one frame over time.
#[derive(Clone, Debug)]
pub struct FramePower<'a> {
    /// What was run, for the line below the title: scene, GPU, platform.
    pub subject: &'a str,
    /// The number of the frame.
    pub frame: u64,
    /// Length of a bin in seconds.
    pub bin_s: f64,
    /// The parts, which add up to the total. All have as many bins as the longest; missing ones count as 0 W.
    pub parts: Vec<PowerPart<'a>>,
    /// Samples of the trace in this frame: time from the frame's start in seconds, and power in watts.
    pub samples: &'a [(f64, f64)],
}

impl FramePower<'_> {
    /// Areas stacked in the order of the parts, overheads first, with their total and the samples over it.
    pub fn picture(&self) -> Picture {
        let title = format!("Power of frame {} by part", self.frame);
        let bins = self.parts.iter().map(|part| part.power_w.len()).max().unwrap_or(0);
        let duration_s = bins as f64 * self.bin_s;
        let subtitle = format!("{} – {bins} bins of {}", self.subject, si(self.bin_s, "s"));
        let mut picture = Picture::new(1200.0, 600.0, &title, &subtitle);
        if bins == 0 || !(duration_s > 0.0 && duration_s.is_finite()) {
            return picture.nothing("no power to show");
        }
        let layers = self.layers(bins);
        let Some(panel) = self.panel(duration_s, &layers) else { return picture.nothing("no power to show") };
        panel.grid(&mut picture);
        draw_layers(&layers, &panel, duration_s, &mut picture);
        let radius = if self.samples.len() > 200 { 1.5 } else { 2.5 };
        for (time_s, power_w) in
            self.samples.iter().filter(|(time, power)| time.is_finite() && power.is_finite())
        {
            picture.dot(panel.at(*time_s, *power_w), radius, TRUTH);
        }
        panel.axes(&mut picture, 0.0);
        self.legend(&layers, duration_s, &mut picture);
        picture
    }

    /// Overheads, then units, each with its own colour, its mean power per column and the tops of what is below.
    fn layers(&self, bins: usize) -> Vec<Layer> {
        let columns = bins.min(480);
        let mut floor = vec![0.0; columns];
        let mut layers = Vec::new();
        for overhead in [true, false] {
            for (index, part) in self.parts.iter().filter(|part| part.overhead == overhead).enumerate() {
                let mut power = part.power_w.clone();
                power.resize(bins, 0.0);
                let own = means(&power, columns);
                let top: Vec<f64> = floor.iter().zip(&own).map(|(below, power)| below + power).collect();
                let colour = part_colour(index, overhead);
                let mean_w = own.iter().sum::<f64>() / columns as f64;
                layers.push(Layer { name: part.name.to_owned(), colour, mean_w, floor, top: top.clone() });
                floor = top;
            }
        }
        layers
    }

    fn panel(&self, duration_s: f64, layers: &[Layer]) -> Option<Panel> {
        let sampled = self.samples.iter().map(|(_, power)| *power);
        let tops = layers.iter().flat_map(|layer| layer.top.iter().copied());
        let high = tops.chain(sampled).filter(|power| power.is_finite()).reduce(f64::max)?;
        if !(is_drawable(0.0, high) && is_drawable(0.0, duration_s)) {
            return None;
        }
        let x = Axis::new("time in the frame", "s", 0.0, duration_s);
        let y = Axis::from_zero("power", "W", high.max(0.0));
        Some(Panel { left: 90.0, top: 84.0, right: 900.0, bottom: 530.0, x, y })
    }

    fn legend(&self, layers: &[Layer], duration_s: f64, picture: &mut Picture) {
        let total: f64 = layers.iter().map(|layer| layer.mean_w).sum();
        let mut entries = vec![(Key::Line(INK), "total".to_owned(), si(total * duration_s, "J"))];
        if !self.samples.is_empty() {
            entries.push((Key::Dot(TRUTH), "samples".to_owned(), self.samples.len().to_string()));
        }
        for layer in layers.iter().rev() {
            let energy = si(layer.mean_w * duration_s, "J");
            entries.push((Key::Area(layer.colour), layer.name.clone(), energy));
        }
        picture.text(Text { size: 12.5, bold: true, ..text("part, energy in the frame", (930.0, 72.0)) });
        legend_column(picture, (930.0, 98.0), 1170.0, &entries);
    }
}

struct Layer {
    name: String,
    colour: super::palette::Colour,
    mean_w: f64,
    floor: Vec<f64>,
    top: Vec<f64>,
}

fn draw_layers(layers: &[Layer], panel: &Panel, duration_s: f64, picture: &mut Picture) {
    for layer in layers.iter().filter(|layer| layer.mean_w != 0.0) {
        let mut points = steps(panel, duration_s, &layer.top);
        points.extend(steps(panel, duration_s, &layer.floor).into_iter().rev());
        picture.polygon(points, layer.colour);
    }
    if let Some(total) = layers.last() {
        picture.polyline(steps(panel, duration_s, &total.top), INK, 1.0);
    }
}

/// A column of constant value each, as a stair.
fn steps(panel: &Panel, duration_s: f64, values: &[f64]) -> Vec<(f64, f64)> {
    let time = |index: usize| duration_s * index as f64 / values.len() as f64;
    let stair = values.iter().enumerate();
    stair.flat_map(|(i, value)| [panel.at(time(i), *value), panel.at(time(i + 1), *value)]).collect()
}
