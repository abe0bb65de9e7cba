//! Which method, where none was asked for.

use super::alike;
use super::beat;
use super::found::Found;
use super::marks::{MarkError, Marks};
use super::matched::find_matched;
use super::method::Method;
use super::tracked::find_tracked;
use crate::trace::Trace;

/// With fewer starts than this there is too little to learn from: the sum of squares is kept, unless what tracking finds is plain.
const FEW: usize = 16;
/// So few are plain too where the sum of squares doubts itself and found more: three gaps are the fewest that can be told to be even.
const FEWEST: usize = 4;
/// It is where so much of it has an even beat, and neighbours correlate so well: in noise it is 0.05, in frames at 0 dB 0.3 to 0.5.
const PLAIN: [f64; 2] = [0.9, 0.5];
/// With fewer samples in the window shapes are too coarse to be followed: of all methods that with the most even beat is taken.
const COARSE: usize = 20;
/// With fewer yet, the sum of squares is kept: any beat can be found among so many look-alikes.
const COARSEST: usize = 8;
/// Traces of more samples are tracked only where the sum of squares is in doubt.
const LONG: usize = 1 << 24;
/// How much more of the trace another method must cover with an even beat to be preferred to the sum of squares.
const BETTER: f64 = 0.02;

/// [`Method::Auto`].
pub(super) fn find_auto(trace: &Trace, marks: &Marks) -> Result<Found, MarkError> {
    let squares = find_matched(trace, marks, Method::SumOfSquares)?;
    let samples = marks.place(trace)?.samples;
    if samples < COARSEST {
        return Ok(squares);
    }
    if squares.starts.len() < FEW {
        // A mark whose like comes back seldom finds itself alone among frames that are plainly there.
        let tracked = (trace.samples() <= LONG).then(|| find_tracked(trace, marks)).transpose()?;
        let plain = |tracked: &Found| enough(tracked, &squares) && even_and_alike(trace, tracked);
        return Ok(tracked.filter(plain).unwrap_or(squares));
    }
    if samples < COARSE {
        return Ok(steadiest(
            squares,
            [find_tracked(trace, marks)?, find_matched(trace, marks, Method::Normalized)?],
        ));
    }
    let long_and_clear = trace.samples() > LONG && squares.threshold.clarity() >= 1.0;
    if long_and_clear { Ok(squares) } else { find_tracked(trace, marks) }
}

/// Whether tracking found starts enough to be asked how plain they are: many, or fewer than the sum of squares where that doubts itself,
/// over as long a stretch.
fn enough(tracked: &Found, squares: &Found) -> bool {
    let count = tracked.starts.len();
    let last_s = span_s(tracked) / count.max(2).saturating_sub(1) as f64;
    let over = span_s(tracked) + last_s >= PLAIN[0] * span_s(squares);
    count >= FEW
        || (squares.threshold.clarity() < 1.0 && (FEWEST..squares.starts.len()).contains(&count) && over)
}

/// Whether starts keep time and are followed by the like.
fn even_and_alike(trace: &Trace, found: &Found) -> bool {
    let [even, alike] = PLAIN;
    covered_s(found) >= even * span_s(found) && alike::neighbours(trace, found) >= alike
}

/// That of the results whose even beat covers most time.
fn steadiest(first: Found, others: [Found; 2]) -> Found {
    others.into_iter().fold(first, |best, other| {
        let more_s = covered_s(&other) - covered_s(&best);
        if more_s > BETTER * span_s(&best).max(span_s(&other)) { other } else { best }
    })
}

fn covered_s(found: &Found) -> f64 {
    let gaps_s: Vec<f64> = found.starts.windows(2).map(|two| two[1].time_s - two[0].time_s).collect();
    beat::covered(&gaps_s)
}

fn span_s(found: &Found) -> f64 {
    found.starts.last().zip(found.starts.first()).map_or(0.0, |(last, first)| last.time_s - first.time_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::Window;
    use crate::metadata::Metadata;
    use crate::random::Random;

    const RATE_HZ: f64 = 50e3;

    fn found(power: impl Fn(usize) -> f32, samples: usize, mark: usize) -> Found {
        let power: Vec<f32> = (0..samples).map(power).collect();
        let trace = Trace::new(vec![1.0; samples], power, RATE_HZ, 0.0, Metadata::default()).unwrap();
        let marks = Marks {
            starts_s: vec![mark as f64 / RATE_HZ],
            window: Window { pre_s: 1e-3, post_s: 4e-3 },
            end_s: trace.end_s(),
        };
        find_auto(&trace, &marks).unwrap()
    }

    fn noise(sample: usize) -> f32 {
        Random::new(1, 0).between(sample as u64, [-0.5, 0.5]) as f32
    }

    #[test]
    fn a_mark_whose_like_does_not_come_back_is_tracked_if_frames_are_plainly_there() {
        // After one of idle, each frame of 400 samples is busy for six stretches of 50, whose levels go their own ways from frame to frame.
        let power = |sample: usize| {
            let (frame, stretch) = ((sample / 400) as f32, sample % 400 / 50);
            let level = 3.0 + 2.0 * (0.1 * frame + 2.1 * stretch as f32).sin();
            0.1 * noise(sample) + if sample >= 400 && stretch < 6 { level } else { 0.5 }
        };
        let found = found(power, 400 * 60, 400 * 30);
        assert_eq!((found.method, found.starts.len()), (Method::Tracking, 59));
    }

    #[test]
    fn four_frames_of_passes_that_look_alike_are_four() {
        // After one of idle, each frame is of four passes, unevenly apart, whose levels differ as much as frames do.
        let power = |sample: usize| {
            let (frame, at) = (sample / 1600, sample % 1600);
            let pass = [0, 480, 700, 1040].partition_point(|&from| from <= at) - 1;
            let level = 3.0 + 0.8 * noise(10 * frame + pass);
            let busy = at - [0, 480, 700, 1040][pass] < [440, 180, 300, 260][pass];
            0.1 * noise(sample) + if frame > 0 && busy { level } else { 0.5 }
        };
        let found = found(power, 1600 * 5, 3200);
        assert_eq!((found.method, found.starts.len()), (Method::Tracking, 4));
    }

    #[test]
    fn a_mark_in_noise_stays_alone() {
        for level in [0.1, 1.0] {
            let found = found(|sample| 2.0 + level * noise(sample), 100_000, 50_000);
            assert_eq!((found.method, found.starts.len()), (Method::SumOfSquares, 1));
        }
    }

    #[test]
    fn a_lone_frame_stays_alone() {
        let power = |sample: usize| {
            let busy = (50_000..50_400).contains(&sample);
            0.1 * noise(sample) + if busy { 3.0 + (sample as f32 / 17.0).sin() } else { 0.5 }
        };
        assert_eq!(found(power, 100_000, 50_000).starts.len(), 1);
    }
}
