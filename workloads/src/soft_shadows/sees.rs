//! What every sample of a fixed set sees: in one pass, or in as many passes as samples.

use activity::Counts;
use glam::Vec3;
use pipeline::frame::render_depth;
use pipeline::{Camera, Draw, PipelineSpec, Settings, Viewport};

use crate::accumulation::{SharedSamples, Snapshot, SnapshotError};
use crate::job::{Emit, JobError, shifted};

/// How the samples of a set are rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// All in one five-dimensional pass.
    OnePass,
    /// Each in a pass of its own, of still geometry through a pinhole.
    Accumulation,
}

/// The triangle each sample sees (`u32::MAX` for none) and the bits of its depth, in the order `(y width + x) n + index`, with what it
/// took.
pub struct Seen {
    /// Triangles and depths.
    pub samples: Vec<(u32, u32)>,
    /// What was done.
    pub counts: Counts,
    /// Triangles drawn, in all passes.
    pub triangles: usize,
}

/// Renders depths of `draws` as `camera` sees them at the samples of `set`.
///
/// # Errors
/// When the hardware cannot be built.
pub fn see(
    (camera, draws): (&Camera, &[Draw<'_>]),
    viewport: Viewport,
    set: &SharedSamples,
    (method, spec): (Method, &PipelineSpec),
    emit: Emit<'_>,
) -> Result<Seen, JobError> {
    let of_a_pass: usize = draws.iter().map(|draw| draw.geometry.triangles().len()).sum();
    if method == Method::OnePass {
        let settings = Settings { spec, viewport, samples: set, background: Vec3::ZERO };
        let (samples, counts) = render_depth(camera, draws, &settings, emit)?;
        return Ok(Seen { samples, counts, triangles: of_a_pass });
    }
    let each = set.samples().len();
    let mut seen =
        Seen { samples: vec![(0, 0); viewport.pixels() * each], counts: Counts::default(), triangles: 0 };
    for (index, at) in set.samples().iter().enumerate() {
        let unmade = |error: SnapshotError| JobError::Setting(error.to_string());
        let snapshot = Snapshot::new(camera, draws, viewport, at).map_err(unmade)?;
        let still = snapshot.draws().map_err(unmade)?;
        let samples = set.still(index);
        let settings = Settings { spec, viewport, samples: &samples, background: Vec3::ZERO };
        let (one, counts) = render_depth(&snapshot.camera, &still, &settings, shifted(index as u16, emit))?;
        seen.counts += &counts;
        seen.triangles += of_a_pass;
        seen.samples.iter_mut().skip(index).step_by(each).zip(one).for_each(|(into, from)| *into = from);
    }
    Ok(seen)
}
