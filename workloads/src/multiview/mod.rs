//! Stereo and multi-view images with motion and defocus in one pass (thesis, Paper VI, section 8).
//!
//! The camera line is a wide lens, of which each view samples a part. One pass renders all samples. A shaded
//! value serves all views, the whole lens and the shutter, through the shading cache.
//!
//! - [`Layout`]: views on the camera line, as two small lenses or with overlapping box filters.
//! - [`MultiviewRig`]: all views in [one pass](MultiviewRig::one_pass), and for comparison [view by
//!   view](MultiviewRig::view_by_view), by [accumulation](MultiviewRig::accumulated), and with [separate
//!   cameras](MultiviewRig::own_cameras), the ground truth of shading.
//! - [`Panel`]: interlacing for a display behind lenticular lenses.
//! - [`job()`]: the workload.

mod layout;
mod rig;

use activity::Event;
use pipeline::{CacheSpec, Draw, Gpu, PipelineSpec, Viewport};
use serde::{Deserialize, Serialize};
use warnings::{Code, Warning};

use crate::error::LoadError;
use crate::job::{
    Drawn, DrawsScene, Fact, Flag, Flags, Job, JobError, JobOptions, JobRequest, Need, OptionSource, facts,
};
use crate::scene::{Frame, Overrides, Scene, SceneSettings};

pub use layout::{Layout, Panel};
pub use rig::{MultiviewRig, ViewTarget, Views};

/// Arrangement of the views in the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Show {
    /// Side by side, the left eye's view first, for parallel viewing. The views share the width.
    #[default]
    SideBySide,
    /// Interlaced for a lenticular panel.
    Interlaced,
    /// One view.
    One,
}

/// Options of the job. The samples per pixel are those of each view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MultiViewOptions {
    /// A built-in scene or a file.
    pub scene: String,
    /// Number of views.
    pub views: u32,
    /// Distance between neighbouring views, scene units.
    pub spacing: f64,
    /// Radius of a view's aperture, scene units.
    pub aperture: f64,
    /// Steps of the camera line that a view's box filter covers; 0 for separate small lenses.
    pub overlap: u32,
    /// Depth of zero disparity, scene units; by default that of the scene's lens.
    pub focus: Option<f32>,
    /// Display of the views.
    pub show: Show,
    /// Panel for interlaced views.
    pub panel: Panel,
    /// Whether to render view by view instead of in one pass: the same images at another cost.
    pub view_by_view: bool,
    /// Whether to render the frame once more with an infinite cache, to measure the cache's misses.
    pub check_cache: bool,
}

impl JobOptions for MultiViewOptions {
    const NEEDS: &'static [Need] = &[Need::new("panel", "show", &["interlaced"])];
}

impl Default for MultiViewOptions {
    fn default() -> Self {
        let Layout { views, spacing, aperture, overlap } = Layout::default();
        Self {
            scene: "default".to_owned(),
            views,
            spacing,
            aperture,
            overlap,
            focus: None,
            show: Show::default(),
            panel: Panel::default(),
            view_by_view: false,
            check_cache: true,
        }
    }
}

impl MultiViewOptions {
    /// Layout of the views.
    pub fn layout(&self) -> Layout {
        let Self { views, spacing, aperture, overlap, .. } = *self;
        Layout { views, spacing, aperture, overlap }
    }
}

/// The job with its scene and layout.
pub struct MultiView {
    scene: Scene,
    options: MultiViewOptions,
    settings: SceneSettings,
    view: Viewport,
    seed: u64,
}

impl MultiView {
    /// Makes the views of the scene of `options`, with settings changed by `overrides`. The default size is
    /// 320x180 pixels per view.
    ///
    /// # Errors
    /// [`LoadError`] for a scene that cannot be loaded, or an invalid option.
    pub fn new(options: MultiViewOptions, overrides: &Overrides, seed: u64) -> Result<Self, LoadError> {
        // The views need a depth of zero disparity even if the scene has no lens.
        let options = MultiViewOptions { focus: options.focus.or(overrides.focus), ..options };
        let (size, focus) = (overrides.size.or(Some((320, 180))), None);
        let scene =
            crate::load(&options.scene)?.with_overrides(&Overrides { size, focus, ..overrides.clone() })?;
        options.panel.check()?;
        options.layout().check()?;
        let settings = scene.settings().clone();
        let across = if options.show == Show::SideBySide { options.views.max(1) } else { 1 };
        settings.check()?;
        let width = settings.width;
        let settings = SceneSettings { width: width.saturating_mul(across), ..settings };
        settings.check().map_err(|_| LoadError::Setting {
            setting: "size",
            message: format!("{across} views of {width} pixels side by side are wider than an image can be: make each smaller, or show them otherwise"),
        })?;
        let settings = SceneSettings { focus: options.focus.or(settings.focus), ..settings };
        let view = Viewport::new(settings.width / across, settings.height);
        let refused = |message: &str| LoadError::Setting { setting: "size", message: message.to_owned() };
        let view = view.ok_or_else(|| refused(crate::job::IMAGE_SIZE))?;
        let job = Self { scene, options, settings, view, seed };
        let first =
            job.scene.frame(job.settings.frames.start).map_err(|error| refused(&error.to_string()))?;
        job.rig(&first)?;
        Ok(job)
    }

    fn rig(&self, frame: &Frame) -> Result<MultiviewRig, LoadError> {
        let lens = frame.camera.lens().map(|lens| lens.focus());
        let focus = self.options.focus.or(lens).ok_or_else(|| {
            let message = "the scene has no lens and so no depth at which views agree: give that depth with --focus or `--set focus=`";
            LoadError::Setting { setting: "focus", message: message.to_owned() }
        })?;
        MultiviewRig::new(&frame.camera, focus, &self.options.layout(), self.settings.samples, self.seed)
    }

