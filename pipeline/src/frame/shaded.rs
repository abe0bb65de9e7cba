//! Shaded triangles: shading at cells and at samples.

use std::cell::RefCell;

use glam::{Vec2, Vec3, Vec4};

use super::Shading;
use super::cells::reference;
use super::pass::{Draw, Pass};
use crate::geometry::{Clip, Geometry, Viewport};
use crate::sample_test::covers;
use crate::sampling::{Sample, TileSamples};
use crate::setup::Corner;
use crate::shader::{Lane, Lines, Outputs, Program, Shader, ShadingPoint};
use crate::shading;
use crate::shading::{QUAD_LANES, QuadAccess, REFERENCE_TIME, cells_of, quad_weights, weights_at};
use crate::texture::{Footprint, Sampler};

/// Work of the lanes of a quad.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct QuadWork {
    /// Operations of each lane.
    pub ops: u32,
    /// Fetches of all lanes.
    pub fetches: u32,
    /// Lanes at the centroid of their samples.
    pub centroids: u32,
}

impl QuadWork {
    fn fetching(self, more: u32) -> Self {
        Self { fetches: self.fetches + more, ..self }
    }
}

/// Attributes of the vertices, those that there are.
struct Attributes {
    /// Positions at [`REFERENCE_TIME`].
    middle: [Vec3; 3],
    normals: Option<[Vec3; 3]>,
    uvs: Option<[Vec2; 3]>,
    colors: Option<[Vec3; 3]>,
}

impl Attributes {
    fn new(geometry: &Geometry<'_>, vertices: [usize; 3]) -> Self {
        fn of<T: Copy>(values: &[T], vertices: [usize; 3]) -> Option<[T; 3]> {
            (!values.is_empty()).then(|| vertices.map(|vertex| values[vertex]))
        }
        Self {
            middle: vertices.map(|v| (geometry.open()[v] + geometry.close()[v]) * 0.5),
            normals: of(geometry.normals(), vertices),
            uvs: of(geometry.uvs(), vertices),
            colors: of(geometry.colors(), vertices),
        }
    }
}

/// One triangle as a surface for shading.
pub(super) struct ShadedTriangle<'a> {
    pass: &'a Pass<'a>,
    draw: usize,
    /// Number in the draw.
    triangle: u32,
    vertices: [usize; 3],
    corners: [Corner; 3],
    reference: [[f32; 3]; 3],
    sampler: Option<Sampler<'a>>,
    attributes: Attributes,
    /// Corners as the sample test sees them, if pixels are shaded at centroids.
    covering: Option<[Corner; 3]>,
}

impl<'a> ShadedTriangle<'a> {
    pub fn new(pass: &'a Pass<'a>, triangle: u32) -> Self {
        let (draw, vertices) = pass.corners(triangle);
        let number = pass.locate(triangle).1 as u32;
        let corners = vertices.map(|vertex| Corner::new(&pass.vertices[draw][vertex]));
        let reference = reference(pass, &corners);
        let texture = pass.draws[draw].shader.texture();
        let textured = texture.filter(|_| !pass.draws[draw].geometry.uvs().is_empty());
        let sampler = textured
            .zip(pass.addresses.textures[draw])
            .map(|(texture, address)| Sampler::new(texture, address));
        let covering = covering(pass, draw, triangle);
        let attributes = Attributes::new(&pass.draws[draw].geometry, vertices);
        Self { pass, draw, triangle: number, vertices, corners, reference, sampler, attributes, covering }
    }

    /// Barycentric weights of the point at which a cell is shaded: its middle, or the centroid of the covered
    /// samples.
    fn weights_of(&self, cell: [i32; 2]) -> [f32; 3] {
        match self.centroid(cell) {
            Some(at) => weights_at(&self.reference, at),
            None => shading::cell_weights(&self.reference, cell, self.pass.origin),
        }
    }

