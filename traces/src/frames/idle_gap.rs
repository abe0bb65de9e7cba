//! Lower confidence where the idle gap before a frame differs from that at the mark, or is missing.
//!
//! A frame begins in little power, between the end of the frame before and its own draws. The alignment
//! follows the draws.
//!
//! - A changed gap: if the gap before the draws has become longer, power does not show whether the wait for
//!   the frame has, or its own quiet beginning (the front end). The start may be anywhere in the added time.
//!   Starts whose gap begins or ends at another distance than at the mark are suspect.
//! - A missing gap: a start amidst work, where others nearby have an idle gap, may lie within a frame. Where
//!   a frame takes two ticks of the display at a slow clock, its middle is on a tick, too.

use super::SUSPECT_CONFIDENCE;
use crate::stats::{mean, nth_smallest, upper_median};
use rayon::prelude::*;

/// Segment examined on either side of a start, as a share of the window.
const REACH_SHARE: f64 = 0.32;
/// Shares of the window before and after the start in which the lowest power is searched.
const LOWEST_SHARES: [f64; 2] = [0.2, 0.12];

/// How an idle gap is bounded.
struct Bound {
    /// It ends where power has risen by this share of the way from the lowest
    rises: f64,
    /// to what it is above for this share of the segment.
    above: f64,
    /// An end that has moved by this share of the window is suspect.
    moved: f64,
}

/// One low threshold, where work draws much more than an idle gap, and one half way up, where the quiet end
/// of the frame before hides the first.
const BOUNDS: [Bound; 2] =
    [Bound { rises: 0.1, above: 0.1, moved: 0.06 }, Bound { rises: 0.35, above: 0.5, moved: 0.08 }];
/// Frames on either side that are averaged.
const NEIGHBOURS: usize = 8;
/// Samples that are averaged.
const SMOOTHED_SAMPLES: usize = 3;
/// Smaller moves, in samples, are noise.
const MIN_MOVED_SAMPLES: f64 = 4.0;
/// Least share of suspect starts nearby that makes a start suspect, too.
const MIN_SUSPECT_SHARE: f64 = 0.125;

/// The samples of a profile at which an idle gap begins and ends, by each of the [`BOUNDS`].
type GapBounds = [Option<[usize; 2]>; BOUNDS.len()];

/// Confidence factors of starts, from their places (samples, in order) and the width of the window: lower
/// where the idle gap has changed since the mark.
pub(super) fn shifted_gap_confidence(
    power: &[f64],
    starts: &[f64],
    marked: &[bool],
    width: usize,
) -> Vec<f64> {
    let marks: Vec<usize> = (0..starts.len()).filter(|&start| marked[start]).collect();
    if BOUNDS.iter().all(|bound| bound.min_moved(width).is_none()) {
        return vec![1.0; starts.len()];
    }
    let gaps = |start: usize| {
        let profile = mean_profile(power, neighbours(starts, start, NEIGHBOURS), width);
        BOUNDS.each_ref().map(|bound| idle_gap(profile.as_ref()?, bound, width))
    };
    let gaps: Vec<GapBounds> = (0..starts.len()).into_par_iter().map(gaps).collect();
    let of_start = |start: usize| {
        let mark = marks.iter().copied().min_by_key(|mark| mark.abs_diff(start))?;
        let mut ends = BOUNDS.iter().zip(gaps[start].iter().zip(gaps[mark]));
        Some(if ends.any(|(bound, (here, there))| bound.moved(*here, there, width)) {
            SUSPECT_CONFIDENCE
        } else {
            1.0
        })
    };
    (0..starts.len()).map(|start| of_start(start).unwrap_or(1.0)).collect()
}

impl Bound {
    /// The least move of an end in a window of that width, in samples; `None` if it would be noise.
    fn min_moved(&self, width: usize) -> Option<f64> {
        Some(self.moved * width as f64).filter(|moved| *moved >= MIN_MOVED_SAMPLES)
    }

    /// Whether an idle gap is bounded elsewhere than another, in samples of a window of that width.
    fn moved(&self, here: Option<[usize; 2]>, there: Option<[usize; 2]>, width: usize) -> bool {
        let (Some(least), Some(here), Some(there)) = (self.min_moved(width), here, there) else {
            return false;
        };
        here.into_iter().zip(there).any(|(a, b)| a.abs_diff(b) as f64 > least)
    }
}

