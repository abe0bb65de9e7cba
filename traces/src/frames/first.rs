//! The first frame of a free-running stretch: nothing was drawn before it, so what lies before the mark differs.

use super::assess::confidence;
use super::found::FrameStart;
use super::matched::{REACH, View};
use super::profile::summed_squared_difference;
use super::refine::align;
use crate::median::median;

/// How far before the first found start, in median distances of starts, the first frame may begin.
const REACH_BACK: f64 = 1.6;
/// A match leaves less than this share of what tells the template from steady power.
const ALIKE: f64 = 0.5;

impl View<'_> {
    /// One more start before the first one found, matched only by what follows the mark, with the threshold (and the
    /// distance told) in proportion to the part compared. `None` if nothing there is near enough.
    pub(super) fn start_after_idle(&self, starts: &[FrameStart], spacing: usize) -> Option<FrameStart> {
        let gap_s = median_gap_s(starts)?;
        let first = self.trace.position(starts.first()?.time_s);
        let from = (first - REACH_BACK * gap_s * self.trace.rate_hz()).max(0.0) as usize;
        let to = (first - spacing as f64).max(0.0) as usize;
        let lead = |mark: &super::marks::Placed| libm::round(mark.anchor) as usize;
        let found = self.placement.marks.iter().filter_map(|mark| {
            let template = &self.power[mark.first + lead(mark)..mark.first + self.placement.samples];
            let stretch = self.power.get(from..to + template.len())?;
            let profile = summed_squared_difference(stretch, template);
            let (near, &distance) = profile.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
            let distance_w2 = distance * self.placement.samples as f64 / template.len() as f64;
            let offset = align(self.power, template, from + near, REACH) - (mark.first + lead(mark)) as f64;
            let time_s = mark.mark_s + offset * self.trace.period_s();
            let inside = near > 0 && near + 1 < profile.len();
            let stands_out = distance < ALIKE * self.contrast_w2(mark.first, lead(mark), template);
            (inside && stands_out && distance_w2 < self.threshold.value_w2).then_some((time_s, distance_w2))
        });
        let (time_s, distance_w2) = found.min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(FrameStart {
            time_s,
            distance_w2,
            confidence: confidence(self.threshold)(distance_w2),
            marked: false,
        })
    }

    /// How much what follows the mark differs from the steady power before it, W^2: where that is nothing, idle alone
    /// resembles it. Unbounded where the window has nothing before the mark.
    fn contrast_w2(&self, first: usize, lead: usize, template: &[f64]) -> f64 {
        if lead == 0 {
            return f64::INFINITY;
        }
        let before = self.power[first..first + lead].iter().sum::<f64>() / lead as f64;
        template.iter().map(|power| (power - before) * (power - before)).sum()
    }
}

/// The median distance between neighbours, s; `None` for fewer than two starts.
fn median_gap_s(starts: &[FrameStart]) -> Option<f64> {
    let mut gaps: Vec<f64> = starts.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect();
    (!gaps.is_empty()).then(|| median(&mut gaps))
}
