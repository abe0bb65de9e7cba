//! Compared methods: named sets of tests. Their subject: draws, a camera and samples.

use activity::Counts;
use glam::Vec3;
use pipeline::sampling::SampleSource;
use pipeline::setup::Triangle;
use pipeline::traversal::{
    Box5, EdgeBounds, Edges, Facing, LensLines, Piece, TileRect, Timeline, View, narrow,
};
use pipeline::{Camera, Draw, Features, PassError, PipelineSpec, RasterPass, Settings, Shear, Viewport};
use run::{GpuSpec, RunError};
use workloads::stress::{Family, Size, brute_force};
use workloads::visibility::Unshaded;

/// A named set of tests.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// Its name in tables and charts.
    pub name: &'static str,
    /// The tests that are on.
    pub features: Features,
}

const NONE: Features = Features::NONE;
const SIDES: Features = Features { side_planes: true, ..NONE };
const EDGES: Features = Features { edges: true, ..NONE };
const FACING: Features = Features { facing: true, facing_splits: Features::ALL.facing_splits, ..NONE };

/// The sets that `quintile stress` compares, each a line.
pub const METHODS: [Method; 14] = [
    Method { name: "box only", features: NONE },
    Method { name: "lens lines", features: Features { lens_lines: true, ..NONE } },
    Method { name: "sides", features: SIDES },
    Method { name: "facing", features: FACING },
    Method { name: "edges", features: EDGES },
    Method { name: "screen", features: Features { screen: true, ..NONE } },
    Method { name: "sides+edges", features: Features { edges: true, ..SIDES } },
    Method { name: "facing+edges", features: Features { edges: true, ..FACING } },
    Method { name: "edges+screen", features: Features { screen: true, ..EDGES } },
    Method { name: "sides+edges+screen", features: Features { edges: true, screen: true, ..SIDES } },
    Method { name: "z_max", features: Features { z_max: true, ..NONE } },
    Method { name: "all but coarse", features: Features { coarse: false, ..Features::ALL } },
    Method { name: "all", features: Features::ALL },
    Method { name: "auto", features: Features { auto: true, ..Features::ALL } },
];

/// A test that can be switched on: its letter in charts, its name, and how.
#[derive(Clone, Copy, Debug)]
pub struct Switch {
    /// Its letter in charts.
    pub letter: char,
    /// Its name, as in a GPU file.
    pub name: &'static str,
    /// Switches it on.
    pub on: fn(&mut Features),
}

/// Every test that can be switched on, each a line.
pub const SWITCHES: [Switch; 7] = [
    Switch { letter: 'l', name: "lens_lines", on: |features| features.lens_lines = true },
    Switch { letter: 's', name: "side_planes", on: |features| features.side_planes = true },
    Switch { letter: 'f', name: "facing", on: |features| *features = with_facing(features) },
    Switch { letter: 'e', name: "edges", on: |features| features.edges = true },
    Switch { letter: 'o', name: "coarse", on: |features| features.coarse = true },
    Switch { letter: 'c', name: "screen", on: |features| features.screen = true },
    Switch { letter: 'z', name: "z_max", on: |features| features.z_max = true },
];

fn with_facing(features: &Features) -> Features {
    Features { facing: true, facing_splits: Features::ALL.facing_splits, ..*features }
}

/// Every combination of switches, with the letters of those that are on (`-` for none).
pub fn combinations() -> Vec<(String, Features)> {
    (0..1_u32 << SWITCHES.len())
        .map(|mask| {
            let on = SWITCHES.iter().enumerate().filter(|(bit, _)| mask >> bit & 1 == 1);
            let (mut letters, mut features) = (String::new(), NONE);
            for (_, switch) in on {
                letters.push(switch.letter);
                (switch.on)(&mut features);
            }
            (if letters.is_empty() { "-".to_owned() } else { letters }, features)
        })
        .collect()
}

/// A tile with what the tests need to know of the camera.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// The tile.
    pub tile: TileRect,
    /// The lens.
    pub shear: Shear,
    /// The near depth.
    pub near: f32,
}

impl Place {
    /// The tile of `side_px` pixels whose first pixel is `origin`.
    pub fn new(viewport: Viewport, shear: Shear, near: f32, origin: [u32; 2], side_px: u32) -> Self {
        Self { tile: TileRect::new(viewport, origin, side_px), shear, near }
    }

    /// The box of lens and time that the tests in `features` leave for `triangle`, or `None` where they cull the tile. A test
    /// that bounds lens or time has its line here.
    pub fn bound(&self, features: &Features, triangle: &Triangle) -> Option<Box5> {
        let lens = !self.shear.is_none();
        let mut within = Box5::whole(lens);
        if features.lens_lines && lens {
            within = LensLines::<f64>::new(triangle, &self.shear, self.near).narrow(&self.tile, &within).0?;
        }
        // As in traversal: a still triangle before a pinhole has nothing to narrow.
        if features.side_planes && (triangle.moving || lens || triangle.behind) {
            within = narrow(triangle, &self.shear, &self.tile, &within)?;
        }
        if features.facing || features.edges {
            within.t = self.times(features, triangle, &within).hull()?;
        }
        Some(within)
    }

