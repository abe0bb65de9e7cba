//! Rows VI-1 to VI-3: continuous collision detection.

use glam::DVec3;
use output::plot::Series;
use pipeline::PipelineSpec;
use rayon::prelude::*;
use run::{GpuSpec, RunError};
use workloads::collision::families::{Case, cases};
use workloads::collision::{
    CollisionMethod, Object, Overlaps, PairSearch, PassWork, PlainPasses, Sweeps, candidates, detect_each,
};
use workloads::shapes;

use super::super::report::over_doublings;
use super::super::row::{Cases, ClaimRow, NamedValue, numbers};
use super::super::{Done, Figure};
use super::figures::{Ends, overlaps};
use super::settings::{Moving, Shape, TwoObjects};
use super::{Pair, Public, Task, any_kept, load_public};
use crate::reproduce::settings::Form;

/// As the file has it.
const fn name(method: CollisionMethod) -> &'static str {
    match method {
        CollisionMethod::FragmentBox => "fragment against box",
        CollisionMethod::BoxBox => "box against box",
        CollisionMethod::DepthOnly => "by depth",
    }
}

/// What the modelled hardware drew, and what the host did, as the rows print them.
fn ran(hardware: &PassWork, host: &PassWork) -> Vec<NamedValue> {
    numbers([
        ("passes", hardware.passes as f64),
        ("draws", hardware.draws as f64),
        ("fragments", hardware.fragments as f64),
        ("passes_on_the_host", host.passes as f64),
        ("draws_on_the_host", host.draws as f64),
        ("triangles_on_the_host", host.triangles as f64),
        ("fragments_on_the_host", host.fragments as f64),
    ])
}

/// The modelled hardware, which draws in f32 what the host draws in f64.
fn hardware() -> Result<PipelineSpec, RunError> {
    Ok(GpuSpec::load("reference")?.pipeline)
}

/// Methods and resolutions, each with each. Methods of one resolution compare the same fragments.
#[derive(Clone, Debug, Default)]
struct Ways {
    methods: Vec<CollisionMethod>,
    resolutions: Vec<u32>,
}

impl Ways {
    /// By method, then by resolution.
    fn each(&self) -> impl Iterator<Item = (CollisionMethod, u32)> {
        self.methods.iter().flat_map(|&method| self.resolutions.iter().map(move |&px| (method, px)))
    }
}

/// Pairs of one kind, and what the ways of drawing them say.
#[derive(Clone, Debug, Default)]
struct Drawn {
    pairs: usize,
    /// Pairs that are cleared, by way of drawing.
    cleared: Vec<u64>,
    work: PassWork,
}

impl Drawn {
    fn new(pairs: &[Pair], ways: &Ways) -> Self {
        let at = ways.resolutions.iter().map(|&px| cleared(pairs, &ways.methods, px));
        let at: Vec<(Vec<u64>, PassWork)> = at.collect();
        let cleared = (0..ways.methods.len()).flat_map(|method| at.iter().map(move |(of, _)| of[method]));
        Self {
            pairs: pairs.len(),
            cleared: cleared.collect(),
            work: work_of(at.iter().map(|(_, work)| work)),
        }
    }

    /// The same on the modelled hardware, each method with its own passes.
    fn on(
        hardware: &PipelineSpec,
        pairs: &[Pair],
        methods: &[CollisionMethod],
        resolution: u32,
    ) -> Result<Self, RunError> {
        let mut drawn = Self { pairs: pairs.len(), ..Self::default() };
        for &method in methods {
            let one = |passes: &mut PlainPasses, pair: &Pair| passes.pair_on(pair, method, hardware);
            let each = pairs.par_iter().with_max_len(1).map_init(|| PlainPasses::new(resolution), one);
            let each: Vec<(Overlaps, PassWork)> = each.collect::<Result<_, _>>()?;
            let cleared = each.iter().filter(|(overlaps, _)| !overlaps.may_collide()).count();
            drawn.cleared.push(cleared as u64);
            drawn.work = each.iter().fold(drawn.work, |all, (_, one)| all.and(one));
        }
        Ok(drawn)
    }

