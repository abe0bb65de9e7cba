//! VI-15: depth intervals by moving planes against those by vertices (Appendix A), in both modes, over what
//! the tile test leaves.

use glam::{Affine3A, Vec3};
use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, Touch, View};
use pipeline::depth::{Bounder, DepthBound};
use pipeline::geometry::Projection;
use pipeline::random::{mix, unit};
use pipeline::setup::Triangle;
use pipeline::{
    Camera, Draw, Features, Geometry, Gpu, LensShape, MovingVertex, RasterPass, SampleTable, Settings,
    Target, Viewport,
};
use rayon::prelude::*;
use run::{GpuSpec, RunError};
use workloads::stress::{Size, StressScene, brute_force, set_up_all};
use workloads::visibility::Unshaded;

use super::settings::{Depths, Mode, Planes, Triangles};
use super::{Task, catalogue};
use crate::reproduce::report::line;
use crate::reproduce::row::{Band, Cases, ClaimRow, numbers, ran};
use crate::reproduce::settings::Form;
use crate::reproduce::{Done, Figure};
use crate::stress::measure::TileAndCamera;
use crate::study::Ran;

/// Widths of depth intervals in tiles, over those of the vertices.
#[derive(Clone, Debug, Default)]
struct Widths {
    /// Sums over tiles of triangles whose facing does not change, and of those whose does: by the planes that
    /// are judged, by those at the ends of the tile's time, and without any plane, by the vertices within
    /// that time.
    sums: [[f64; 3]; 2],
    tiles: [u64; 2],
    /// Tiles, or places, with a depth outside.
    violations: u64,
    /// Places, or samples, that were looked at.
    places: u64,
    triangles: u64,
    /// The width by planes over that by vertices, of each tile.
    ratios: [Vec<f64>; 2],
}

impl Widths {
    /// Widths of a tile by the planes that are judged, by local ones, and by the vertices within the tile's
    /// time, with that by vertices over the whole shutter.
    fn add(&mut self, turns: bool, vertices: f64, widths: [f64; 3]) {
        let class = usize::from(turns);
        for (sum, width) in self.sums[class].iter_mut().zip(widths) {
            *sum += width / vertices;
        }
        self.tiles[class] += 1;
        self.ratios[class].push(widths[0] / vertices);
    }

    fn and(mut self, other: Self) -> Self {
        for class in 0..2 {
            for which in 0..3 {
                self.sums[class][which] += other.sums[class][which];
            }
            self.tiles[class] += other.tiles[class];
        }
        self.violations += other.violations;
        self.places += other.places;
        self.triangles += other.triangles;
        for (ratios, more) in self.ratios.iter_mut().zip(other.ratios) {
            ratios.extend(more);
        }
        self
    }

    /// The mean over all tiles, over those where the facing changes, and over the others.
    fn means(&self, which: usize) -> [f64; 3] {
        let [steady, turning] = [0, 1].map(|class| (self.sums[class][which], self.tiles[class] as f64));
        [(steady.0 + turning.0) / (steady.1 + turning.1), turning.0 / turning.1, steady.0 / steady.1]
    }

    /// Whether planes gain on the null, which has none, and most where the facing changes.
    fn holds(&self) -> bool {
        let [all, turning, steady] = self.over_null();
        self.violations == 0 && all < 1.0 && turning < steady
    }

    /// Below 1 where the facing change is where planes gain most.
    fn number(&self) -> f64 {
        let [_, turning, steady] = self.over_null();
        turning / steady
    }

    /// Without any plane: the means by the vertices within the tile's time, over those of the whole shutter.
    fn null(&self) -> [f64; 3] {
        self.means(2)
    }

    /// Gain of planes beyond that, without the gain by time: over all tiles, where the facing changes, and elsewhere.
    fn over_null(&self) -> [f64; 3] {
        let (planes, null) = (self.means(0), self.null());
        [0, 1, 2].map(|class| planes[class] / null[class])
    }

