//! Figures 11, 14 and 17, which are images: points in space, glossy surfaces, and views of a stereo pair and of seven cameras.

use std::path::Path;

use glam::{Affine3A, Vec3};
use output::plot::{CaptionedImage, Images, Look};
use pipeline::{Camera, Cull, Draw, Geometry, Gpu, LensShape, RasterPass, SampleTable, Viewport};
use run::{GpuSpec, RunError};
use workloads::Overrides;
use workloads::job::{OptionSource, Request};
use workloads::lighting::Light;
use workloads::material::{Material, SurfaceShader};
use workloads::points::job::Rasterized;
use workloads::scene::Mesh;
use workloads::{catalog, shapes};

use crate::reproduce::Figure;

fn figure(
    name: &'static str,
    [title, subject]: [&str; 2],
    across: usize,
    images: &[CaptionedImage],
) -> Figure {
    let picture = Images { title, subject, across, images }.picture(&Look::default());
    Figure { name, picture }
}

/// The first frame of a workload.
fn drawn(
    name: &str,
    set: &[(&str, String)],
    overrides: &Overrides,
    caption: &str,
) -> Result<CaptionedImage, RunError> {
    let set = set.iter().map(|(option, value)| ((*option).to_owned(), value.clone())).collect();
    let (options, request) = (OptionSource { file: None, set }, Request { overrides, seed: 1 });
    let (_, job) = catalog::load(Path::new(name), &options, &request)?;
    let gpu = GpuSpec::load("reference")?;
    let mut on = Gpu::quiet(&gpu.pipeline).map_err(RunError::setting)?;
    let first = job.settings().frames.start;
    let image = job.frame(first, &mut on).map_err(RunError::setting)?.image;
    let size = [job.settings().width, job.settings().height];
    let pixels = image.iter().map(|color| color.to_array()).collect();
    Ok(CaptionedImage { size, pixels, caption: caption.to_owned() })
}

/// Size of the images of Figure 14, and samples of a pixel.
const GLOSSY: ((u32, u32), u32) = ((160, 90), 16);
/// Most samples of a texel, for the image that others are compared with.
const REFERENCE_SAMPLES: u32 = 256;

/// Figure 14: surfaces with maps of few and of many samples a texel, and with the most there can be.
pub(super) fn glossy(
    texels: u32,
    roughness: f64,
    index: f64,
    samples: (u32, u32),
) -> Result<Figure, RunError> {
    let overrides = Overrides { size: Some(GLOSSY.0), samples: Some(GLOSSY.1), ..Overrides::default() };
    let mut shown = Vec::new();
    for (effect, index) in [("reflection", None), ("refraction", Some(index))] {
        for samples in [samples.0, samples.1, REFERENCE_SAMPLES] {
            let mut set = vec![
                ("texels", texels.to_string()),
                ("roughness", format!("{roughness:?}")),
                ("map_samples", samples.to_string()),
            ];
            set.extend(index.map(|index| ("index", format!("{index:?}"))));
            shown.push(drawn("glossy", &set, &overrides, &format!("{effect}, {samples} samples a texel"))?);
        }
    }
    let subject =
        format!("maps of {texels} rows, lens of radius {roughness}; right: the most samples of a texel");
    Ok(figure("VI_fig14", ["Glossy reflection and refraction (Paper VI, Figure 14)", &subject], 3, &shown))
}

/// Views in one pass: how many, the scene, and the lenses.
pub(super) struct Line<'a> {
    pub scene: &'a str,
    pub frame: u32,
    pub views: u32,
    /// Distance of neighbouring views.
    pub spacing: f64,
    /// Radius of the lens of a view.
    pub aperture: f64,
    /// Steps of the line that a view covers; 0 for lenses of their own.
    pub overlap: u32,
    pub samples: u32,
    pub shutter: f64,
}

/// Width and height of a view of Figure 17.
const VIEW: (u32, u32) = (128, 72);

/// Figure 17: the views of a frame beside each other, at most four in a row.
pub(super) fn views(name: &'static str, line: &Line<'_>) -> Result<Figure, RunError> {
    let Line { scene, frame, views, spacing, aperture, overlap, samples, shutter } = line;
    let overrides = Overrides {
        size: Some(VIEW),
        samples: Some(*samples),
        shutter: Some(*shutter),
        frames: Some(*frame..*frame + 1),
        ..Overrides::default()
    };
    let set = [
        ("scene", (*scene).to_owned()),
        ("views", views.to_string()),
        ("spacing", format!("{spacing:?}")),
        ("aperture", format!("{aperture:?}")),
        ("overlap", overlap.to_string()),
        ("check_cache", "false".to_owned()),
    ];
    let all = drawn("multiview", &set, &overrides, "")?;
    let (width, whole) = (VIEW.0 as usize, all.size[0] as usize);
    let view = |number: usize| {
        let rows = all.pixels.chunks(whole);
        let pixels = rows.flat_map(|row| row[number * width..][..width].iter().copied()).collect();
        CaptionedImage { size: [VIEW.0, VIEW.1], pixels, caption: format!("view {}", number + 1) }
    };
    let shown: Vec<CaptionedImage> = (0..*views as usize).map(view).collect();
    let subject = format!(
        "{views} views of one pass, {spacing:.4} scene units apart, lenses of radius {aperture:.4}, {samples} samples a view, shutter {shutter}; \
         frame {frame} of scene {scene}"
    );
    let titles = ["Views with motion and defocus blur (Paper VI, Figure 17)", &subject];
    Ok(figure(name, titles, shown.len().min(4), &shown))
}