    /// Pairs of generated cases whose objects do not both stay in the potentially colliding set.
    fn in_sweeps(cases: &[Case], ways: &Ways) -> Self {
        let pairs = cases.iter().map(|case| case.collide.len()).sum();
        let one = |(method, resolution), Case { objects, collide, .. }: &Case| {
            let set = Sweeps { method, resolution, bins: 1 }.detect(objects);
            let is_kept = |object: &usize| set.objects.binary_search(object).is_ok();
            let cleared = collide.iter().filter(|(a, b)| !(is_kept(a) && is_kept(b))).count();
            (cleared as u64, set.work)
        };
        let and = |a: (u64, PassWork), b: (u64, PassWork)| (a.0 + b.0, a.1.and(&b.1));
        let by =
            |way| cases.par_iter().with_max_len(1).map(|case| one(way, case)).reduce(Default::default, and);
        let each: Vec<(u64, PassWork)> = ways.each().map(by).collect();
        let cleared = each.iter().map(|(cleared, _)| *cleared).collect();
        Self { pairs, cleared, work: work_of(each.iter().map(|(_, work)| work)) }
    }

    /// Pairs that each way keeps.
    fn kept(&self) -> impl Iterator<Item = u64> {
        self.cleared.iter().map(|cleared| self.pairs as u64 - cleared)
    }

    /// Share of the pairs that each way keeps, in percent.
    fn kept_percent(&self) -> impl Iterator<Item = f64> {
        self.kept().map(|kept| 100.0 * kept as f64 / self.pairs as f64)
    }
}

/// How many pairs each method clears, and the work of drawing them.
fn cleared(pairs: &[Pair], methods: &[CollisionMethod], resolution: u32) -> (Vec<u64>, PassWork) {
    let none = || (vec![0; methods.len()], PassWork::default());
    let one = |passes: &mut PlainPasses, pair: &Pair| {
        let (overlaps, work) = passes.pair(pair.each_ref(), methods);
        (overlaps.iter().map(|overlaps| u64::from(!overlaps.may_collide())).collect::<Vec<u64>>(), work)
    };
    let each = pairs.par_iter().with_max_len(1).map_init(|| PlainPasses::new(resolution), one);
    each.reduce(none, |(a, work), (b, other)| {
        (a.iter().zip(&b).map(|(a, b)| a + b).collect(), work.and(&other))
    })
}

/// The sum of work.
fn work_of<'a>(each: impl Iterator<Item = &'a PassWork>) -> PassWork {
    each.fold(PassWork::default(), |all, one| all.and(one))
}

/// Every method at every resolution.
#[derive(Default)]
struct Comparisons {
    ways: Ways,
    generated: Drawn,
    /// Public cases that collide.
    collide: Drawn,
    /// Public queries that do not.
    apart: Drawn,
    /// All objects of a generated case, in two sweeps.
    swept: Drawn,
}

impl Comparisons {
    fn new(ways: Ways, (own, generated): (&[Case], &[Pair]), public: &Public) -> Self {
        let swept = Drawn::in_sweeps(own, &ways);
        let [generated, collide, apart] =
            [generated, &public.collide, &public.apart].map(|pairs| Drawn::new(pairs, &ways));
        Self { ways, generated, collide, apart, swept }
    }

    /// Pairs missed by each way.
    fn missed(&self) -> impl Iterator<Item = (CollisionMethod, u32, u64)> {
        self.ways.each().enumerate().map(|(way, (method, px))| {
            let cleared = [&self.generated, &self.collide, &self.swept].map(|drawn| drawn.cleared[way]);
            (method, px, cleared.iter().sum())
        })
    }

