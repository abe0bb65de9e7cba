//! Doubt where every other start is alike.
//!
//! Content changes slowly: a frame is as unlike the next as it is unlike the one after that, or less. Where a start is far more like the
//! one after the next, each frame may have been cut in two, as happens where a slow clock makes them as long as two were at the mark.
//! Frames that take turns by themselves (a shadow map drawn every other time) do so at the mark, too.

use super::rest::{LEFT, about, near};
use crate::median::median;
use crate::squares::mean;
use rayon::prelude::*;

/// The shares of the window before and after a start that are compared.
const COMPARED: [f64; 2] = [0.2, 0.8];
/// So many starts on either side are looked at, and no fewer comparisons than this are enough.
const FRAMES: usize = 4;
const LEAST: usize = 4;
/// Neighbours differ so many times as much as every other start does, and as they do at the mark.
const MORE: f64 = 3.0;

/// What is left of the confidence of each start, from their places (samples, in order) and the width of the window.
pub(super) fn left(power: &[f64], starts: &[f64], marked: &[bool], width: usize) -> Vec<f64> {
    let [next, after_next] = [1, 2].map(|apart| differences(power, starts, width, apart));
    let turns: Vec<f64> = (0..starts.len()).map(|start| turns(&next, &after_next, start)).collect();
    let marks: Vec<usize> = (0..starts.len()).filter(|&start| marked[start]).collect();
    let of_start = |start: usize| {
        let mark = marks.iter().copied().min_by_key(|mark| mark.abs_diff(start));
        let usual = mark.map_or(1.0, |mark| turns[mark].max(1.0));
        if turns[start] > MORE * usual { LEFT } else { 1.0 }
    };
    (0..starts.len()).map(of_start).collect()
}

/// How many times as much as every other start neighbours near one differ; 1 where too few are near.
fn turns(next: &[Option<f64>], after_next: &[Option<f64>], start: usize) -> f64 {
    let [next, after_next] =
        [next, after_next].map(|of| near(of, start, FRAMES).iter().flatten().copied().collect::<Vec<f64>>());
    if after_next.len() < LEAST {
        return 1.0;
    }
    let [next, after_next] = [next, after_next].map(|mut of| median(&mut of));
    if next > 0.0 { next / after_next } else { 1.0 }
}

/// The mean squared difference, W^2, of each start from the one so many after it; `None` where there is none, or not all of it.
fn differences(power: &[f64], starts: &[f64], width: usize, apart: usize) -> Vec<Option<f64>> {
    let of_start = |start: usize| {
        let window = |start: f64| about(power, start, COMPARED, width);
        let (a, b) = (window(starts[start])?, window(*starts.get(start + apart)?)?);
        Some(mean(&a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).collect::<Vec<_>>()))
    };
    (0..starts.len()).into_par_iter().map(of_start).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const WIDTH: usize = 250;
    const FRAME: usize = 320;

    /// 60 frames whose first half differs from the second by `apart_w`, in noise of up to 0.1 W either way, and where each begins.
    fn frames(apart_w: f64) -> (Vec<f64>, Vec<f64>) {
        let random = Random::new(7, 0);
        let draws = |i: usize| 1.0 + f64::from((i % FRAME % (FRAME / 2) / 2 * 37 % 11) as u32) / 11.0;
        let half = |i: usize| if i % FRAME < FRAME / 2 { 0.0 } else { apart_w };
        let noise = |i: usize| random.between(i as u64, [-0.1, 0.1]);
        let power = (0..60 * FRAME).map(|i| draws(i) + half(i) + noise(i)).collect();
        (power, (0..60).map(|frame| (frame * FRAME) as f64).collect())
    }

    /// The starts in doubt where frames from the 30th on are cut in two; marked is that number.
    fn doubted(apart_w: f64, marked: usize) -> Vec<usize> {
        let (power, whole) = frames(apart_w);
        let cut =
            |start: &f64| if *start < 30.0 * 320.0 { vec![*start] } else { vec![*start, start + 160.0] };
        let starts: Vec<f64> = whole.iter().flat_map(cut).collect();
        let marked: Vec<bool> = (0..starts.len()).map(|start| start == marked).collect();
        let left = left(&power, &starts, &marked, WIDTH);
        (0..starts.len()).filter(|&start| left[start] < 1.0).collect()
    }

    #[test]
    fn frames_that_are_cut_in_two_are_doubted_and_whole_ones_are_not() {
        let doubted = doubted(0.5, 10);
        assert!(doubted.iter().all(|start| *start >= 26), "{doubted:?}");
        assert!((34..88).all(|start| doubted.contains(&start)), "{doubted:?}");
    }

    #[test]
    fn halves_that_noise_hides_and_frames_that_take_turns_at_the_mark_are_no_doubt() {
        assert!(doubted(0.02, 10).is_empty());
        assert!(doubted(0.5, 60).is_empty());
    }

    #[test]
    fn few_starts_or_none_are_no_doubt() {
        let (power, starts) = frames(0.5);
        for count in 0..5 {
            assert_eq!(left(&power, &starts[..count], &vec![false; count], WIDTH), vec![1.0; count]);
        }
        assert_eq!(left(&[1.0; 3000], &[500.0, 900.0, 1400.0], &[true, false, false], WIDTH), [1.0; 3]);
    }
}