    /// Image coordinate of the mean of the samples of a pixel that the triangle covers; `None` where it
    /// covers the middle or none of them, and in draws without centroids.
    fn centroid(&self, cell: [i32; 2]) -> Option<[f32; 2]> {
        let (corners, settings) = (self.covering.as_ref()?, self.pass.settings);
        let (viewport, source) = (settings.viewport, settings.samples);
        let [x, y] = [u32::try_from(cell[0]).ok()?, u32::try_from(cell[1]).ok()?];
        if x >= viewport.width() || y >= viewport.height() {
            return None;
        }
        let first = [Viewport::edge(x, viewport.width()), Viewport::edge(y, viewport.height())];
        let (shear, near) = (&self.pass.projection.shear, self.pass.projection.near);
        let covers = |s: &Sample| {
            let rays = [shear.ray(0, first[0] + s.x, s.u), shear.ray(1, first[1] + s.y, s.v)];
            covers(corners, rays, s.t, near)
        };
        if covers(&Sample { x: 0.5, y: 0.5, t: REFERENCE_TIME, ..Sample::default() }) {
            return None;
        }
        let mut samples = vec![Sample::default(); source.per_pixel() as usize];
        source.pixel_into(x, y, &mut samples);
        samples.retain(covers);
        let sum: Vec2 = samples.iter().map(|s| Vec2::new(s.x, s.y)).sum();
        let mean = sum / samples.len() as f32;
        (!samples.is_empty()).then(|| [first[0] + mean.x, first[1] + mean.y])
    }

    /// Linear RGB radiance and opacity of a cell, a function of the triangle and the cell alone.
    pub fn shade(&self, lane: &Lane, cell: [i32; 2]) -> Vec4 {
        let (at, texel) = self.of_cell(cell);
        self.shader().shade(lane, &at, texel)
    }

    /// The same for all targets.
    pub fn outputs(&self, lane: &Lane, cell: [i32; 2]) -> Outputs {
        let (at, texel) = self.of_cell(cell);
        self.shader().outputs(lane, &at, texel)
    }

    /// The same for the requested cells of a quad, by lane.
    pub fn shade_quad(&self, lane: &Lane, access: &QuadAccess) -> [Vec4; 4] {
        let weights = self.weights_in(access.quad);
        let footprint = self.sampler.map(|sampler| self.footprint(&sampler, &weights));
        let mut colours = [Vec4::ZERO; 4];
        for (index, cell) in cells_of(access.quad).into_iter().enumerate() {
            if access.lanes >> index & 1 == 1 {
                let weights =
                    self.centroid(cell).map_or(weights[index], |at| weights_at(&self.reference, at));
                let (at, texel) = self.of_weights(cell, weights, footprint.as_ref());
                colours[index] = self.shader().shade(lane, &at, texel);
            }
        }
        colours
    }

    /// Weights of the middles of the cells of a quad, by lane.
    fn weights_in(&self, quad: [i32; 2]) -> [[f32; 3]; 4] {
        quad_weights(&self.reference, quad, self.pass.origin)
    }

    /// Shader input and texel of a cell.
    fn of_cell(&self, cell: [i32; 2]) -> (ShadingPoint, Vec4) {
        let of_quad = |sampler: Sampler<'_>| self.footprint(&sampler, &self.weights_in(cell.map(|c| c >> 1)));
        self.of_weights(cell, self.weights_of(cell), self.sampler.map(of_quad).as_ref())
    }

    /// Shader input and texel of a cell that is shaded at the point with the given weights, in a quad with
    /// this footprint.
    fn of_weights(
        &self,
        cell: [i32; 2],
        weights: [f32; 3],
        footprint: Option<&Footprint>,
    ) -> (ShadingPoint, Vec4) {
        let texture = self.sampler.as_ref().zip(footprint);
        let texel =
            texture.map_or(Vec4::ONE, |(sampler, footprint)| sampler.sample(self.uv(weights), footprint));
        (ShadingPoint { pixel: cell, ..self.point(weights, self.attributes.middle) }, texel)
    }

