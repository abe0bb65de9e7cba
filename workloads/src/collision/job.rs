//! `quintile run ccd`: collision detection as the hardware would do it, three passes for each pair.

use std::path::PathBuf;

use activity::{Event, PacketCounts, Warning};
use glam::Vec3;
use pipeline::PipelineSpec;
use serde::{Deserialize, Serialize};

use super::compare::{Scratch, Watch};
use super::families::swarm_of;
use super::pass::{Fragment, Part, Pass};
use super::{Method, Object, Search, Verdict, candidates};
use crate::error::LoadError;
use crate::job::{
    Drawn, Emit, Fact, FrontEnd, Job, JobError, OptionSource, Passes, Request, TileWork, Touch, must_hold,
};
use crate::scene::Settings;
use crate::visibility::load_cases;

/// What is drawn, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
    /// An .mts file; without it balls fly about.
    pub file: Option<PathBuf>,
    /// Balls, 2 to 100.
    pub balls: u32,
    /// Tiles across each image, 1 to 1024.
    pub resolution: u32,
    /// Bins of time in a tile, 1 to 256.
    pub bins: u32,
    /// What is compared.
    pub method: Method,
}

impl Default for Options {
    fn default() -> Self {
        Self { file: None, balls: 12, resolution: 64, bins: 1, method: Method::FragmentBox }
    }
}

impl Options {
    fn check(&self) -> Result<(), LoadError> {
        must_hold([
            ("balls", (2..=100).contains(&self.balls), "2 to 100"),
            ("resolution", (1..=1024).contains(&self.resolution), "1 to 1024 tiles"),
            ("bins", (1..=256).contains(&self.bins), "1 to 256"),
        ])
    }

    fn objects(&self, seed: u64) -> Result<Vec<Object>, LoadError> {
        let Some(file) = &self.file else { return Ok(swarm_of(self.balls, seed)) };
        let broken = |message: &str| LoadError::Broken {
            file: file.display().to_string(),
            place: "objects".to_owned(),
            message: message.to_owned(),
        };
        let case = load_cases(std::slice::from_ref(file))?.pop().ok_or_else(|| broken("there are none"))?;
        let object = |mesh| Object::new(mesh, case.uncertainty);
        let objects: Option<Vec<Object>> = case.objects.iter().map(object).collect();
        objects.ok_or_else(|| broken("a coordinate is beyond 1e60 or not a number; scale it"))
    }
}

/// The job.
struct Collision {
    search: Search,
    objects: Vec<Object>,
    settings: Settings,
}

/// Makes the job `ccd`.
///
/// # Errors
/// [`LoadError`] when an option makes no sense, or the file cannot be read.
pub fn job(options: &OptionSource, request: &Request<'_>) -> Result<Box<dyn Job>, LoadError> {
    let options: Options = options.read()?;
    options.check()?;
    if request.overrides.size.is_some() {
        let message = "the images of `ccd` are as large as its option `resolution` says".to_owned();
        return Err(LoadError::Setting { setting: "size", message });
    }
    let Options { resolution, bins, method, .. } = options;
    let settings = Settings { width: 3 * resolution, height: resolution, samples: 1, ..Settings::default() };
    let search = Search { resolution, bins, method, zoom: false };
    let settings = settings.with(request.overrides)?;
    Ok(Box::new(Collision { search, objects: options.objects(request.seed)?, settings }))
}

/// Above this share of candidates, most of what is near is kept.
const MOST_KEPT: f64 = 0.9;
/// Fewer candidates than this say little.
const FEWEST: usize = 4;

impl Job for Collision {
    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn is_animated(&self) -> bool {
        false
    }

