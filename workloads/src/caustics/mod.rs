//! Caustics: light refracted or reflected by a surface, in light volumes (thesis, Paper VI, section 4).
//!
//! A *generator* triangle and the light behind each of its corners span a beam, whose sides are bilinear
//! patches. For a 5D rasterizer the beam is a moving triangle: the generator at shutter open, the far end at
//! shutter close. A pixel is in the beam if it is inside all three moving edges at some time. The exact times
//! give the light that it gathers, so no bounding volume is needed. The bounding volumes of earlier methods
//! are included for comparison.
//!
//! - [`Beam`]: the light volume of a generator triangle; [`Beam::inside`]: when a point lies in it.
//! - [`generator`]: beams of an ocean, of a water surface with one wave, of a mirror ring, of a ball lens.
//! - [`BeamMethod`]: the moving triangle, and bounding volumes: the prism of Ernst et al. (2005), the refined
//!   bound of Liktor and Dachsbacher (2011), the convex hull.
//! - [`Squares`]: the same light by photons, as a reference for images.
//! - [`Eye`], [`draw()`]: light and shader executions of every pixel, in the volume ([`LightQuantity::Volume`]) or on
//!   the floor ([`LightQuantity::Floor`]).
//! - [`Coverage`], [`accuracy_warnings`]: a method compared with brute force, and warnings about inaccurate beams.
//! - [`job()`]: the workload.
//!
//! All views are orthographic. In perspective a beam may reach behind the camera, and no method here clips.

mod beam;
mod bound;
mod draw;
pub mod generator;
mod light;
mod refraction;
mod shader;

use glam::DVec3;
use pipeline::{Gpu, Lane, PipelineSpec};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use warnings::{Code, Warning};

use crate::error::LoadError;
use crate::job::{
    Drawn, Draws, Fact, Flag, Flags, Job, JobError, JobOptions, JobRequest, OptionSource, facts, must_hold,
};
use crate::scene::SceneSettings;
pub use beam::{Beam, Hit};
pub use bound::BeamMethod;
use draw::draw_with_work;
pub use draw::{LightPicture, draw};
use generator::Ocean;
use light::Seen;
pub use light::{Eye, Floor, LightQuantity, Squares, error};
use refraction::refract_on;
pub use shader::draw_on;
use shader::{draw_stored, tone_on};

/// View of the light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LightView {
    /// Light in the water, from the side.
    #[default]
    Volume,
    /// Light on the floor, from above.
    Floor,
}

/// Options of the job: water with waves under the sun.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CausticsOptions {
    /// Squares of two generator triangles along each side, 1 to 1024. 255 give the 130,050 volumes of the
    /// paper's ocean.
    pub cells: u32,
    /// Length of a side in metres.
    pub side_m: f64,
    /// Depth in metres.
    pub depth_m: f64,
    /// Length of the longest waves in metres; the shortest are a third of it.
    pub wave_m: f64,
    /// Root mean square of the surface slope, 0 to 1.
    pub slope: f64,
    /// Offset of every other column of corners along its light, as a share of its length, 0 to 0.9. The light
    /// stays the same, but sides of beams cross.
    pub pleat: f64,
    /// How beams are rasterized.
    pub method: BeamMethod,
    /// View of the light.
    pub look: LightView,
}

impl JobOptions for CausticsOptions {}

impl Default for CausticsOptions {
    fn default() -> Self {
        Self {
            cells: 64,
            side_m: 16.0,
            depth_m: 5.0,
            wave_m: 4.0,
            slope: 0.15,
            pleat: 0.0,
            method: BeamMethod::Moving,
            look: LightView::Volume,
        }
    }
}

impl CausticsOptions {
    fn check(&self) -> Result<(), LoadError> {
        let (is_length, length) = (|value: f64| (1e-3..=1e4).contains(&value), "0.001 to 10000 metres");
        must_hold([
            ("cells", &self.cells, (1..=1024).contains(&self.cells), "1 to 1024 squares along a side"),
            ("side_m", &self.side_m, is_length(self.side_m), length),
            ("depth_m", &self.depth_m, is_length(self.depth_m), length),
            ("wave_m", &self.wave_m, is_length(self.wave_m), length),
            ("slope", &self.slope, (0.0..=1.0).contains(&self.slope), "0 to 1"),
            ("pleat", &self.pleat, (0.0..=0.9).contains(&self.pleat), "0 to 0.9"),
        ])
    }
}