    /// A lane for its shader.
    pub fn lane(&self) -> Lane<'a> {
        Lane::reading(&self.pass.bound[self.draw])
    }

    /// Shader input at the point with the given weights at time `t`.
    fn point_at(&self, weights: [f32; 3], t: f32) -> ShadingPoint {
        let geometry = &self.pass.draws[self.draw].geometry;
        let ends = self.vertices.map(|v| (geometry.open()[v], geometry.close()[v]));
        self.point(weights, ends.map(|(open, close)| open + t * (close - open)))
    }

    fn shader(&self) -> &'a dyn Shader {
        self.pass.draws[self.draw].shader
    }

    fn program(&self) -> Program {
        self.pass.programs[self.draw]
    }

    /// Whether shading at samples needs their positions to be counted.
    pub fn needs_samples(&self) -> bool {
        self.sampler.is_some() || self.program().pixel_ops.is_none() || self.reads_bindings()
    }

    fn reads_bindings(&self) -> bool {
        !self.pass.bound[self.draw].is_empty()
    }

    /// Work of shading the four cells of a quad; `line` gets every line that they read through the texture cache.
    pub fn quad(&self, quad: [i32; 2], mut line: impl FnMut(u64)) -> QuadWork {
        let of_cell = |cell, lane: &Lane| self.run_all(lane, self.of_cell(cell));
        let fetches = self.fetch(quad, &mut line);
        let centroids =
            cells_of(quad).into_iter().filter(|&cell| self.centroid(cell).is_some()).count() as u32;
        QuadWork { centroids, ..self.work(cells_of(quad).into_iter(), of_cell, line).fetching(fetches) }
    }

    fn run_all(&self, lane: &Lane, (at, texel): (ShadingPoint, Vec4)) {
        if self.pass.colours.len() > 1 {
            self.shader().outputs(lane, &at, texel);
        } else {
            self.shader().shade(lane, &at, texel);
        }
    }

    /// Work of lanes that `run` runs. Each takes the operations of the longest, as lanes of a quad run in step.
    fn work<L>(
        &self,
        lanes: impl Iterator<Item = L>,
        run: impl Fn(L, &Lane),
        line: impl FnMut(u64),
    ) -> QuadWork {
        if let Some(ops) = self.program().pixel_ops.filter(|_| !self.reads_bindings()) {
            return QuadWork { ops, ..QuadWork::default() };
        }
        let lines = RefCell::<Lines>::default();
        let work = lanes.fold(QuadWork::default(), |work, own| {
            let lane = Lane::noting(&self.pass.bound[self.draw], &lines);
            run(own, &lane);
            let (ops, fetches) = (work.ops.max(lane.ops()), work.fetches + lane.fetches());
            QuadWork { ops, fetches, ..work }
        });
        lines.into_inner().accessed().for_each(line);
        work
    }

    /// Bilinear fetches of the texture for the four cells of a quad; `line` gets every memory line they read.
    fn fetch(&self, quad: [i32; 2], mut line: impl FnMut(u64)) -> u32 {
        let Some(sampler) = self.sampler else { return 0 };
        let weights = self.weights_in(quad);
        let footprint = self.footprint(&sampler, &weights);
        for (cell, weights) in cells_of(quad).into_iter().zip(weights) {
            let weights = self.centroid(cell).map_or(weights, |at| weights_at(&self.reference, at));
            sampler.lines(self.uv(weights), &footprint, &mut line);
        }
        4 * Sampler::fetches(&footprint)
    }

    /// Footprint of a quad, from the differences between its cells.
    fn footprint(&self, sampler: &Sampler<'_>, weights: &[[f32; 3]; 4]) -> Footprint {
        let corner = self.uv(weights[0]);
        sampler.footprint(self.uv(weights[1]) - corner, self.uv(weights[2]) - corner)
    }

    fn uv(&self, weights: [f32; 3]) -> Vec2 {
        self.attributes.uvs.map_or(Vec2::ZERO, |uvs| (0..3).map(|k| uvs[k] * weights[k]).sum())
    }

    /// Cells on a border extrapolate, so the colour is clamped to its range.
    fn color(&self, weights: [f32; 3]) -> Vec3 {
        self.attributes.colors.map_or(Vec3::ONE, |colors| {
            (0..3).map(|k| colors[k] * weights[k]).sum::<Vec3>().clamp(Vec3::ZERO, Vec3::ONE)
        })
    }

    fn point(&self, weights: [f32; 3], corners: [Vec3; 3]) -> ShadingPoint {
        let position: Vec3 = (0..3).map(|k| corners[k] * weights[k]).sum();
        let flat = || (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        let mean = |normals: [Vec3; 3]| (0..3).map(|k| normals[k] * weights[k]).sum::<Vec3>();
        let smooth = self.attributes.normals.map(mean).and_then(Vec3::try_normalize).unwrap_or_else(flat);
        let eye = self.pass.eye;
        let to_camera = (eye.truncate() - position * eye.w).normalize_or_zero();
        let normal = if smooth.dot(to_camera) < 0.0 { -smooth } else { smooth };
        let (uv, color) = (self.uv(weights), self.color(weights));
        let triangle = self.triangle;
        ShadingPoint { position, normal, to_camera, uv, color, triangle, ..ShadingPoint::FACING }
    }
}