/// Spreads suspicion to all starts near enough suspect ones: what moved does not move for a single frame.
pub(super) fn spread_to_neighbours(left: Vec<f64>) -> Vec<f64> {
    let of_start = |start: usize| {
        let near = neighbours(&left, start, NEIGHBOURS);
        let suspect = near.iter().filter(|left| **left < 1.0).count();
        if suspect as f64 >= MIN_SUSPECT_SHARE * near.len() as f64 {
            SUSPECT_CONFIDENCE.min(left[start])
        } else {
            left[start]
        }
    };
    (0..left.len()).map(of_start).collect()
}

/// A start and its neighbours on either side.
pub(super) fn neighbours<T>(starts: &[T], start: usize, frames: usize) -> &[T] {
    &starts[start.saturating_sub(frames)..starts.len().min(start + frames + 1)]
}

/// The power about a start, by shares of the window before and after it; `None` where that is not all in the
/// trace.
pub(super) fn window_around(power: &[f64], start: f64, shares: [f64; 2], width: usize) -> Option<&[f64]> {
    let [before, after] = shares.map(|share| (share * width as f64) as usize);
    let place = libm::round(start) as usize;
    power.get(place.checked_sub(before)?..place + after)
}

/// The mean power about some starts, W; `None` where none lies well within the trace.
fn mean_profile(power: &[f64], starts: &[f64], width: usize) -> Option<Vec<f64>> {
    let segments: Vec<&[f64]> =
        starts.iter().filter_map(|start| window_around(power, *start, [REACH_SHARE; 2], width)).collect();
    let length = segments.first()?.len();
    let at = |sample: usize| mean(&segments.iter().map(|of| of[sample]).collect::<Vec<_>>());
    let means: Vec<f64> = (0..length).map(at).collect();
    Some(means.windows(SMOOTHED_SAMPLES).map(mean).collect())
}

/// The samples of a profile at which the idle gap in its middle, or next to that, begins and ends.
fn idle_gap(profile: &[f64], bound: &Bound, width: usize) -> Option<[usize; 2]> {
    let [before, after] = LOWEST_SHARES.map(|share| (share * width as f64) as usize);
    let middle = (REACH_SHARE * width as f64) as usize;
    let places = middle.saturating_sub(before)..(middle + after).min(profile.len());
    let lowest_w = profile[places.clone()].iter().copied().fold(f64::INFINITY, f64::min);
    let high = ((1.0 - bound.above) * profile.len() as f64) as usize;
    let high_w = nth_smallest(&mut profile.to_vec(), high);
    let ends_w = lowest_w + bound.rises * (high_w - lowest_w);
    let within =
        places.filter(|place| profile[*place] <= ends_w).min_by_key(|place| place.abs_diff(middle))?;
    let works = |watts: &f64| *watts > ends_w;
    let first = profile[..within].iter().rposition(works).unwrap_or(0);
    let last = profile[within..].iter().position(works).map_or(profile.len(), |after| within + after);
    Some([first, last])
}

/// Shares of the window before and after a start in which its idle gap lies.
const OWN_SHARES: [f64; 2] = [0.1, 0.06];
/// Length of the shortest idle gap, as a share of the window.
const MIN_GAP_SHARE: f64 = 0.02;
/// Shares of the window before and after the start that give the usual power.
const USUAL_SHARES: [f64; 2] = [0.32, 0.8];
/// A start has no idle gap if power dips there by less than this share of the dip at the deepest quarter of
/// its neighbours.
const MIN_DIP_RATIO: f64 = 0.6;
/// That dip must be at least this many deviations of the noise.
const MIN_NOISE_DEVIATIONS: f64 = 6.0;

/// Confidence factors of starts, from their places (samples, in order), the width of the window and the
/// deviation of the noise: lower where the idle gap is missing.
pub(super) fn missing_gap_confidence(power: &[f64], starts: &[f64], width: usize, noise_w: f64) -> Vec<f64> {
    let gap_samples = (MIN_GAP_SHARE * width as f64) as usize;
    if gap_samples == 0 {
        return vec![1.0; starts.len()];
    }
    let depths: Vec<Option<Depth>> =
        starts.iter().map(|start| Depth::of(power, *start, width, gap_samples)).collect();
    let clear_w = MIN_NOISE_DEVIATIONS * noise_w / libm::sqrt(gap_samples as f64);
    let of_start = |start: usize| {
        let own_w = depths[start]?.lowest_w;
        let near = neighbours(&depths, start, NEIGHBOURS);
        let mut lowest: Vec<f64> = near.iter().flatten().map(|depth| depth.lowest_w).collect();
        let quarter = lowest.len() / 4;
        let low_w = nth_smallest(&mut lowest, quarter);
        let usual_w = upper_median(&mut near.iter().flatten().map(|depth| depth.usual_w).collect::<Vec<_>>());
        let none = usual_w - own_w < MIN_DIP_RATIO * (usual_w - low_w);
        Some(if none && usual_w - low_w > clear_w { SUSPECT_CONFIDENCE } else { 1.0 })
    };
    (0..starts.len()).map(|start| of_start(start).unwrap_or(1.0)).collect()
}

