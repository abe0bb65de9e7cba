//! Work before the first start found and after the last frame: a sequence that begins late or ends early says nothing of what it left
//! out.

use crate::warning::Warning;

/// So many usual lengths of work without a start are worth a warning.
const WORTH: usize = 3;
/// A stretch works above this share of the way from the lowest power to the mean within frames.
const WORKS: f64 = 0.5;
/// The lowest power is that of stretches of so many to a usual length.
const PARTS: usize = 20;

/// How many usual lengths of work lie beyond the starts, whose places are in samples and in order. `None` for fewer than three.
fn beyond(power: &[f64], starts: &[f64]) -> Option<usize> {
    let (&first, &last) = starts.first().zip(starts.last())?;
    let mut gaps: Vec<f64> = starts.windows(2).map(|two| two[1] - two[0]).collect();
    gaps.sort_by(f64::total_cmp);
    let usual = (*gaps.get(gaps.len() / 2).filter(|_| gaps.len() > 1)? as usize).max(1);
    let place = |position: f64| (position.max(0.0) as usize).min(power.len());
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
    let lowest = power.chunks_exact((usual / PARTS).max(1)).map(mean).fold(f64::INFINITY, f64::min);
    let works_w = lowest + WORKS * (mean(&power[place(first)..place(last)]) - lowest);
    let (before, after) = (&power[..place(first)], &power[place(last + usual as f64)..]);
    let busy = before.rchunks_exact(usual).chain(after.chunks_exact(usual)).filter(|of| mean(of) > works_w);
    Some(busy.count())
}

/// The warning, where there is much.
pub(super) fn uncovered(power: &[f64], starts: &[f64]) -> Option<Warning> {
    let frames = beyond(power, starts).filter(|frames| *frames >= WORTH)?;
    Some(Warning::new(
        "uncovered",
        format!(
            "before the first start and after the last frame there is work of about {frames} frames in which none was found: \
         frames are missing there; mark one of them, too"
        ),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Idle of 500 samples, frames of 100, busy for 70, and idle again.
    fn power(frames: usize) -> Vec<f64> {
        let work = (0..100 * frames).map(|i| if i % 100 < 70 { 3.0 } else { 1.0 });
        [1.0; 500].into_iter().chain(work).chain([1.0; 500]).collect()
    }

    fn starts(from: usize, to: usize) -> Vec<f64> {
        (from..to).map(|frame| 500.0 + 100.0 * frame as f64).collect()
    }

    #[test]
    fn frames_left_out_at_either_end_are_counted() {
        let power = power(40);
        assert_eq!(beyond(&power, &starts(0, 40)), Some(0));
        assert_eq!(beyond(&power, &starts(7, 40)), Some(7));
        assert_eq!(beyond(&power, &starts(7, 30)), Some(17));
        assert_eq!(beyond(&power, &starts(0, 2)), None);
    }

    #[test]
    fn one_frame_more_or_less_is_no_matter() {
        let power = power(40);
        assert!(uncovered(&power, &starts(1, 39)).is_none());
        assert!(uncovered(&power, &starts(0, 37)).unwrap().message.contains("about 3 frames"));
    }
}
