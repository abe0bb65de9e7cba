//! Shader runs, times and errors of views.

use std::time::Instant;

use activity::{Counts, Event};
use glam::{Vec3, Vec4};
use pipeline::{
    CacheSpec, Draw, Features, Gpu, Lane, PipelineSpec, Replacement, Shader, ShadingPoint, Texture, Viewport,
};
use run::GpuSpec;
use serde::Serialize;
use workloads::multiview::{Layout, MultiviewRig, ViewTarget, Views};
use workloads::{Frame, Overrides, Scene};

use super::{SAMPLES, line, stereo};
use crate::chart::{errors, mean_square};
use crate::study::{Ran, StudyError};

/// Cost of one way to render all views.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ViewsRun {
    /// Passes over the geometry.
    pub passes: u32,
    /// Pixel shader lanes run, helpers included.
    pub invocations: u64,
    /// The same over those of one view alone.
    pub over_one_view: f64,
    /// Vertex shader runs.
    pub vertices: u64,
    /// Bytes read from and written to memory.
    pub dram_bytes: u64,
    /// Seconds of the host.
    pub host_s: f64,
}

/// One number of views.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ViewsRow {
    /// Views.
    pub views: u32,
    /// Samples for each view of a pixel; fewer where all of them do not fit in a pixel.
    pub samples_per_view: u32,
    /// All in one pass.
    pub one_pass: ViewsRun,
    /// A pass each.
    pub view_by_view: ViewsRun,
    /// A pass for each sample.
    pub accumulation: ViewsRun,
}

/// One shading cache.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Cached {
    /// Views.
    pub views: u32,
    /// Name of the replacement policy.
    pub policy: &'static str,
    /// Entries, quads each, in sets of four.
    pub entries: u32,
    /// Pixel shader lanes run for all views, for each pixel of one.
    pub invocations_per_pixel: f64,
    /// Invocations a pixel of one view alone.
    pub one_view_per_pixel: f64,
    /// The first over the second, less one.
    pub increase: f64,
}

/// Pixel shader lanes of views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ViewLanes {
    /// Of all views in one pass.
    pub all: u64,
    /// Of one view alone.
    pub one: u64,
    /// Work of the one pass and of the view alone.
    pub ran: Ran,
}

/// One length of the camera line.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Angle {
    /// Length of the camera line over the distance of what is in focus.
    pub baseline: f64,
    /// The angle under which a point in focus sees it, in degrees.
    pub degrees: f64,
    /// Error of the outer views against cameras of their own, where shading does not depend on who looks.
    pub rmse_matt: f64,
    /// The same with a highlight.
    pub rmse_shiny: f64,
}

/// Tile tests of all views in one pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct TileTestCosts {
    /// Tiles culled by the tests of the sides and of the lens, coarse and fine ones.
    pub tiles_culled: u64,
    /// Multiply-adds of tile tests.
    pub tile_madds: u64,
    /// Samples that the tile tests leave.
    pub samples: u64,
    /// Multiply-adds of tile tests, screens and sample tests.
    pub all_madds: u64,
}

/// Views with one test over the whole lens, and with one over each region.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct RegionTests {
    /// Kind of views.
    pub views: &'static str,
    /// Length of the camera line over the distance of what is in focus.
    pub baseline: f64,
    /// One test over the whole lens.
    pub whole: TileTestCosts,
    /// A test of `u` over each region.
    pub each: TileTestCosts,
    /// Whether the images are equal to the bit.
    pub equal: bool,
}

/// Exponent of that highlight.
const EXPONENT: i32 = 64;

/// A scene and hardware to draw it with.
pub struct MultiviewBench {
    scene: Scene,
    frame: Frame,
    gpu: GpuSpec,
    viewport: Viewport,
    focus: f32,
}

impl MultiviewBench {
    /// Frame of a built-in scene, for views of a size.
    ///
    /// # Errors
    /// When it cannot be loaded, or has no lens to say what is in focus.
    pub fn new((name, number): (&str, u32), size: [u32; 2]) -> Result<Self, StudyError> {
        Self::with_shutter((name, number), size, None)
    }