    fn text(&self, what: &str) -> String {
        let ([all, turning, steady], null) = (self.means(0), self.null());
        format!(
            "{what}: {all:.3} of the vertices' width, {turning:.3} in {} tiles where the facing changes and {steady:.3} in {} where it does \
             not, {} violations (null, vertices within the tile's time: {:.3}, {:.3} and {:.3})",
            self.tiles[1], self.tiles[0], self.violations, null[0], null[1], null[2]
        )
    }
}

/// Whether planes are narrower than the null, which has none: the vertices within the tile's own time.
#[derive(Default)]
struct AgainstNull {
    /// How many cases there are.
    cases: usize,
    /// In how many the planes are narrower where the facing changes, and elsewhere.
    narrower: [usize; 2],
    /// In how many they gain more on the null where the facing changes than elsewhere.
    turning_more: usize,
    /// Least and greatest width over the null's, where the facing changes and elsewhere.
    ranges: [[f64; 2]; 2],
}

impl AgainstNull {
    fn add(&mut self, widths: &Widths) {
        let [_, turning, steady] = widths.over_null();
        for (class, over) in [turning, steady].into_iter().enumerate() {
            let [low, high] = if self.cases == 0 { [over; 2] } else { self.ranges[class] };
            self.ranges[class] = [low.min(over), high.max(over)];
            self.narrower[class] += usize::from(over < 1.0);
        }
        self.turning_more += usize::from(turning < steady);
        self.cases += 1;
    }

    fn text(&self) -> String {
        let Self { cases, narrower, turning_more, ranges: [turning, steady] } = self;
        format!(
            "against the null, vertices within the tile's own time and no plane, planes are narrower in {} of {cases} cases where the facing \
             changes ({:.3} to {:.3} of it) and in {} of {cases} elsewhere ({:.3} to {:.3}), and gain more where the facing changes in \
             {turning_more}",
            narrower[0], turning[0], turning[1], narrower[1], steady[0], steady[1]
        )
    }
}

/// All widths of the row, by mode, triangles and size of tiles.
#[derive(Default)]
struct AllWidths {
    described: Vec<String>,
    /// By the planes at the ends of the tile's own time, in standard mode with the tiles given.
    locals: Vec<String>,
    total: Widths,
    against_null: AgainstNull,
    /// Of the first widths in standard mode with the tiles given.
    figure: Option<Figure>,
}

impl AllWidths {
    fn measure(all: &Scenes<'_>, row: &Depths, form: Form) -> Result<(Self, Band), RunError> {
        let (mut tried, mut found) = (Cases::new(OF, VARIED), Self::default());
        for &mode in row.mode.all(form) {
            let sides = match mode {
                Mode::Standard => row.tile_px.all(form).to_vec(),
                Mode::Conservative => vec![*row.conservative_tile_px.get(form)],
            };
            for &triangles in row.triangles.all(form) {
                let name = triangles_name(triangles);
                let mut at = Vec::new();
                for &side in &sides {
                    let widths = all.measure(mode, triangles, side)?;
                    found.add(&format!("{}, {name}, tiles of {side} px", mode_name(mode)), &widths);
                    at.push((side, widths.number(), widths.holds()));
                    if mode == Mode::Standard && side == *row.tile_px.get(form) {
                        found.locals.push(format!("{:.3} ({name})", widths.means(1)[0]));
                        found.figure.get_or_insert_with(|| cumulative(&widths));
                    }
                }
                tried.along(&format!("tile_px ({}, {name})", mode_name(mode)), at);
            }
        }
        let full = row.triangles.values() * (row.tile_px.values() + row.mode.values() - 1);
        Ok((found, tried.band(full)?))
    }

    fn add(&mut self, what: &str, widths: &Widths) {
        self.described.push(widths.text(what));
        self.against_null.add(widths);
        let Widths { violations, places, triangles, tiles, .. } = widths;
        self.total.violations += violations;
        self.total.places += places;
        self.total.triangles += triangles;
        self.total.tiles[0] += tiles[0] + tiles[1];
    }
}

