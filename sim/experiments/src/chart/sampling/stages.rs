//! What is drawn: the built-in scene moving, out of focus and both, and a fence that no table is a match for.

use glam::{Affine3A, Vec3};
use pipeline::{Camera, Cull, Draw, Geometry, Lens, Viewport};
use workloads::{Frame, Overrides, Scene};

use super::Effort;
use crate::chart::image::White;
use crate::study::StudyError;

/// Something to draw.
pub(super) enum Stage {
    /// A frame of a scene.
    Scene(Box<SceneStage>),
    /// Thin bars, many to a pixel.
    Fence(Fence),
}

/// A frame of a scene.
pub(super) struct SceneStage {
    name: &'static str,
    scene: Scene,
    frame: Frame,
    viewport: Viewport,
}

/// The scenes of the chart.
pub(super) fn scenes(effort: &Effort) -> Result<Vec<Stage>, StudyError> {
    let ([width, height], (file, frame)) = (effort.size, effort.scene);
    let scene = |name, lens_radius, shutter| -> Result<Stage, StudyError> {
        let size = Some((width, height));
        let overrides = Overrides { size, lens_radius, shutter, ..Overrides::default() };
        let scene = workloads::load(file)?.with_overrides(&overrides)?;
        let frame = scene.frame(frame)?;
        Ok(Stage::Scene(Box::new(SceneStage { name, scene, frame, viewport: viewport(overrides.size)? })))
    };
    Ok(vec![
        scene("motion", Some(0.0), None)?,
        scene("defocus", None, Some(0.0))?,
        scene("motion and defocus", None, None)?,
    ])
}

fn viewport(size: Option<(u32, u32)>) -> Result<Viewport, StudyError> {
    let (width, height) = size.unwrap_or_default();
    Viewport::new(width, height).ok_or_else(|| StudyError::Pipeline(format!("an image of {width}x{height}")))
}

impl Stage {
    /// The name in tables and pictures.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Scene(stage) => stage.name,
            Self::Fence(_) => "fence",
        }
    }

    /// Hands camera, draws, image and background to `render`.
    pub fn draw<T>(
        &self,
        render: impl FnOnce(&Camera, &[Draw<'_>], Viewport, Vec3) -> T,
    ) -> Result<T, StudyError> {
        match self {
            Self::Scene(stage) => {
                let draws = stage.frame.draws(&stage.scene)?;
                Ok(render(&stage.frame.camera, &draws, stage.viewport, stage.scene.background()))
            }
            Self::Fence(fence) => fence.draw(render),
        }
    }
}

/// Bars of a sixteenth of a pixel with gaps as wide, which slide across many pixels before an open lens: a sample in any
/// pixel sees a bar half of the time, and which depends on all of x, u and t at once.
pub(super) struct Fence {
    viewport: Viewport,
    open: Vec<Vec3>,
    close: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// Bars in a pixel.
const BARS: f32 = 8.0;
/// Pixels by which the bars slide while the shutter is open.
const SLIDE: f32 = 9.3;

impl Fence {
    /// The fence before an image of `size` pixels.
    pub fn new(size: [u32; 2]) -> Result<Self, StudyError> {
        let viewport = viewport(Some((size[0], size[1])))?;
        let (half_width, half_height) = (0.5 * size[0] as f32, 0.5 * size[1] as f32);
        let margin = 16.0;
        let bars = ((2.0 * (half_width + margin)) * BARS) as u32;
        let (mut open, mut triangles) = (Vec::new(), Vec::new());
        for bar in 0..bars {
            let left = bar as f32 / BARS - half_width - margin;
            let right = left + 0.5 / BARS;
            let first = 4 * bar;
            for (x, y) in [(left, -1.0), (right, -1.0), (right, 1.0), (left, 1.0)] {
                // A pixel of the image is a unit at depth 1, twice as much at depth 2, where the bars stand.
                open.push(Vec3::new(2.0 * x, 2.0 * y * (half_height + margin), 2.0));
            }
            triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        let close = open.iter().map(|p| *p + Vec3::new(2.0 * SLIDE, 0.0, 0.0)).collect();
        Ok(Self { viewport, open, close, triangles })
    }

    fn draw<T>(
        &self,
        render: impl FnOnce(&Camera, &[Draw<'_>], Viewport, Vec3) -> T,
    ) -> Result<T, StudyError> {
        let refused = |error: &dyn std::fmt::Display| StudyError::Pipeline(error.to_string());
        let tan_half_height = 0.5 * self.viewport.height() as f32;
        let camera = Camera::new(Affine3A::IDENTITY, tan_half_height, 0.25).map_err(|e| refused(&e))?;
        // Focused at depth 1: at depth 2 the circle of confusion is 3 pixels across.
        let camera = camera.with_lens(Some(Lens::new(3.0, 1.0).map_err(|e| refused(&e))?));
        let geometry = Geometry::new(&self.open, &self.close, &self.triangles).map_err(|e| refused(&e))?;
        let draws = [Draw { geometry, shader: &White, cull: Cull::None }];
        Ok(render(&camera, &draws, self.viewport, Vec3::ZERO))
    }
}