    /// The same with a shutter of its own, as a share of the frame's time.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_shutter(
        (name, number): (&str, u32),
        [width, height]: [u32; 2],
        shutter: Option<f64>,
    ) -> Result<Self, StudyError> {
        let refused = |why: &str| StudyError::Pipeline(why.to_owned());
        let size = Some((width, height));
        let scene =
            workloads::load(name)?.with_overrides(&Overrides { size, shutter, ..Overrides::default() })?;
        let frame = scene.frame(number)?;
        let focus = frame.camera.lens().ok_or_else(|| refused("it has no lens"))?.focus();
        let viewport = Viewport::new(width, height).ok_or_else(|| refused(workloads::job::IMAGE_SIZE))?;
        Ok(Self { scene, frame, gpu: GpuSpec::load("reference")?, viewport, focus })
    }

    /// Distance of what is in focus, scene units.
    pub fn focus(&self) -> f64 {
        f64::from(self.focus)
    }

    fn rig(&self, layout: &Layout, samples: u32) -> Result<MultiviewRig, StudyError> {
        let strips = layout.overlap.max(1);
        let per_strip = (samples / strips).min(256 / layout.strips());
        Ok(MultiviewRig::new(&self.frame.camera, self.focus, layout, per_strip * strips, 1)?)
    }

    fn target<'a>(&self, spec: &'a PipelineSpec) -> ViewTarget<'a> {
        ViewTarget { viewport: self.viewport, spec, background: self.scene.background(), places: &[] }
    }

    /// All ways of rendering so many views: two are apart as eyes are, others overlap.
    pub(super) fn row(&self, views: u32) -> Result<ViewsRow, StudyError> {
        let layout = if views == 2 { stereo() } else { line(views) };
        let (rig, to) = (self.rig(&layout, SAMPLES)?, self.target(&self.gpu.pipeline));
        let draws = self.frame.draws(&self.scene)?;
        let (one, _) = self.one_view(&rig, &layout, &draws, &to)?;
        let run = |render: &dyn Fn() -> Result<Views, workloads::job::JobError>| {
            let started = Instant::now();
            let views = render()?;
            let host_s = started.elapsed().as_secs_f64();
            let counts = &views.counts;
            let invocations = counts[Event::PixelInvocations];
            Ok::<_, StudyError>(ViewsRun {
                passes: views.passes,
                invocations,
                over_one_view: invocations as f64 / one as f64,
                vertices: counts[Event::VertexInvocations],
                dram_bytes: counts[Event::DramReadBytes] + counts[Event::DramWriteBytes],
                host_s,
            })
        };
        Ok(ViewsRow {
            views,
            samples_per_view: rig.samples() / layout.strips() * layout.overlap.max(1),
            one_pass: run(&|| rig.one_pass(&draws, &to, &mut Gpu::without_packets(to.spec)?))?,
            view_by_view: run(&|| rig.view_by_view(&draws, &to, &mut Gpu::without_packets(to.spec)?))?,
            accumulation: run(&|| rig.accumulated(&draws, &to, &mut Gpu::without_packets(to.spec)?))?,
        })
    }

    /// Lanes that the view nearest to the middle takes alone, and its work.
    fn one_view(
        &self,
        rig: &MultiviewRig,
        layout: &Layout,
        draws: &[Draw<'_>],
        to: &ViewTarget<'_>,
    ) -> Result<(u64, Ran), StudyError> {
        let middle = (layout.views as usize - 1) / 2;
        let mut gpu = Gpu::without_packets(to.spec)?;
        let counts = rig.view(middle, draws, to, &mut gpu)?.counts;
        Ok((counts[Event::PixelInvocations].max(1), Ran::of(&gpu.finish())))
    }

    /// Shader runs with another cache.
    ///
    /// # Errors
    /// When the cache cannot be built.
    pub fn cached(
        &self,
        layout: Layout,
        (policy, replacement): (&'static str, Replacement),
        entries: u32,
    ) -> Result<Cached, StudyError> {
        let cache = CacheSpec { replacement, ..CacheSpec::lru(entries, 4) };
        let lanes = self.lanes(layout, cache, SAMPLES)?;
        let pixels = self.viewport.pixels() as f64;
        Ok(Cached {
            views: layout.views,
            policy,
            entries,
            invocations_per_pixel: lanes.all as f64 / pixels,
            one_view_per_pixel: lanes.one as f64 / pixels,
            increase: lanes.all as f64 / lanes.one as f64 - 1.0,
        })
    }

    /// Shader lanes of all views in one pass, and of the one nearest to the middle alone, with a cache and
    /// samples of each view.
    ///
    /// # Errors
    /// When the cache cannot be built.
    pub fn lanes(
        &self,
        layout: Layout,
        shading_cache: CacheSpec,
        samples: u32,
    ) -> Result<ViewLanes, StudyError> {
        let spec = PipelineSpec { shading_cache, ..self.gpu.pipeline };
        let (rig, to) = (self.rig(&layout, samples)?, self.target(&spec));
        let draws = self.frame.draws(&self.scene)?;
        let mut gpu = Gpu::without_packets(to.spec)?;
        let counts = rig.one_pass(&draws, &to, &mut gpu)?.counts;
        let mut ran = Ran::of(&gpu.finish());
        let (one, of_one) = self.one_view(&rig, &layout, &draws, &to)?;
        ran += of_one;
        Ok(ViewLanes { all: counts[Event::PixelInvocations], one, ran })
    }

    /// Views of a kind on a camera line of a length, with and without separate tests of the regions of the lens.
    pub(super) fn regions(&self, views: &'static str, baseline: f64) -> Result<RegionTests, StudyError> {
        let length = baseline * self.focus();
        let layout = match views {
            "two eyes" => Layout::stereo(length, 0.4 * length),
            "seven lenses" => {
                Layout { views: 7, spacing: length / 6.0, aperture: 0.4 * length / 6.0, overlap: 0 }
            }
            _ => Layout::line(7, length, 0.1 * length),
        };
        let rig = self.rig(&layout, SAMPLES)?;
        let draws = self.frame.draws(&self.scene)?;
        let drawn = |lens_regions: bool| {
            let features = Features { lens_regions, ..self.gpu.pipeline.features };
            let spec = PipelineSpec { features, ..self.gpu.pipeline };
            rig.one_pass(&draws, &self.target(&spec), &mut Gpu::without_packets(&spec)?)
        };
        let (whole, each) = (drawn(false)?, drawn(true)?);
        let bits = |views: &Views| -> Vec<_> {
            views.images.concat().iter().map(|pixel| pixel.to_array().map(f32::to_bits)).collect()
        };
        let equal = bits(&whole) == bits(&each);
        Ok(RegionTests { views, baseline, whole: tests(&whole.counts), each: tests(&each.counts), equal })
    }

    /// The error of two views at the ends of a camera line, shaded for its middle.
    pub(super) fn angle(&self, baseline: f64) -> Result<Angle, StudyError> {
        let spacing = baseline * self.focus();
        let layout = Layout::stereo(spacing, (0.4 * spacing).min(0.02));
        let (rig, to) = (self.rig(&layout, SAMPLES)?, self.target(&self.gpu.pipeline));
        let error = |exponent| {
            let draws = self.frame.draws(&self.scene)?;
            let glosses: Vec<_> = draws.iter().map(|draw| Gloss { looks: draw.shader, exponent }).collect();
            let draws: Vec<_> =
                draws.iter().zip(&glosses).map(|(draw, shader)| Draw { shader, ..*draw }).collect();
            let found = rig.one_pass(&draws, &to, &mut Gpu::images_only(to.spec)?)?.images;
            let truth = rig.own_cameras(&draws, &to)?;
            let pixels = |images: &[Vec<Vec3>]| images.concat();
            Ok::<_, StudyError>(mean_square(&errors(&pixels(&found), &pixels(&truth))).sqrt())
        };
        let degrees = rig.degrees();
        Ok(Angle { baseline, degrees, rmse_matt: error(None)?, rmse_shiny: error(Some(EXPONENT))? })
    }
}

fn tests(counts: &Counts) -> TileTestCosts {
    // With screens every sample that is left is screened.
    let samples = counts[Event::SamplesScreened].max(counts[Event::SamplesTested]);
    TileTestCosts {
        tiles_culled: counts[Event::TilesCulledSides] + counts[Event::TilesCulledLens],
        tile_madds: counts[Event::TileMadds],
        samples,
        all_madds: [Event::TileMadds, Event::ScreenMadds, Event::SampleMadds]
            .iter()
            .map(|e| counts[*e])
            .sum(),
    }
}

/// A shader made independent of the direction to the viewer, with a highlight of its own on top where there is one.
struct Gloss<'a> {
    looks: &'a dyn Shader,
    /// Exponent of the highlight (Blinn 1977).
    exponent: Option<i32>,
}

/// From the scene towards its lamp.
const TOWARD: Vec3 = Vec3::new(0.36, 0.80, 0.48);

impl Shader for Gloss<'_> {
    fn texture(&self) -> Option<&Texture> {
        self.looks.texture()
    }

    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        let matt = self.looks.shade(lane, &ShadingPoint { to_camera: at.normal, ..*at }, texel);
        let half = (TOWARD + at.to_camera).normalize_or_zero();
        let glint = self.exponent.map_or(0.0, |exponent| at.normal.dot(half).max(0.0).powi(exponent));
        matt + Vec3::splat(glint).extend(0.0)
    }
}