/// VI-15.
pub(super) fn tighter(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_15);
    let (row, form) = (with.settings, with.form);
    let all = Scenes::new(row, form)?;
    let (widths, band) = AllWidths::measure(&all, row, form)?;
    let AllWidths { described, locals, total, against_null, figure } = widths;
    let ours = format!(
        "{}; by the planes at the ends of the tile's own time, in standard mode: {}",
        described.join("; "),
        locals.join(", ")
    );
    let facts = numbers([
        ("least_turning_over_steady", band.min),
        ("most_turning_over_steady", band.max),
        ("violations", total.violations as f64),
        ("cases", against_null.cases as f64),
        ("cases_narrower_than_null_turning", against_null.narrower[0] as f64),
        ("cases_narrower_than_null_steady", against_null.narrower[1] as f64),
        ("least_over_null_turning", against_null.ranges[0][0]),
        ("most_over_null_turning", against_null.ranges[0][1]),
        ("least_over_null_steady", against_null.ranges[1][0]),
        ("most_over_null_steady", against_null.ranges[1][1]),
    ]);
    let mut ran = ran(&all.drawn()?);
    ran.extend(numbers([
        ("triangles_on_the_host", total.triangles as f64),
        ("tiles_on_the_host", total.tiles[0] as f64),
        ("depths_checked_on_the_host", total.places as f64),
    ]));
    let figures = figure.into_iter().collect();
    let made = with.banded(&row.about, ours, band);
    let note = format!("{}; {}", made.note, against_null.text());
    Ok(Done { row: ClaimRow { numbers: facts, ran, note, ..made }, figures })
}

const OF: &str = "width over that without planes where the facing changes, over the same elsewhere";
const VARIED: &str = "mode and triangles jointly, in standard mode with tile_px";

const fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::Standard => "standard mode",
        Mode::Conservative => "conservative mode",
    }
}

const fn triangles_name(triangles: Triangles) -> &'static str {
    match triangles {
        Triangles::Catalogue => "failure catalogue",
        Triangles::Random => "random triangles",
    }
}

/// All triangles that are measured.
struct Scenes<'a> {
    row: &'a Depths,
    form: Form,
    catalogue: Vec<StressScene>,
    random: StressScene,
}

impl<'a> Scenes<'a> {
    fn new(row: &'a Depths, form: Form) -> Result<Self, RunError> {
        let (side_px, of_each) = (*row.side_px.get(form), *row.of_each_scene.get(form));
        let size = Size { side_px, triangles: of_each as u32 };
        let catalogue = catalogue(size, *row.values_of_each_family.get(form), *row.seed.get(form))?;
        let random = random(*row.random_triangles.get(form), side_px, *row.seed.get(form))?;
        Ok(Self { row, form, catalogue, random })
    }

    /// What the modelled hardware draws of them, each scene for its depths. The intervals are measured on the host.
    fn drawn(&self) -> Result<Ran, RunError> {
        let spec = GpuSpec::load("reference")?.pipeline;
        let one = |scene: &StressScene| -> Result<Ran, RunError> {
            let StressScene { camera, viewport, samples, .. } = scene;
            let draws = [scene.draw(&Unshaded)?];
            let settings = Settings { spec: &spec, viewport: *viewport, samples, background: Vec3::ZERO };
            let mut gpu = Gpu::without_packets(&spec)?;
            let pass = RasterPass::new(camera, &draws, &settings).onto(Target::Depth);
            gpu.draw(&pass)?;
            Ok(Ran::of(&gpu.finish()))
        };
        self.catalogue.par_iter().chain([&self.random]).map(one).sum()
    }

    /// Every triangle alone.
    fn measure(&self, mode: Mode, triangles: Triangles, side_px: u32) -> Result<Widths, RunError> {
        let (scenes, most) = match triangles {
            Triangles::Catalogue => (&self.catalogue[..], *self.row.of_each_scene.get(self.form)),
            Triangles::Random => (std::slice::from_ref(&self.random), usize::MAX),
        };
        let each: Vec<(&StressScene, &[u32; 3])> = scenes
            .iter()
            .flat_map(|scene| scene.triangles.iter().take(most).map(move |corners| (scene, corners)))
            .collect();
        let (planes, places) = (*self.row.planes.get(self.form), *self.row.points.get(self.form));
        let one =
            |(number, (scene, corners)): (usize, &(&StressScene, &[u32; 3]))| -> Result<Widths, RunError> {
                let alone = Alone::new(scene, corners)?;
                Ok(alone.map_or_else(Widths::default, |alone| match mode {
                    Mode::Standard => alone.standard(side_px, planes),
                    Mode::Conservative => alone.conservative(side_px, places, number as u64),
                }))
            };
        // In order, so that sums are the same for any number of threads.
        let widths: Vec<Widths> = each.par_iter().enumerate().map(one).collect::<Result<_, RunError>>()?;
        Ok(widths.into_iter().fold(Widths::default(), Widths::and))
    }
}