    /// All work, and that of each kind of public case that there is.
    fn ran(&self, hardware: &PassWork) -> Vec<NamedValue> {
        let Self { generated, collide, apart, swept, .. } = self;
        let mut all =
            ran(hardware, &work_of([generated, collide, apart].map(|drawn| &drawn.work).into_iter()));
        all.extend(numbers([
            ("passes_of_sweeps_on_the_host", swept.work.passes as f64),
            ("draws_of_sweeps_on_the_host", swept.work.draws as f64),
            ("fragments_of_sweeps_on_the_host", swept.work.fragments as f64),
        ]));
        if collide.pairs > 0 {
            all.extend(numbers([
                ("draws_of_public_cases_that_collide", collide.work.draws as f64),
                ("fragments_of_public_cases_that_collide", collide.work.fragments as f64),
            ]));
        }
        if apart.pairs > 0 {
            all.extend(numbers([
                ("draws_of_public_queries_that_do_not", apart.work.draws as f64),
                ("fragments_of_public_queries_that_do_not", apart.work.fragments as f64),
            ]));
        }
        all
    }

    /// Least and greatest share of public queries that are kept although they do not collide, in percent.
    fn false_positives(&self) -> Option<[f64; 2]> {
        let shares = || self.apart.kept_percent().filter(|share| share.is_finite());
        Some([shares().reduce(f64::min)?, shares().reduce(f64::max)?])
    }

    /// Share of public queries without a collision that each method keeps: no error, only work.
    fn text_of_others(&self, public: &Public) -> String {
        if self.false_positives().is_none() {
            return String::new();
        }
        let each = self.ways.each().zip(self.apart.kept_percent());
        let each = each.map(|((method, px), kept)| format!("{} at {px} px {kept:.1} %", name(method)));
        let ccd = 100.0 * public.kept_closer as f64 / public.apart.len() as f64;
        let each = each.collect::<Vec<_>>().join(", ");
        format!(
            "; false positives of {} public queries that do not collide, all drawn, not judged: {each}, `quintile ccd` {ccd:.1} %",
            public.apart.len()
        )
    }
}

/// VI-1: no pair that collides is missed.
pub(super) fn missed(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_1);
    let (row, form) = (with.settings, with.form);
    let own = cases(*row.seed.get(form), *row.cases_of_each_family.get(form));
    let pair = |case: &Case, (a, b): (usize, usize)| [case.objects[a].clone(), case.objects[b].clone()];
    let generated: Vec<Pair> =
        own.iter().flat_map(|case| case.collide.iter().map(move |&both| pair(case, both))).collect();
    let public = match task.collision_data {
        Some(folder) => load_public(folder, row.public_scenes.get(form))?,
        None => Public::default(),
    };
    let methods = row.methods.get(form);
    let ways = Ways { methods: methods.clone(), resolutions: row.resolution_px.all(form).to_vec() };
    let comparisons = Comparisons::new(ways, (&own, &generated), &public);
    let px = *row.resolution_px.get(form);
    let on_hardware = Drawn::on(&hardware()?, &generated, methods, px)?;
    let missed_there: u64 = on_hardware.cleared.iter().sum();
    let mut tried = Cases::new("pairs missed", "methods and resolution_px jointly, and `quintile ccd`");
    for &of in methods {
        let at = comparisons.missed().filter(|(method, ..)| *method == of);
        tried.along(
            &format!("resolution_px ({})", name(of)),
            at.map(|(_, px, missed)| (px, missed as f64, missed == 0)),
        );
    }
    let closer = missed_closer(&generated) + public.missed_closer;
    tried.along("quintile ccd", [("default search", closer as f64, closer == 0)]);
    let missed = comparisons.missed().map(|(.., missed)| missed).sum::<u64>() + closer as u64;
    let ours = format!(
        "{missed} missed: {} generated pairs that collide{}, by {} kinds of passes, of each pair and, in two sweeps, of all objects of a generated case, and by `quintile ccd`, and \
         {missed_there} by {} of these kinds at {px} px on the modelled hardware, which draws the generated pairs alone{}",
        generated.len(),
        public_text(&public, task.collision_data.is_some()),
        comparisons.ways.each().count(),
        methods.len(),
        comparisons.text_of_others(&public)
    );
    let full = row.methods.get(Form::Full).len() * row.resolution_px.values() + 1;
    let band = tried.band(full)?;
    let made = with.banded(&row.about, ours, band);
    let note = match public.collide.len() + public.known {
        0 => format!("no public case that collides was tested; {}", made.note),
        _ => made.note.clone(),
    };
    let counted = [
        ("missed", missed as f64),
        ("missed_on_the_modelled_hardware", missed_there as f64),
        ("generated_cases", own.len() as f64),
    ];
    let facts = numbers(counted).into_iter().chain(facts(&comparisons, &public)).collect();
    Ok(Done::bare(ClaimRow { numbers: facts, ran: comparisons.ran(&on_hardware.work), note, ..made }))
}

