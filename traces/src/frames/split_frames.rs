//! Split frames: every other start is similar, and false starts split a frame in two.
//!
//! Content changes slowly, so a frame differs from the next at least as little as from the one after that. If
//! a start is far more similar to the one after the next, each frame may have been split, as happens when a
//! slow clock makes a frame as long as two were at the mark. Frames that alternate by themselves (a shadow
//! map drawn every other time) do so at the mark, too. A frame begins in an idle gap: of alternating starts,
//! those with a clearly smaller dip are false.

use super::SUSPECT_CONFIDENCE;
use super::idle_gap::{lowest_w, neighbours, window_around};
use crate::stats::{mean, mean_and_error, upper_median};
use core::ops::Range;
use rayon::prelude::*;

/// Shares of the window before and after a start that are compared.
const COMPARED_SHARES: [f64; 2] = [0.2, 0.8];
/// Starts compared on either side of each.
const NEIGHBOURS: usize = 4;
/// Fewest comparisons that give a mean.
const MIN_COMPARISONS: usize = 4;
/// Direct neighbours must differ by at least this many times what every other start does, and what they do at
/// the mark.
const MIN_CONTRAST: f64 = 3.0;
/// Length of an idle gap, as a share of the window.
const IDLE_SHARE: f64 = 0.06;
/// At a false start in the middle of a frame, power dips by less than this share of its dip at a true one.
const MAX_DIP_RATIO: f64 = 0.85;
/// Fewest standard errors between the two dips.
const MIN_STANDARD_ERRORS: f64 = 4.0;
/// Fewest starts of either kind.
const MIN_STARTS: usize = 4;
/// Starts of either kind that may lie beyond either end of the alternating segment.
const MARGIN_STARTS: usize = 2;

/// The assessment of each start.
pub(super) struct SplitFrames {
    /// Factor on the confidence of each start: 1, or less where starts alternate.
    pub confidence_factors: Vec<f64>,
    /// Whether each start splits a frame.
    pub splits_frame: Vec<bool>,
}

impl SplitFrames {
    /// From the places of all starts (samples, in order), which of them are marked, and the width of the
    /// window.
    pub fn new(power: &[f64], starts: &[f64], marked: &[bool], width: usize) -> Self {
        let confidence_factors = alternation_confidence(power, starts, marked, width);
        let dips = Dips { power, starts, width };
        let mut cut = vec![false; starts.len()];
        for segment in segments(&confidence_factors) {
            for start in dips.false_starts(segment).into_iter().filter(|start| !marked[*start]) {
                cut[start] = true;
            }
        }
        Self { confidence_factors, splits_frame: cut }
    }
}

/// Confidence factors of starts, from their places (samples, in order) and the width of the window.
fn alternation_confidence(power: &[f64], starts: &[f64], marked: &[bool], width: usize) -> Vec<f64> {
    let [next, after_next] = [1, 2].map(|apart| differences(power, starts, width, apart));
    let alternations: Vec<f64> =
        (0..starts.len()).map(|start| alternation(&next, &after_next, start)).collect();
    let marks: Vec<usize> = (0..starts.len()).filter(|&start| marked[start]).collect();
    let of_start = |start: usize| {
        let mark = marks.iter().copied().min_by_key(|mark| mark.abs_diff(start));
        let usual = mark.map_or(1.0, |mark| alternations[mark].max(1.0));
        if alternations[start] > MIN_CONTRAST * usual { SUSPECT_CONFIDENCE } else { 1.0 }
    };
    (0..starts.len()).map(of_start).collect()
}

/// Ratio of the differences of direct neighbours to those of every other start, near a start; 1 with too few
/// starts near.
fn alternation(next: &[Option<f64>], after_next: &[Option<f64>], start: usize) -> f64 {
    let [next, after_next] = [next, after_next]
        .map(|of| neighbours(of, start, NEIGHBOURS).iter().flatten().copied().collect::<Vec<f64>>());
    if after_next.len() < MIN_COMPARISONS {
        return 1.0;
    }
    let [next, after_next] = [next, after_next].map(|mut of| upper_median(&mut of));
    if next > 0.0 { next / after_next } else { 1.0 }
}

