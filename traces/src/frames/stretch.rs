//! Alignment of two frames at different clocks.
//!
//! Where the clock has stepped, the same draws take longer or shorter: what follows the start of one frame is what follows that
//! of the other, drawn out in time. Compared as they are, the two fit best where the start is up to a sixth of the window off. So the
//! earlier stretch is drawn out about its start by one ratio after another, and the shift is taken from the ratio that fits best.

use super::refine::{between, nearest, vertex};

/// Ratios of durations that are tried: powers of this, up and down.
const STEP: f64 = 1.06;
/// The greatest power: clocks of a device lie within a factor of two.
const POWERS: i32 = 11;
/// Shifts are first tried so many samples apart.
const ROUGH: usize = 3;

/// Where a drawn-out stretch fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    /// How much longer things take in the later frame.
    pub ratio: f64,
    /// How much later than its place the start of the later frame lies, samples.
    pub shift: f64,
    /// Share of the variance that is left unexplained, whatever the gain.
    pub unlike: f64,
    /// Second difference of that share over the shift, per squared sample.
    pub curvature: f64,
}

/// Two frames to be aligned, by where their starts are thought to be, and what of them is compared: `before` and `after` samples of the
/// later one, for shifts up to `reach`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair<'a> {
    pub power: &'a [f64],
    pub starts: [usize; 2],
    pub before: usize,
    pub after: usize,
    pub reach: usize,
}

impl Pair<'_> {
    /// The ratio and the shift that leave least unexplained; `None` where the trace ends too early or nothing fits best.
    pub fn best(&self) -> Option<Fit> {
        let fits = (-POWERS..=POWERS)
            .filter_map(|power| Some((power, self.fit(libm::pow(STEP, f64::from(power)))?)));
        let (power, fit) = fits.min_by(|a, b| a.1.unlike.total_cmp(&b.1.unlike))?;
        // What fits best by the greatest ratio would fit better by a greater one.
        (power.abs() < POWERS).then_some(fit)
    }

    /// The fit of clocks that are the same.
    pub fn plain(&self) -> Option<Fit> {
        self.fit(1.0)
    }

    /// What of the later frame is compared at one shift or another.
    fn searched(&self) -> Option<&[f64]> {
        let first = self.starts[1].checked_sub(self.before + self.reach)?;
        self.power.get(first..self.starts[1] + self.after + self.reach)
    }

    /// What lies about the start of the earlier frame, drawn out about it, of mean 0.
    fn drawn_out(&self, ratio: f64) -> Option<Vec<f64>> {
        let value = |index: usize| {
            let place = self.starts[0] as f64 + (index as f64 - self.before as f64) / ratio;
            between(self.power, place)
        };
        let mut values = (0..self.before + self.after).map(value).collect::<Option<Vec<f64>>>()?;
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter_mut().for_each(|watts| *watts -= mean);
        Some(values)
    }

    /// The best shift at one ratio.
    fn fit(&self, ratio: f64) -> Option<Fit> {
        let (stretch, template) = (self.searched()?, self.drawn_out(ratio)?);
        let own: f64 = template.iter().map(|x| x * x).sum();
        let unlike = |shift: usize| unexplained(&template, own, &stretch[shift..shift + template.len()]);
        let last = (2 * self.reach).checked_sub(1)?;
        let at = nearest(1..=last, ROUGH, unlike);
        let [left, middle, right] = [at - 1, at, at + 1].map(unlike);
        let curvature = left - 2.0 * middle + right;
        (middle <= left.min(right) && curvature > 0.0).then(|| Fit {
            ratio,
            shift: at as f64 - self.reach as f64 + vertex(left, middle, right),
            unlike: middle,
            curvature,
        })
    }
}

/// One less the squared correlation coefficient of a template (of mean 0 and squares `own`) and a stretch; 1 where they are opposed.
fn unexplained(template: &[f64], own: f64, stretch: &[f64]) -> f64 {
    let (mut sum, mut squares, mut inner) = (0.0, 0.0, 0.0);
    for (t, x) in template.iter().zip(stretch) {
        sum += x;
        squares += x * x;
        inner += t * x;
    }
    let variance = squares - sum * sum / stretch.len() as f64;
    if inner <= 0.0 || variance <= 0.0 || own <= 0.0 { 1.0 } else { 1.0 - inner * inner / (variance * own) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Draws of many lengths from sample 300 on, every one longer by a ratio, after a rest.
    fn frame(ratio: f64, gain: f64) -> Vec<f64> {
        let edges = [0.0, 7.0, 12.0, 31.0, 40.0, 66.0, 71.0, 95.0, 130.0, 170.0, 400.0];
        let heights = [0.3, 1.0, 0.5, 0.8, 0.4, 0.9, 0.6, 0.7, 0.5, 0.8];
        let power = |at: f64| {
            let draw = edges.windows(2).position(|e| (e[0] * ratio..e[1] * ratio).contains(&at));
            0.2 + gain * draw.map_or(0.0, |draw| heights[draw])
        };
        // Sample 300 is the first of the frame; each is the mean of ten places.
        (0..600)
            .map(|i| (0..10).map(|k| power(f64::from(i) - 300.0 + 0.1 * f64::from(k))).sum::<f64>() / 10.0)
            .collect()
    }

    #[test]
    fn analytic_a_frame_at_another_clock_is_aligned_at_its_start_and_its_ratio_is_found() {
        for (ratio, gain) in [(1.0 / 0.58, 0.4), (0.72, 1.6), (1.0, 1.0)] {
            let power = [frame(1.0, 1.0), frame(ratio, gain)].concat();
            for thought in [880, 900, 925] {
                let pair = Pair { power: &power, starts: [300, thought], before: 20, after: 110, reach: 60 };
                let fit = pair.best().unwrap();
                let off = fit.shift - (900.0 - thought as f64);
                assert!((fit.ratio / ratio - 1.0).abs() < 0.05, "{ratio}: {fit:?}");
                assert!(off.abs() < 1.0 && fit.unlike < 0.1, "{ratio} {thought}: {fit:?}");
            }
        }
    }

    #[test]
    fn compared_as_they_are_frames_of_unlike_clocks_are_unlike_or_misplaced() {
        let power = [frame(1.0, 1.0), frame(1.0 / 0.58, 0.4)].concat();
        let pair = Pair { power: &power, starts: [300, 900], before: 20, after: 110, reach: 60 };
        let (plain, best) = (pair.plain().unwrap(), pair.best().unwrap());
        assert!(plain.unlike > 3.0 * best.unlike && plain.shift.abs() > 5.0, "{plain:?} {best:?}");
    }

    #[test]
    fn steady_power_and_the_ends_of_a_trace_have_no_fit() {
        let pair = |starts| Pair { power: &[1.0; 300], starts, before: 5, after: 50, reach: 20 };
        assert_eq!(pair([100, 200]).best(), None);
        assert_eq!(pair([100, 10]).best(), None);
        assert_eq!(pair([100, 290]).best(), None);
    }
}