/// How many cases of each kind there are, and how many of those that do not collide are kept.
fn facts(comparisons: &Comparisons, public: &Public) -> Vec<NamedValue> {
    let [fewest, most] = comparisons.false_positives().unwrap_or([f64::NAN; 2]);
    let cleared = || comparisons.apart.cleared.iter().copied();
    numbers([
        ("generated_pairs_that_collide", comparisons.generated.pairs as f64),
        ("public_scenes", public.scenes as f64),
        ("public_scene_pairs_that_collide", public.known as f64),
        ("public_scene_pairs_identified", public.seen as f64),
        ("public_query_files", public.query_files as f64),
        ("public_queries", public.queries as f64),
        ("public_cases_that_collide_drawn", public.collide.len() as f64),
        ("public_queries_that_do_not_collide_drawn", public.apart.len() as f64),
        ("fewest_of_these_cleared", cleared().min().unwrap_or(0) as f64),
        ("most_of_these_cleared", cleared().max().unwrap_or(0) as f64),
        ("least_false_positives_percent", fewest),
        ("most_false_positives_percent", most),
        ("kept_of_these_by_ccd", public.kept_closer as f64),
    ])
}

/// Remainder of a sentence: the public data that was run.
fn public_text(public: &Public, given: bool) -> String {
    if !given {
        return "; no public case, as no folder was given (--collision-data)".to_owned();
    }
    let unknown = match public.known - public.seen {
        0 => String::new(),
        n => format!(" (which {n} of them are is not known; they are counted for `quintile ccd` alone)"),
    };
    format!(
        "; {} public scenes with {} pairs that collide{unknown}, their other pairs not drawn; {} public queries in {} files, all drawn, of which {} collide",
        public.scenes,
        public.known,
        public.queries,
        public.query_files,
        public.collide.len() - public.seen
    )
}

/// Pairs that collide and that `quintile ccd` misses.
fn missed_closer(pairs: &[Pair]) -> usize {
    let cases: Vec<&[Object]> = pairs.iter().map(Pair::as_slice).collect();
    let answers = detect_each(&cases, &PairSearch::default(), || ());
    answers.iter().filter(|answers| !any_kept(answers)).count()
}

/// A shape on its way.
fn object(moving: &Moving) -> Option<Object> {
    Object::from_ends(triangles(moving), 0.0)
}

/// Triangles of a shape on its way.
fn triangles(moving: &Moving) -> Vec<Ends> {
    let mesh = match moving.shape {
        Shape::Cuboid(x, y, z) => shapes::cuboid(DVec3::new(x, y, z).as_vec3(), 0),
        Shape::Ball { radius, segments } => shapes::sphere(radius, segments, 0),
    };
    let (sin, cos) = libm::sincos(moving.turned_deg.to_radians());
    let at = |vertex: u32, (x, y, z): (f64, f64, f64)| {
        let p = mesh.positions[vertex as usize].as_dvec3();
        [cos * p.x - sin * p.y + x, sin * p.x + cos * p.y + y, p.z + z]
    };
    let ends =
        |triangle: &[u32; 3]| [moving.from, moving.to].map(|place| triangle.map(|vertex| at(vertex, place)));
    mesh.triangles.iter().map(ends).collect()
}