/// The job and its ocean.
struct Caustics {
    options: CausticsOptions,
    ocean: Ocean,
    settings: SceneSettings,
}

/// Run options in use. The image has no samples, lens or shutter; a frame is an instant.
pub(crate) const FLAGS: Flags = Flags { uses: &[Flag::Size], instead: &[] };

/// Makes the job `caustics`.
///
/// # Errors
/// [`LoadError`] for an invalid option or setting.
pub fn job(options: &OptionSource, request: &JobRequest<'_>) -> Result<Box<dyn Job>, LoadError> {
    let options: CausticsOptions = options.read()?;
    options.check()?;
    let settings = SceneSettings {
        width: 512,
        height: 288,
        samples: 1,
        table: "none".to_owned(),
        frame_rate_hz: 30.0,
        ..SceneSettings::default()
    };
    let settings = settings.with(request.overrides)?;
    let CausticsOptions { cells, side_m, depth_m, wave_m, slope, .. } = options;
    let mut ocean = Ocean::new(cells, side_m, depth_m, [wave_m, slope], request.seed);
    ocean.pleat = options.pleat;
    if options.look == LightView::Floor {
        ocean.overshoot = 0.02;
    }
    Ok(Box::new(Caustics { options, ocean, settings }))
}

impl Draws for Caustics {
    /// Time of the waves, in seconds.
    type Input = f64;

    fn settings(&self) -> &SceneSettings {
        &self.settings
    }

    fn input(&self, number: u32) -> Result<f64, JobError> {
        Ok(f64::from(number) / self.settings.frame_rate_hz)
    }

    fn draw(&self, time_s: &f64, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let eye = self.eye().ok_or_else(|| JobError::setting("the view has no extent"))?;
        let method = self.options.method;
        let (beams, stored) = refract_on(gpu, &self.ocean, *time_s, method)?;
        let (picture, buffer) = draw_stored(gpu, (&beams, stored), &eye, method, self.light())?;
        let mut warnings = accuracy_warnings(&self.ocean, &beams);
        warnings.extend(from_host(gpu.spec()));
        Ok(Drawn {
            image: tone_on(gpu, &eye, &picture.light, buffer, white(&picture.light))?,
            moving: method == BeamMethod::Moving,
            lens: false,
            facts: facts(&picture, &beams),
            warnings,
        })
    }
}

impl Caustics {
    fn light(&self) -> LightQuantity {
        match self.options.look {
            LightView::Volume => LightQuantity::Volume,
            LightView::Floor => LightQuantity::Floor(Floor { height_m: -self.options.depth_m }),
        }
    }

    /// A camera slightly above the side, or straight above. All of the water is in the image.
    fn eye(&self) -> Option<Eye> {
        let CausticsOptions { side_m, depth_m, .. } = self.options;
        let size @ [width, height] = [self.settings.width, self.settings.height];
        let aspect = f64::from(width) / f64::from(height);
        let middle = DVec3::new(0.12 * depth_m, -0.5 * depth_m, 0.07 * depth_m);
        let distance = 4.0 * (side_m + depth_m);
        let (toward, up, needed) = match self.options.look {
            LightView::Volume => {
                let high = 0.5 * (depth_m + 0.5 * side_m);
                (DVec3::new(0.3, 0.35, 1.0).normalize(), DVec3::Y, [0.72 * side_m, high])
            }
            LightView::Floor => (DVec3::Y, DVec3::NEG_Z, [0.55 * side_m; 2]),
        };
        Eye::new([middle + distance * toward, middle, up], needed[1].max(needed[0] / aspect), size)
    }
}

facts! {
    beams "count" "light volumes"
    flux_W "W" "flux of all light volumes"
    shader_executions "count" "executions of the shader, each for a pixel and a light volume"
    shader_executions_per_pixel "per pixel" "the same, mean over the pixels of the image"
    executions_that_find_light "share" "of these executions, those that find light"
    tiles_touched "count" "tiles of 8x8 pixels that light volumes, or faces of bounding volumes, touch"
    pixels_tested "count" "pixels of these tiles that are tested"
    crossed_share_of_length "share" "length of a light volume over which its sides cross, mean"
    beams_left_out "count" "light volumes that are not drawn: without volume, or reaching behind the camera"
}

