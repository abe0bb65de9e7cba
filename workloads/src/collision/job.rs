//! The job `quintile run ccd`: collision detection on the modelled hardware, in two sweeps over all objects
//! along each axis, or narrowed pair by pair.

use std::path::{Path, PathBuf};

use pipeline::{Gpu, Viewport};
use serde::{Deserialize, Serialize};
use warnings::{Code, Warning};

use super::families::swarm_of;
use super::object::load_objects;
use super::on_gpu::{Emitted, PassesOnGpu};
use super::pass::Scratch;
use super::{CollisionMethod, Object, PairSearch, Sweeps, candidates};
use crate::error::LoadError;
use crate::job::{
    Drawn, Draws, Fact, Flag, Flags, Job, JobError, JobOptions, JobRequest, Need, OptionSource, facts,
    must_hold,
};
use crate::scene::SceneSettings;

/// Options of the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CollisionOptions {
    /// An `.mts` file; without it, balls move at random.
    pub file: Option<PathBuf>,
    /// Number of balls, 2 to 100.
    pub balls: u32,
    /// Tiles across each image, 1 to 1024.
    pub resolution: u32,
    /// Time bins per tile, 1 to 256.
    pub bins: u32,
    /// What a pass compares.
    pub method: CollisionMethod,
    /// Whether pairs whose swept boxes touch are drawn one by one within the space they share, of which the
    /// CPU narrows more from axis to axis, instead of two sweeps over all objects.
    pub narrow: bool,
}

impl JobOptions for CollisionOptions {
    const NEEDS: &'static [Need] = &[Need::new("balls", "file", &["none"])];
}

impl Default for CollisionOptions {
    fn default() -> Self {
        Self {
            file: None,
            balls: 12,
            resolution: 64,
            bins: 1,
            method: CollisionMethod::FragmentBox,
            narrow: false,
        }
    }
}

impl CollisionOptions {
    fn check(&self) -> Result<(), LoadError> {
        must_hold([
            (
                "file",
                &self.file.as_deref().unwrap_or(Path::new("")),
                self.file.as_deref().is_none_or(|file| !file.as_os_str().is_empty()),
                "the path of a file; leave it out for balls",
            ),
            ("balls", &self.balls, (2..=100).contains(&self.balls), "2 to 100"),
            ("resolution", &self.resolution, (1..=1024).contains(&self.resolution), "1 to 1024 pixels"),
            ("bins", &self.bins, (1..=256).contains(&self.bins), "1 to 256"),
        ])
    }

    fn objects(&self, seed: u64) -> Result<Vec<Object>, LoadError> {
        let Some(file) = &self.file else { return Ok(swarm_of(self.balls, seed)) };
        let broken = |message: &str| LoadError::Broken {
            file: file.display().to_string(),
            place: "objects".to_owned(),
            message: message.to_owned(),
        };
        let meshes = load_objects(file)?;
        if meshes.is_empty() {
            let message =
                format!("{} holds no objects, so nothing can collide; give another file", file.display());
            return Err(LoadError::Setting { setting: "file", message });
        }
        // Coordinates of an `.mts` file are exact.
        let objects: Option<Vec<Object>> = meshes.iter().map(|mesh| Object::new(mesh, 0.0)).collect();
        objects.ok_or_else(|| broken("a coordinate is beyond 1e60 or not a number; scale it"))
    }
}

/// The job and its objects.
struct Collision {
    search: PairSearch,
    narrow: bool,
    viewport: Viewport,
    objects: Vec<Object>,
    settings: SceneSettings,
}

facts! {
    objects "count" "moving objects"
    objects_that_may_collide "count" "objects that no image separates from all others"
    pairs_whose_boxes_touch "count" "pairs of objects whose swept boxes touch"
    pairs_that_may_collide "count" "of these, those that no image separates"
    fragments "count" "fragments of the passes, each for a triangle and a tile that it may touch"
}

/// Run options that the job replaces. Its images are squares, sampled at pixel centres over the whole time.
pub(crate) const FLAGS: Flags = Flags { uses: &[], instead: &[(Flag::Size, "resolution")] };

