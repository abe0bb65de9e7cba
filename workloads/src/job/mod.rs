//! Jobs: what a run draws, be it a rendering of a scene or a workload of many passes.
//!
//! A [`Job`] draws the passes of each frame on a [`Gpu`], which counts and times them. [`crate::catalog`]
//! makes jobs by name from their options ([`OptionSource`]), and from scenes.
//!
//! A [`Fingerprint`] is equal when two frames have the same content.

mod options;

use std::io;
use std::io::{BufWriter, Write};

use glam::Vec3;
use pipeline::{Gpu, PassError};
use serde::Serialize;
use twox_hash::xxhash3_128;
use warnings::Warning;

use crate::regime::Regime;
use crate::scene::{Frame, FrameError, Overrides, Scene, SceneSettings};

pub(crate) use options::{Flag, Flags, must_hold};
pub use options::{JobOptions, Need, OptionSource};

/// A result that a job can have. It is declared by the macro `facts`, so each has a meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct FactKind {
    /// Name in `summary.json`.
    pub name: &'static str,
    /// Unit; `count` and `share` have none.
    pub unit: &'static str,
    /// Meaning in a line.
    pub meaning: &'static str,
}

/// Declares the facts of a workload, each with name, unit and meaning: a constant in the module `fact`, and
/// an entry of `FACTS`.
macro_rules! facts {
    ($($name:ident $unit:literal $meaning:literal)*) => {
        #[allow(non_upper_case_globals, reason = "they are the names in summary.json")]
        mod fact {
            $(pub const $name: $crate::job::FactKind = $crate::job::FactKind {
                name: stringify!($name),
                unit: $unit,
                meaning: $meaning,
            };)*
        }

        /// All facts of the workload.
        pub(crate) const FACTS: &[$crate::job::FactKind] = &[$(fact::$name),*];
    };
}
pub(crate) use facts;

/// A result of a job.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Fact {
    /// Name, that of a [`FactKind`].
    pub name: &'static str,
    /// Value.
    pub value: f64,
}

impl Fact {
    /// Results of these kinds with their values.
    pub(crate) fn all<const N: usize>(facts: [(FactKind, f64); N]) -> Vec<Self> {
        facts.map(|(kind, value)| Self { name: kind.name, value }).into()
    }
}

/// Result of one frame of a job.
#[derive(Clone, Debug, Default)]
pub struct Drawn {
    /// Linear RGB radiance of each pixel, row by row from the top left.
    pub image: Vec<Vec3>,
    /// Whether time is a dimension of the rendering.
    pub moving: bool,
    /// Whether the lens is a dimension of the rendering.
    pub lens: bool,
    /// Results.
    pub facts: Vec<Fact>,
    /// Warnings about limitations of the methods.
    pub warnings: Vec<Warning>,
}

/// Implementation of a job: prepares the input of a frame, and draws from that alone.
///
/// [`draw`](Self::draw) does not receive the frame number. So everything that differs between frames is in
/// the input, and frames with equal inputs are drawn once. Derive `Serialize` for the input, so that new
/// fields are compared, too.
pub trait Draws: Sync + Send {
    /// Data that changes from frame to frame.
    type Input: Serialize;

    /// Size of the image, frames and frame rate.
    fn settings(&self) -> &SceneSettings;

    /// Warnings about the job's sources, such as a scene file.
    fn warnings(&self) -> &[Warning] {
        &[]
    }

    /// Content of the images, for captions; empty if it is obvious.
    fn shows(&self) -> &'static str {
        ""
    }

    /// The scene whose frames it draws, if any.
    fn scene(&self) -> Option<&Scene> {
        None
    }

    /// The job with less work for each frame, if that takes neither reading files nor options.
    fn reduced(&self, _to: &Reduction) -> Option<Box<dyn Job + '_>> {
        None
    }

    /// Prepares the input of frame `number`.
    ///
    /// # Errors
    /// [`JobError`] if the frame cannot be made.
    fn input(&self, number: u32) -> Result<Self::Input, JobError>;

    /// Draws a frame on `gpu`. Every frame may repeat warnings.
    ///
    /// # Errors
    /// [`JobError`] if the frame cannot be drawn.
    fn draw(&self, input: &Self::Input, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError>;

    /// Triangles of a frame for which tile tests are ineffective, if the job counts them.
    ///
    /// # Errors
    /// [`JobError`] if the frame cannot be drawn.
    fn regime(&self, _input: &Self::Input) -> Result<Regime, JobError> {
        Ok(Regime::default())
    }
}

/// A job whose frames are those of a scene.
pub trait DrawsScene: Sync + Send {
    /// The scene.
    fn scene(&self) -> &Scene;

    /// Size of the image, frames and frame rate.
    fn settings(&self) -> &SceneSettings {
        self.scene().settings()
    }

    /// Draws a frame, as [`Draws::draw`].
    ///
    /// # Errors
    /// As [`Draws::draw`].
    fn draw_frame(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError>;
}

impl<D: DrawsScene> Draws for D {
    type Input = Frame;