    /// The times at which facing and edges let the triangle be seen.
    fn times(&self, features: &Features, triangle: &Triangle, within: &Box5) -> Timeline {
        let edges = Edges::<f64>::new(View::new(triangle, &self.shear, &self.tile, within));
        let mut times = Timeline::one(Piece { t: within.t, faces: [true; 2] });
        if features.facing {
            times = Facing::new(&edges).timeline(within.t, triangle.faces, features.facing_splits).0;
        }
        if features.edges {
            times = EdgeBounds::new(&edges).timeline(&edges, &times, triangle.faces).0;
        }
        times
    }
}

/// Draws with what looks at them.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Size of the image.
    pub viewport: Viewport,
    /// Where and when each pixel looks.
    pub samples: &'a dyn SampleSource,
    /// The draws.
    pub draws: &'a [Draw<'a>],
    /// The hardware; its features are those of each method in turn.
    pub spec: &'a PipelineSpec,
}

/// Calls `run` with the scene of `family` at `value`.
///
/// # Errors
/// When the scene cannot be made or the hardware cannot be built.
pub fn on_subject<T>(
    family: &Family,
    value: f64,
    (size, seed): (Size, u64),
    gpu: &GpuSpec,
    run: impl FnOnce(&Subject<'_>) -> Result<T, PassError>,
) -> Result<T, RunError> {
    let failed = |message: String| RunError::Setting(format!("{} at {value}: {message}", family.name));
    let scene = family.scene(value, size, seed).map_err(|error| failed(error.to_string()))?;
    let draws = [scene.draw(&Unshaded).map_err(|error| failed(error.to_string()))?];
    let (camera, viewport, samples) = (&scene.camera, scene.viewport, &scene.samples);
    let subject = Subject { camera, viewport, samples, draws: &draws, spec: &gpu.pipeline };
    run(&subject).map_err(|error| failed(error.to_string()))
}

/// The triangle of each sample and the bits of its depth.
pub type Seen = Vec<(u32, u32)>;

/// The most tests of a sample against a triangle that brute force may take.
const MOST_TESTS: u64 = 200_000_000;

impl Subject<'_> {
    /// Triangles that are drawn.
    pub fn triangles(&self) -> u64 {
        self.draws.iter().map(|draw| draw.geometry.triangles().len() as u64).sum()
    }

    /// The triangle that every sample sees with the tests of `features`.
    pub fn seen(&self, features: Features) -> Result<Seen, PassError> {
        self.with(features, |settings| RasterPass::new(self.camera, self.draws, settings).visibility())
    }

    /// How often each event happens with the tests of `features`.
    pub fn counts(&self, features: Features) -> Result<Counts, PassError> {
        self.with(features, |settings| {
            Ok(RasterPass::new(self.camera, self.draws, settings).render(|_, _| ())?.counts)
        })
    }

    /// The triangle that every sample has to see: from all triangles against all samples where that is not too much, else from the pipeline
    /// with every test off. Also returns whether it was brute force.
    pub fn reference(&self) -> Result<(Seen, bool), PassError> {
        let samples = self.viewport.pixels() as u64 * u64::from(self.samples.per_pixel());
        if samples * self.triangles() <= MOST_TESTS {
            Ok((brute_force(self.camera, self.draws, self.viewport, self.samples), true))
        } else {
            Ok((self.seen(Features::NONE)?, false))
        }
    }

    fn with<T>(&self, features: Features, run: impl FnOnce(&Settings<'_>) -> T) -> T {
        let spec = PipelineSpec { features, ..*self.spec };
        let (viewport, samples) = (self.viewport, self.samples);
        run(&Settings { spec: &spec, viewport, samples, background: Vec3::ZERO })
    }
}

/// Samples that differ: lost to another triangle, to none, or gained.
pub fn differing(a: &Seen, b: &Seen) -> u64 {
    a.iter().zip(b).filter(|(a, b)| a != b).count() as u64 + a.len().abs_diff(b.len()) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_is_there_once() {
        let all = combinations();
        assert_eq!(all.len(), 128);
        assert_eq!(all[0], ("-".to_owned(), Features::NONE));
        assert_eq!(all[127], ("lsfeocz".to_owned(), Features::ALL));
        for (place, one) in all.iter().enumerate() {
            assert!(all[place + 1..].iter().all(|other| other.0 != one.0 && other.1 != one.1));
        }
    }
}