/// The dip of power at a start.
#[derive(Clone, Copy, Debug)]
struct Depth {
    /// Lowest mean power over `gap_samples` samples, W.
    lowest_w: f64,
    /// Median of the power around, W.
    usual_w: f64,
}

impl Depth {
    fn of(power: &[f64], start: f64, width: usize, gap_samples: usize) -> Option<Self> {
        let usual_w = upper_median(&mut window_around(power, start, USUAL_SHARES, width)?.to_vec());
        Some(Self { lowest_w: lowest_w(power, start, width, gap_samples)?, usual_w })
    }
}

/// The least mean of `gap_samples` samples at a start, W.
pub(super) fn lowest_w(power: &[f64], start: f64, width: usize, gap_samples: usize) -> Option<f64> {
    window_around(power, start, OWN_SHARES, width)?.windows(gap_samples).map(mean).min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Random;

    const WIDTH: usize = 250;

    /// Frames with a rest of `rest(frame)` samples before draws of 300; each starts, as it was found by its
    /// draws, 10 before those.
    fn frames(count: usize, rest: impl Fn(usize) -> usize) -> (Vec<f64>, Vec<f64>) {
        let (mut power, mut starts) = (vec![1.2; 300], Vec::new());
        for frame in 0..count {
            power.extend(vec![0.2; rest(frame)]);
            starts.push(power.len() as f64 - 10.0);
            power.extend((0..300).map(|sample| 1.0 + f64::from(sample / 2 * 37 % 11) / 22.0));
        }
        (power, starts)
    }

    fn suspect(count: usize, mark: usize, rest: impl Fn(usize) -> usize) -> Vec<usize> {
        let (power, starts) = frames(count, rest);
        let marked: Vec<bool> = (0..count).map(|frame| frame == mark).collect();
        let left = shifted_gap_confidence(&power, &starts, &marked, WIDTH);
        (0..count).filter(|&frame| left[frame] < 1.0).collect()
    }

    #[test]
    fn an_idle_gap_that_has_grown_by_more_than_the_tolerance_of_a_start_is_suspect() {
        // From 15 samples at the mark to 45: 0.12 of the window.
        let suspect = suspect(120, 10, |frame| if frame < 60 { 15 } else { 45 });
        assert!(suspect.iter().all(|frame| (50..120).contains(frame)), "{suspect:?}");
        assert!((70..112).all(|frame| suspect.contains(&frame)), "{suspect:?}");
    }

    #[test]
    fn a_rest_that_stays_or_changes_a_little_is_none() {
        assert!(suspect(60, 10, |_| 15).is_empty());
        assert!(suspect(60, 10, |frame| 12 + frame * 7 % 5).is_empty());
        assert!(suspect(120, 10, |frame| if frame < 60 { 15 } else { 25 }).is_empty());
    }

    #[test]
    fn a_quiet_end_of_the_frame_before_is_not_the_rest() {
        // 30 samples at the end of each frame, 25 before its rest, draw as little as that, and for some
        // frames even less.
        let (mut power, starts) = frames(120, |_| 12);
        for (frame, start) in starts.iter().enumerate() {
            let end = *start as usize - 30;
            power[end - 30..end].fill(if frame < 60 { 0.21 } else { 0.19 });
        }
        let marked: Vec<bool> = (0..120).map(|frame| frame == 10).collect();
        assert_eq!(shifted_gap_confidence(&power, &starts, &marked, WIDTH), [1.0; 120]);
    }

    #[test]
    fn the_nearest_mark_is_what_a_rest_is_compared_with() {
        let (power, starts) = frames(120, |frame| if frame < 60 { 15 } else { 45 });
        let marked: Vec<bool> = (0..120).map(|frame| frame == 10 || frame == 100).collect();
        let left = shifted_gap_confidence(&power, &starts, &marked, WIDTH);
        assert!(
            (0..120).filter(|frame| left[*frame] < 1.0).all(|frame| (45..75).contains(&frame)),
            "{left:?}"
        );
    }

    #[test]
    fn a_few_suspect_starts_spread_to_their_neighbours_and_one_does_not() {
        let mut left = vec![1.0; 60];
        left[50] = 0.3;
        assert_eq!(spread_to_neighbours(left.clone()), left);
        left[18..22].fill(SUSPECT_CONFIDENCE);
        let spread = spread_to_neighbours(left);
        assert!(spread[13..27].iter().all(|left| *left == SUSPECT_CONFIDENCE), "{spread:?}");
        assert!(spread[..10].iter().chain(&spread[30..50]).all(|left| *left == 1.0), "{spread:?}");
        assert_eq!(spread[50], 0.3);
    }

    #[test]
    fn without_marks_or_with_few_samples_nothing_is_suspect() {
        let (power, starts) = frames(60, |frame| 15 + frame);
        assert_eq!(shifted_gap_confidence(&power, &starts, &[false; 60], WIDTH), [1.0; 60]);
        let marked: Vec<bool> = (0..60).map(|frame| frame == 1).collect();
        for width in [0, 1, 3, 5, 40] {
            assert_eq!(shifted_gap_confidence(&power, &starts, &marked, width), [1.0; 60]);
        }
        assert_eq!(shifted_gap_confidence(&[1.0; 9], &[3.0], &[true], WIDTH), [1.0]);
        assert!(shifted_gap_confidence(&[], &[], &[], WIDTH).is_empty());
    }

    /// 40 frames with a rest of `rest` samples before 300 of draws, in noise of up to `noise_w` either way,
    /// and their starts.
    fn frames_in_noise(rest: usize, noise_w: f64) -> (Vec<f64>, Vec<f64>) {
        let (mut power, mut starts) = (vec![1.2; 300], Vec::new());
        for _ in 0..40 {
            power.extend(vec![0.2; rest]);
            starts.push(power.len() as f64 - 2.0);
            power.extend((0..300).map(|sample| 1.0 + f64::from(sample / 2 * 37 % 11) / 22.0));
        }
        let random = Random::new(3, 0);
        power
            .iter_mut()
            .enumerate()
            .for_each(|(i, watts)| *watts += random.between(i as u64, [-noise_w, noise_w]));
        (power, starts)
    }

    fn amidst_work(power: &[f64], starts: &[f64], noise_w: f64) -> Vec<usize> {
        let left = missing_gap_confidence(power, starts, WIDTH, noise_w);
        (0..starts.len()).filter(|&start| left[start] < 1.0).collect()
    }

    #[test]
    fn a_start_amidst_work_is_suspect_and_those_around_it_are_not() {
        for noise_w in [0.0, 0.05] {
            let (power, mut starts) = frames_in_noise(10, noise_w);
            starts.insert(21, starts[20] + 155.0);
            starts.insert(31, starts[30] + 155.0);
            assert_eq!(amidst_work(&power, &starts, noise_w), [21, 31]);
        }
    }

    #[test]
    fn where_every_other_frame_is_cut_in_two_the_cuts_are_what_is_suspect() {
        let (power, starts) = frames_in_noise(10, 0.02);
        let cut: Vec<f64> = starts[..39].iter().flat_map(|start| [*start, start + 155.0]).collect();
        assert_eq!(amidst_work(&power, &cut, 0.02), (0..39).map(|frame| 2 * frame + 1).collect::<Vec<_>>());
    }

    #[test]
    fn where_no_frame_has_a_rest_or_noise_hides_it_nothing_is_suspect() {
        let (power, starts) = frames_in_noise(0, 0.05);
        assert!(amidst_work(&power, &starts, 0.05).is_empty());
        let (power, mut starts) = frames_in_noise(10, 2.0);
        starts.insert(21, starts[20] + 155.0);
        assert!(amidst_work(&power, &starts, 2.0).is_empty());
        assert!(amidst_work(&[], &[], 0.0).is_empty());
        assert_eq!(missing_gap_confidence(&[1.0; 20], &[3.0, 9.0], 10, 0.0), [1.0; 2]);
    }

    #[test]
    fn starts_at_the_ends_of_a_trace_have_nothing_to_be_compared_with() {
        assert_eq!(missing_gap_confidence(&[1.0; 300], &[3.0, 290.0], WIDTH, 0.0), [1.0; 2]);
    }
}
