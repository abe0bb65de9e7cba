//! `quintile chart anchors`: rates of the model beside those that others measured on parts. GPU files of the
//! parts are in `sim/experiments/parts`; they were written from data sheets before the first rate was looked
//! at. The work is passes through the pipeline, timed at the level `stepped`.

mod published;

use std::sync::Arc;

use activity::{LineAccess, Packet, S_PER_PS, Unit};
use glam::{Affine3A, Vec2, Vec3, Vec4};
use output::OutputError;
use output::terminal::Progress;
use pipeline::sampling::Pattern;
use pipeline::{
    Attachment, Attachments, Binding, Blend, Camera, Clear, Cull, DepthState, Draw, DrawState, Format,
    Geometry, Gpu, Lane, RasterPass, SampleSpec, SampleTable, Settings, Shader, ShadingPoint, SurfaceId,
    SurfaceSpec, Target, Texture, Viewport, Wrap,
};
use published::{PUBLISHED, Published};
use run::{BIN_PS, GpuSpec, RunError};
use serde::Serialize;
use timing::{FrameClock, Level, Recorder};
use workloads::material::SurfaceShader;
use workloads::{Light, Material};

use super::quantiles;
use crate::study::table::{Sheet, TableBuilder, plain};
use crate::study::{Gallery, Study, StudyError, each};

/// Largest median and single error that are aimed at, percent.
const MEDIAN_PERCENT: f64 = 10.0;
const WORST_PERCENT: f64 = 30.0;

/// Effort.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct AnchorsEffort {
    /// Width of the images in pixels, and height of the lower one of two.
    pub size: [u32; 2],
}

/// A rate beside the published one.
#[derive(Clone, Debug, Serialize)]
pub struct AnchorRow {
    /// The part.
    pub part: &'static str,
    /// What was done.
    pub quantity: &'static str,
    /// Unit of both rates.
    pub unit: String,
    /// The published rate.
    pub measured: f64,
    /// The rate of the model at the level `stepped`.
    pub ours: f64,
    /// Relative error of ours.
    pub error_percent: f64,
    /// The unit that has most to do.
    pub limit: &'static str,
    /// Whether the GPU file has the published number, which then tests nothing.
    pub is_input: bool,
    /// Who published it.
    pub source: &'static str,
}

/// The whole chart.
#[derive(Clone, Debug, Serialize)]
pub struct AnchorsChart {
    /// Effort.
    pub effort: AnchorsEffort,
    /// Median of the errors of rates that are no input, without sign.
    pub median_percent: f64,
    /// The largest of them.
    pub worst_percent: f64,
    /// Worst first; inputs last.
    pub rows: Vec<AnchorRow>,
}

impl Study for AnchorsChart {
    const NAME: &'static str = "anchors";
    const ABOUT: &'static str = "Rates of fill, texels and triangles beside those measured on parts";
    const PICTURES: &'static [&'static str] = &[];
    const FILES: &'static [&'static str] = &["anchors.csv", "anchors.json"];

    type Effort = AnchorsEffort;
    const FULL: AnchorsEffort = AnchorsEffort { size: [1024, 1024] };
    const QUICK: AnchorsEffort = AnchorsEffort { size: [512, 512] };

    fn measure(effort: AnchorsEffort, _: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let row = |published: &_| AnchorRow::new(published, effort);
        let mut rows = each(&PUBLISHED, ("rates", progress), row)?;
        rows.sort_by(|a, b| {
            a.is_input.cmp(&b.is_input).then(b.error_percent.abs().total_cmp(&a.error_percent.abs()))
        });
        let tested = rows.iter().filter(|row| !row.is_input);
        let [median_percent, worst_percent] = {
            let error = quantiles(tested.map(|row| row.error_percent.abs()));
            [0.5, 1.0].map(error)
        };
        Ok(Self { effort, median_percent, worst_percent, rows })
    }

    fn draw(&self, _: &Gallery<'_>) -> Result<(), OutputError> {
        Ok(())
    }

    fn tables(&self) -> Vec<Sheet> {
        let verdict = |name, percent, bar| {
            let word = if percent <= bar { "met" } else { "missed" };
            format!("{name} {percent:.1} % (goal {bar} %: {word})")
        };
        let median = verdict("median", self.median_percent, MEDIAN_PERCENT);
        let worst = verdict("worst", self.worst_percent, WORST_PERCENT);
        let rows = TableBuilder::of(&self.rows)
            .column("part", "part", |row| row.part, plain)
            .column("quantity", "quantity", |row| row.quantity, plain)
            .column("unit", "unit", |row| row.unit.clone(), plain)
            .column("measured", "measured", |row| row.measured, plain)
            .column("ours", "ours", |row| row.ours, |rate| format!("{rate:.3}"))
            .column("error_percent", "error", |row| row.error_percent, |error| format!("{error:+.1} %"))
            .column("limit", "limited by", |row| row.limit, plain)
            .column(
                "is_input",
                "input",
                |row| row.is_input,
                |is_input| if is_input { "input" } else { "" }.to_owned(),
            )
            .column("source", "source", |row| row.source, plain)
            .after(format!("\nwithout inputs: {median}, {worst}\n"))
            .csv("anchors.csv");
        vec![rows.sheet()]
    }
}

