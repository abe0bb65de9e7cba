//! Energy of each frame, measured against true.

use super::axis::{Axis, Way, is_drawable};
use super::legend::{Key, legend_lines};
use super::look::Look;
use super::palette::{MEASURED, TRUTH};
use super::panel::{BELOW, Panel, aside};
use super::picture::Picture;
use crate::MeanSd;
use crate::table::si_mean_sd;

/// The energy of one frame.
#[derive(Clone, Copy, Debug)]
pub struct FrameEnergyPoint {
    /// The number of the frame.
    pub frame: u64,
    /// What the analysis of the trace says, in joules; `None` where it found no such frame.
    pub measured_j: Option<f64>,
    /// What the simulator says, in joules; `None` for a recording.
    pub true_j: Option<f64>,
}

/// The energy of each frame of a run.
#[derive(Clone, Copy, Debug)]
pub struct FrameEnergy<'a> {
    /// What was run, for the line below the title: scene, GPU, platform.
    pub subject: &'a str,
    /// The frames in order.
    pub frames: &'a [FrameEnergyPoint],
    /// Mean and standard deviation of the measured energies, in joules, over the frames that count for it.
    pub measured_j: Option<MeanSd>,
    /// Pixels of a frame, for the axis in joules per pixel; 0 leaves that axis out.
    pub pixels: u64,
}

impl FrameEnergy<'_> {
    /// Points and lines over the number of the frame, with the mean and its band.
    pub fn picture(&self, look: &Look) -> Picture {
        let mut picture = Picture::titled(look, (1200.0, 300.0), ["Energy per frame", self.subject]);
        let Some(mut panel) = self.panel(&picture) else { return picture.nothing("no frames to show") };
        let top = picture.height + 10.0;
        let legend = legend_lines(&mut picture, top, &self.legend());
        let height = panel.bottom - panel.top;
        (panel.top, panel.bottom) = (top + legend, top + legend + height);
        let per_pixel = (self.pixels > 0).then(|| {
            let [low, high] = [panel.y.low, panel.y.high].map(|energy_j| energy_j / self.pixels as f64);
            Axis::new("energy per pixel", "J", (low, high), (Way::Up, height))
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

    /// The panel, at the top of the picture.
    fn panel(&self, picture: &Picture) -> Option<Panel> {
        let all = || self.values(true).chain(self.values(false));
        let (first, last) = (all().map(|p| p.0).reduce(f64::min)?, all().map(|p| p.0).reduce(f64::max)?);
        let bounds = self.measured_j.iter().flat_map(|stats| [stats.mean - stats.sd, stats.mean + stats.sd]);
        let energies =
            || all().map(|point| point.1).chain(bounds.clone()).filter(|energy| energy.is_finite());
        let (low, high) = (energies().reduce(f64::min)?, energies().reduce(f64::max)?);
        if !is_drawable(low, high) {
            return None;
        }
        // Differences of a percent are to be seen, so the axis need not start at 0; its labels say where it does.
        let margin = (0.12 * (high - low)).max(0.002 * high.abs());
        let height = if picture.is_narrow() { 210.0 } else { 430.0 };
        let y = Axis::new("energy per frame", "J", (low - margin, high + margin), (Way::Up, height));
        let (left, right) = (picture.margin() + aside(&y), picture.width() - picture.margin() - 4.0);
        let x = Axis::whole("frame", (first - 0.5, last + 0.5), (Way::Across, right - left - 70.0));
        Some(Panel { left, top: 0.0, right, bottom: height, x, y })
    }

    fn band(&self, panel: &Panel, picture: &mut Picture) {
        let Some(stats) = self.measured_j.filter(|s| s.mean.is_finite() && s.sd.is_finite()) else { return };
        let (top, bottom) = (panel.y_px(stats.mean + stats.sd), panel.y_px(stats.mean - stats.sd));
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
        if let Some(stats) = self.measured_j {
            let label = format!("mean and deviation of the measured: {}", si_mean_sd(stats, "J"));
            entries.push((Key::Area(MEASURED.alpha(0.25)), label));
        }
        entries
    }
}