    fn settings(&self) -> &SceneSettings {
        DrawsScene::settings(self)
    }

    fn warnings(&self) -> &[Warning] {
        DrawsScene::scene(self).warnings()
    }

    fn scene(&self) -> Option<&Scene> {
        Some(DrawsScene::scene(self))
    }

    fn input(&self, number: u32) -> Result<Frame, JobError> {
        Ok(DrawsScene::scene(self).frame(number)?)
    }

    fn draw(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        self.draw_frame(frame, gpu)
    }
}

/// Less work for each frame, for probes and previews.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reduction {
    /// Width and height of the image in pixels.
    pub size: [u32; 2],
    /// Samples per pixel; `None` keeps their number. A job that cannot draw so many keeps it, too.
    pub samples: Option<u32>,
    /// Largest number of triangles of a scene, chosen at equal steps; `None` for all. Other jobs draw all.
    pub max_triangles: Option<usize>,
}

impl Reduction {
    /// Images about `target_px` wide, but at most `max` times smaller along each axis; larger ones are not enlarged.
    pub fn to_width(settings: &SceneSettings, target_px: u32, max: u32) -> Self {
        let by = (settings.width / target_px).clamp(1, max);
        let size = [settings.width, settings.height].map(|side| side.div_ceil(by));
        Self { size, samples: None, max_triangles: None }
    }
}

/// A frame of a job, ready to be drawn.
pub trait ReadyFrame {
    /// Fingerprint of its input. Frames with equal fingerprints have equal results.
    ///
    /// # Errors
    /// [`JobError`] if the input cannot be compared.
    fn fingerprint(&self) -> Result<Fingerprint, JobError>;

    /// Draws it on `gpu`.
    ///
    /// # Errors
    /// [`JobError`] if it cannot be drawn.
    fn draw(&self, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError>;

    /// Triangles for which tile tests are ineffective, if the job counts them.
    ///
    /// # Errors
    /// [`JobError`] if it cannot be drawn.
    fn regime(&self) -> Result<Regime, JobError>;
}

/// What a run draws: a rendering of a scene, or a workload. Every type that implements [`Draws`] is a job.
pub trait Job: Sync + Send {
    /// Size of the image, frames and frame rate.
    fn settings(&self) -> &SceneSettings;

    /// Warnings about the job's sources, such as a scene file.
    fn warnings(&self) -> &[Warning];

    /// Content of the images, for captions; empty if it is obvious.
    fn shows(&self) -> &'static str;

    /// The scene whose frames it draws, if any.
    fn scene(&self) -> Option<&Scene>;

    /// The job with less work for each frame, if that takes neither reading files nor options: a rendering of
    /// a scene. [`crate::catalog::reduced`] reduces any job.
    fn reduced(&self, to: &Reduction) -> Option<Box<dyn Job + '_>>;

    /// Prepares frame `number`.
    ///
    /// # Errors
    /// [`JobError`] if the frame cannot be made.
    fn prepare(&self, number: u32) -> Result<Box<dyn ReadyFrame + '_>, JobError>;

    /// Prepares and draws frame `number`.
    ///
    /// # Errors
    /// [`JobError`] if the frame cannot be made or drawn.
    fn frame(&self, number: u32, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        self.prepare(number)?.draw(gpu)
    }

    /// Fingerprint of the input of frame `number`.
    ///
    /// # Errors
    /// [`JobError`] if the frame cannot be made.
    fn fingerprint(&self, number: u32) -> Result<Fingerprint, JobError> {
        self.prepare(number)?.fingerprint()
    }
}

impl<D: Draws> Job for D {
    fn settings(&self) -> &SceneSettings {
        Draws::settings(self)
    }

    fn warnings(&self) -> &[Warning] {
        Draws::warnings(self)
    }

    fn shows(&self) -> &'static str {
        Draws::shows(self)
    }

    fn scene(&self) -> Option<&Scene> {
        Draws::scene(self)
    }

    fn reduced(&self, to: &Reduction) -> Option<Box<dyn Job + '_>> {
        Draws::reduced(self, to)
    }

    fn prepare(&self, number: u32) -> Result<Box<dyn ReadyFrame + '_>, JobError> {
        Ok(Box::new(Ready { job: self, input: self.input(number)? }))
    }
}

/// A job with the input of a frame.
struct Ready<'a, D: Draws> {
    job: &'a D,
    input: D::Input,
}

impl<D: Draws> ReadyFrame for Ready<'_, D> {
    fn fingerprint(&self) -> Result<Fingerprint, JobError> {
        Ok(Fingerprint::of(&self.input)?)
    }

    fn draw(&self, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        self.job.draw(&self.input, gpu)
    }

    fn regime(&self) -> Result<Regime, JobError> {
        self.job.regime(&self.input)
    }
}

