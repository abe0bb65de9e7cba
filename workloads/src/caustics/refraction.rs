//! Beams in memory, and the passes that make those of an ocean: one refracts the light at every corner of its
//! triangles, the next puts three corners together.
//!
//! Lanes compute in `f64` what the host does. Words in memory are single, and stand for that.

use glam::DVec3;
use pipeline::{Buffer, ComputePass, Gpu, Group, GroupShader, PassError};

use super::generator::{Corner, Ocean};
use super::{Beam, BeamMethod};

/// Lanes of a group.
pub(super) const GROUP_LANES: u32 = 64;
/// Words of the vertices of a beam, at both ends.
pub(super) const VERTICES_WORDS: u32 = 18;
/// The same with the flux.
pub(super) const BEAM_WORDS: u32 = VERTICES_WORDS + 1;

/// Beams in memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct BeamBuffer {
    pub words: Buffer<f32>,
    /// Number of beams.
    pub beams: u32,
    /// Whether the fluxes are behind the vertices of all beams, instead of each behind those of its beam: the
    /// vertices are then those of the primitives.
    pub is_split: bool,
}

impl BeamBuffer {
    pub fn new(gpu: &mut Gpu<'_>, beams: usize, method: BeamMethod) -> Self {
        let words = gpu.buffer("beams", &vec![0.0; beams * BEAM_WORDS as usize]);
        Self { words, beams: beams as u32, is_split: method == BeamMethod::Moving }
    }

    /// First word of the vertices of a beam, and the word of its flux.
    fn place(&self, beam: u32) -> [u32; 2] {
        if self.is_split {
            [VERTICES_WORDS * beam, VERTICES_WORDS * self.beams + beam]
        } else {
            [BEAM_WORDS * beam, BEAM_WORDS * beam + VERTICES_WORDS]
        }
    }
}

/// Makes the beams of `ocean` at a time in seconds. Without a compute unit they are in memory already.
///
/// # Errors
/// [`PassError`] if the GPU does not take the passes.
pub(super) fn refract_on(
    gpu: &mut Gpu<'_>,
    ocean: &Ocean,
    time_s: f64,
    method: BeamMethod,
) -> Result<(Vec<Beam>, BeamBuffer), PassError> {
    let (side, corners) = (ocean.cells + 1, ocean.corners(time_s));
    let beams = ocean.beams_of(&corners);
    if gpu.spec().compute.is_none() {
        let buffer = BeamBuffer::new(gpu, beams.len(), method);
        return Ok((beams, buffer));
    }
    let each = if ocean.pleat == 0.0 { 7 } else { 10 };
    let words = gpu.buffer("corners", &vec![0.0_f32; (side * side * each) as usize]);
    let buffer = BeamBuffer::new(gpu, beams.len(), method);
    let stored = StoredCorners { words, each };
    gpu.dispatch(&ComputePass {
        name: "refraction",
        groups: [side.div_ceil(GROUP_LANES), side, 1],
        group_size: GROUP_LANES,
        shared_bytes: 0,
        bindings: &[words.writes()],
        shader: &Refraction { ocean, stored, time_s },
    })?;
    gpu.dispatch(&ComputePass {
        name: "beams",
        groups: [(2 * ocean.cells).div_ceil(GROUP_LANES), ocean.cells, 1],
        group_size: GROUP_LANES,
        shared_bytes: 0,
        bindings: &[words.reads(), buffer.words.writes()],
        shader: &Joining { ocean, stored, corners: &corners, buffer },
    })?;
    Ok((beams, buffer))
}

/// Corners in memory, row by row.
#[derive(Clone, Copy)]
struct StoredCorners {
    words: Buffer<f32>,
    /// Words of each: position, end of its light, share that enters, and the start of its beam if it is elsewhere.
    each: u32,
}

/// Refracts light, a lane for each corner of a row.
struct Refraction<'a> {
    ocean: &'a Ocean,
    stored: StoredCorners,
    time_s: f64,
}

