//! Doubt where a start, unlike its neighbours, has no rest.
//!
//! A frame begins in little power, after the end of the one before. What was found amidst work, where others near have a rest, may lie
//! within a frame: where a frame takes two ticks of the display at a slow clock, its middle is on a tick, too.

use super::rest::{FRAMES, LEFT, about, near};
use crate::median::median;
use crate::squares::mean;

/// Shares of the window before and after a start in which it has its rest, and that of a rest that counts.
const OWN: [f64; 2] = [0.1, 0.06];
const BRIEF: f64 = 0.02;
/// The shares of the window before and after the start that tell the usual power.
const USUAL: [f64; 2] = [0.32, 0.8];
/// None is where power goes down by less than this share of what it does for a quarter of the neighbours.
const NONE: f64 = 0.6;
/// That must be so many deviations of the noise, or nothing is said.
const CLEAR: f64 = 6.0;

/// What is left of the confidence of each start from their places (samples, in order), the width of the window
/// and the deviation of the noise in a sample.
pub(super) fn left(power: &[f64], starts: &[f64], width: usize, noise_w: f64) -> Vec<f64> {
    let brief = (BRIEF * width as f64) as usize;
    if brief == 0 {
        return vec![1.0; starts.len()];
    }
    let depths: Vec<Option<Depth>> =
        starts.iter().map(|start| Depth::of(power, *start, width, brief)).collect();
    let clear_w = CLEAR * noise_w / libm::sqrt(brief as f64);
    let of_start = |start: usize| {
        let own_w = depths[start]?.lowest_w;
        let near = near(&depths, start, FRAMES);
        let mut lowest: Vec<f64> = near.iter().flatten().map(|depth| depth.lowest_w).collect();
        let quarter = lowest.len() / 4;
        let low_w = *lowest.select_nth_unstable_by(quarter, f64::total_cmp).1;
        let usual_w = median(&mut near.iter().flatten().map(|depth| depth.usual_w).collect::<Vec<_>>());
        let none = usual_w - own_w < NONE * (usual_w - low_w);
        Some(if none && usual_w - low_w > clear_w { LEFT } else { 1.0 })
    };
    (0..starts.len()).map(|start| of_start(start).unwrap_or(1.0)).collect()
}

/// How far power goes down at a start.
#[derive(Clone, Copy, Debug)]
struct Depth {
    /// Least mean of a brief stretch, W.
    lowest_w: f64,
    /// Median of the power around, W.
    usual_w: f64,
}

impl Depth {
    fn of(power: &[f64], start: f64, width: usize, brief: usize) -> Option<Self> {
        let usual_w = median(&mut about(power, start, USUAL, width)?.to_vec());
        Some(Self { lowest_w: lowest_w(power, start, width, brief)?, usual_w })
    }
}

/// The least mean of a stretch of `brief` samples at a start, W.
pub(super) fn lowest_w(power: &[f64], start: f64, width: usize, brief: usize) -> Option<f64> {
    about(power, start, OWN, width)?.windows(brief).map(mean).min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const WIDTH: usize = 250;

    /// 40 frames with a rest of `rest` samples before 300 of draws, in noise of up to `noise_w` either way, and their starts.
    fn frames(rest: usize, noise_w: f64) -> (Vec<f64>, Vec<f64>) {
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

    fn doubted(power: &[f64], starts: &[f64], noise_w: f64) -> Vec<usize> {
        let left = left(power, starts, WIDTH, noise_w);
        (0..starts.len()).filter(|&start| left[start] < 1.0).collect()
    }

    #[test]
    fn a_start_amidst_work_is_doubted_and_those_around_it_are_not() {
        for noise_w in [0.0, 0.05] {
            let (power, mut starts) = frames(10, noise_w);
            starts.insert(21, starts[20] + 155.0);
            starts.insert(31, starts[30] + 155.0);
            assert_eq!(doubted(&power, &starts, noise_w), [21, 31]);
        }
    }

    #[test]
    fn where_every_other_frame_is_cut_in_two_the_cuts_are_what_is_doubted() {
        let (power, starts) = frames(10, 0.02);
        let cut: Vec<f64> = starts[..39].iter().flat_map(|start| [*start, start + 155.0]).collect();
        assert_eq!(doubted(&power, &cut, 0.02), (0..39).map(|frame| 2 * frame + 1).collect::<Vec<_>>());
    }

    #[test]
    fn where_no_frame_has_a_rest_or_noise_hides_it_nothing_is_doubted() {
        let (power, starts) = frames(0, 0.05);
        assert!(doubted(&power, &starts, 0.05).is_empty());
        let (power, mut starts) = frames(10, 2.0);
        starts.insert(21, starts[20] + 155.0);
        assert!(doubted(&power, &starts, 2.0).is_empty());
        assert!(doubted(&[], &[], 0.0).is_empty());
        assert_eq!(left(&[1.0; 20], &[3.0, 9.0], 10, 0.0), [1.0; 2]);
    }

    #[test]
    fn starts_at_the_ends_of_a_trace_have_nothing_to_be_compared_with() {
        assert_eq!(left(&[1.0; 300], &[3.0, 290.0], WIDTH, 0.0), [1.0; 2]);
    }
}
