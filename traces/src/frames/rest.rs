//! Doubt where the rest that frames begin in is another than at the mark.
//!
//! A frame begins in little power, between the end of the one before and its own draws. What is aligned are the draws. If the rest
//! before them has become longer, power does not tell whether the wait for the frame has, or its own quiet beginning (the front end):
//! the start may be anywhere in what was added. So starts whose rest begins or ends at another distance than it did at the mark, by
//! more than a start may be off, are in doubt.

use crate::squares::mean;
use rayon::prelude::*;

/// The stretch looked at on either side of a start, as a share of the window.
const REACH: f64 = 0.32;
/// Shares of the window before and after the start in which the lowest power is looked for.
const LOWEST: [f64; 2] = [0.2, 0.12];

/// How a rest is bounded.
struct Bound {
    /// It ends where power is this share of the way from the lowest
    rises: f64,
    /// to what it is above for this share of the stretch.
    above: f64,
    /// An end that has moved by this share of the window is a doubt.
    moved: f64,
}

/// Low down where work draws much more than a rest, and, where the quiet end of the frame before hides that, half way up.
const BOUNDS: [Bound; 2] =
    [Bound { rises: 0.1, above: 0.1, moved: 0.06 }, Bound { rises: 0.35, above: 0.5, moved: 0.08 }];
/// So many frames on either side are averaged, and so many samples.
pub(super) const FRAMES: usize = 8;
const SAMPLES: usize = 3;
/// Where that is less than so many samples, it is noise.
const LEAST: f64 = 4.0;
/// Where so many of the starts near are in doubt, a start is, too.
const ENOUGH: f64 = 0.125;
/// What is left of the confidence then.
pub(super) const LEFT: f64 = 0.4;

/// The samples of a profile at which a rest begins and ends, by each of the [`BOUNDS`].
type Rests = [Option<[usize; 2]>; BOUNDS.len()];

/// What is left of the confidence of each start, from their places (samples, in order) and the width of the window.
pub(super) fn left(power: &[f64], starts: &[f64], marked: &[bool], width: usize) -> Vec<f64> {
    let marks: Vec<usize> = (0..starts.len()).filter(|&start| marked[start]).collect();
    if BOUNDS.iter().all(|bound| bound.least(width).is_none()) {
        return vec![1.0; starts.len()];
    }
    let rests = |start: usize| {
        let profile = profile(power, near(starts, start, FRAMES), width);
        BOUNDS.each_ref().map(|bound| rest(profile.as_ref()?, bound, width))
    };
    let rests: Vec<Rests> = (0..starts.len()).into_par_iter().map(rests).collect();
    let of_start = |start: usize| {
        let mark = marks.iter().copied().min_by_key(|mark| mark.abs_diff(start))?;
        let mut ends = BOUNDS.iter().zip(rests[start].iter().zip(rests[mark]));
        Some(if ends.any(|(bound, (here, there))| bound.moved(*here, there, width)) { LEFT } else { 1.0 })
    };
    (0..starts.len()).map(|start| of_start(start).unwrap_or(1.0)).collect()
}

impl Bound {
    /// The samples by which an end must have moved in a window of that width; `None` where so few are noise.
    fn least(&self, width: usize) -> Option<f64> {
        Some(self.moved * width as f64).filter(|moved| *moved >= LEAST)
    }

    /// Whether a rest is bounded elsewhere than another, in samples of a window of that width.
    fn moved(&self, here: Option<[usize; 2]>, there: Option<[usize; 2]>, width: usize) -> bool {
        let (Some(least), Some(here), Some(there)) = (self.least(width), here, there) else { return false };
        here.into_iter().zip(there).any(|(a, b)| a.abs_diff(b) as f64 > least)
    }
}

/// Doubts spread to all starts near which enough others are in doubt: what moved does not move for a frame and back.
pub(super) fn spread(left: Vec<f64>) -> Vec<f64> {
    let of_start = |start: usize| {
        let near = near(&left, start, FRAMES);
        let doubted = near.iter().filter(|left| **left < 1.0).count();
        if doubted as f64 >= ENOUGH * near.len() as f64 { LEFT.min(left[start]) } else { left[start] }
    };
    (0..left.len()).map(of_start).collect()
}

/// One of some starts and so many on either side of it.
pub(super) fn near<T>(starts: &[T], start: usize, frames: usize) -> &[T] {
    &starts[start.saturating_sub(frames)..starts.len().min(start + frames + 1)]
}

/// The power about a start, by shares of the window before and after it; `None` where that is not all in the trace.
pub(super) fn about(power: &[f64], start: f64, shares: [f64; 2], width: usize) -> Option<&[f64]> {
    let [before, after] = shares.map(|share| (share * width as f64) as usize);
    let place = libm::round(start) as usize;
    power.get(place.checked_sub(before)?..place + after)
}

/// The mean power about some starts, W; `None` where none lies well within the trace.
fn profile(power: &[f64], starts: &[f64], width: usize) -> Option<Vec<f64>> {
    let stretches: Vec<&[f64]> =
        starts.iter().filter_map(|start| about(power, *start, [REACH; 2], width)).collect();
    let length = stretches.first()?.len();
    let at = |sample: usize| mean(&stretches.iter().map(|of| of[sample]).collect::<Vec<_>>());
    let means: Vec<f64> = (0..length).map(at).collect();
    Some(means.windows(SAMPLES).map(mean).collect())
}