/// Triangles through a pinhole: of every two one has both ends anywhere, the other drifts and wobbles a little.
fn random(count: u32, side_px: u32, seed: u64) -> Result<StressScene, RunError> {
    let camera = Camera::new(Affine3A::IDENTITY, 1.0, NEAR)?;
    let viewport = Viewport::new(side_px, side_px)
        .ok_or_else(|| RunError::setting(format!("VI-15: {}", workloads::job::IMAGE_SIZE)))?;
    let samples = SampleTable::low_discrepancy(4, seed, LensShape::Disk)?;
    let (mut open, mut close) = (Vec::new(), Vec::new());
    for number in 0..count {
        let uniform = |n: u64, [low, high]: [f32; 2]| {
            low + (high - low) * unit(mix(mix(seed ^ u64::from(number) << 16) ^ n)) as f32
        };
        // A place on the image, from -1 to 1, and a depth.
        let place =
            |n: u64| [uniform(n, [-1.0, 1.0]), uniform(n + 1, [-1.0, 1.0]), uniform(n + 2, [1.0, 8.0])];
        let world = |[x, y, w]: [f32; 3]| Vec3::new(x * w, y * w, w);
        let drift = [uniform(30, [-0.75, 0.75]), uniform(31, [-0.75, 0.75]), uniform(32, [-0.5, 0.5])];
        for corner in 0..3 {
            let (from, to) = (place(3 * corner), place(9 + 3 * corner));
            let drifted = [0, 1, 2].map(|axis| from[axis] + drift[axis] + 0.05 * (to[axis] - from[axis]));
            open.push(world(from));
            close.push(world(if number % 2 == 0 { to } else { drifted }));
        }
    }
    let triangles = (0..count).map(|n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
    Ok(StressScene { camera, viewport, samples, open, close, triangles })
}

/// The near depth of random triangles.
const NEAR: f32 = 0.25;

/// One triangle of a scene.
struct Alone<'a> {
    scene: &'a StressScene,
    corners: &'a [u32; 3],
    projection: Projection,
    triangle: Triangle,
    vertices: [MovingVertex; 3],
    turns: bool,
}

impl<'a> Alone<'a> {
    /// `None` where set-up drops it.
    fn new(scene: &'a StressScene, corners: &'a [u32; 3]) -> Result<Option<Self>, RunError> {
        let projection = Projection::new(&scene.camera, scene.viewport);
        let vertices = corners.map(|n| projection.vertex(scene.open[n as usize], scene.close[n as usize]));
        let triangle = set_up_all(&scene.camera, &[draw(scene, corners)?], scene.viewport).next();
        Ok(triangle.map(|triangle| Self {
            scene,
            corners,
            projection,
            triangle,
            vertices,
            turns: turns(&vertices),
        }))
    }

    fn near(&self) -> f64 {
        f64::from(self.projection.near)
    }

    /// Depths by the vertices at both ends of the shutter, in front of the near depth.
    fn by_vertices(&self) -> [f64; 2] {
        let [low, high] = self.vertices_within([0.0, 1.0]);
        [low.max(self.near()), high]
    }