impl GroupShader for Refraction<'_> {
    fn run(&self, group: &mut Group<'_>) {
        let ([part, row, _], size) = (group.id(), group.size());
        let (side, StoredCorners { words, each }) = (self.ocean.cells + 1, self.stored);
        group.lanes(|lane| {
            let column = lane.madd(part, size, lane.index());
            if lane.branch(column >= side) {
                return;
            }
            let Corner { position, start, end, enters } =
                self.ocean.corner_at(lane, [column, row], self.time_s);
            let first = lane.mul(lane.madd(row, side, column), each);
            let values = numbers([position, end]).chain([enters]).chain(numbers([start]));
            for (word, value) in (first..first + each).zip(values) {
                lane.store(words, word, value as f32);
            }
        });
    }
}

/// Makes beams of corners, a lane for each beam of a row.
struct Joining<'a> {
    ocean: &'a Ocean,
    stored: StoredCorners,
    corners: &'a [Corner],
    buffer: BeamBuffer,
}

impl GroupShader for Joining<'_> {
    fn run(&self, group: &mut Group<'_>) {
        let ([part, row, _], size) = (group.id(), group.size());
        let (across, StoredCorners { words, each }) = (2 * self.ocean.cells, self.stored);
        group.lanes(|lane| {
            let number = lane.madd(part, size, lane.index());
            if lane.branch(number >= across) {
                return;
            }
            let corners = self.ocean.corners_of(lane, [number, row]).map(|corner| {
                let first = lane.mul(corner, each);
                (first..first + each).for_each(|word| _ = lane.load(words, word));
                &self.corners[corner as usize]
            });
            let Beam { open, close, flux_w } = self.ocean.beam(lane, corners);
            let [first, flux] = self.buffer.place(lane.madd(row, across, number));
            let ends = open.into_iter().zip(close).flat_map(|(open, close)| numbers([open, close]));
            for (word, value) in (first..).zip(ends) {
                lane.store(self.buffer.words, word, value as f32);
            }
            lane.store(self.buffer.words, flux, flux_w as f32);
        });
    }
}

/// Coordinates of points.
fn numbers<const N: usize>(points: [DVec3; N]) -> impl Iterator<Item = f64> {
    points.into_iter().flat_map(|point| point.to_array())
}

#[cfg(test)]
mod tests {
    use activity::Event;

    use super::*;
    use crate::job::testing::hardware;

    #[test]
    fn the_passes_make_the_beams_of_the_host() {
        let hardware = hardware();
        for (cells, pleat, method) in
            [(5, 0.0, BeamMethod::Moving), (40, 0.3, BeamMethod::Moving), (9, 0.0, BeamMethod::Hull)]
        {
            let ocean = Ocean { pleat, ..Ocean::new(cells, 16.0, 5.0, [6.0, 0.3], 2) };
            let mut gpu = Gpu::without_packets(&hardware).unwrap();
            let (beams, buffer) = refract_on(&mut gpu, &ocean, 0.4, method).unwrap();
            assert_eq!(beams, ocean.beams(0.4));
            let words = gpu.values(buffer.words);
            for (number, beam) in (0..).zip(&beams) {
                let [first, flux] = buffer.place(number).map(|word| word as usize);
                let ends = beam.open.into_iter().zip(beam.close).flat_map(|(a, b)| numbers([a, b]));
                let wanted: Vec<f32> = ends.map(|value| value as f32).collect();
                assert_eq!(words[first..][..wanted.len()], wanted, "{number}");
                assert_eq!(words[flux], beam.flux_w as f32, "{number}");
            }
        }
    }

    /// A wave more is two products for its place, an angle of two, a sine and a cosine of two each, the height, the
    /// fall and two slopes.
    #[test]
    fn every_wave_costs_at_every_corner() {
        let hardware = hardware();
        let work = |waves| {
            let mut ocean = Ocean::new(63, 16.0, 5.0, [6.0, 0.3], 2);
            ocean.waves.truncate(waves);
            let mut gpu = Gpu::without_packets(&hardware).unwrap();
            refract_on(&mut gpu, &ocean, 0.4, BeamMethod::Moving).unwrap();
            let report = gpu.finish();
            let [refraction, beams] = [0, 1].map(|pass| report.passes[pass].counts()[Event::ShaderOps]);
            [refraction, beams]
        };
        let [few, many] = [4, 12].map(work);
        assert_eq!([many[0] - few[0], many[1] - few[1]], [8 * 64 * 64 * 12, 0]);
        assert!(few[1] > 0);
    }
}
