//! Warnings about triangles for which tile tests are ineffective.

use warnings::{Code, Warning};
use workloads::Regime;

use crate::Simulated;

/// Smallest share of triangles in view for a warning about tiny triangles.
const TINY_SHARE: f64 = 0.5;
/// The same for slivers and blur.
const SLIVER_OR_BLURRED_SHARE: f64 = 0.25;
/// The same for triangles behind the camera and fast motion.
const BEHIND_OR_FAST_SHARE: f64 = 0.1;

/// Warnings about triangles for which tile tests are ineffective, each for the worst frame. Results stay
/// correct.
pub(super) fn of_regimes(simulated: &Simulated) -> Vec<Warning> {
    [
        behind(simulated),
        tiny(simulated),
        slivers(simulated),
        fast(simulated),
        blurred(simulated),
        extreme(simulated),
        coarse(simulated),
        cut(simulated),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Frame with the most triangles of a regime, counted by `of`, if they are at least `share` of those in view.
/// The text is, for example, `12 of 40 in view, frame 3`.
fn worst_frame(simulated: &Simulated, share: f64, of: fn(&Regime) -> u64) -> Option<String> {
    let (frame, observed) = simulated.observed().max_by_key(|(_, observed)| of(&observed.regime))?;
    let (count, all) = (of(&observed.regime), observed.regime.in_view);
    (count > 0 && count as f64 >= share * all as f64)
        .then(|| format!("{count} of {all} in view, frame {}", frame.index))
}

fn behind(simulated: &Simulated) -> Option<Warning> {
    let which = worst_frame(simulated, BEHIND_OR_FAST_SHARE, |regime| regime.behind)?;
    Some(Warning::new(
        Code::BehindCamera,
        format!(
            "triangles reach behind the camera ({which}): nothing bounds their image, so they are tested all over it; move the camera, \
             or cut large triangles into smaller ones"
        ),
    ))
}

fn tiny(simulated: &Simulated) -> Option<Warning> {
    let which = worst_frame(simulated, TINY_SHARE, |regime| regime.tiny)?;
    Some(Warning::new(
        Code::SubSampleTriangles,
        format!(
            "triangles are smaller than the spacing of samples ({which}): most are hit by none, and tile tests cannot help; use a \
             coarser mesh, a larger image or more samples"
        ),
    ))
}

fn slivers(simulated: &Simulated) -> Option<Warning> {
    let which = worst_frame(simulated, SLIVER_OR_BLURRED_SHARE, |regime| regime.slivers)?;
    Some(Warning::new(
        Code::SliverTriangles,
        format!(
            "triangles are more than a hundred times as long as high ({which}): they touch many tiles and few samples; fix the mesh \
             where it was made"
        ),
    ))
}

fn fast(simulated: &Simulated) -> Option<Warning> {
    let which = worst_frame(simulated, BEHIND_OR_FAST_SHARE, |regime| regime.fast)?;
    Some(Warning::new(
        Code::FastMotion,
        format!(
            "triangles move by more than an image while the shutter is open ({which}): few samples see them, the image is noisy, and \
             a straight way may be far from the true one; use a shorter shutter, a higher frame rate or more samples"
        ),
    ))
}

fn blurred(simulated: &Simulated) -> Option<Warning> {
    let which = worst_frame(simulated, SLIVER_OR_BLURRED_SHARE, |regime| regime.blurred)?;
    Some(Warning::new(
        Code::BlurBeyondImage,
        format!(
            "triangles are out of focus by more than an image ({which}): the lens is too large for this scene; use a smaller --lens \
             or another --focus"
        ),
    ))
}

fn extreme(simulated: &Simulated) -> Option<Warning> {
    let which = worst_frame(simulated, 0.0, |regime| regime.extreme)?;
    Some(Warning::new(
        Code::CoordinatesOutOfRange,
        format!(
            "triangles have coordinates whose products leave the range of 32-bit numbers ({which}): they may not be seen, or at wrong \
             depths; scale the scene to ordinary lengths"
        ),
    ))
}

fn coarse(simulated: &Simulated) -> Option<Warning> {
    let which = worst_frame(simulated, 0.0, |regime| regime.coarse)?;
    Some(Warning::new(
        Code::CoordinatesCoarse,
        format!(
            "triangles have coordinates so large that 32-bit numbers move them by more than a quarter of a pixel ({which}): they are drawn \
             out of place; move what the camera sees to the origin, without what is far from it"
        ),
    ))
}

fn cut(simulated: &Simulated) -> Option<Warning> {
    let (frame, worst) = simulated.observed().max_by_key(|(_, observed)| observed.regime.cut)?;
    let (count, frames) =
        (worst.regime.cut, simulated.observed().filter(|(_, observed)| observed.regime.cut > 0).count());
    (count > 0).then(|| {
        let message = format!(
            "the near plane cuts triangles in front of the camera away, or parts of them ({count} in frame {}, some in {frames} of {} \
             frames): give the camera a smaller `near`, or move it",
            frame.index,
            simulated.distinct.len()
        );
        Warning::new(Code::NearPlaneCuts, message)
    })
}
