//! Rows VI-1 to VI-3: continuous collision detection.

use glam::DVec3;
use output::plot::Series;
use pipeline::PipelineSpec;
use rayon::prelude::*;
use run::{GpuSpec, RunError};
use workloads::collision::families::{Case, cases};
use workloads::collision::{
    Method, Object, PlainPasses, PlainResult, Search, Sweeps, candidates, detect_each,
};
use workloads::shapes;

use super::super::report::over_doublings;
use super::super::row::{Cases, Number, Row, numbers};
use super::super::{Done, Figure};
use super::figures::{Ends, overlaps};
use super::settings::{Moving, Shape, TwoObjects};
use super::{Pair, Public, Task, any_kept, load_public};
use crate::reproduce::settings::Form;

/// As the file has it.
const fn name(method: Method) -> &'static str {
    match method {
        Method::FragmentBox => "fragment against box",
        Method::BoxBox => "box against box",
        Method::DepthOnly => "by depth",
    }
}

/// What the modelled hardware drew, and what the host did, as the rows print them.
fn ran(hardware: &PlainResult, host: &PlainResult) -> Vec<Number> {
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

/// Pairs of one kind, and what a way of drawing them says.
#[derive(Clone, Copy, Debug, Default)]
struct Drawn {
    pairs: usize,
    cleared: u64,
    work: PlainResult,
}

impl Drawn {
    fn new(pairs: &[Pair], method: Method, resolution: u32) -> Self {
        let one = |passes: &mut PlainPasses, [a, b]: &Pair| {
            let drawn = passes.pair(a, b);
            (u64::from(!drawn.may_collide()), drawn)
        };
        let each = pairs.par_iter().with_max_len(1).map_init(|| PlainPasses::new(method, resolution), one);
        let (cleared, work) = each.reduce(Default::default, |(n, all), (m, drawn)| (n + m, all.and(&drawn)));
        Self { pairs: pairs.len(), cleared, work }
    }

    /// The same on the modelled hardware.
    fn on(
        hardware: &PipelineSpec,
        pairs: &[Pair],
        method: Method,
        resolution: u32,
    ) -> Result<Self, RunError> {
        let one = |passes: &mut PlainPasses, [a, b]: &Pair| passes.pair_on(a, b, hardware);
        let each = pairs.par_iter().with_max_len(1).map_init(|| PlainPasses::new(method, resolution), one);
        let each: Vec<PlainResult> = each.collect::<Result<_, _>>().map_err(RunError::setting)?;
        let cleared = each.iter().filter(|drawn| !drawn.may_collide()).count() as u64;
        let work = each.iter().fold(PlainResult::default(), |all, one| all.and(one));
        Ok(Self { pairs: pairs.len(), cleared, work })
    }

    /// Pairs of generated cases whose objects do not both stay in the potentially colliding set.
    fn in_sweeps(cases: &[Case], method: Method, resolution: u32) -> Self {
        let one = |Case { objects, collide, .. }: &Case| {
            let set = Sweeps { method, resolution, bins: 1 }.detect(objects);
            let is_kept = |object: &usize| set.objects.binary_search(object).is_ok();
            let cleared = collide.iter().filter(|(a, b)| !(is_kept(a) && is_kept(b))).count();
            Self { pairs: collide.len(), cleared: cleared as u64, work: set.work }
        };
        let and = |a: Self, b: Self| Self {
            pairs: a.pairs + b.pairs,
            cleared: a.cleared + b.cleared,
            work: a.work.and(&b.work),
        };
        cases.par_iter().with_max_len(1).map(one).reduce(Self::default, and)
    }

    /// Share of the pairs that are kept, in percent.
    fn kept_percent(&self) -> f64 {
        100.0 * kept_pairs(self) / self.pairs as f64
    }
}

/// Work of several ways of drawing.
fn work_of(drawn: &[Drawn]) -> PlainResult {
    drawn.iter().fold(PlainResult::default(), |all, one| all.and(&one.work))
}

/// Every method at every resolution.
#[derive(Default)]
struct Looks {
    names: Vec<(Method, u32)>,
    generated: Vec<Drawn>,
    /// Public cases that collide.
    collide: Vec<Drawn>,
    /// Public queries that do not.
    apart: Vec<Drawn>,
    /// All objects of a generated case, in two sweeps.
    swept: Vec<Drawn>,
}

impl Looks {
    fn new(ways: Vec<(Method, u32)>, (own, generated): (&[Case], &[Pair]), public: &Public) -> Self {
        let swept = ways.iter().map(|(method, px)| Drawn::in_sweeps(own, *method, *px)).collect();
        let each = |pairs: &[Pair]| ways.iter().map(|(method, px)| Drawn::new(pairs, *method, *px)).collect();
        let [generated, collide, apart] = [generated, &public.collide, &public.apart].map(each);
        Self { names: ways, generated, collide, apart, swept }
    }

    /// Pairs missed by each way.
    fn missed(&self) -> impl Iterator<Item = (Method, u32, u64)> {
        self.names.iter().enumerate().map(|(way, &(method, px))| {
            let cleared = [&self.generated, &self.collide, &self.swept].map(|drawn| drawn[way].cleared);
            (method, px, cleared.iter().sum())
        })
    }

    /// All work, and that of each kind of public case that there is.
    fn ran(&self, hardware: &PlainResult) -> Vec<Number> {
        let [own, collide, apart] = [&self.generated, &self.collide, &self.apart].map(|drawn| work_of(drawn));
        let mut all = ran(hardware, &own.and(&collide).and(&apart));
        let swept = work_of(&self.swept);
        all.extend(numbers([
            ("passes_of_sweeps_on_the_host", swept.passes as f64),
            ("draws_of_sweeps_on_the_host", swept.draws as f64),
            ("fragments_of_sweeps_on_the_host", swept.fragments as f64),
        ]));
        let some = |drawn: &[Drawn]| drawn.iter().any(|one| one.pairs > 0);
        if some(&self.collide) {
            all.extend(numbers([
                ("draws_of_public_cases_that_collide", collide.draws as f64),
                ("fragments_of_public_cases_that_collide", collide.fragments as f64),
            ]));
        }
        if some(&self.apart) {
            all.extend(numbers([
                ("draws_of_public_queries_that_do_not", apart.draws as f64),
                ("fragments_of_public_queries_that_do_not", apart.fragments as f64),
            ]));
        }
        all
    }

    /// Least and greatest share of public queries that are kept although they do not collide, in percent.
    fn false_positives(&self) -> Option<[f64; 2]> {
        let shares = || self.apart.iter().filter(|one| one.pairs > 0).map(Drawn::kept_percent);
        Some([shares().reduce(f64::min)?, shares().reduce(f64::max)?])
    }

    /// Share of public queries without a collision that each method keeps: no error, only work.
    fn text_of_others(&self, public: &Public) -> String {
        if self.false_positives().is_none() {
            return String::new();
        }
        let each = self.names.iter().zip(&self.apart);
        let each = each
            .map(|((method, px), one)| format!("{} at {px} px {:.1} %", name(*method), one.kept_percent()));
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
    let at =
        |&method: &Method| row.resolution_px.all(form).iter().map(move |&resolution| (method, resolution));
    let ways = row.methods.get(form).iter().flat_map(at).collect();
    let looks = Looks::new(ways, (&own, &generated), &public);
    let (hardware, px) = (hardware()?, *row.resolution_px.get(form));
    let on_hardware = row.methods.get(form).iter().map(|&of| Drawn::on(&hardware, &generated, of, px));
    let on_hardware: Vec<Drawn> = on_hardware.collect::<Result<_, _>>()?;
    let missed_there: u64 = on_hardware.iter().map(|drawn| drawn.cleared).sum();
    let mut tried = Cases::new("pairs missed", "methods and resolution_px jointly, and `quintile ccd`");
    for &of in row.methods.get(form) {
        let at = looks.missed().filter(|(method, ..)| *method == of);
        tried.along(
            &format!("resolution_px ({})", name(of)),
            at.map(|(_, px, missed)| (px, missed as f64, missed == 0)),
        );
    }
    let closer = missed_closer(&generated) + public.missed_closer;
    tried.along("quintile ccd", [("default search", closer as f64, closer == 0)]);
    let missed = looks.missed().map(|(.., missed)| missed).sum::<u64>() + closer as u64;
    let ours = format!(
        "{missed} missed: {} generated pairs that collide{}, by {} kinds of passes, of each pair and, in two sweeps, of all objects of a generated case, and by `quintile ccd`, and \
         {missed_there} by {} of these kinds at {px} px on the modelled hardware, which draws the generated pairs alone{}",
        generated.len(),
        public_text(&public, task.collision_data.is_some()),
        looks.names.len(),
        on_hardware.len(),
        looks.text_of_others(&public)
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
    let facts = numbers(counted).into_iter().chain(facts(&looks, &public)).collect();
    Ok(Done::bare(Row { numbers: facts, ran: looks.ran(&work_of(&on_hardware)), note, ..made }))
}

/// How many cases of each kind there are, and how many of those that do not collide are kept.
fn facts(looks: &Looks, public: &Public) -> Vec<Number> {
    let [fewest, most] = looks.false_positives().unwrap_or([f64::NAN; 2]);
    let cleared = || looks.apart.iter().map(|one| one.cleared);
    numbers([
        ("generated_pairs_that_collide", looks.generated.first().map_or(0, |one| one.pairs) as f64),
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
    let answers = detect_each(&cases, &Search::default(), || ());
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

/// Two objects of a case, and what each way of drawing them leaves.
struct Looked<'a> {
    case: &'a TwoObjects,
    objects: Pair,
}

impl Looked<'_> {
    fn drawn(&self, method: Method, resolution: u32) -> PlainResult {
        PlainPasses::new(method, resolution).pair(&self.objects[0], &self.objects[1])
    }

    /// The same on the modelled hardware.
    fn drawn_on(
        &self,
        hardware: &PipelineSpec,
        method: Method,
        resolution: u32,
    ) -> Result<PlainResult, RunError> {
        let [a, b] = &self.objects;
        PlainPasses::new(method, resolution).pair_on(a, b, hardware).map_err(RunError::setting)
    }

    /// Whether boxes of time and depth and boxes of depth alone say what they have to.
    fn is_distinguished(&self, ours: &PlainResult, depth: &PlainResult) -> bool {
        depth.may_collide() && ours.may_collide() == self.case.collide
    }
}

/// VI-2: time separates what depth alone cannot.
pub(super) fn dodged(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_2);
    let (row, form) = (with.settings, with.form);
    let refused = || RunError::setting("VI-2: a coordinate is beyond 1e60 or not a number");
    let (mut tried, mut drawn, mut said) = (
        Cases::new("pixels left of a pair", "cases, methods and resolution_px jointly"),
        PlainResult::default(),
        Vec::new(),
    );
    let (hardware, mut there) = (hardware()?, PlainResult::default());
    for case in row.objects.get(form).iter().filter(|case| row.cases.all(form).contains(&case.name)) {
        let objects = [object(&case.first).ok_or_else(refused)?, object(&case.second).ok_or_else(refused)?];
        let looked = Looked { case, objects };
        let mut resolutions = row.resolution_px.all(form).to_vec();
        resolutions.sort_unstable();
        for &method in row.methods.get(form) {
            let mut at = Vec::new();
            for &resolution in &resolutions {
                let (ours, depth) =
                    (looked.drawn(method, resolution), looked.drawn(Method::DepthOnly, resolution));
                drawn = drawn.and(&ours).and(&depth);
                let fewest = ours.overlaps.into_iter().min().unwrap_or(0);
                at.push((resolution, fewest as f64, looked.is_distinguished(&ours, &depth)));
                if resolution == *row.resolution_px.get(form) && method == row.methods.get(form)[0] {
                    let on = |method| looked.drawn_on(&hardware, method, resolution);
                    let (ours_there, depth_there) = (on(method)?, on(Method::DepthOnly)?);
                    there = there.and(&ours_there).and(&depth_there);
                    let same = looked.is_distinguished(&ours_there, &depth_there);
                    let text = case_text(case, &ours, &depth, resolution);
                    let on_hardware = if same { "does the same" } else { "does not" };
                    said.push(format!("{text}; the modelled hardware {on_hardware}"));
                }
            }
            tried.along(&format!("resolution_px ({}, {})", case.name, name(method)), at);
        }
    }
    let full = row.cases.values() * row.methods.get(Form::Full).len() * row.resolution_px.values();
    let band = tried.band(full)?;
    let made = with.banded(&row.about, said.join("; "), band);
    let shown = row.objects.get(form).iter().find(|case| case.name == *row.cases.get(form));
    let figure = |case: &TwoObjects| {
        let [first, second] = [&case.first, &case.second].map(triangles);
        overlaps(&case.name, [&first, &second], *row.resolution_px.get(form))
    };
    let figures = shown.map(figure).into_iter().collect();
    Ok(Done { row: Row { ran: ran(&there, &drawn), ..made }, figures })
}

/// Result of the passes for a case, in words.
fn case_text(case: &TwoObjects, ours: &PlainResult, depth: &PlainResult, resolution: u32) -> String {
    let kept = |drawn: &PlainResult| if drawn.may_collide() { "keep" } else { "clear" };
    let along =
        ["x", "y", "z"].into_iter().zip(ours.overlaps).filter(|(_, left)| *left == 0).map(|(axis, _)| axis);
    let along: Vec<&str> = along.collect();
    let where_ =
        if along.is_empty() { String::new() } else { format!(" (apart along {})", along.join(" and ")) };
    format!(
        "{} at {resolution} px: the {} passes {} the pair{where_}, the {} by depth {} it ({} fragments)",
        case.name,
        ours.passes,
        kept(ours),
        depth.passes,
        kept(depth),
        ours.fragments
    )
}

/// VI-3: a fragment against a box is at least as tight as a box against a box.
pub(super) fn tighter(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_3);
    let (row, form) = (with.settings, with.form);
    let all = cases(*row.seed.get(form), *row.cases_of_each_family.get(form));
    let mut resolutions = row.resolution_px.all(form).to_vec();
    resolutions.sort_unstable();
    let mut drawn = PlainResult::default();
    let mut kept = |method| -> Vec<Vec<usize>> {
        let at = |&resolution: &u32| {
            let each: Vec<_> = all.par_iter().map(|case| false_positives(case, method, resolution)).collect();
            drawn = each.iter().fold(drawn, |all, (_, one)| all.and(one));
            each.into_iter().map(|(count, _)| count).collect()
        };
        resolutions.iter().map(at).collect()
    };
    let (boxes, fragments) = (kept(Method::BoxBox), kept(Method::FragmentBox));
    let (hardware, apart) = (hardware()?, all.iter().flat_map(apart).collect::<Vec<Pair>>());
    let px = *row.resolution_px.get(form);
    let on = |method| Drawn::on(&hardware, &apart, method, px);
    let on_hardware = [on(Method::BoxBox)?, on(Method::FragmentBox)?];
    let there = work_of(&on_hardware);
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
        kept_pairs(&on_hardware[1]),
        kept_pairs(&on_hardware[0])
    );

    let facts = numbers([
        ("cases", each().count() as f64),
        ("cases_fewer", better as f64),
        ("cases_more", worse as f64),
        ("boxes_on_the_modelled_hardware", kept_pairs(&on_hardware[0])),
        ("fragments_on_the_modelled_hardware", kept_pairs(&on_hardware[1])),
    ]);
    let figure = curves(&resolutions, [("fragment against box", &fragments), ("box against box", &boxes)]);
    let row = Row { numbers: facts, ran: ran(&there, &drawn), ..with.banded(&row.about, ours, band) };
    Ok(Done { row, figures: vec![figure] })
}

/// Pairs that were kept.
fn kept_pairs(drawn: &Drawn) -> f64 {
    drawn.pairs as f64 - drawn.cleared as f64
}

/// Pairs of a case whose boxes touch and that do not collide.
fn apart(case: &Case) -> impl Iterator<Item = Pair> {
    let pairs = candidates(&case.objects).into_iter().filter(|pair| !case.collide.contains(pair));
    pairs.map(|(a, b)| [case.objects[a].clone(), case.objects[b].clone()])
}

/// Pairs of a case that do not collide and are kept, and what was drawn for that.
fn false_positives(case: &Case, method: Method, resolution: u32) -> (usize, PlainResult) {
    let mut passes = PlainPasses::new(method, resolution);
    let (mut kept, mut all) = (0, PlainResult::default());
    for (a, b) in candidates(&case.objects) {
        if !case.collide.contains(&(a, b)) {
            let drawn = passes.pair(&case.objects[a], &case.objects[b]);
            kept += usize::from(drawn.may_collide());
            all = all.and(&drawn);
        }
    }
    (kept, all)
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

    fn looks(public: &Public) -> Looks {
        Looks::new(vec![(Method::BoxBox, 8), (Method::FragmentBox, 8)], (&[], &[]), public)
    }

    #[test]
    fn public_queries_of_both_kinds_are_drawn_and_counted() {
        // The point beside the diagonal passes within a pixel of the triangle; that above it stays away.
        let apart = vec![query(0.51, 0.51, 2.0), query(0.25, 0.25, 0.5)];
        let public = Public { collide: vec![query(0.25, 0.25, 2.0)], apart, ..Public::default() };
        let looks = looks(&public);
        assert!(looks.missed().all(|(.., missed)| missed == 0));
        assert_eq!(looks.false_positives(), Some([50.0, 50.0]));
        let ran = looks.ran(&PlainResult::default());
        let of = |name: &str| ran.iter().find(|number| number.name == name).unwrap().value;
        assert_eq!(of("draws_of_public_queries_that_do_not"), 2.0 * of("draws_of_public_cases_that_collide"));
        assert_eq!(of("draws_on_the_host"), 3.0 * of("draws_of_public_cases_that_collide"));
        let both =
            ["collide", "do_not"].map(|end| ran.iter().filter(|n| n.name.ends_with(end)).collect::<Vec<_>>());
        assert!(both.iter().all(|kind| kind.len() == 2 && kind.iter().all(|number| number.value > 0.0)));
        let said = looks.text_of_others(&public);
        assert!(said.contains("of 2 public queries that do not collide"), "{said}");
        assert!(said.contains("box against box at 8 px 50.0 %") && said.contains("`quintile ccd` 0.0 %"));
    }

    #[test]
    fn a_pair_that_is_cleared_and_collides_is_missed() {
        let public = Public { collide: vec![query(0.25, 0.25, 0.5)], ..Public::default() };
        let looks = looks(&public);
        assert!(looks.missed().all(|(.., missed)| missed == 1));
        assert_eq!((looks.false_positives(), looks.text_of_others(&public)), (None, String::new()));
        assert!(looks.ran(&PlainResult::default()).iter().all(|number| !number.name.ends_with("do_not")));
    }
}