/// Makes the job `ccd`.
///
/// # Errors
/// [`LoadError`] for an invalid option, or a file that cannot be read.
pub fn job(options: &OptionSource, request: &JobRequest<'_>) -> Result<Box<dyn Job>, LoadError> {
    let options: CollisionOptions = options.read()?;
    options.check()?;
    let CollisionOptions { resolution, bins, method, narrow, .. } = options;
    let settings = SceneSettings {
        width: 3 * resolution,
        height: resolution,
        samples: 1,
        table: "none".to_owned(),
        ..SceneSettings::default()
    };
    let search = PairSearch { resolution, bins, method, zoom: false };
    let settings = settings.with(request.overrides)?;
    let refused = || LoadError::Setting { setting: "resolution", message: "1 to 1024 pixels".to_owned() };
    let viewport = Viewport::new(resolution, resolution).ok_or_else(refused)?;
    let objects = options.objects(request.seed)?;
    Ok(Box::new(Collision { search, narrow, viewport, objects, settings }))
}

/// Share of kept candidates above which a warning is given.
const MAX_KEPT_SHARE: f64 = 0.9;
/// Least number of candidates for the warning.
const MIN_CANDIDATES: usize = 4;

impl Draws for Collision {
    /// All frames search the same motion.
    type Input = ();

    fn settings(&self) -> &SceneSettings {
        &self.settings
    }

    fn shows(&self) -> &'static str {
        "the way of all objects, seen along x, y and z; blue: fragments of the passes, red: where a pair may collide; shades are \
         logarithmic"
    }

    fn input(&self, _: u32) -> Result<(), JobError> {
        Ok(())
    }

    fn draw(&self, (): &(), gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let PairSearch { method, bins, resolution, .. } = self.search;
        let mut passes = PassesOnGpu::new((method, self.viewport, bins), &self.objects, gpu);
        let pairs = candidates(&self.objects);
        let (may_collide, kept) = if self.narrow {
            let kept = self.narrowed(&pairs, &mut passes);
            (in_pairs(&kept), kept)
        } else {
            let set = Sweeps { method, resolution, bins }.detect_on(&self.objects, &mut passes);
            let is_kept = |object: &usize| set.binary_search(object).is_ok();
            let kept = pairs.iter().filter(|(a, b)| is_kept(a) && is_kept(b)).copied().collect();
            (set.len(), kept)
        };
        let kept = kept.len() as u32;
        let Emitted { image, fragments } = passes.finish()?;
        let facts = Fact::all([
            (fact::objects, self.objects.len() as f64),
            (fact::objects_that_may_collide, may_collide as f64),
            (fact::pairs_whose_boxes_touch, pairs.len() as f64),
            (fact::pairs_that_may_collide, f64::from(kept)),
            (fact::fragments, fragments as f64),
        ]);
        let warnings = near_everywhere(pairs.len(), kept).into_iter().collect();
        Ok(Drawn { image, moving: true, lens: false, facts, warnings })
    }
}

impl Collision {
    /// Pairs that may collide, each drawn alone and narrowed.
    fn narrowed(&self, pairs: &[(usize, usize)], passes: &mut PassesOnGpu<'_, '_>) -> Vec<(usize, usize)> {
        let mut scratch = Scratch::default();
        let mut kept = |&(a, b): &(usize, usize)| {
            let verdict = self.search.pair_observed(&self.objects[a], &self.objects[b], &mut scratch, passes);
            verdict.may_collide()
        };
        pairs.iter().copied().filter(|pair| kept(pair)).collect()
    }
}

/// Objects in pairs.
fn in_pairs(pairs: &[(usize, usize)]) -> usize {
    pairs.iter().flat_map(|&(a, b)| [a, b]).collect::<std::collections::BTreeSet<_>>().len()
}

fn near_everywhere(pairs: usize, kept: u32) -> Option<Warning> {
    (pairs >= MIN_CANDIDATES && f64::from(kept) > MAX_KEPT_SHARE * pairs as f64).then(|| {
        let message = format!(
            "{kept} of {pairs} pairs whose swept boxes touch may collide: images separate hardly any of them, as where surfaces slide along \
             each other; raise `resolution` and `bins`, or use `quintile ccd`, which looks closer"
        );
        Warning::new(Code::CollisionNearEverywhere, message)
    })
}

#[cfg(test)]
mod tests {
    use activity::{Counts, Event, Packet, PacketKind, Waits};

    use super::*;
    use crate::collision::detect;
    use crate::job::testing::hardware;
    use crate::scene::Overrides;

    fn made(set: &[(&str, &str)]) -> Result<Box<dyn Job>, LoadError> {
        let set = set.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
        job(&OptionSource { file: None, set }, &JobRequest { overrides: &Overrides::default(), seed: 1 })
    }