    /// Depths by the vertices at both ends of a time.
    fn vertices_within(&self, times: [f64; 2]) -> [f64; 2] {
        let depths = self.vertices.iter().flat_map(|vertex| {
            let [open, close] = [vertex.open[2], vertex.close[2]].map(f64::from);
            times.map(|t| (1.0 - t) * open + t * close)
        });
        depths.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], w| [low.min(w), high.max(w)])
    }

    fn width(&self, [low, high]: [f64; 2]) -> f64 {
        (high - low.max(self.near())).max(0.0)
    }

    /// Tiles that a sample sees it in, over the box of lens and time that all tile tests leave.
    fn standard(&self, side_px: u32, planes: Planes) -> Widths {
        let mut widths = Widths { triangles: 1, ..Widths::default() };
        let Ok(draw) = draw(self.scene, self.corners) else { return widths };
        let seen = brute_force(&self.scene.camera, &[draw], self.scene.viewport, &self.scene.samples);
        let judged = match planes {
            Planes::Shutter => DepthBound::Planes,
            Planes::Tile => DepthBound::LocalPlanes,
        };
        let bounders = [judged, DepthBound::LocalPlanes, DepthBound::VerticesInTime]
            .map(|bound| Bounder::new(&self.triangle, &self.projection.shear, bound));
        let vertices = self.width(self.by_vertices());
        let across = self.scene.viewport.width();
        let starts = || (0..across).step_by(side_px as usize);
        for (y, x) in starts().flat_map(|y| starts().map(move |x| (y, x))) {
            let (range, count) = self.seen_in(&seen, [x, y], side_px);
            widths.places += count;
            if count == 0 {
                continue;
            }
            let place = TileAndCamera::new(
                self.scene.viewport,
                self.projection.shear,
                self.projection.near,
                [x, y],
                side_px,
            );
            let Some(within) = place.bound(&Features::ALL, &self.triangle) else {
                widths.violations += 1;
                continue;
            };
            let bounds = bounders.each_ref().map(|bounder| bounder.over(&place.tile, &within).map(f64::from));
            let outside = |[low, high]: &[f64; 2]| range[0] < *low || range[1] > *high;
            widths.violations += u64::from(bounds.iter().any(outside));
            if vertices > 0.0 {
                widths.add(self.turns, vertices, bounds.map(|bound| self.width(bound)));
            }
        }
        widths
    }

    /// Nearest and farthest depth in a tile, and how many samples see the triangle there.
    fn seen_in(&self, seen: &[(u32, u32)], [x, y]: [u32; 2], side_px: u32) -> ([f64; 2], u64) {
        let (across, down) = (self.scene.viewport.width(), self.scene.viewport.height());
        let per_pixel = seen.len() / self.scene.viewport.pixels();
        let (mut range, mut count) = ([f64::INFINITY, f64::NEG_INFINITY], 0);
        for row in y..(y + side_px).min(down) {
            for column in x..(x + side_px).min(across) {
                let pixel = (row * across + column) as usize;
                for (triangle, bits) in &seen[pixel * per_pixel..][..per_pixel] {
                    if *triangle != u32::MAX {
                        let depth = f64::from(f32::from_bits(*bits));
                        range = [range[0].min(depth), range[1].max(depth)];
                        count += 1;
                    }
                }
            }
        }
        (range, count)
    }

    /// Tiles that a place of the exact triangle falls in; `number` decides where places are.
    fn conservative(&self, side_px: u32, places: u32, number: u64) -> Widths {
        let mut widths = Widths { triangles: 1, ..Widths::default() };
        let ends =
            [self.vertices.map(|v| v.open.map(f64::from)), self.vertices.map(|v| v.close.map(f64::from))];
        let Some(exact) = MovingTriangle::new(ends[0], ends[1]) else { return widths };
        let rasterizer = Rasterizer::new(View::of(&self.projection.shear, self.projection.near));
        let tiles = Tiles::new(&rasterizer, &exact, self.scene.viewport, side_px);
        let vertices = self.width(self.by_vertices());
        let mut hit = vec![false; tiles.touched.len()];
        for place in 0..u64::from(places) {
            let uniform = |n: u64| unit(mix(mix(number << 32 ^ place) ^ n));
            let Some(seen) = self.place(&ends, uniform) else { continue };
            let Some(tile) = tiles.of(seen.image) else { continue };
            widths.places += 1;
            hit[tile] = true;
            widths.violations += u64::from(!tiles.touched[tile].is_some_and(|touch| seen.is_in(&touch)));
        }
        for touch in
            tiles.touched.iter().zip(&hit).filter(|(_, hit)| **hit).filter_map(|(touch, _)| touch.as_ref())
        {
            if vertices > 0.0 {
                let [width, null] = [touch.z, self.vertices_within(touch.t)].map(|range| self.width(range));
                widths.add(self.turns, vertices, [width, width, null]);
            }
        }
        widths
    }

    /// A place of the triangle at some time, seen through some place on the lens, or `None` where that is
    /// nearer than the near depth.
    fn place(&self, ends: &[[[f64; 3]; 3]; 2], uniform: impl Fn(u64) -> f64) -> Option<Seen> {
        let (mut b, mut c) = (uniform(0), uniform(1));
        if b + c > 1.0 {
            (b, c) = (1.0 - b, 1.0 - c);
        }
        let (weights, t) = ([1.0 - b - c, b, c], uniform(2));
        let lens = !self.projection.shear.is_none();
        let [u, v] = if lens { [2.0 * uniform(3) - 1.0, 2.0 * uniform(4) - 1.0] } else { [0.0; 2] };
        let at = |axis: usize| {
            (0..3)
                .map(|k| weights[k] * (ends[0][k][axis] + t * (ends[1][k][axis] - ends[0][k][axis])))
                .sum::<f64>()
        };
        let [x, y, z] = [at(0), at(1), at(2)];
        if z <= self.near() {
            return None;
        }
        let shear = &self.projection.shear;
        let [s, a] = [shear.s, shear.a].map(|part| part.map(f64::from));
        let weight = if shear.parallel { 1.0 } else { z };
        let image = [(x + u * (a[0] * z - s[0])) / weight, (y + v * (a[1] * z - s[1])) / weight];
        Some(Seen { image, u, v, t, z, lens })
    }
}