/// VI-2: time separates what depth alone cannot.
pub(super) fn dodged(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_2);
    let (row, form) = (with.settings, with.form);
    let refused = || RunError::setting("VI-2: a coordinate is beyond 1e60 or not a number");
    let (mut tried, mut drawn, mut described) = (
        Cases::new("pixels left of a pair", "cases, methods and resolution_px jointly"),
        PassWork::default(),
        Vec::new(),
    );
    let (hardware, mut there) = (hardware()?, PassWork::default());
    let methods = row.methods.get(form);
    for case in row.objects.get(form).iter().filter(|case| row.cases.all(form).contains(&case.name)) {
        let pair = [object(&case.first).ok_or_else(refused)?, object(&case.second).ok_or_else(refused)?];
        let mut resolutions = row.resolution_px.all(form).to_vec();
        resolutions.sort_unstable();
        let each: Vec<Compared> = resolutions.iter().map(|&px| Compared::new(&pair, methods, px)).collect();
        drawn = drawn.and(&work_of(each.iter().map(|at| &at.work)));
        for (of, &method) in methods.iter().enumerate() {
            let at = each.iter().map(|at| {
                (at.resolution, at.ours[of].fewest() as f64, is_distinguished(case, &at.ours[of], &at.depth))
            });
            tried.along(&format!("resolution_px ({}, {})", case.name, name(method)), at);
        }
        let base = *row.resolution_px.get(form);
        if let Some(at) = each.iter().find(|at| at.resolution == base) {
            let on =
                |method| PlainPasses::new(base).pair_on(&pair, method, &hardware).map_err(RunError::from);
            let ((ours, work), (depth, depth_work)) = (on(methods[0])?, on(CollisionMethod::DepthOnly)?);
            there = there.and(&work).and(&depth_work);
            let same = if is_distinguished(case, &ours, &depth) { "does the same" } else { "does not" };
            described.push(format!("{}; the modelled hardware {same}", at.text(case)));
        }
    }
    let full = row.cases.values() * row.methods.get(Form::Full).len() * row.resolution_px.values();
    let band = tried.band(full)?;
    let made = with.banded(&row.about, described.join("; "), band);
    let shown = row.objects.get(form).iter().find(|case| case.name == *row.cases.get(form));
    let figure = |case: &TwoObjects| {
        let [first, second] = [&case.first, &case.second].map(triangles);
        overlaps(&case.name, [&first, &second], *row.resolution_px.get(form))
    };
    let figures = shown.map(figure).into_iter().collect();
    Ok(Done { row: ClaimRow { ran: ran(&there, &drawn), ..made }, figures })
}

/// Whether boxes of time and depth, and of depth alone, say of a case what they have to.
fn is_distinguished(case: &TwoObjects, ours: &Overlaps, depth: &Overlaps) -> bool {
    depth.may_collide() && ours.may_collide() == case.collide
}

/// What the passes leave of two objects.
struct Compared {
    resolution: u32,
    /// By method.
    ours: Vec<Overlaps>,
    /// By depth alone.
    depth: Overlaps,
    work: PassWork,
}

impl Compared {
    fn new(pair: &Pair, methods: &[CollisionMethod], resolution: u32) -> Self {
        let all = [methods, &[CollisionMethod::DepthOnly]].concat();
        let (mut ours, work) = PlainPasses::new(resolution).pair(pair.each_ref(), &all);
        let depth = ours.remove(methods.len());
        Self { resolution, ours, depth, work }
    }

    /// The first method beside depth alone, in words.
    fn text(&self, case: &TwoObjects) -> String {
        let kept = |drawn: &Overlaps| if drawn.may_collide() { "keep" } else { "clear" };
        let ours = &self.ours[0];
        let along = ["x", "y", "z"].into_iter().zip(ours.0).filter(|(_, left)| *left == 0);
        let along: Vec<&str> = along.map(|(axis, _)| axis).collect();
        let where_ =
            if along.is_empty() { String::new() } else { format!(" (apart along {})", along.join(" and ")) };
        format!(
            "{} at {} px: the {} passes {} the pair{where_}, by depth alone in both directions they {} it ({} fragments)",
            case.name,
            self.resolution,
            self.work.passes,
            kept(ours),
            kept(&self.depth),
            self.work.fragments
        )
    }
}