fn facts(picture: &LightPicture, beams: &[Beam]) -> Vec<Fact> {
    let runs = picture.total_runs() as f64;
    Fact::all([
        (fact::beams, beams.len() as f64),
        (fact::flux_W, beams.iter().map(|beam| beam.flux_w).sum()),
        (fact::shader_executions, runs),
        (fact::shader_executions_per_pixel, runs / picture.runs.len().max(1) as f64),
        (fact::executions_that_find_light, picture.useful as f64 / runs.max(1.0)),
        (fact::tiles_touched, picture.tiles as f64),
        (fact::pixels_tested, picture.tests as f64),
        (fact::crossed_share_of_length, crossing(beams)),
        (fact::beams_left_out, picture.skipped as f64),
    ])
}

/// Light that is white: one lit pixel in a hundred has more.
fn white(light: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = light.iter().copied().filter(|light| *light > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len().saturating_sub(1 + sorted.len() / 100)).copied().unwrap_or(1.0)
}

/// Coverage of a method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Pairs of a pixel and a beam that lights the floor at the pixel's centre.
    pub lit: u64,
    /// Pairs that the method misses (false negatives); must be 0.
    pub missed: u64,
    /// Pairs by number of hits: one, two, three. A folded beam hits a point more than once.
    pub by_hits: [u64; 3],
    /// Pictures drawn to find the covered pixels.
    pub draws: u64,
    /// Covered pixels of all beams.
    pub fragments: u64,
}

impl Coverage {
    /// Sum of both.
    #[must_use]
    pub fn and(self, other: &Self) -> Self {
        let by_hits = [0, 1, 2].map(|n| self.by_hits[n] + other.by_hits[n]);
        Self {
            lit: self.lit + other.lit,
            missed: self.missed + other.missed,
            by_hits,
            draws: self.draws + other.draws,
            fragments: self.fragments + other.fragments,
        }
    }
}

/// Tests every beam at the floor point of every pixel, and counts the pairs that a method misses.
pub fn receivers(beams: &[Beam], eye: &Eye, method: BeamMethod, floor: &Floor) -> Coverage {
    let (picture, mut work) = draw_with_work(beams, eye, method, None, true);
    work.sort_by_key(|work| (work.beam, work.tile));
    let (width, height) = (eye.viewport().width(), eye.viewport().height());
    let columns = width.div_ceil(8);
    let covered = |beam: u32, [x, y]: [u32; 2]| {
        let tile = y / 8 * columns + x / 8;
        let at = work.binary_search_by_key(&(beam, tile), |work| (work.beam, work.tile));
        at.is_ok_and(|at| work[at].pixels >> (y % 8 * 8 + x % 8) & 1 != 0)
    };
    let bounded = |seen: Seen| (BoundingBox::of(&seen.image), seen);
    let seen: Vec<Option<(BoundingBox, Seen)>> =
        beams.iter().map(|beam| eye.see(beam).map(bounded)).collect();
    let row = |y: u32| {
        let mut found = Coverage::default();
        for x in 0..width {
            let Some(point) = floor.point(eye, eye.pixel_centre([x, y])) else { continue };
            for (number, seen) in (0..).zip(&seen) {
                let near = seen.as_ref().filter(|(bounds, _)| bounds.contains(point));
                let hits = near.map_or(0, |(_, seen)| seen.image.inside(&Lane::default(), point).count());
                if hits > 0 {
                    found.lit += 1;
                    found.by_hits[hits.min(3) - 1] += 1;
                    found.missed += u64::from(!covered(number, [x, y]));
                }
            }
        }
        found
    };
    let drawn = Coverage { draws: 1, fragments: picture.total_runs(), ..Coverage::default() };
    (0..height).into_par_iter().map(row).reduce(Coverage::default, |a, b| a.and(&b)).and(&drawn)
}

/// Bounding box of a beam's corners, with a margin for rounding. Points outside are outside the beam.
struct BoundingBox {
    low: DVec3,
    high: DVec3,
}

impl BoundingBox {
    fn of(beam: &Beam) -> Self {
        let corners = || beam.open.iter().chain(&beam.close).copied();
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        let bounds = DVec3::splat(1e-3 * (1.0 + (high - low).max_element()));
        Self { low: low - bounds, high: high + bounds }
    }