impl AnchorRow {
    fn new(published: &Published, effort: AnchorsEffort) -> Result<Self, StudyError> {
        let Published { part, quantity, value, unit, work, is_input, source } = *published;
        let gpu = part.gpu()?;
        let rate = work.rate(&gpu, effort.size)?;
        let ours = unit.of(rate.per_s, gpu.core_hz);
        Ok(Self {
            part: part.name(),
            quantity,
            unit: unit.name(),
            measured: value,
            ours,
            error_percent: 100.0 * (ours / value - 1.0),
            limit: rate.limit.name(),
            is_input,
            source,
        })
    }
}

/// What is done as often as possible.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Work {
    /// Pixels of one colour, in all of these targets, replaced or blended.
    Fill { targets: &'static [Format], blend: Blend },
    /// Filtered fetches of a texture at a level of detail.
    Texels { lod: f32 },
    /// Fetches of stored depths.
    Depths,
    /// Triangles of a mesh with a texture, lit by a lamp and a sky or not.
    Triangles { lit: bool },
}

/// Fetches of a pixel, so many that they take longer than to store its colour.
const FETCHES: u32 = 8;
/// Side of the texture in texels, one for a pixel; it repeats.
const TEXTURE_PX: u32 = 256;
/// Side in pixels of a cell of the mesh, which has two triangles.
const CELL_PX: u32 = 4;
/// Depth of all surfaces: coordinates at it are pixels from the middle of the image.
const DEPTH: f32 = 1.0;
const NEAR: f32 = 0.25;
const MAX_BINS: usize = 4096;

/// A rate and what limits it.
#[derive(Clone, Copy, Debug)]
struct Rate {
    /// Of a second.
    pub per_s: f64,
    /// The unit with most to do.
    pub limit: Unit,
}

impl Work {
    /// Rate on a GPU: what an image twice as high adds in work over what it adds in time. Filling and
    /// draining the pipeline are not in it.
    pub fn rate(self, gpu: &GpuSpec, [width, height]: [u32; 2]) -> Result<Rate, StudyError> {
        let timed = |height| Stage::new(gpu, self, [width, height])?.timed();
        let (small, large) = (timed(height)?, timed(2 * height)?);
        Ok(Rate { per_s: (large.amount - small.amount) / (large.time_s - small.time_s), limit: large.limit })
    }
}

/// How much was done in the last pass of a frame, and in which time.
struct Timed {
    amount: f64,
    time_s: f64,
    limit: Unit,
}

/// An image on a GPU, and what is drawn on it.
struct Stage<'a> {
    gpu: &'a GpuSpec,
    work: Work,
    viewport: Viewport,
    camera: Camera,
    samples: SampleTable,
}

impl<'a> Stage<'a> {
    fn new(gpu: &'a GpuSpec, work: Work, [width, height]: [u32; 2]) -> Result<Self, StudyError> {
        let wrong = || StudyError::Pipeline(format!("an image of {width}x{height} pixels"));
        let viewport = Viewport::new(width, height).ok_or_else(wrong)?;
        let camera = Camera::new(Affine3A::IDENTITY, 0.5 * height as f32, NEAR);
        let centre = SampleSpec { pattern: Pattern::Multisample, ..SampleSpec::default() };
        let camera = camera.map_err(StudyError::pipeline)?;
        Ok(Self { gpu, work, viewport, camera, samples: SampleTable::new(&centre, 1, 1)? })
    }

    fn timed(&self) -> Result<Timed, StudyError> {
        let machine = self.gpu.machine().map_err(RunError::from)?;
        let mut clock = FrameClock::new(Level::Stepped, machine, Recorder::new(BIN_PS, MAX_BINS));
        let emit = |packet: &Packet, lines: &[LineAccess]| clock.push(packet, lines);
        let mut on = Gpu::new(&self.gpu.pipeline, emit)?;
        let amount = self.draw(&mut on)?;
        // What the caches hold at the end is as much for either image. Its write-back takes a time of its own, as its
        // rows lie in other banks, so the frame is not finished.
        drop(on);
        let timed = clock.finish().map_err(RunError::from)?;
        let ends: Vec<u64> = std::iter::once(0).chain(timed.passes.iter().map(|pass| pass.end_ps)).collect();
        let length_ps = ends.windows(2).last().map_or(0, |ends| ends[1] - ends[0]);
        let busy = |unit: &Unit| timed.passes.last().map(|pass| pass.busy_ps[*unit as usize]);
        let limit = Unit::ALL.into_iter().max_by_key(busy).unwrap_or(Unit::Command);
        Ok(Timed { amount, time_s: length_ps as f64 * S_PER_PS, limit })
    }