/// Message about an image without pixels, or with too many.
pub const IMAGE_SIZE: &str = "image width or height is zero or too large";

/// Reason why a frame could not be drawn.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the variants are the sources, documented there")]
pub enum JobError {
    #[error(transparent)]
    Pass(#[from] PassError),
    #[error(transparent)]
    Frame(#[from] FrameError),
    #[error(transparent)]
    Fingerprint(#[from] FingerprintError),
    /// Invalid or incompatible settings.
    #[error("{0}")]
    Setting(String),
}

impl JobError {
    /// Wraps an error of a setting.
    pub(crate) fn setting(error: impl std::fmt::Display) -> Self {
        Self::Setting(error.to_string())
    }
}

/// Parameters of a job besides its own options.
#[derive(Clone, Copy, Debug)]
pub struct JobRequest<'a> {
    /// Changes to the settings.
    pub overrides: &'a Overrides,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// A 128-bit hash (XXH3) of everything that a value serializes, floats by their bits.
///
/// Values of one type with the same content have the same fingerprint. Values that differ in one bit have
/// different ones, except with probability 2^-128 per pair. Compare fingerprints of one type only: names of
/// types and fields are not hashed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Fingerprint(u128);

impl Fingerprint {
    /// Fingerprint of `value`. Derive `Serialize` on its type, so that no field is missing.
    ///
    /// # Errors
    /// [`FingerprintError`] for types that cannot be serialized, such as a sequence of unknown length.
    pub fn of<T: Serialize>(value: &T) -> Result<Self, FingerprintError> {
        let mut writer = BufWriter::with_capacity(BUFFER_BYTES, HashWriter(xxhash3_128::Hasher::new()));
        postcard::to_io(value, &mut writer).map_err(|error| FingerprintError(error.to_string()))?;
        let hash = writer.into_inner().map_err(|error| FingerprintError(error.to_string()))?;
        Ok(Self(hash.0.finish_128()))
    }
}

/// Reason why a value has no fingerprint.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("internal error, please report it: frames cannot be compared: {0}")]
pub struct FingerprintError(String);

/// Bytes that are buffered before hashing: the serializer writes single numbers.
const BUFFER_BYTES: usize = 1 << 16;

/// A hash as a writer.
struct HashWriter(xxhash3_128::Hasher);

impl Write for HashWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Hardware for tests of jobs.
#[cfg(test)]
pub(crate) mod testing {
    use pipeline::depth::DepthSpec;
    use pipeline::{CacheSpec, ComputeSpec, Features, MemorySpec, PipelineSpec, Shading};

    /// Small caches, with all features on.
    pub(crate) fn hardware() -> PipelineSpec {
        let lines = CacheSpec::lru(256, 4);
        let groups =
            ComputeSpec { warp_lanes: 32, group_lanes: 256, shared_bytes: 8192, banks: 32, atomic_units: 1 };
        let compression = Default::default();
        PipelineSpec {
            tile_px: 8,
            coarse_tile_px: 16,
            batch_triangles: 1000,
            vertex_reuse: 16,
            shading: Shading::default(),
            shading_cache: CacheSpec::lru(1024, 4),
            memory: MemorySpec {
                depth: lines,
                colour: lines,
                texture: lines,
                bins: None,
                l2: lines,
                llc: None,
                edram: None,
                compression,
            },
            features: Features::ALL,
            depth: DepthSpec::default(),
            compute: Some(groups),
            warp_lanes: 32,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[derive(Clone, Serialize)]
    struct Value {
        names: Vec<String>,
        numbers: Arc<[f32]>,
        index: Option<u32>,
    }

    fn value() -> Value {
        Value { names: vec!["a".to_owned(), "bc".to_owned()], numbers: Arc::from([0.0, 1.5]), index: None }
    }

    #[test]
    fn equal_content_has_equal_fingerprints() {
        assert_eq!(Fingerprint::of(&value()), Fingerprint::of(&value()));
    }

    #[test]
    fn every_bit_of_every_field_counts() {
        let others = [
            Value { numbers: Arc::from([-0.0, 1.5]), ..value() },
            Value { numbers: Arc::from([0.0, f32::from_bits(1.5_f32.to_bits() + 1)]), ..value() },
            Value { numbers: Arc::from([0.0]), ..value() },
            Value { names: vec!["ab".to_owned(), "c".to_owned()], ..value() },
            Value { names: vec!["abc".to_owned()], ..value() },
            Value { index: Some(0), ..value() },
        ];
        let all: std::collections::HashSet<_> =
            others.iter().chain([&value()]).map(|value| Fingerprint::of(value).unwrap()).collect();
        assert_eq!(all.len(), others.len() + 1);
    }

    #[test]
    fn content_longer_than_the_buffer_is_hashed_to_its_end() {
        let long = |last: u32| Fingerprint::of(&(0..40_000).chain([last]).collect::<Vec<u32>>());
        assert_ne!(long(1), long(2));
    }
}