/// A place of a triangle as it is seen.
struct Seen {
    /// Pixels from the middle of the image.
    image: [f64; 2],
    u: f64,
    v: f64,
    t: f64,
    z: f64,
    lens: bool,
}

impl Seen {
    fn is_in(&self, touch: &Touch) -> bool {
        let inside = |[low, high]: [f64; 2], at: f64| low <= at && at <= high;
        let lens = !self.lens || (inside(touch.u, self.u) && inside(touch.v, self.v));
        inside(touch.t, self.t) && inside(touch.z, self.z) && lens
    }
}

/// The tiles of an image, with what conservative mode says of each.
struct Tiles {
    touched: Vec<Option<Touch>>,
    columns: usize,
    rows: usize,
    half: [f64; 2],
    side: f64,
}

/// So near to the border of a tile, in pixels, rounding may put a place on either side of it.
const BORDER_PX: f64 = 1e-7;

impl Tiles {
    fn new(rasterizer: &Rasterizer, triangle: &MovingTriangle, viewport: Viewport, side_px: u32) -> Self {
        let [width, height] = [viewport.width(), viewport.height()];
        let (columns, rows) = (width.div_ceil(side_px), height.div_ceil(side_px));
        let half = [width, height].map(|side| 0.5 * f64::from(side));
        let side = f64::from(side_px);
        let grid = Grid { origin: [-half[0], -half[1]], tile: [side; 2], columns, rows };
        let mut touched = vec![None; (columns * rows) as usize];
        rasterizer.rasterize_part(triangle, &grid, [0..columns, 0..rows], |[column, row], touch| {
            touched[(row * columns + column) as usize] = Some(*touch);
        });
        Self { touched, columns: columns as usize, rows: rows as usize, half, side }
    }

    /// The tile that a place of the image is inside of; `None` outside of the image and next to a border.
    fn of(&self, image: [f64; 2]) -> Option<usize> {
        let at = [0, 1].map(|axis| (image[axis] + self.half[axis]) / self.side);
        let clear = |at: f64| (at - at.round()).abs() * self.side > BORDER_PX;
        let inside = at[0] > 0.0 && at[1] > 0.0 && at[0] < self.columns as f64 && at[1] < self.rows as f64;
        (inside && at.into_iter().all(clear)).then(|| at[1] as usize * self.columns + at[0] as usize)
    }
}

