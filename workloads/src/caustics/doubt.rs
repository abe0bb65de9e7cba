//! Regimes in which beams are known to be bad.

use warnings::{Code, Warning};

use super::Beam;
use super::generator::Ocean;

/// Sides of beams cross for more than this part of their length on average: half a percent of the light in the volume is missing there
/// (`quintile chart caustics`).
pub const CROSSED: f64 = 0.1;
/// Fewer squares than this along the shortest wave.
pub const SQUARES: f64 = 4.0;

/// For how much of their length the sides of beams cross, on average.
pub fn crossing(beams: &[Beam]) -> f64 {
    beams.iter().map(Beam::crossing).sum::<f64>() / beams.len().max(1) as f64
}

/// What is to be doubted of an ocean made of these beams.
pub fn doubts(ocean: &Ocean, beams: &[Beam]) -> Vec<Warning> {
    let crossed = crossing(beams);
    let squares = ocean.shortest_m() / ocean.side_m * f64::from(ocean.cells);
    let crossed = (crossed > CROSSED).then(|| {
        Warning::new(
            Code::CausticsCrossed,
            format!(
                "the sides of beams cross for {:.1} % of their length on average (a warning from {:.0} % on): triangles stand along the light for much \
                 of its way, which then differs in length within a beam, and light in the water is missing, half a percent from there on and more beyond; \
                 more cells, flatter waves or deeper water help",
                100.0 * crossed,
                100.0 * CROSSED
            ),
        )
    });
    let coarse = (squares < SQUARES).then(|| {
        Warning::new(
            Code::CausticsCoarse,
            format!(
                "the shortest wave is {squares:.1} squares of generator triangles long, fewer than {SQUARES:.0}: the surface is not resolved and its light \
                 falls elsewhere; more cells or longer waves help"
            ),
        )
    });
    crossed.into_iter().chain(coarse).collect()
}