    #[test]
    fn packets_add_up_and_the_answer_is_that_of_the_search_and_of_the_sweeps() {
        for (name, method) in [
            ("fragment_box", CollisionMethod::FragmentBox),
            ("box_box", CollisionMethod::BoxBox),
            ("depth_only", CollisionMethod::DepthOnly),
        ] {
            for narrow in ["false", "true"] {
                let job = made(&[("resolution", "16"), ("balls", "6"), ("method", name), ("narrow", narrow)])
                    .unwrap();
                let mut sum = Counts::default();
                let hardware = hardware();
                let mut gpu = Gpu::new(&hardware, |packet: &Packet, _| sum += &packet.counts).unwrap();
                let drawn = job.frame(0, &mut gpu).unwrap();
                let counts = gpu.finish().counts();
                assert_eq!(sum, counts, "{name}");
                assert_eq!(drawn.image.len(), 48 * 16);
                let fact = |name| drawn.facts.iter().find(|fact| fact.name == name).unwrap().value as usize;
                assert!(counts[Event::PixelInvocations] >= fact("fragments") as u64, "{name}");
                let objects = swarm_of(6, 1);
                let kept = if narrow == "true" {
                    let search = PairSearch { resolution: 16, bins: 1, method, zoom: false };
                    let found = detect(&objects, &search);
                    found.iter().filter(|answer| answer.verdict.may_collide()).count()
                } else {
                    let found = Sweeps { method, resolution: 16, bins: 1 }.detect(&objects);
                    assert_eq!(fact("objects_that_may_collide"), found.objects.len());
                    assert_eq!(found.work.fragments as usize, fact("fragments"));
                    assert_eq!(found.work.draws, counts[Event::Draws]);
                    found.pairs(&objects).len()
                };
                assert_eq!(fact("pairs_that_may_collide"), kept);
                assert!(kept > 0 && kept <= candidates(&objects).len());
            }
        }
    }

    /// Every object has vertices of its own, and each of its draws its own counts.
    #[test]
    fn every_object_is_read_from_memory() {
        let read = |method: &str, balls: &str| {
            let job = made(&[("resolution", "4"), ("balls", balls), ("method", method)]).unwrap();
            let hardware = hardware();
            let mut gpu = Gpu::new(&hardware, |_: &Packet, _| ()).unwrap();
            job.frame(0, &mut gpu).unwrap();
            let report = gpu.finish();
            for pass in &report.passes {
                let draws: u64 = pass.draws.iter().map(|draw| draw[Event::Draws]).sum();
                assert_eq!(draws, pass.draws.len() as u64, "{}", pass.name);
            }
            let first = &report.passes[0];
            assert!(first.draws.iter().all(|draw| draw[Event::VerticesFetched] > 0));
            let of_object = first.draws[0][Event::VertexBytes];
            (first.draws.len() as u64, first.counts()[Event::DramReadBytes] / of_object)
        };
        // An object is compared, then added; or drawn once, and boxes are compared.
        for (method, draws) in [("fragment_box", 2), ("box_box", 1)] {
            for (balls, objects) in [("4", 4), ("8", 8)] {
                assert_eq!(read(method, balls), (objects * draws, objects), "{method}");
            }
        }
    }

    #[test]
    fn an_axis_waits_for_the_one_whose_results_the_host_has_read() {
        let job = made(&[("resolution", "16"), ("balls", "6")]).unwrap();
        let hardware = hardware();
        let (mut waits, mut last) = (Vec::new(), 0);
        let mut gpu = Gpu::new(&hardware, |packet: &Packet, _| {
            if packet.kind == PacketKind::Barrier(Waits::All) {
                waits.push(last);
            }
            last = packet.pass;
        })
        .unwrap();
        job.frame(0, &mut gpu).unwrap();
        gpu.finish();
        // Passes 0 to 5 sweep along x, y and z, forward and backward.
        assert_eq!(waits, [1, 3]);
    }

    #[test]
    fn invalid_options_are_refused() {
        assert!(made(&[("resolution", "0")]).is_err() && made(&[("bins", "257")]).is_err());
        assert!(made(&[("balls", "1")]).is_err() && made(&[("file", "nowhere.mts")]).is_err());
    }

    #[test]
    fn a_warning_reports_that_most_pairs_are_kept() {
        assert_eq!(near_everywhere(10, 10).unwrap().code, Code::CollisionNearEverywhere);
        assert!(near_everywhere(10, 9).is_none());
        assert!(near_everywhere(3, 3).is_none());
    }
}