/// VI-3: a fragment against a box is at least as tight as a box against a box.
pub(super) fn tighter(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_3);
    let (row, form) = (with.settings, with.form);
    let all = cases(*row.seed.get(form), *row.cases_of_each_family.get(form));
    let mut resolutions = row.resolution_px.all(form).to_vec();
    resolutions.sort_unstable();
    let methods = [CollisionMethod::BoxBox, CollisionMethod::FragmentBox];
    let at = |&resolution: &u32| -> Vec<(Vec<usize>, PassWork)> {
        all.par_iter().map(|case| false_positives(case, &methods, resolution)).collect()
    };
    let each: Vec<Vec<(Vec<usize>, PassWork)>> = resolutions.iter().map(at).collect();
    let drawn = work_of(each.iter().flatten().map(|(_, work)| work));
    let [boxes, fragments] = [0, 1].map(|method| -> Vec<Vec<usize>> {
        each.iter().map(|at| at.iter().map(|(kept, _)| kept[method]).collect()).collect()
    });
    let apart = all.iter().flat_map(apart).collect::<Vec<Pair>>();
    let px = *row.resolution_px.get(form);
    let on_hardware = Drawn::on(&hardware()?, &apart, &methods, px)?;
    let kept_there: Vec<u64> = on_hardware.kept().collect();
    let mut tried = Cases::new(
        "cases with fewer false positives for fragments, less those with more",
        "resolution_px alone",
    );
    let judged = |(at, (fragments, boxes)): (&u32, (&Vec<usize>, &Vec<usize>))| {
        let count =
            |is: fn(&usize, &usize) -> bool| fragments.iter().zip(boxes).filter(|(f, b)| is(f, b)).count();
        let (worse, better) = (count(|f, b| f > b), count(|f, b| f < b));
        (*at, better as f64 - worse as f64, worse == 0 && better > 0)
    };
    tried.along("resolution_px", resolutions.iter().zip(fragments.iter().zip(&boxes)).map(judged));
    let band = tried.band(row.resolution_px.values())?;
    let each = || fragments.iter().flatten().zip(boxes.iter().flatten());
    let (worse, better) = (each().filter(|(f, b)| f > b).count(), each().filter(|(f, b)| f < b).count());
    let sums =
        |of: &[Vec<usize>]| of.iter().map(|counts| counts.iter().sum::<usize>()).collect::<Vec<usize>>();
    let (boxes, fragments) = (sums(&boxes), sums(&fragments));
    let ours = format!(
        "false positives at {resolutions:?} px: {fragments:?} for fragments, {boxes:?} for boxes; fewer in {better} of {} cases, more in {worse}; \
         on the modelled hardware at {px} px {} and {}",
        each().count(),
        kept_there[1],
        kept_there[0]
    );

    let facts = numbers([
        ("cases", each().count() as f64),
        ("cases_fewer", better as f64),
        ("cases_more", worse as f64),
        ("boxes_on_the_modelled_hardware", kept_there[0] as f64),
        ("fragments_on_the_modelled_hardware", kept_there[1] as f64),
    ]);
    let figure = curves(&resolutions, [("fragment against box", &fragments), ("box against box", &boxes)]);
    let row = ClaimRow {
        numbers: facts,
        ran: ran(&on_hardware.work, &drawn),
        ..with.banded(&row.about, ours, band)
    };
    Ok(Done { row, figures: vec![figure] })
}

/// Pairs of a case whose boxes touch and that do not collide.
fn apart(case: &Case) -> impl Iterator<Item = Pair> {
    let pairs = candidates(&case.objects).into_iter().filter(|pair| !case.collide.contains(pair));
    pairs.map(|(a, b)| [case.objects[a].clone(), case.objects[b].clone()])
}