/// Corners that decide which samples of a pixel a triangle covers, if it is shaded at their centroid.
fn covering(pass: &Pass<'_>, draw: usize, triangle: u32) -> Option<[Corner; 3]> {
    let Draw { state, geometry, .. } = &pass.draws[draw];
    let is_whole = [pass.clip, geometry.clip()].iter().all(|clip| *clip == Clip::NONE);
    if !state.centroid || pass.lens || !is_whole || pass.shading == Shading::PerSample {
        return None;
    }
    let (corners, moving) = pass.moving_corners(triangle);
    (!moving).then_some(corners)
}

/// A triangle as seen by one sample.
pub(super) struct SampleView {
    /// The vertices at the sample's time, moved by the part of the lens shear that is independent of depth.
    /// In an orthographic view they are homogeneous points as seen from the sample.
    vertices: [[f32; 3]; 3],
    /// Image position of the sample, including the other part of the lens shear.
    at: [f32; 2],
    t: f32,
    pixel: [i32; 2],
    /// Index in the pixel.
    sample: u32,
}

impl SampleView {
    /// View of the sample in `slot` of a tile, with its pixel and its index there.
    pub fn of_slot(
        corners: &[Corner; 3],
        samples: &TileSamples,
        slot: usize,
        (pixel, sample): ([i32; 2], u32),
    ) -> Self {
        let rays = [0, 1].map(|axis| [samples.slope[axis][slot], samples.lens[axis][slot]]);
        let view = Self::new(corners, rays, samples.t[slot], samples.parallel);
        Self { pixel, sample, ..view }
    }

    /// View of a sample of pixel (`px`, `py`).
    fn of_sample(corners: &[Corner; 3], pass: &Pass<'_>, [px, py]: [u32; 2], s: &Sample) -> Self {
        let (shear, viewport) = (&pass.projection.shear, pass.settings.viewport);
        let x = Viewport::edge(px, viewport.width()) + s.x;
        let y = Viewport::edge(py, viewport.height()) + s.y;
        Self::new(corners, [shear.ray(0, x, s.u), shear.ray(1, y, s.v)], s.t, shear.parallel)
    }

    /// Each axis has a slope and a base ([`crate::geometry::Shear::ray`]).
    fn new(corners: &[Corner; 3], [across, down]: [[f32; 2]; 2], t: f32, parallel: bool) -> Self {
        let vertices = corners.map(|corner| {
            let [x, y, w] = corner.at(t);
            let [x, y] = [x - across[1], y - down[1]];
            if parallel { [x - across[0] * w, y - down[0] * w, 1.0] } else { [x, y, w] }
        });
        let at = if parallel { [0.0; 2] } else { [across[0], down[0]] };
        Self { vertices, at, t, pixel: [0; 2], sample: 0 }
    }