    fn contains(&self, point: DVec3) -> bool {
        point.cmpge(self.low).all() && point.cmple(self.high).all()
    }
}

/// Mean share of a beam's length with crossed sides above which a warning is given. Half a percent of the
/// light in the volume is missing there (`quintile chart caustics`).
pub const MAX_CROSSED_SHARE: f64 = 0.1;
/// Least number of grid squares along the shortest wave.
pub const MIN_SQUARES_PER_WAVE: f64 = 4.0;

/// Mean share of their length over which sides of beams cross.
pub fn crossing(beams: &[Beam]) -> f64 {
    beams.iter().map(Beam::crossing).sum::<f64>() / beams.len().max(1) as f64
}

/// Warning that time and energy lack the passes that make the beams.
fn from_host(spec: &PipelineSpec) -> Option<Warning> {
    let message = "the GPU has no compute unit, so the host makes the beams and no time or energy of the frame is that of refraction; \
                   give the GPU a `compute` unit to compare it with others";
    spec.compute.is_none().then(|| Warning::new(Code::CausticsFromHost, message))
}

/// Warnings about an ocean made of these beams.
pub fn accuracy_warnings(ocean: &Ocean, beams: &[Beam]) -> Vec<Warning> {
    let crossed = crossing(beams);
    let squares = ocean.shortest_m() / ocean.side_m * f64::from(ocean.cells);
    let crossed = (crossed > MAX_CROSSED_SHARE).then(|| {
        Warning::new(
            Code::CausticsCrossed,
            format!(
                "the sides of beams cross for {:.1} % of their length on average (a warning from {:.0} % on): triangles stand along the light for much \
                 of its way, which then differs in length within a beam, and light in the water is missing, half a percent from there on and more beyond; \
                 more cells, flatter waves or deeper water help",
                100.0 * crossed,
                100.0 * MAX_CROSSED_SHARE
            ),
        )
    });
    let coarse = (squares < MIN_SQUARES_PER_WAVE).then(|| {
        Warning::new(
            Code::CausticsCoarse,
            format!(
                "the shortest wave is {squares:.1} squares of generator triangles long, fewer than {MIN_SQUARES_PER_WAVE:.0}: the surface is not resolved and its light \
                 falls elsewhere; more cells or longer waves help"
            ),
        )
    });
    crossed.into_iter().chain(coarse).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caustics::generator::tests::{hit, turned, uniform, warped};
    use crate::job::testing::hardware;
    use crate::scene::Overrides;
    use activity::{Counts, Event};

    fn drawn(set: &[(&str, &str)]) -> (Drawn, Counts) {
        let set = set.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
        let overrides = Overrides { size: Some((96, 54)), ..Overrides::default() };
        let request = JobRequest { overrides: &overrides, seed: 1 };
        let job = job(&OptionSource { file: None, set }, &request).unwrap();
        let hardware = hardware();
        let mut gpu = Gpu::without_packets(&hardware).unwrap();
        (job.frame(0, &mut gpu).unwrap(), gpu.finish().counts())
    }

    #[test]
    fn every_view_and_method_emits_all_packets() {
        for look in ["volume", "floor"] {
            let (ours, counts) = drawn(&[("cells", "12"), ("wave_m", "18"), ("look", look)]);
            assert!(ours.warnings.is_empty() && ours.moving, "{:?}", ours.warnings);
            assert!(ours.image.iter().filter(|pixel| pixel.y > 0.0).count() > 500, "{look}");
            let [executions, tiles, tested] = of_picture(&ours);
            // The tone pass runs for every pixel and reads its light; a tile of a beam reads its flux.
            let toned = 96 * 54;
            assert_eq!(counts[Event::TextureFetches], toned + tiles);
            // A program for every tile, and one for every pixel that is lit.
            assert_eq!(counts[Event::PixelInvocations] - toned, executions + tiles);
            assert_eq!([counts[Event::SamplesTested], counts[Event::SamplesHit]], [tested, executions]);
            assert!(tested > executions);
            // A moving triangle comes to a tile once, and marks nothing.
            assert_eq!([counts[Event::DepthReads], counts[Event::DepthWrites]], [0; 2]);
            let (prism, prism_counts) =
                drawn(&[("cells", "12"), ("wave_m", "18"), ("look", look), ("method", "prism")]);
            assert_eq!(prism.image, ours.image);
            assert!(prism_counts[Event::PixelInvocations] > counts[Event::PixelInvocations]);
            // Three words of marks are read for every tile; where pixels are covered they are combined, too.
            let [_, tiles, _] = of_picture(&prism);
            let [read, written] = [Event::DepthReads, Event::DepthWrites].map(|event| prism_counts[event]);
            assert_eq!(read, 3 * tiles + written);
            assert!(written % 3 == 0 && written > 0 && written <= 3 * tiles);
        }
    }

    /// Executions, tiles and tests of a picture.
    fn of_picture(drawn: &Drawn) -> [u64; 3] {
        ["shader_executions", "tiles_touched", "pixels_tested"]
            .map(|name| drawn.facts.iter().find(|fact| fact.name == name).unwrap().value as u64)
    }

    /// The picture of the pass is that of the host, with its tiles and tests, for every method.
    #[test]
    fn the_pass_draws_what_the_host_draws() {
        let (ocean, size) = (Ocean::new(10, 16.0, 5.0, [18.0, 0.4], 3), [70, 41]);
        let view = [DVec3::new(6.0, 7.0, 20.0), DVec3::new(0.5, -2.0, 0.0), DVec3::Y];
        let (beams, eye) = (ocean.beams(0.0), Eye::new(view, 4.0, size).unwrap());
        let hardware = hardware();
        for method in BeamMethod::ALL {
            let mut gpu = Gpu::without_packets(&hardware).unwrap();
            let (picture, _) = draw_on(&mut gpu, &beams, &eye, method, LightQuantity::Volume).unwrap();
            assert_eq!(picture, draw(&beams, &eye, method, Some(LightQuantity::Volume)), "{method:?}");
            // Still bodies are moved to the image once, moving triangles at both ends.
            let counts = gpu.finish().counts();
            let bytes = if method == BeamMethod::Moving { 24 } else { 12 };
            assert_eq!(counts[Event::VertexBytes], bytes * counts[Event::VerticesFetched]);
            // Bounding volumes are made by a lane for each beam.
            let groups = if method == BeamMethod::Moving { 0 } else { beams.len().div_ceil(64) as u64 };
            assert_eq!(counts[Event::Groups], groups);
            assert_eq!(counts[Event::BufferLines] > 0, groups > 0);
        }
    }

    #[test]
    fn warped_beams_and_coarse_surfaces_are_warned_of() {
        let codes = |set| drawn(set).0.warnings.iter().map(|warning| warning.code).collect::<Vec<_>>();
        let crossed =
            [("cells", "26"), ("wave_m", "8"), ("slope", "0.5"), ("depth_m", "16"), ("pleat", "0.5")];
        assert_eq!(codes(&crossed), ["caustics-crossed"]);
        assert!(codes(&crossed[..4]).is_empty(), "steep, but not crossed");
        assert_eq!(codes(&[("cells", "6")]), ["caustics-coarse"]);
    }

    #[test]
    fn invalid_options_are_named() {
        let overrides = Overrides::default();
        for (name, value) in [
            ("cells", "0"),
            ("depth_m", "-1"),
            ("slope", "2"),
            ("pleat", "1"),
            ("method", "\"prsm\""),
            ("method", "\"uncut\""),
        ] {
            let set = vec![(name.to_owned(), value.to_owned())];
            let made = job(&OptionSource { file: None, set }, &JobRequest { overrides: &overrides, seed: 1 });
            let error = made.err().map(|error| error.to_string()).unwrap_or_default();
            assert!(error.contains(name), "{name}: {error}");
        }
    }

    #[test]
    fn every_point_of_a_beam_is_in_its_box() {
        let mut random = uniform(8);
        for round in 0..2000 {
            let beam = if round % 2 == 0 { warped(&mut random, 0.8) } else { turned(&mut random) };
            let inside = beam.point(&hit(&mut random));
            let bounds = BoundingBox::of(&beam);
            assert!(bounds.contains(inside));
            let far = inside + DVec3::splat(12.0);
            assert!(!bounds.contains(far) && beam.inside(&Lane::default(), far).count() == 0);
        }
    }
}