    fn frame(&self, _: u32, spec: &PipelineSpec, emit: Emit<'_>) -> Result<Drawn, JobError> {
        let passes = Passes::new(&spec.memory, emit)?;
        let side = self.search.resolution as usize;
        let image = vec![Vec3::ZERO; 3 * side * side];
        let mut easel =
            Easel { passes, spec, image, side, bins: self.search.bins, fragments: 0, drawn: None };
        let pairs = candidates(&self.objects);
        let mut scratch = Scratch::default();
        let mut kept = 0_u32;
        for &(a, b) in &pairs {
            let verdict = self.search.watched(&self.objects[a], &self.objects[b], &mut scratch, &mut easel);
            easel.flush();
            kept += u32::from(matches!(verdict, Verdict::Maybe { .. }));
        }
        easel.passes.resolve(IMAGE, (3 * side * side) as u64, spec.tile_px.pow(2));
        let (image, fragments) = (std::mem::take(&mut easel.image), easel.fragments);
        let (counts, triangles) = easel.passes.finish();
        let fact = |name, value| Fact { name, value };
        let facts = vec![
            fact("pairs_whose_boxes_touch", pairs.len() as f64),
            fact("pairs_that_may_collide", f64::from(kept)),
            fact("fragments", fragments as f64),
        ];
        let warnings = near_everywhere(pairs.len(), kept).into_iter().collect();
        Ok(Drawn { image, counts, triangles, moving: true, lens: false, facts, warnings })
    }
}

fn near_everywhere(pairs: usize, kept: u32) -> Option<Warning> {
    (pairs >= FEWEST && f64::from(kept) > MOST_KEPT * pairs as f64).then(|| {
        let message = format!(
            "{kept} of {pairs} pairs whose swept boxes touch may collide: images tell hardly any apart, as where surfaces slide along \
             each other; raise `resolution` and `bins`, or use `quintile ccd`, which looks closer"
        );
        Warning::new("collision-near-everywhere", message)
    })
}

/// Bytes of a vertex at both ends, its transformation, and the set-up of a triangle with conservative edges that move.
const FRONT_END: FrontEnd = FrontEnd { vertex_bytes: 24, vertex_ops: 24, setup_madds: 77 };
/// Multiply-adds of a conservative test of a triangle in a tile: three edges by four corners at both ends, and the depths.
const TEST_MADDS: u32 = 3 * 4 * 2 * 2 + 18;
/// Bytes of a box of time and depth: four numbers of 16 bits.
const BOX_BYTES: u64 = 8;
/// Where vertices, boxes of the first and the second object, and the image lie.
const VERTICES: u64 = 0;
const BOXES: [u64; 2] = [1 << 32, 1 << 33];
const IMAGE: u64 = 1 << 34;

/// Draws what is told of passes: as packets, and as a picture with an image for each axis side by side.
struct Easel<'a> {
    passes: Passes<'a>,
    spec: &'a PipelineSpec,
    image: Vec<Vec3>,
    side: usize,
    bins: u32,
    fragments: u64,
    /// The fragments of one triangle in one tile of the hardware that are not told yet.
    drawn: Option<Pending>,
}

/// Fragments that travel in one packet.
struct Pending {
    tile: u32,
    item: u32,
    which: usize,
    fragments: u32,
    /// Pixels of the tile that are touched.
    pixels: u64,
    first_place: u64,
}

impl Easel<'_> {
    /// The hardware's tile of a pixel, and the pixel's place in it.
    fn tile(&self, [x, y]: [u32; 2]) -> (u32, u32) {
        let side = self.spec.tile_px;
        (y / side * (self.side as u32).div_ceil(side) + x / side, y % side * side + x % side)
    }

    /// Tells the packet that is being put together.
    fn flush(&mut self) {
        let Some(pending) = self.drawn.take() else { return };
        let mut counts = PacketCounts::default();
        let pixels = pending.pixels.count_ones();
        counts[Event::TilesVisited] = 1;
        counts[Event::EdgeBoundMadds] = pixels * TEST_MADDS;
        counts[Event::TileMadds] = pixels * TEST_MADDS;
        counts[Event::DepthReads] = pending.fragments;
        counts[Event::DepthWrites] = if pending.which == 0 { pending.fragments } else { 0 };
        counts[Event::SamplesHit] = pending.fragments;
        let bytes = u64::from(pixels) * u64::from(self.bins) * BOX_BYTES;
        let address = BOXES[0] + pending.first_place * u64::from(self.bins) * BOX_BYTES;
        let touch = Touch { address, bytes, write: pending.which == 0, fresh: false };
        let work = TileWork { tile: pending.tile, triangle: pending.item, counts };
        self.passes.tile(&work, &[touch], &[]);
    }

    fn pixel(&mut self, pass: &Pass, [x, y]: [u32; 2]) -> &mut Vec3 {
        let across = pass.axis * self.side + x as usize;
        &mut self.image[y as usize * 3 * self.side + across]
    }
}