/// Pairs of a case that do not collide and that each method keeps, and what was drawn for that.
fn false_positives(case: &Case, methods: &[CollisionMethod], resolution: u32) -> (Vec<usize>, PassWork) {
    let mut passes = PlainPasses::new(resolution);
    let mut all = (vec![0; methods.len()], PassWork::default());
    for (a, b) in candidates(&case.objects) {
        if !case.collide.contains(&(a, b)) {
            let (overlaps, work) = passes.pair([&case.objects[a], &case.objects[b]], methods);
            all.0.iter_mut().zip(overlaps).for_each(|(kept, of)| *kept += usize::from(of.may_collide()));
            all.1 = all.1.and(&work);
        }
    }
    all
}

fn curves(resolutions: &[u32], kept: [(&str, &Vec<usize>); 2]) -> Figure {
    let curve = |(name, kept): (&str, &Vec<usize>)| {
        let points = resolutions.iter().zip(kept).map(|(pixels, kept)| (f64::from(*pixels), *kept as f64));
        Series::curve(name, points)
    };
    over_doublings(
        "VI_fig5",
        [
            "False positives: fragment against box, box against box",
            "families of moving objects, one box of time and depth a pixel",
        ],
        ["pixels across", "false positives"],
        kept.into_iter().map(curve).collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point that goes down by two at a place, and the triangle below the diagonal of the unit square.
    fn query(x: f64, y: f64, down: f64) -> Pair {
        let point = [[[x, y, 1.0]; 3], [[x, y, 1.0 - down]; 3]];
        let face = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        [point, [face, face]].map(|ends| Object::from_ends(vec![ends], 0.0).unwrap())
    }

    fn comparisons(public: &Public) -> Comparisons {
        let ways = Ways {
            methods: vec![CollisionMethod::BoxBox, CollisionMethod::FragmentBox],
            resolutions: vec![8],
        };
        Comparisons::new(ways, (&[], &[]), public)
    }

    #[test]
    fn public_queries_of_both_kinds_are_drawn_and_counted() {
        // The point beside the diagonal passes within a pixel of the triangle; that above it stays away.
        let apart = vec![query(0.51, 0.51, 2.0), query(0.25, 0.25, 0.5)];
        let public = Public { collide: vec![query(0.25, 0.25, 2.0)], apart, ..Public::default() };
        let comparisons = comparisons(&public);
        assert!(comparisons.missed().all(|(.., missed)| missed == 0));
        assert_eq!(comparisons.false_positives(), Some([50.0, 50.0]));
        let ran = comparisons.ran(&PassWork::default());
        let of = |name: &str| ran.iter().find(|number| number.name == name).unwrap().value;
        assert_eq!(of("draws_of_public_queries_that_do_not"), 2.0 * of("draws_of_public_cases_that_collide"));
        assert_eq!(of("draws_on_the_host"), 3.0 * of("draws_of_public_cases_that_collide"));
        let both =
            ["collide", "do_not"].map(|end| ran.iter().filter(|n| n.name.ends_with(end)).collect::<Vec<_>>());
        assert!(both.iter().all(|kind| kind.len() == 2 && kind.iter().all(|number| number.value > 0.0)));
        let described = comparisons.text_of_others(&public);
        assert!(described.contains("of 2 public queries that do not collide"), "{described}");
        assert!(
            described.contains("box against box at 8 px 50.0 %")
                && described.contains("`quintile ccd` 0.0 %")
        );
    }

    #[test]
    fn a_pair_that_is_cleared_and_collides_is_missed() {
        let public = Public { collide: vec![query(0.25, 0.25, 0.5)], ..Public::default() };
        let comparisons = comparisons(&public);
        assert!(comparisons.missed().all(|(.., missed)| missed == 1));
        assert_eq!(
            (comparisons.false_positives(), comparisons.text_of_others(&public)),
            (None, String::new())
        );
        assert!(comparisons.ran(&PassWork::default()).iter().all(|number| !number.name.ends_with("do_not")));
    }
}