    fn shown(&self, views: &Views) -> Vec<glam::Vec3> {
        let width = self.view.width();
        match self.options.show {
            Show::One => views.images[0].clone(),
            Show::Interlaced => self.options.panel.interlace(&views.images, width),
            Show::SideBySide => {
                let rows = (0..self.view.height() as usize).map(|row| row * width as usize);
                rows.flat_map(|from| {
                    views.images.iter().flat_map(move |image| &image[from..from + width as usize]).copied()
                })
                .collect()
            }
        }
    }

    /// First pixel of each view in the image; empty if the image has the size of a view.
    fn places(&self) -> Vec<[u32; 2]> {
        match self.options.show {
            Show::SideBySide => (0..self.options.views).map(|view| [view * self.view.width(), 0]).collect(),
            Show::Interlaced | Show::One => Vec::new(),
        }
    }

    /// Warns about view-dependent materials: they are shaded for the middle of the line only.
    fn angle_warning(&self, rig: &MultiviewRig) -> Option<Warning> {
        let angle = rig.degrees();
        let shiny = self.scene.materials().iter().any(|material| !material.unlit);
        (shiny && angle > MAX_VIEW_ANGLE_DEG).then(|| {
            let message = format!(
                "views see the same point from up to {angle:.0} degrees apart, and shading is that of their middle: highlights do \
                 not move with the viewer"
            );
            Warning::new(Code::ViewDependentShading, message)
        })
    }
}

/// Angle between views, in degrees, above which highlights are visibly misplaced.
pub const MAX_VIEW_ANGLE_DEG: f64 = 6.0;
/// A cache that holds everything.
const INFINITE_CACHE: CacheSpec = CacheSpec::lru(1 << 22, 16);
/// Shader executions, relative to those with an infinite cache, above which the cache is too small.
pub const MAX_RUNS_OVER_INFINITE_CACHE: f64 = 1.25;

impl DrawsScene for MultiView {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn settings(&self) -> &SceneSettings {
        &self.settings
    }

    fn draw_frame(&self, frame: &Frame, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let draws = frame.draws(&self.scene)?;
        let rig = self.rig(frame).map_err(JobError::setting)?;
        let (places, background) = (self.places(), self.scene.background());
        let to = ViewTarget { viewport: self.view, spec: gpu.spec(), background, places: &places };
        let views = if self.options.view_by_view {
            rig.view_by_view(&draws, &to, gpu)?
        } else {
            rig.one_pass(&draws, &to, gpu)?
        };
        let mut facts = Fact::all([
            (fact::pixel_invocations, views.counts[Event::PixelInvocations] as f64),
            (fact::invocations_per_pixel_and_view, per_pixel(&views, self.view)),
        ]);
        let mut warnings: Vec<_> = self.angle_warning(&rig).into_iter().collect();
        if self.options.check_cache {
            let value = runs_over_infinite_cache(&rig, &draws, &to, &views)?;
            facts.extend(Fact::all([(fact::invocations_over_those_with_all_in_cache, value)]));
            // Views that are drawn one by one share nothing, whatever the size of the cache.
            warnings.extend(cache_warning(value, gpu.spec()).filter(|_| !self.options.view_by_view));
        }
        let (image, moving) = (self.shown(&views), frame.is_moving());
        Ok(Drawn { image, moving, lens: true, facts, warnings })
    }
}

/// Shader executions of `views`, relative to one pass with an infinite cache.
fn runs_over_infinite_cache(
    rig: &MultiviewRig,
    draws: &[Draw<'_>],
    to: &ViewTarget<'_>,
    views: &Views,
) -> Result<f64, JobError> {
    let infinite = PipelineSpec { shading_cache: INFINITE_CACHE, ..*to.spec };
    let to = ViewTarget { spec: &infinite, ..*to };
    let least =
        rig.one_pass(draws, &to, &mut Gpu::without_packets(&infinite)?)?.counts[Event::PixelInvocations];
    Ok(views.counts[Event::PixelInvocations] as f64 / least.max(1) as f64)
}

fn per_pixel(views: &Views, viewport: Viewport) -> f64 {
    views.counts[Event::PixelInvocations] as f64 / (viewport.pixels() * views.images.len()) as f64
}

fn cache_warning(ratio: f64, spec: &PipelineSpec) -> Option<Warning> {
    (ratio > MAX_RUNS_OVER_INFINITE_CACHE).then(|| {
        let message = format!(
            "the shader runs {ratio:.2} times as often as with a cache that holds everything: {} entries are fewer than are in use at \
             a time; a larger cache, or fewer views and samples",
            spec.shading_cache.entries
        );
        Warning::new(Code::ShadingCacheSmall, message)
    })
}

facts! {
    pixel_invocations "count" "invocations of the pixel shader for all views"
    invocations_per_pixel_and_view "per pixel" "the same, mean over the pixels of all views"
    invocations_over_those_with_all_in_cache "ratio" "the same, over those of one pass with an infinite cache"
}

/// Run options in use. The camera's lens is the one that contains all views.
pub(crate) const FLAGS: Flags = Flags {
    uses: &[Flag::Size, Flag::Samples, Flag::Shutter, Flag::Focus, Flag::Clip, Flag::Camera],
    instead: &[(Flag::Lens, "aperture")],
};

/// Makes the job from its options.
///
/// # Errors
/// As [`MultiView::new`].
pub fn job(options: &OptionSource, request: &JobRequest<'_>) -> Result<Box<dyn Job>, LoadError> {
    Ok(Box::new(MultiView::new(options.read()?, request.overrides, request.seed)?))
}