fn draw<'a>(scene: &'a StressScene, corners: &'a [u32; 3]) -> Result<Draw<'a>, RunError> {
    let close = if scene.open == scene.close { &scene.open } else { &scene.close };
    let geometry = Geometry::new(&scene.open, close, std::slice::from_ref(corners))?;
    Ok(Draw { geometry, ..scene.draw(&Unshaded)? })
}

/// Instants at which the facing is looked at.
const INSTANTS: u32 = 64;

/// Whether the middle of the lens sees another face of the triangle at some time than at another.
fn turns(vertices: &[MovingVertex; 3]) -> bool {
    let facing = |step: u32| {
        let t = f64::from(step) / f64::from(INSTANTS);
        let [a, b, c] = vertices.map(|vertex| {
            let [open, close] =
                [vertex.open, vertex.close].map(|end| glam::DVec3::from_array(end.map(f64::from)));
            open + t * (close - open)
        });
        a.dot(b.cross(c))
    };
    let first = facing(0);
    (1..=INSTANTS).any(|step| facing(step) * first < 0.0)
}

/// The share of tiles whose interval by planes is at most so wide, relative to that by vertices.
fn cumulative(widths: &Widths) -> Figure {
    let shares = |class: usize| {
        let mut ratios = widths.ratios[class].clone();
        ratios.sort_by(f64::total_cmp);
        let tiles = ratios.len() as f64;
        ratios.into_iter().zip(1_u32..).map(|(ratio, rank)| (ratio, f64::from(rank) / tiles)).collect()
    };
    Figure::lines(
        "VI_figA_depth",
        "Width of depth intervals by moving planes over that by vertices",
        "cumulative distribution over the tiles that see a triangle; standard mode, failure catalogue",
        [("width over that by vertices", ""), ("share of tiles at most so wide", "")],
        vec![line("facing stays", shares(0)), line("facing changes", shares(1))],
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn widths(turning: [f64; 3], steady: [f64; 3]) -> Widths {
        let mut widths = Widths::default();
        widths.add(true, 2.0, turning);
        widths.add(false, 2.0, steady);
        widths
    }

    /// Narrower than the vertices over the whole shutter, and most so where the facing changes, with no gain by
    /// planes at all: the condition does not hold.
    #[test]
    fn planes_that_gain_nothing_are_not_narrower_than_the_null() {
        let idle = widths([1.0, 1.0, 1.0], [1.8, 1.8, 1.8]);
        assert!(!idle.holds() && idle.means(0) == [0.7, 0.5, 0.9] && idle.number() == 1.0);
        assert_eq!(idle.over_null(), [1.0; 3]);
        let useful = widths([0.5, 0.5, 1.0], [1.8, 1.8, 1.8]);
        assert!(useful.holds() && useful.number() == 0.5);
        let mut against = AgainstNull::default();
        against.add(&idle);
        assert_eq!((against.cases, against.narrower, against.turning_more), (1, [0, 0], 0));
        against.add(&useful);
        assert_eq!((against.cases, against.narrower, against.turning_more), (2, [1, 0], 1));
        assert_eq!(against.ranges, [[0.5, 1.0], [1.0, 1.0]]);
        assert!(against.text().contains("in 1 of 2 cases where the facing changes (0.500 to 1.000 of it)"));
    }

    /// With the committed settings the null of vertices within the tile's time is itself below 1.
    #[test]
    fn the_null_alone_is_narrower_than_the_vertices() {
        let scene = random(40, 32, 6).unwrap();
        let all = scene.triangles.iter().filter_map(|corners| Alone::new(&scene, corners).unwrap());
        let widths = all.map(|alone| alone.standard(8, Planes::Shutter));
        let widths = widths.fold(Widths::default(), Widths::and);
        let (planes, null) = (widths.means(0), widths.null());
        assert!(planes[0] < null[0] && null[0] < 1.0, "{planes:?} {null:?}");
    }
}