/// The mean squared difference, W^2, of each start from the one `apart` starts later; `None` if that is
/// missing or cut.
fn differences(power: &[f64], starts: &[f64], width: usize, apart: usize) -> Vec<Option<f64>> {
    let of_start = |start: usize| {
        let window = |start: f64| window_around(power, start, COMPARED_SHARES, width);
        let (a, b) = (window(starts[start])?, window(*starts.get(start + apart)?)?);
        Some(mean(&a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).collect::<Vec<_>>()))
    };
    (0..starts.len()).into_par_iter().map(of_start).collect()
}

/// The segments of suspect starts.
fn segments(confidence_factors: &[f64]) -> Vec<Range<usize>> {
    let is_suspect = |place: usize| confidence_factors[place] < 1.0;
    let ends = |place: usize| place == 0 || is_suspect(place) != is_suspect(place - 1);
    let mut bounds: Vec<usize> = (0..confidence_factors.len()).filter(|place| ends(*place)).collect();
    bounds.push(confidence_factors.len());
    bounds
        .windows(2)
        .map(|two| two[0]..two[1])
        .filter(|segment| confidence_factors[segment.start] < 1.0)
        .collect()
}

/// The dips of power at starts.
struct Dips<'a> {
    power: &'a [f64],
    starts: &'a [f64],
    width: usize,
}