/// Width and height of the image of points in space.
const SPACE_PX: u32 = 320;
/// Distances r along a side of the part of the cube that is drawn.
const SIDE: f64 = 9.0;

/// Linear RGB of uncovered regions, blue as in the paper, and of points.
const REGION: Vec3 = Vec3::new(0.05, 0.20, 0.80);
const POINT: Vec3 = Vec3::new(0.75, 0.72, 0.66);

/// Meshes in one.
#[derive(Default)]
struct Shown {
    corners: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    colors: Vec<Vec3>,
}

impl Shown {
    fn add(&mut self, mesh: &Mesh, centre: Vec3, color: Vec3) {
        let first = self.corners.len() as u32;
        self.corners.extend(mesh.positions.iter().map(|corner| *corner + centre));
        self.triangles.extend(mesh.triangles.iter().map(|three| three.map(|corner| first + corner)));
        self.colors.extend(mesh.positions.iter().map(|_| color));
    }
}

/// Figure 11 in space: balls of half the least distance around the points before the last pass, so that they touch at most, and the
/// uncovered regions that it draws.
pub(super) fn balls_and_uncovered(darts: &Rasterized<3>, radius: f64) -> Result<Figure, RunError> {
    let side = (SIDE * radius).min(1.0);
    let is_inside = |point: &[f64; 3]| point.iter().all(|at| *at < side);
    let place = |point: [f64; 3]| Vec3::from(point.map(|at| (at / side) as f32 - 0.5));
    let ball = shapes::sphere(0.5 * radius / side, 12, 0);
    let points = darts.found.points.iter().filter(|point| is_inside(point) && !darts.is_in_uncovered(point));
    let points: Vec<_> = points.collect();
    let uncovered: Vec<_> = darts.uncovered.iter().filter(|region| is_inside(&region.low)).collect();
    let mut shown = Shown::default();
    points.iter().for_each(|point| shown.add(&ball, place(**point), POINT));
    for region in &uncovered {
        let cube = shapes::cuboid(Vec3::splat((region.side / side) as f32), 0);
        shown.add(&cube, place(region.low.map(|at| at + 0.5 * region.side)), REGION);
    }
    let Shown { corners, triangles, colors } = shown;
    let geometry = Geometry::new(&corners, &corners, &triangles).map_err(RunError::setting)?;
    let geometry = geometry.with_colors(&colors).map_err(RunError::setting)?;
    let light = Light { toward: Some(Vec3::new(0.3, 0.9, 0.4).normalize()), ..Light::default() };
    let shader = SurfaceShader::new(&Material::colored("ball", Vec3::ONE), &light).with_vertex_colors();
    let draws = [Draw::new(geometry, &shader, Cull::Back)];
    let gpu = GpuSpec::load("reference")?;
    let samples = SampleTable::low_discrepancy(8, 1, LensShape::Disk)?;
    let viewport = Viewport::new(SPACE_PX, SPACE_PX).ok_or_else(|| RunError::setting("no pixels"))?;
    let settings =
        pipeline::Settings { spec: &gpu.pipeline, viewport, samples: &samples, background: Vec3::ONE };
    let camera = corner_view().map_err(RunError::setting)?;
    let pass = RasterPass::new(&camera, &draws, &settings).named("points");
    let image = pass.uncounted().map_err(RunError::setting)?;
    let pixels = image.into_image().iter().map(|color| color.to_array()).collect();
    let caption = format!(
        "{} points and {} uncovered regions of a corner of the cube, {:.1} r along each side",
        points.len(),
        uncovered.len(),
        side / radius
    );
    let shown = [CaptionedImage { size: [SPACE_PX; 2], pixels, caption }];
    let subject = format!(
        "before the last of {} passes: balls of radius r/2 around the points, and in blue the uncovered regions that it draws; r = {radius}",
        darts.passes
    );
    Ok(figure(
        "VI_fig11_3d",
        ["Points and uncovered regions in space (Paper VI, Figure 11)", &subject],
        1,
        &shown,
    ))
}

/// A camera that sees three sides of the unit cube about the origin.
fn corner_view() -> Result<Camera, pipeline::CameraError> {
    let (eye, up) = (Vec3::new(2.0, 1.6, 2.4), Vec3::Y);
    let forward = -eye.normalize();
    let right = forward.cross(up).normalize();
    let up = right.cross(forward);
    // Camera space is x right, y up, z forward.
    let pose =
        Affine3A::from_mat3_translation(glam::Mat3::from_cols(right, up, forward).transpose(), Vec3::ZERO)
            * Affine3A::from_translation(-eye);
    Camera::new(pose, 0.26, 0.1)
}
