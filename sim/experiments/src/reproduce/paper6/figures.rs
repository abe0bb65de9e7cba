//! Figures of Paper VI: two objects that overlap (6), one beam by each method and light in water (7), and
//! images of points (11), glossy surfaces (14) and views (17).

use std::path::Path;

use glam::{Affine3A, DVec3, Vec3, dvec3};
use output::plot::{CaptionedImage, HeatMapPlot, HeatScale, HeatTile, Images, PlotStyle};
use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, View};
use pipeline::{Camera, Cull, Draw, Geometry, Gpu, LensShape, RasterPass, SampleTable, Viewport};
use run::{GpuSpec, RunError};
use workloads::caustics::generator::Ocean;
use workloads::caustics::{Beam, BeamMethod, Eye, Floor, LightPicture, LightQuantity, draw};
use workloads::job::{JobRequest, OptionSource};
use workloads::material::Light as SceneLight;
use workloads::material::{Material, SurfaceShader};
use workloads::points::job::Rasterized;
use workloads::scene::Mesh;
use workloads::{Overrides, catalog, shapes};

use crate::chart::caustics::measure;
use crate::reproduce::Figure;
use crate::reproduce::settings::Form;

fn figure(
    name: &'static str,
    [title, subject]: [&str; 2],
    across: usize,
    images: &[CaptionedImage],
) -> Figure {
    let picture = Images { title, subject, across, images }.picture(&PlotStyle::default());
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
    let (options, request) = (OptionSource { file: None, set }, JobRequest { overrides, seed: 1 });
    let (_, job) = catalog::load(Path::new(name), &options, &request)?;
    let gpu = GpuSpec::load("reference")?;
    let mut on = Gpu::without_packets(&gpu.pipeline)?;
    let first = job.settings().frames.start;
    let image = job.frame(first, &mut on)?.image;
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

/// Figure 11 in space: balls of half the least distance around the points before the last pass, so that they
/// touch at most, and the uncovered regions that it draws.
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
    let geometry = Geometry::new(&corners, &corners, &triangles)?;
    let geometry = geometry.with_colors(&colors)?;
    let light = SceneLight { toward: Some(Vec3::new(0.3, 0.9, 0.4).normalize()), ..SceneLight::default() };
    let shader = SurfaceShader::new(&Material::colored("ball", Vec3::ONE), &light).with_vertex_colors();
    let draws = [Draw::new(geometry, &shader, Cull::Back)];
    let gpu = GpuSpec::load("reference")?;
    let samples = SampleTable::low_discrepancy(8, 1, LensShape::Disk)?;
    let viewport = Viewport::new(SPACE_PX, SPACE_PX).ok_or_else(|| RunError::setting("no pixels"))?;
    let settings =
        pipeline::Settings { spec: &gpu.pipeline, viewport, samples: &samples, background: Vec3::ONE };
    let camera = corner_view()?;
    let pass = RasterPass::new(&camera, &draws, &settings).named("points");
    let image = pass.uncounted()?;
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

/// A triangle when the shutter opens and when it closes.
pub(super) type Ends = [[[f64; 3]; 3]; 2];

/// Time and depth of an object in a pixel; `None` where it never is.
type Boxes = Vec<Option<[[f64; 2]; 2]>>;

/// The views of the paper: their axis, and their name.
const VIEWS: [(usize, &str); 3] = [(2, "x and y"), (1, "z and x"), (0, "y and z")];

/// Red where the times of both overlap, blue where their depths do, dark grey where one of them is.
pub(super) fn overlaps(name: &str, objects: [&[Ends]; 2], pixels: u32) -> Figure {
    let image = |(axis, axes): (usize, &str)| {
        let grid = grid(&objects, axis, pixels);
        let boxes = objects.map(|object| boxes(object, axis, &grid));
        let colors: Vec<[f32; 3]> = boxes[0].iter().zip(&boxes[1]).map(|(a, b)| color([*a, *b])).collect();
        let both = colors.iter().filter(|color| color[0] == 1.0 && color[2] == 1.0).count();
        let caption = format!("{axes}: {both} pixels in time and depth");
        CaptionedImage { size: [pixels; 2], pixels: colors, caption }
    };
    let images = VIEWS.map(image);
    let subject = format!(
        "{name}, {pixels} pixels across; red where their times overlap, blue where their depths do, purple both; a pixel has a box of time and \
         depth for each object"
    );
    let title = "Overlap in time and depth (Paper VI, Figure 6)";
    let picture =
        Images { title, subject: &subject, across: 3, images: &images }.picture(&PlotStyle::default());
    Figure { name: "VI_fig6", picture }
}

/// Square pixels over all that both sweep.
fn grid(objects: &[&[Ends]; 2], axis: usize, pixels: u32) -> Grid {
    let points = || objects.iter().flat_map(|object| object.iter()).flatten().flatten();
    let range = |along: usize| {
        let of = points().map(|point| point[along]);
        of.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
    };
    let [across, down] = [range((axis + 1) % 3), range((axis + 2) % 3)];
    let side = (across[1] - across[0]).max(down[1] - down[0]) / f64::from(pixels);
    let middle = |[low, high]: [f64; 2]| 0.5 * (low + high) - 0.5 * side * f64::from(pixels);
    Grid { origin: [middle(across), middle(down)], tile: [side; 2], columns: pixels, rows: pixels }
}

fn boxes(object: &[Ends], axis: usize, grid: &Grid) -> Boxes {
    let rasterizer = Rasterizer::new(View::orthographic());
    let mut boxes: Boxes = vec![None; (grid.columns * grid.rows) as usize];
    let turn = |p: [f64; 3]| [p[(axis + 1) % 3], p[(axis + 2) % 3], p[axis]];
    for [open, close] in object.iter().map(|ends| ends.map(|end| end.map(turn))) {
        let Some(triangle) = MovingTriangle::new(open, close) else { continue };
        rasterizer.rasterize(&triangle, grid, |[column, row], touch| {
            let pixel = &mut boxes[(row * grid.columns + column) as usize];
            let known = pixel.unwrap_or([touch.t, touch.z]);
            let hull = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
            *pixel = Some([hull(known[0], touch.t), hull(known[1], touch.z)]);
        });
    }
    boxes
}

fn color(boxes: [Option<[[f64; 2]; 2]>; 2]) -> [f32; 3] {
    let meet = |a: [f64; 2], b: [f64; 2]| f32::from(u8::from(a[0] <= b[1] && b[0] <= a[1]));
    match boxes {
        [Some(a), Some(b)] => [meet(a[0], b[0]), 0.0, meet(a[1], b[1])],
        [None, None] => [0.0; 3],
        _ => [0.05; 3],
    }
}

/// Pixels across and down of the view of one method.
const PANEL_PX: [u32; 2] = [120, 160];

/// Figure 7: which pixels each method shades for one warped beam, and in which of them there is light.
pub(super) fn warped() -> Result<Figure, RunError> {
    let eye = beside().ok_or_else(|| RunError::setting("a view without extent"))?;
    let pictures =
        BeamMethod::ALL.map(|method| draw(&[twisted()], &eye, method, Some(LightQuantity::Volume)));
    let tiles: Vec<HeatTile> =
        (0..).zip(&pictures).flat_map(|(panel, picture)| areas_of(panel, picture)).collect();
    let areas = BeamMethod::ALL.iter().zip(&pictures);
    let areas: Vec<String> = areas
        .map(|(method, picture)| {
            format!("{} {}", method.name(), picture.runs.iter().filter(|runs| **runs > 0).count())
        })
        .collect();
    let map = HeatMapPlot {
        title: "The pixels of one warped beam (Paper VI, Figure 7)",
        subject: &format!("from left to right, with pixels that are shaded: {}", areas.join(", ")),
        label: "",
        size: [4 * PANEL_PX[0], PANEL_PX[1]],
        tiles: &tiles,
        shading: HeatScale::Classes(&["not shaded", "shaded without light", "shaded with light"]),
        brightness: &[],
    };
    Ok(Figure { name: "VI_fig7", picture: map.picture(&PlotStyle::default()) })
}

/// The view of the beam.
fn beside() -> Option<Eye> {
    Eye::new([dvec3(1.2, 1.6, 8.0), dvec3(0.2, -1.0, 0.0), DVec3::Y], 2.2, PANEL_PX)
}

/// Runs of equal pixels in a row: 0 not shaded, 1 wasted, 2 with light.
fn areas_of(panel: u32, picture: &LightPicture) -> Vec<HeatTile> {
    let width = PANEL_PX[0];
    let kinds = picture.runs.iter().zip(&picture.light);
    let kinds: Vec<u32> = kinds.map(|(runs, light)| u32::from(*runs > 0) + u32::from(*light > 0.0)).collect();
    let mut tiles = Vec::new();
    for (y, row) in (0..).zip(kinds.chunks(width as usize)) {
        let mut x = panel * width;
        for equal in row.chunk_by(|a, b| a == b) {
            let size = [equal.len() as u32, 1];
            tiles.push(HeatTile { origin: [x, y], size, value: f64::from(equal[0]) });
            x += size[0];
        }
    }
    tiles
}

/// A beam that turns by a radian and narrows on its way.
fn twisted() -> Beam {
    let open = [dvec3(-0.8, 0.3, -0.5), dvec3(0.9, 0.4, -0.4), dvec3(0.0, 0.2, 0.9)];
    let (sin, cos) = libm::sincos(1.0);
    let close = open
        .map(|p| dvec3(0.8 * (cos * p.x + sin * p.z) + 0.2, p.y - 2.6, 0.8 * (cos * p.z - sin * p.x) + 0.1));
    Beam { open, close, flux_w: 1.0 }
}

/// The light of the ocean in the water from the side, and on its floor from above.
pub(super) fn light(form: Form) -> Result<[Figure; 2], RunError> {
    let (cells, [width, height]) = if form == Form::Quick { (48, [128, 72]) } else { (128, [256, 144]) };
    let water = Ocean { overshoot: 0.02, ..measure::water(cells, measure::SLOPE) };
    let beams = water.beams(0.0);
    let aside = measure::aside([width, height])?;
    let above = measure::above(height)?;
    let floor = LightQuantity::Floor(Floor { height_m: -measure::DEPTH_M });
    let image = |name, what: &str, label: &str, eye: &Eye, light| {
        let picture = draw(&beams, eye, BeamMethod::Moving, Some(light));
        let subject =
            format!("{} beams as moving triangles, waves of slope {}; {what}", beams.len(), measure::SLOPE);
        let size = [eye.viewport().width(), eye.viewport().height()];
        let title = "Caustics under waves (Paper VI, section 4)";
        let tiles = &tiles(&picture.light, size[0]);
        // Next to a focus light has no bound.
        let shading = HeatScale::Clipped;
        let map = HeatMapPlot { title, subject: &subject, label, size, tiles, shading, brightness: &[] };
        Figure { name, picture: map.picture(&PlotStyle::default()) }
    };
    Ok([
        image("VI_caustics_volume", "in the water, from the side", "W/m", &aside, LightQuantity::Volume),
        image("VI_caustics_floor", "on the floor, from above", "W/m2", &above, floor),
    ])
}

/// Pixels of light in rows of `width`.
fn tiles(light: &[f64], width: u32) -> Vec<HeatTile> {
    let tile = |(place, light): (u32, &f64)| HeatTile {
        origin: [place % width, place / width],
        size: [1, 1],
        value: *light,
    };
    (0..).zip(light).map(tile).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit square that moves, as two triangles.
    fn square(from: [f64; 3], to: [f64; 3]) -> Vec<Ends> {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let at = |[x, y, z]: [f64; 3], corner: usize| [x + corners[corner][0], y + corners[corner][1], z];
        [[0, 1, 2], [0, 2, 3]].map(|three: [usize; 3]| [from, to].map(|end| three.map(|k| at(end, k)))).into()
    }

    /// Pixels of each colour along z: overlap of time alone, of depth alone, and of both.
    fn counts(objects: [&[Ends]; 2]) -> [usize; 3] {
        let grid = grid(&objects, 2, 32);
        let [a, b] = objects.map(|object| boxes(object, 2, &grid));
        let colors: Vec<[f32; 3]> = a.iter().zip(&b).map(|(a, b)| color([*a, *b])).collect();
        [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]
            .map(|wanted| colors.iter().filter(|color| **color == wanted).count())
    }

    #[test]
    fn time_and_depth_are_distinguished() {
        let still = square([0.0; 3], [0.0; 3]);
        // In front at all times; through the square at depth 0; and there only at its end, after the first has left.
        let in_front = square([0.0, 0.0, 3.0], [0.0, 0.0, 3.0]);
        let [time, depth, both] = counts([&still, &in_front]);
        assert!(time > 500 && depth == 0 && both == 0, "{time} {depth} {both}");
        let [time, depth, both] = counts([&still, &square([-3.0, 0.0, 0.0], [0.0; 3])]);
        assert!(time == 0 && depth == 0 && both > 50, "{time} {depth} {both}");
        let leaves = square([0.0; 3], [9.0, 0.0, 0.0]);
        let [time, depth, both] = counts([&leaves, &square([-9.0, 0.0, 0.0], [0.0; 3])]);
        assert!(time == 0 && depth > 0 && both == 0, "{time} {depth} {both}");
    }

    #[test]
    fn every_body_has_more_pixels_than_the_beam() {
        let eye = Eye::new([dvec3(1.2, 1.6, 8.0), dvec3(0.0, -1.0, 0.0), DVec3::Y], 1.7, PANEL_PX).unwrap();
        let area = |method| draw(&[twisted()], &eye, method, None).total_runs();
        let [moving, refined, hull, prism] = BeamMethod::ALL.map(area);
        assert!(moving < refined && refined <= hull && hull < prism, "{moving} {refined} {hull} {prism}");
    }
}