    /// Draws what is timed as the last pass. Returns how much of it was done.
    fn draw(&self, gpu: &mut Gpu<'_>) -> Result<f64, StudyError> {
        let pixels = f64::from(self.viewport.width()) * f64::from(self.viewport.height());
        match self.work {
            Work::Fill { targets, blend } => {
                self.fill(gpu, targets, blend)?;
                Ok(pixels)
            }
            Work::Texels { lod } => {
                let texture = texture()?;
                self.fetch(gpu, Binding::Texture(&texture), lod)?;
                Ok(pixels * f64::from(FETCHES))
            }
            Work::Depths => {
                let depths = self.surface(gpu, Format::D32);
                self.store_depths(gpu, depths)?;
                self.fetch(gpu, Binding::Surface(depths), 0.0)?;
                Ok(pixels * f64::from(FETCHES))
            }
            Work::Triangles { lit } => self.mesh(gpu, lit),
        }
    }

    fn fill(&self, gpu: &mut Gpu<'_>, targets: &[Format], blend: Blend) -> Result<(), StudyError> {
        let targets: Vec<SurfaceId> = targets.iter().map(|&format| self.surface(gpu, format)).collect();
        let cleared: Vec<_> = targets.iter().map(|&to| Attachment::cleared(to, Vec4::ZERO)).collect();
        let shader = Fetches { count: 0, lod: 0.0 };
        self.screen(gpu, &shader, &[], cleared, Blend::Replace)?;
        if blend != Blend::Replace {
            let loaded = targets.iter().map(|&to| Attachment::loaded(to)).collect();
            self.screen(gpu, &shader, &[], loaded, blend)?;
        }
        Ok(())
    }

    fn fetch(&self, gpu: &mut Gpu<'_>, from: Binding<'_>, lod: f32) -> Result<(), StudyError> {
        let to = self.surface(gpu, Format::Rgba8);
        let cleared = vec![Attachment::cleared(to, Vec4::ZERO)];
        self.screen(gpu, &Fetches { count: FETCHES, lod }, &[from], cleared, Blend::Replace)
    }

    fn store_depths(&self, gpu: &mut Gpu<'_>, depths: SurfaceId) -> Result<(), StudyError> {
        let corners = self.corners();
        let shader = Fetches { count: 0, lod: 0.0 };
        let draw = Draw::new(geometry(&corners, &[[0, 1, 2]])?, &shader, Cull::None);
        let depth = Some(Attachment::cleared(depths, Clear::default()));
        self.pass(gpu, draw, &Attachments { colours: Vec::new(), depth })
    }

