//! Drawing a frame of a run.

use activity::{Event, LineAccess, Packet};
use pipeline::frame::{HeatMap, render_with_heat};
use pipeline::{Settings, Viewport};
use workloads::job::Drawn;
use workloads::{Frame, Scene};

use super::regime::Regime;
use super::{Plan, RunError, Work};

/// A frame as it was drawn.
pub(super) struct Drawing {
    pub drawn: Drawn,
    pub regime: Regime,
    pub heat: Vec<HeatMap>,
}

/// Draws frame `number`, with heat maps of `events`.
pub(super) fn draw(
    plan: &Plan,
    number: u32,
    events: &[Event],
    mut emit: impl FnMut(&Packet, &[LineAccess]),
) -> Result<Drawing, RunError> {
    match &plan.work {
        Work::Scene(scene) => draw_scene(plan, scene, &scene.frame(number)?, events, emit),
        Work::Job { job, .. } => {
            let drawn = job.frame(number, &plan.gpu.pipeline, &mut emit)?;
            Ok(Drawing { drawn, regime: Regime::default(), heat: Vec::new() })
        }
    }
}

/// Draws from `frame` and from what is the same in all frames. It must not know which frame it draws, because frames with the
/// same fingerprint are drawn once.
fn draw_scene(
    plan: &Plan,
    scene: &Scene,
    frame: &Frame,
    events: &[Event],
    emit: impl FnMut(&Packet, &[LineAccess]),
) -> Result<Drawing, RunError> {
    let draws = frame.draws(scene)?;
    let viewport: Viewport = plan.viewport;
    let background = scene.background();
    let settings = Settings { spec: &plan.gpu.pipeline, viewport, samples: &*plan.samples, background };
    let (rendered, heat) =
        render_with_heat(&frame.camera, &draws, &settings, events, emit).map_err(RunError::setting)?;
    let drawn = Drawn {
        image: rendered.image,
        counts: rendered.counts,
        triangles: frame.triangle_count(),
        moving: frame.is_moving(),
        lens: frame.camera.lens().is_some(),
        ..Drawn::default()
    };
    let regime = Regime::of(&frame.camera, &draws, viewport, plan.samples.per_pixel());
    Ok(Drawing { drawn, regime, heat })
}