impl Watch for Easel<'_> {
    fn part(&mut self, _: &Pass, which: usize, part: Part<'_>) {
        self.flush();
        if which == 0 {
            self.passes.next();
        }
        self.passes.draw(part.list.len(), VERTICES, &FRONT_END);
    }

    fn fragment(&mut self, pass: &Pass, which: usize, fragment: &Fragment) {
        self.fragments += 1;
        let (tile, place) = self.tile(fragment.tile);
        let known = self.drawn.as_ref().map(|pending| (pending.tile, pending.item, pending.which));
        if known != Some((tile, fragment.item, which)) {
            self.flush();
        }
        let first_place = u64::from(tile) * u64::from(self.spec.tile_px.pow(2)) + u64::from(place);
        let pending = self.drawn.get_or_insert(Pending {
            tile,
            item: fragment.item,
            which,
            fragments: 0,
            pixels: 0,
            first_place,
        });
        pending.fragments += 1;
        pending.pixels |= 1 << place;
        let shade = [Vec3::new(0.01, 0.03, 0.08), Vec3::new(0.02, 0.06, 0.02)][which] / self.bins as f32;
        *self.pixel(pass, fragment.tile) += shade;
    }

    fn left(&mut self, pass: &Pass, tile: [u32; 2]) {
        let red = Vec3::new(0.6, 0.05, 0.02);
        let bins = self.bins as f32;
        let pixel = self.pixel(pass, tile);
        *pixel = (*pixel + red / bins).min(Vec3::ONE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Overrides;
    use activity::{Counts, LineAccess, Packet};
    use pipeline::depth::DepthSpec;
    use pipeline::{CacheSpec, Features, MemorySpec, Shading};

    fn spec() -> PipelineSpec {
        let lines = CacheSpec::lru(256, 4);
        let compression = Default::default();
        PipelineSpec {
            tile_px: 8,
            coarse_tile_px: 16,
            batch_triangles: 1000,
            vertex_reuse: 16,
            shading: Shading::default(),
            shading_cache: CacheSpec::lru(1024, 4),
            memory: MemorySpec { depth: lines, colour: lines, texture: lines, l2: lines, compression },
            features: Features::ALL,
            depth: DepthSpec::default(),
        }
    }

    fn made(set: &[(&str, &str)]) -> Result<Box<dyn Job>, LoadError> {
        let set = set.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
        job(&OptionSource { file: None, set }, &Request { overrides: &Overrides::default(), seed: 1 })
    }

    #[test]
    fn packets_add_up_and_the_answer_is_that_of_the_search() {
        for method in ["fragment_box", "box_box", "depth_only"] {
            let job = made(&[("resolution", "16"), ("balls", "6"), ("method", method)]).unwrap();
            let mut sum = Counts::default();
            let mut emit = |packet: &Packet, _: &[LineAccess]| sum += &packet.counts;
            let drawn = job.frame(0, &spec(), &mut emit).unwrap();
            assert_eq!(sum, drawn.counts, "{method}");
            assert_eq!(drawn.image.len(), 48 * 16);
            let fact = |name| drawn.facts.iter().find(|fact| fact.name == name).unwrap().value;
            assert_eq!(drawn.counts[Event::SamplesHit] as f64, fact("fragments"), "{method}");
            let objects = swarm_of(6, 1);
            let method: Method = serde_json::from_str(&format!("\"{method}\"")).unwrap();
            let search = Search { resolution: 16, bins: 1, method, zoom: false };
            let found = super::super::detect(&objects, &search);
            let kept = found.iter().filter(|answer| answer.verdict.may_collide()).count();
            assert_eq!(fact("pairs_that_may_collide"), kept as f64);
            assert!(kept > 0 && kept < found.len());
        }
    }

    #[test]
    fn options_that_make_no_sense_are_refused() {
        assert!(made(&[("resolution", "0")]).is_err() && made(&[("bins", "257")]).is_err());
        assert!(made(&[("balls", "1")]).is_err() && made(&[("file", "nowhere.mts")]).is_err());
        let size = Overrides { size: Some((4, 4)), ..Overrides::default() };
        assert!(job(&OptionSource::default(), &Request { overrides: &size, seed: 1 }).is_err());
    }

    #[test]
    fn pairs_that_are_all_kept_are_told() {
        assert!(near_everywhere(10, 10).is_some() && near_everywhere(10, 9).is_none());
        assert!(near_everywhere(3, 3).is_none());
    }
}