    /// Barycentric weights of the point seen the given number of pixels to the right and below, at the same
    /// lens position and time.
    fn weights(&self, right: f32, below: f32) -> [f32; 3] {
        weights_at(&self.vertices, [self.at[0] + right, self.at[1] + below])
    }
}

impl ShadedTriangle<'_> {
    /// Linear RGB radiance and opacity at the sample's own point.
    pub fn shade_at(&self, lane: &Lane, view: &SampleView) -> Vec4 {
        let (at, texel) = self.of_view(view);
        self.shader().shade(lane, &at, texel)
    }

    /// The same for all targets.
    pub fn outputs_at(&self, lane: &Lane, view: &SampleView) -> Outputs {
        let (at, texel) = self.of_view(view);
        self.shader().outputs(lane, &at, texel)
    }

    /// Shader input and texel at the sample's own point.
    fn of_view(&self, view: &SampleView) -> (ShadingPoint, Vec4) {
        let weights = view.weights(0.0, 0.0);
        let texel = self.sampler.map_or(Vec4::ONE, |sampler| {
            sampler.sample(self.uv(weights), &self.footprint_at(&sampler, view))
        });
        let (pixel, sample) = (view.pixel, view.sample);
        (ShadingPoint { pixel, sample, ..self.point_at(weights, view.t) }, texel)
    }

    /// Work of the four lanes of a quad of pixels at one sample index; `line` gets every line that they read
    /// through the texture cache. `samples` has the samples of each pixel of the quad. A helper lane uses the
    /// sample of its own pixel.
    pub fn quad_at(
        &self,
        access: &QuadAccess,
        samples: &[Vec<Sample>; 4],
        mut line: impl FnMut(u64),
    ) -> QuadWork {
        let fetches = self.fetch_at(access, samples, &mut line);
        let views = self.views_of(access, samples);
        let of_view = |view: SampleView, lane: &Lane| self.run_all(lane, self.of_view(&view));
        self.work(views, of_view, line).fetching(fetches)
    }

    /// Bilinear fetches of the texture; arguments as for [`Self::quad_at`].
    fn fetch_at(&self, access: &QuadAccess, samples: &[Vec<Sample>; 4], mut line: impl FnMut(u64)) -> u32 {
        let Some(sampler) = self.sampler else { return 0 };
        self.views_of(access, samples).fold(0, |fetches, view| {
            let footprint = self.footprint_at(&sampler, &view);
            sampler.lines(self.uv(view.weights(0.0, 0.0)), &footprint, &mut line);
            fetches + Sampler::fetches(&footprint)
        })
    }

    /// Views of the four lanes of a quad.
    fn views_of(&self, access: &QuadAccess, samples: &[Vec<Sample>; 4]) -> impl Iterator<Item = SampleView> {
        QUAD_LANES.into_iter().zip(samples).map(|(offset, of_pixel)| {
            let pixel = [0, 1].map(|axis| (2 * access.quad[axis] + offset[axis]) as u32);
            let view =
                SampleView::of_sample(&self.corners, self.pass, pixel, &of_pixel[access.sample as usize]);
            SampleView { pixel: pixel.map(|part| part as i32), sample: u32::from(access.sample), ..view }
        })
    }

    /// Footprint of a pixel around the sample's point.
    fn footprint_at(&self, sampler: &Sampler<'_>, view: &SampleView) -> Footprint {
        let uv = |right, below| -> Vec2 { self.uv(view.weights(right, below)) };
        let here = uv(0.0, 0.0);
        sampler.footprint(uv(1.0, 0.0) - here, uv(0.0, 1.0) - here)
    }
}
