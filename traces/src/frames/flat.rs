//! A mark where there is nothing to see: whatever is as flat resembles it.

use super::marks::Placement;
use super::split::moments;
use crate::warning::Warning;

/// So many standard errors above the noise's own deviation are more than noise.
const CLEAR: f64 = 3.0;

/// Whether a window varies by no more than the noise of a sample, `sigma`: the deviation of `n` samples of noise is known to
/// one part in `sqrt(2 n)`.
fn is_flat(window: &[f64], sigma: f64) -> bool {
    let most = sigma * (1.0 + CLEAR / libm::sqrt(2.0 * window.len() as f64));
    moments(window).deviation <= most
}

/// The warning, where one of some marked windows, each with where its mark is (s), is flat in noise of deviation `sigma`.
pub(crate) fn flat_mark<'a>(
    windows: impl IntoIterator<Item = (f64, &'a [f64])>,
    sigma: f64,
) -> Option<Warning> {
    let (mark_s, _) = windows.into_iter().find(|(_, window)| is_flat(window, sigma))?;
    Some(Warning::new(
        "flat-mark",
        format!(
            "around the mark at {mark_s} s power varies by no more than noise, so that any rest resembles it: what is found may be no \
             frames; mark where one begins"
        ),
    ))
}

/// [`flat_mark`] of a trace that is all at hand.
pub(super) fn flat_mark_of(power: &[f64], placement: &Placement, sigma: f64) -> Option<Warning> {
    let windows = placement
        .marks
        .iter()
        .filter_map(|mark| Some((mark.mark_s, power.get(mark.first..mark.first + placement.samples)?)));
    flat_mark(windows, sigma)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::matched::noise_variance;
    use crate::random::Random;

    #[test]
    fn noise_is_flat_and_an_edge_in_as_much_noise_is_not() {
        let random = Random::new(5, 0);
        let noise: Vec<f64> = (0..5000).map(|at| random.normals(at).0).collect();
        let sigma = libm::sqrt(noise_variance(&noise));
        let flat = noise.chunks_exact(250).filter(|window| is_flat(window, sigma)).count();
        assert_eq!(flat, 20);
        let edge = |window: &[f64]| -> Vec<f64> {
            window.iter().enumerate().map(|(at, watts)| watts + if at < 50 { 0.0 } else { 3.0 }).collect()
        };
        assert!(noise.chunks_exact(250).all(|window| !is_flat(&edge(window), sigma)));
    }
}