/// The samples of a profile at which the rest in its middle, or next to that, begins and ends.
fn rest(profile: &[f64], bound: &Bound, width: usize) -> Option<[usize; 2]> {
    let [before, after] = LOWEST.map(|share| (share * width as f64) as usize);
    let middle = (REACH * width as f64) as usize;
    let places = middle.saturating_sub(before)..(middle + after).min(profile.len());
    let lowest_w = profile[places.clone()].iter().copied().fold(f64::INFINITY, f64::min);
    let high = ((1.0 - bound.above) * profile.len() as f64) as usize;
    let high_w = *profile.to_vec().select_nth_unstable_by(high, f64::total_cmp).1;
    let ends_w = lowest_w + bound.rises * (high_w - lowest_w);
    let within =
        places.filter(|place| profile[*place] <= ends_w).min_by_key(|place| place.abs_diff(middle))?;
    let works = |watts: &f64| *watts > ends_w;
    let first = profile[..within].iter().rposition(works).unwrap_or(0);
    let last = profile[within..].iter().position(works).map_or(profile.len(), |after| within + after);
    Some([first, last])
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 250;

    /// Frames with a rest of `rest(frame)` samples before draws of 300; each starts, as it was found by its draws, 10 before those.
    fn frames(count: usize, rest: impl Fn(usize) -> usize) -> (Vec<f64>, Vec<f64>) {
        let (mut power, mut starts) = (vec![1.2; 300], Vec::new());
        for frame in 0..count {
            power.extend(vec![0.2; rest(frame)]);
            starts.push(power.len() as f64 - 10.0);
            power.extend((0..300).map(|sample| 1.0 + f64::from(sample / 2 * 37 % 11) / 22.0));
        }
        (power, starts)
    }

    fn doubted(count: usize, mark: usize, rest: impl Fn(usize) -> usize) -> Vec<usize> {
        let (power, starts) = frames(count, rest);
        let marked: Vec<bool> = (0..count).map(|frame| frame == mark).collect();
        let left = left(&power, &starts, &marked, WIDTH);
        (0..count).filter(|&frame| left[frame] < 1.0).collect()
    }

    #[test]
    fn a_rest_that_has_grown_by_more_than_a_start_may_be_off_is_a_doubt() {
        // From 15 samples at the mark to 45: 0.12 of the window.
        let doubted = doubted(120, 10, |frame| if frame < 60 { 15 } else { 45 });
        assert!(doubted.iter().all(|frame| (50..120).contains(frame)), "{doubted:?}");
        assert!((70..112).all(|frame| doubted.contains(&frame)), "{doubted:?}");
    }

    #[test]
    fn a_rest_that_stays_or_changes_a_little_is_none() {
        assert!(doubted(60, 10, |_| 15).is_empty());
        assert!(doubted(60, 10, |frame| 12 + frame * 7 % 5).is_empty());
        assert!(doubted(120, 10, |frame| if frame < 60 { 15 } else { 25 }).is_empty());
    }

    #[test]
    fn a_quiet_end_of_the_frame_before_is_not_the_rest() {
        // 30 samples at the end of each frame, 25 before its rest, draw as little as that, and for some frames even less.
        let (mut power, starts) = frames(120, |_| 12);
        for (frame, start) in starts.iter().enumerate() {
            let end = *start as usize - 30;
            power[end - 30..end].fill(if frame < 60 { 0.21 } else { 0.19 });
        }
        let marked: Vec<bool> = (0..120).map(|frame| frame == 10).collect();
        assert_eq!(left(&power, &starts, &marked, WIDTH), [1.0; 120]);
    }

    #[test]
    fn the_nearest_mark_is_what_a_rest_is_compared_with() {
        let (power, starts) = frames(120, |frame| if frame < 60 { 15 } else { 45 });
        let marked: Vec<bool> = (0..120).map(|frame| frame == 10 || frame == 100).collect();
        let left = left(&power, &starts, &marked, WIDTH);
        assert!(
            (0..120).filter(|frame| left[*frame] < 1.0).all(|frame| (45..75).contains(&frame)),
            "{left:?}"
        );
    }

    #[test]
    fn a_few_doubts_make_all_near_them_doubtful_and_one_does_not() {
        let mut left = vec![1.0; 60];
        left[50] = 0.3;
        assert_eq!(spread(left.clone()), left);
        left[18..22].fill(LEFT);
        let spread = spread(left);
        assert!(spread[13..27].iter().all(|left| *left == LEFT), "{spread:?}");
        assert!(spread[..10].iter().chain(&spread[30..50]).all(|left| *left == 1.0), "{spread:?}");
        assert_eq!(spread[50], 0.3);
    }

    #[test]
    fn without_marks_or_with_few_samples_nothing_is_doubted() {
        let (power, starts) = frames(60, |frame| 15 + frame);
        assert_eq!(left(&power, &starts, &[false; 60], WIDTH), [1.0; 60]);
        let marked: Vec<bool> = (0..60).map(|frame| frame == 1).collect();
        for width in [0, 1, 3, 5, 40] {
            assert_eq!(left(&power, &starts, &marked, width), [1.0; 60]);
        }
        assert_eq!(left(&[1.0; 9], &[3.0], &[true], WIDTH), [1.0]);
        assert!(left(&[], &[], &[], WIDTH).is_empty());
    }
}
