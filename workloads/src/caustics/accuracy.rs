//! Warnings about regimes in which beams are inaccurate.

use warnings::{Code, Warning};

use super::Beam;
use super::generator::Ocean;

/// Mean share of a beam's length with crossed sides above which a warning is given. Half a percent of the
/// light in the volume is missing there (`quintile chart caustics`).
pub const MAX_CROSSED_SHARE: f64 = 0.1;
/// Least number of grid squares along the shortest wave.
pub const MIN_SQUARES_PER_WAVE: f64 = 4.0;

/// Mean share of their length over which sides of beams cross.
pub fn crossing(beams: &[Beam]) -> f64 {
    beams.iter().map(Beam::crossing).sum::<f64>() / beams.len().max(1) as f64
}

/// Warnings about an ocean made of these beams.
pub fn accuracy_warnings(ocean: &Ocean, beams: &[Beam]) -> Vec<Warning> {
    let crossed = crossing(beams);
    let squares = ocean.shortest_m() / ocean.side_m * f64::from(ocean.cells);
    let crossed = (crossed > MAX_CROSSED_SHARE).then(|| {
        Warning::new(
            Code::CausticsCrossed,
            format!(
                "the sides of beams cross for {:.1} % of their length on average (a warning from {:.0} % on): triangles stand along the light for much \
                 of its way, which then differs in length within a beam, and light in the water is missing, half a percent from there on and more beyond; \
                 more cells, flatter waves or deeper water help",
                100.0 * crossed,
                100.0 * MAX_CROSSED_SHARE
            ),
        )
    });
    let coarse = (squares < MIN_SQUARES_PER_WAVE).then(|| {
        Warning::new(
            Code::CausticsCoarse,
            format!(
                "the shortest wave is {squares:.1} squares of generator triangles long, fewer than {MIN_SQUARES_PER_WAVE:.0}: the surface is not resolved and its light \
                 falls elsewhere; more cells or longer waves help"
            ),
        )
    });
    crossed.into_iter().chain(coarse).collect()
}