impl Dips<'_> {
    /// Lowest mean power over `gap_samples` samples at a start, W.
    fn lowest_w(&self, start: usize) -> Option<f64> {
        let gap_samples = ((IDLE_SHARE * self.width as f64) as usize).max(1);
        lowest_w(self.power, self.starts[start], self.width, gap_samples)
    }

    /// Median of the power around a start, W.
    fn usual_w(&self, start: usize) -> Option<f64> {
        Some(upper_median(
            &mut window_around(self.power, self.starts[start], COMPARED_SHARES, self.width)?.to_vec(),
        ))
    }

    /// Every other start of a segment, and beyond as long as starts go down as little, if those clearly go
    /// down less than the others.
    fn false_starts(&self, segment: Range<usize>) -> Vec<usize> {
        let every_other = |from: usize| (segment.start + from..segment.end).step_by(2);
        let lowest = [0, 1].map(|from| every_other(from).filter_map(|start| self.lowest_w(start)).collect());
        let [a, b]: [Vec<f64>; 2] = lowest;
        if a.len().min(b.len()) < MIN_STARTS {
            return Vec::new();
        }
        let usual_w =
            upper_median(&mut segment.clone().filter_map(|start| self.usual_w(start)).collect::<Vec<_>>());
        let ([a_w, a_error], [b_w, b_error]) = (mean_and_error(&a), mean_and_error(&b));
        let (from, low_w, high_w) = if a_w > b_w { (0, b_w, a_w) } else { (1, a_w, b_w) };
        let clear = high_w - low_w > MIN_STANDARD_ERRORS * libm::hypot(a_error, b_error);
        if !clear || usual_w - high_w > MAX_DIP_RATIO * (usual_w - low_w) {
            return Vec::new();
        }
        let cut = |start: &usize| self.lowest_w(*start).is_some_and(|watts| watts > 0.5 * (low_w + high_w));
        let first = segment.start + from;
        let before = (0..first).rev().skip(1).step_by(2).take(MARGIN_STARTS).take_while(cut);
        let last = every_other(from).next_back().unwrap_or(first);
        let after = (last + 2..self.starts.len()).step_by(2).take(MARGIN_STARTS).take_while(cut);
        before.chain(every_other(from)).chain(after).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Random;

    const WIDTH: usize = 250;
    const FRAME: usize = 320;

    /// 60 frames whose first half differs from the second by `apart_w`, in noise of up to 0.1 W either way,
    /// and where each begins.
    fn frames(apart_w: f64) -> (Vec<f64>, Vec<f64>) {
        let random = Random::new(7, 0);
        let draws = |i: usize| 1.0 + f64::from((i % FRAME % (FRAME / 2) / 2 * 37 % 11) as u32) / 11.0;
        let half = |i: usize| if i % FRAME < FRAME / 2 { 0.0 } else { apart_w };
        let noise = |i: usize| random.between(i as u64, [-0.1, 0.1]);
        let power = (0..60 * FRAME).map(|i| draws(i) + half(i) + noise(i)).collect();
        (power, (0..60).map(|frame| (frame * FRAME) as f64).collect())
    }

    /// The suspect starts if frames from the 30th on are split; `marked` is the number of the mark.
    fn suspect(apart_w: f64, marked: usize) -> Vec<usize> {
        let (power, whole) = frames(apart_w);
        let cut =
            |start: &f64| if *start < 30.0 * 320.0 { vec![*start] } else { vec![*start, start + 160.0] };
        let starts: Vec<f64> = whole.iter().flat_map(cut).collect();
        let marked: Vec<bool> = (0..starts.len()).map(|start| start == marked).collect();
        let confidence_factors = alternation_confidence(&power, &starts, &marked, WIDTH);
        (0..starts.len()).filter(|&start| confidence_factors[start] < 1.0).collect()
    }

    /// Of 60 frames with a rest before 300 samples of draws and a dip of `dip` samples in the midst of those:
    /// all starts, with those in the dip from the 30th frame on, and what is said of them.
    fn with_dips(dip_w: f64) -> (Vec<f64>, SplitFrames) {
        let random = Random::new(9, 0);
        let (mut power, mut starts) = (vec![1.2; 300], Vec::new());
        for frame in 0..60 {
            power.extend([0.2; 16]);
            starts.push(power.len() as f64 - 3.0);
            power.extend((0..150).map(|sample| 1.0 + f64::from(sample / 2 * 37 % 11) / 22.0));
            power.extend([dip_w; 16]);
            if frame >= 30 {
                starts.push(power.len() as f64 - 3.0);
            }
            power.extend((0..150).map(|sample| 1.3 + f64::from(sample / 2 * 31 % 13) / 22.0));
        }
        power.iter_mut().enumerate().for_each(|(i, w)| *w += random.between(i as u64, [-0.05, 0.05]));
        let marked: Vec<bool> = (0..starts.len()).map(|start| start == 10).collect();
        let split = SplitFrames::new(&power, &starts, &marked, WIDTH);
        (starts, split)
    }

    #[test]
    fn starts_that_go_down_less_than_those_they_take_turns_with_are_cuts() {
        let (starts, turns) = with_dips(0.5);
        let cut: Vec<usize> = (0..starts.len()).filter(|start| turns.splits_frame[*start]).collect();
        assert!(cut.iter().all(|start| *start > 30 && start % 2 == 1), "{cut:?}");
        assert!(cut.len() > 27, "{cut:?}");
        // Where both dip as far, either may be a start: they are suspect, but none is false.
        let (starts, turns) = with_dips(0.2);
        assert!(
            (40..starts.len() - 4)
                .all(|start| turns.confidence_factors[start] < 1.0 && !turns.splits_frame[start])
        );
    }

    #[test]
    fn frames_that_are_cut_in_two_are_suspect_and_whole_ones_are_not() {
        let suspect = suspect(0.5, 10);
        assert!(suspect.iter().all(|start| *start >= 26), "{suspect:?}");
        assert!((34..88).all(|start| suspect.contains(&start)), "{suspect:?}");
    }

    #[test]
    fn halves_hidden_by_noise_and_frames_that_alternate_at_the_mark_are_not_suspect() {
        assert!(suspect(0.02, 10).is_empty());
        assert!(suspect(0.5, 60).is_empty());
    }

    #[test]
    fn few_starts_or_none_are_not_flagged() {
        let (power, starts) = frames(0.5);
        for count in 0..5 {
            assert_eq!(
                alternation_confidence(&power, &starts[..count], &vec![false; count], WIDTH),
                vec![1.0; count]
            );
        }
        assert_eq!(
            alternation_confidence(&[1.0; 3000], &[500.0, 900.0, 1400.0], &[true, false, false], WIDTH),
            [1.0; 3]
        );
    }
}
