//! The query by samples: the box is drawn, and samples that pass the depth test are counted.

use activity::Event;
use pipeline::frame::{render_depth, visibility};
use pipeline::memory::CacheError;
use pipeline::{Camera, Cull, Draw, Features, Geometry, PipelineSpec, Settings};

use super::MovingBox;
use crate::visibility::Unshaded;

/// The depths that a query is held against.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// Who looks.
    pub camera: &'a Camera,
    /// The hardware and the samples.
    pub settings: &'a Settings<'a>,
    /// The depth of every sample in the order `(y width + x) per_pixel + index`, infinite where nothing is.
    pub depths: &'a [f32],
}

/// What a sampled query found, and what it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// Samples that see the box: none of what is stored there is as near.
    pub passed: u64,
    /// Samples tested.
    pub tested: u64,
    /// Tiles tested.
    pub tiles: u64,
    /// Samples inside, for each of which a stored depth of four bytes is read.
    pub hit: u64,
    /// Multiply-adds of all that.
    pub madds: u64,
}

impl Seen {
    /// Tests of any kind, those of depth included.
    pub fn tests(&self) -> u64 {
        self.tested + self.tiles + self.hit
    }

    /// Bytes of stored depth that were read.
    pub fn bytes(&self) -> u64 {
        4 * self.hit
    }
}

/// The depth of every sample that sees `draws`, as [`Samples`] wants it.
///
/// # Errors
/// When a cache of the hardware cannot be built.
pub fn depths(camera: &Camera, draws: &[Draw<'_>], settings: &Settings<'_>) -> Result<Vec<f32>, CacheError> {
    Ok(visibility(camera, draws, settings)?.into_iter().map(depth).collect())
}

/// The depth of what a sample sees.
fn depth((_, bits): (u32, u32)) -> f32 {
    f32::from_bits(bits)
}

impl Samples<'_> {
    /// How many samples see the box, by drawing it alone.
    ///
    /// # Errors
    /// When a cache of the hardware cannot be built.
    pub fn ask(&self, object: &MovingBox) -> Result<Seen, CacheError> {
        let [open, close] = object.corners();
        // A geometry is only refused for a number that is not finite, and then nothing of it can be seen.
        let Ok(geometry) = Geometry::new(&open, &close, &MovingBox::TRIANGLES) else {
            return Ok(Seen::default());
        };
        let draws = [Draw { geometry, shader: &Unshaded, cull: Cull::None }];
        // A query knows the stored depths of nothing but samples.
        let features = Features { z_max: false, ..self.settings.spec.features };
        let spec = PipelineSpec { features, ..*self.settings.spec };
        let settings = Settings { spec: &spec, ..*self.settings };
        let (own, counts) = render_depth(self.camera, &draws, &settings, |_, _| ())?;
        let passes = |(own, stored): &(f32, &f32)| own.is_finite() && own <= stored;
        let passed = own.into_iter().map(depth).zip(self.depths).filter(passes).count() as u64;
        let all = |events: &[Event]| events.iter().map(|event| counts[*event]).sum();
        Ok(Seen {
            passed,
            tested: counts[Event::SamplesTested] + counts[Event::SamplesScreened],
            tiles: all(&[Event::TilesVisited, Event::CoarseTilesVisited]),
            hit: counts[Event::SamplesHit],
            madds: all(&[Event::SetupMadds, Event::TileMadds, Event::ScreenMadds, Event::SampleMadds]),
        })
    }
}