    /// Draws a triangle over the whole image, without depths.
    fn screen(
        &self,
        gpu: &mut Gpu<'_>,
        shader: &dyn Shader,
        bindings: &[Binding<'_>],
        colours: Vec<Attachment<Vec4>>,
        blend: Blend,
    ) -> Result<(), StudyError> {
        let corners = self.corners();
        let state = DrawState { depth: DepthState::NONE, blend, ..DrawState::default() };
        let draw = Draw::new(geometry(&corners, &[[0, 1, 2]])?, shader, Cull::None);
        self.pass(gpu, draw.with_state(state).binding(bindings), &Attachments { colours, depth: None })
    }

    /// Draws the mesh. Returns its triangles. Depths are not stored.
    fn mesh(&self, gpu: &mut Gpu<'_>, lit: bool) -> Result<f64, StudyError> {
        let mesh = Mesh::over(self.viewport);
        let material = Material {
            texture: Some(Arc::new(texture()?)),
            unlit: !lit,
            ..Material::colored("mesh", Vec3::ONE)
        };
        let shader = SurfaceShader::new(&material, &Light::default());
        let geometry = geometry(&mesh.points, &mesh.triangles)?.with_uvs(&mesh.uvs);
        let geometry = geometry.and_then(|geometry| geometry.with_normals(&mesh.normals));
        let draw = Draw::new(geometry.map_err(StudyError::pipeline)?, &shader, Cull::None);
        let [colours, depths] = [Format::Rgba8, Format::D32].map(|format| self.surface(gpu, format));
        let targets = Attachments {
            colours: vec![Attachment::cleared(colours, Vec4::ZERO)],
            depth: Some(Attachment::cleared(depths, Clear::default()).dropped()),
        };
        self.pass(gpu, draw, &targets)?;
        Ok(mesh.triangles.len() as f64)
    }

    fn pass(&self, gpu: &mut Gpu<'_>, draw: Draw<'_>, targets: &Attachments) -> Result<(), StudyError> {
        let Self { viewport, ref samples, .. } = *self;
        let settings = Settings { spec: gpu.spec(), viewport, samples, background: Vec3::ZERO };
        let draws = [draw];
        let pass = RasterPass::new(&self.camera, &draws, &settings).onto(Target::Surfaces(targets));
        gpu.draw(&pass.without_image())?;
        Ok(())
    }

    fn surface(&self, gpu: &mut Gpu<'_>, format: Format) -> SurfaceId {
        gpu.create_surface(&SurfaceSpec::new("target", self.viewport, format))
    }

    /// Corners of a triangle over the whole image.
    fn corners(&self) -> [Vec3; 3] {
        let [x, y] = [self.viewport.width(), self.viewport.height()].map(|side| side as f32);
        [Vec3::new(-x, -y, DEPTH), Vec3::new(3.0 * x, -y, DEPTH), Vec3::new(-x, 3.0 * y, DEPTH)]
    }
}

fn geometry<'a>(points: &'a [Vec3], triangles: &'a [[u32; 3]]) -> Result<Geometry<'a>, StudyError> {
    Geometry::new(points, points, triangles).map_err(StudyError::pipeline)
}

fn texture() -> Result<Texture, StudyError> {
    let texels = vec![[200, 100, 50, 255]; (TEXTURE_PX * TEXTURE_PX) as usize];
    Texture::from_srgb8(TEXTURE_PX, TEXTURE_PX, texels, [Wrap::Repeat; 2]).map_err(StudyError::pipeline)
}

/// Half-transparent white, after so many fetches at the pixel from slot 0.
struct Fetches {
    count: u32,
    lod: f32,
}

impl Shader for Fetches {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        let uv = Vec2::from(at.pixel.map(|place| (place as f32 + 0.5) / TEXTURE_PX as f32));
        for _ in 0..self.count {
            lane.fetch(0, uv, self.lod);
        }
        Vec4::new(1.0, 1.0, 1.0, 0.5)
    }

    fn outputs(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> pipeline::Outputs {
        [self.shade(lane, at, texel); 4]
    }
}

/// A mesh of square cells over an image, with a texel for a pixel.
struct Mesh {
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    fn over(viewport: Viewport) -> Self {
        let size = [viewport.width(), viewport.height()];
        let [across, down] = size.map(|side| side / CELL_PX);
        let corners = || (0..=down).flat_map(|y| (0..=across).map(move |x| [x, y]));
        let at = |corner: [u32; 2]| Vec2::from(corner.map(|cell| (cell * CELL_PX) as f32));
        let middle = 0.5 * Vec2::from(size.map(|side| side as f32));
        let cells = (0..down).flat_map(|y| (0..across).map(move |x| y * (across + 1) + x));
        let below = across + 1;
        Self {
            points: corners().map(|corner| (at(corner) - middle).extend(DEPTH)).collect(),
            normals: corners().map(|_| Vec3::NEG_Z).collect(),
            uvs: corners().map(|corner| at(corner) / TEXTURE_PX as f32).collect(),
            triangles: cells
                .flat_map(|c| [[c, c + 1, c + below], [c + 1, c + below + 1, c + below]])
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::published::Part;
    use super::*;

    fn ours(part: Part, quantity: &str) -> f64 {
        let is_it = |published: &&Published| published.part == part && published.quantity == quantity;
        let published = PUBLISHED.iter().find(is_it).unwrap();
        AnchorRow::new(published, AnchorsChart::QUICK).unwrap().ours
    }

    /// The published numbers are in the test, so that neither side can drift.
    #[test]
    fn rates_are_near_those_of_the_parts() {
        for (part, quantity, measured, within) in [
            (Part::Hd7970, "blended fill, 4 x 16 bits", 13.33, 0.3),
            (Part::Gtx580, "fill, 4 x 8 bits", 23.3, 0.3),
            (Part::Sgx543Mp2, "texels", 890.1, 0.3),
        ] {
            let ours = ours(part, quantity);
            assert!((ours / measured - 1.0_f64).abs() < within, "{quantity}: {ours} of {measured}");
        }
    }

    /// The multiprocessors limit the card to 24.7 Gpixel/s; its ROPs could do 37.1.
    #[test]
    fn multiprocessors_limit_a_card_with_more_rops() {
        let filled = ours(Part::Gtx580, "fill, 4 x 8 bits");
        assert!(filled < 24.71, "{filled}");
    }
}
