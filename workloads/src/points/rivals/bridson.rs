//! Candidates around points that are there.

use super::cells::Cells;
use super::plain::grain;
use crate::points::poisson::{Domain, PoissonError, PoissonSpec};
use crate::points::random::Stream;

/// From a random point on, `candidates` places between one and two radii from a point that is still active, evenly by volume; the
/// first free one becomes a point, and where none is the active point retires (Bridson 2007).
///
/// # Errors
/// As [`crate::points::poisson::poisson_disk`].
pub fn bridson<const D: usize>(spec: &PoissonSpec, candidates: u32) -> Result<Vec<[f64; D]>, PoissonError> {
    let (mut cells, stream) = (Cells::new(spec)?, Stream::new(spec.seed, 0xB51D));
    let mut number = D as u64;
    cells.add(std::array::from_fn(|k| grain(stream.unit(k as u64))));
    let mut active = vec![0_usize];
    while !active.is_empty() {
        let chosen = stream.below(number, active.len() as u64) as usize;
        let from = cells.points[active[chosen]];
        number += 1;
        let found = (0..candidates).find_map(|_| {
            let at = around(&from, spec, stream, &mut number)?;
            cells.is_free(&at).then_some(at)
        });
        match found {
            Some(at) => {
                active.push(cells.points.len());
                cells.add(at);
            }
            None => _ = active.swap_remove(chosen),
        }
    }
    Ok(cells.points)
}

/// A place in the shell around a point, if it is in the domain.
fn around<const D: usize>(
    from: &[f64; D],
    spec: &PoissonSpec,
    stream: Stream,
    number: &mut u64,
) -> Option<[f64; D]> {
    let away: [f64; D] = loop {
        let place: [f64; D] = std::array::from_fn(|k| 4.0 * stream.unit(*number + k as u64) - 2.0);
        *number += D as u64;
        let square: f64 = place.iter().map(|x| x * x).sum();
        if (1.0..4.0).contains(&square) {
            break place;
        }
    };
    let at: [f64; D] = std::array::from_fn(|k| from[k] + away[k] * spec.radius);
    match spec.domain {
        Domain::Torus => Some(at.map(|x| grain(x.rem_euclid(1.0)).min(1.0 - f64::EPSILON))),
        Domain::Box => at.iter().all(|x| (0.0..1.0).contains(x)).then(|| at.map(grain)),
    }
}
