//! `quintile chart ccd`: false positives of collision detection over resolution, time bins and cost, and
//! failure modes.

use cpu_time::ThreadTime;
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::terminal::Progress;
use power_model::{EnergyTable, Platform, PowerModel};
use run::{GpuSpec, JobFrame, RunError};
use serde::Serialize;
use workloads::collision::families::{Case, cases, reference_cases, slide, triangles_boxes_touch};
use workloads::collision::{CollisionMethod, PairSearch, Sweeps, candidates, detect, job};
use workloads::job::{JobRequest, OptionSource};
use workloads::scene::Overrides;

use crate::study::table::{Sheet, TableBuilder, fixed, millis, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError};

/// Effort of the measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CcdEffort {
    /// Cases of each family of two objects, and of each of many.
    pub cases: [usize; 2],
    /// Pixels across.
    pub resolutions: &'static [u32],
    /// Bins of time in a pixel, for the methods that look once.
    pub bins: &'static [u32],
    /// Gaps between plates that slide, in parts of their length.
    pub gaps: &'static [f64],
    /// Ways in which they lie, for each gap.
    pub slides: usize,
    /// Reference cases of each kind, of two objects and of many.
    pub reference_cases: [usize; 2],
    /// Bins of time in a pixel for these.
    pub reference_bins: &'static [u32],
    /// Balls that `quintile run ccd` moves, drawn on a GPU with and without narrowing.
    pub balls: u32,
}

/// A method of collision detection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CcdMethod {
    /// By the boxes that whole objects sweep.
    ObjectBoxes,
    /// By the boxes that triangles sweep.
    TriangleBoxes,
    /// By two sweeps over all objects along each axis, as in the paper.
    Sweeps(Sweeps),
    /// By images of each pair.
    Images(PairSearch),
}

impl CcdMethod {
    /// Name of the method in the tables.
    pub fn name(&self) -> String {
        match self {
            Self::ObjectBoxes => "swept boxes of objects".to_owned(),
            Self::TriangleBoxes => "swept boxes of triangles".to_owned(),
            Self::Sweeps(Sweeps { bins, .. }) => format!("two sweeps, bins {bins}"),
            Self::Images(PairSearch { zoom: true, .. }) => "with refinement".to_owned(),
            Self::Images(PairSearch { method: CollisionMethod::DepthOnly, .. }) => "depth only".to_owned(),
            Self::Images(PairSearch { method: CollisionMethod::BoxBox, bins, .. }) => {
                format!("box-box, bins {bins}")
            }
            Self::Images(PairSearch { bins, .. }) => format!("fragment-box, bins {bins}"),
        }
    }

    /// Pixels across; none where there is no image.
    pub fn resolution(&self) -> u32 {
        match self {
            Self::Images(PairSearch { resolution, .. }) | Self::Sweeps(Sweeps { resolution, .. }) => {
                *resolution
            }
            Self::ObjectBoxes | Self::TriangleBoxes => 0,
        }
    }
}

/// Which cases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Set {
    /// The families.
    Families,
    /// Cases like the reference cases of the book.
    LikeReference,
}

impl Set {
    /// Name of the set in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Families => "families",
            Self::LikeReference => "like_reference",
        }
    }
}

/// Results of one method for all cases of a set.
#[derive(Clone, Debug, Serialize)]
pub struct CcdRow {
    /// The set.
    pub cases: Set,
    /// The way.
    pub way: String,
    /// Pixels across; 0 where there is no image.
    pub resolution: u32,
    /// False positive rate over pairs of two objects: pairs kept, as a share of those that do not collide.
    pub two: f64,
    /// The same of pairs among many.
    pub many: f64,
    /// Pairs that collide and were not kept: there may be none.
    pub missed: usize,
    /// CPU time of a pair whose swept boxes touch, s.
    pub pair_s: f64,
}

/// Plates that slide along each other without touching.
#[derive(Clone, Debug, Serialize)]
pub struct Slide {
    /// Pixels across.
    pub resolution: u32,
    /// The gap in parts of the plates' length.
    pub gap: f64,
    /// False positive rate over orientations.
    pub kept: f64,
}

/// A frame of `quintile run ccd`.
#[derive(Clone, Debug, Serialize)]
pub struct Narrowing {
    /// Whether pairs are narrowed one by one, instead of two sweeps over all objects along each axis.
    pub narrow: bool,
    /// Pixels across.
    pub resolution: u32,
    /// Pairs that may collide, as a share of those whose swept boxes touch.
    pub kept: f64,
    /// Time on the GPU, s.
    pub gpu_s: f64,
    /// Energy, J.
    pub gpu_j: f64,
}

impl Narrowing {
    /// Name of the method.
    fn name(&self) -> &'static str {
        if self.narrow { "narrowed pair by pair" } else { "two sweeps" }
    }
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct CcdChart {
    /// Effort of the measurement.
    pub effort: CcdEffort,
    /// Pairs that collide and pairs that do not, of two objects and of many.
    pub pairs: [[usize; 2]; 2],
    /// The same of the cases like the reference cases.
    pub reference_pairs: [[usize; 2]; 2],
    /// Way by way: over the families, then over cases like the reference cases.
    pub rows: Vec<CcdRow>,
    /// Plates that slide, looked at closer.
    pub slides: Vec<Slide>,
    /// Frames with and without narrowing.
    pub narrowed: Vec<Narrowing>,
}

/// Two-object cases, then those of many.
fn all_cases(effort: &CcdEffort) -> Vec<Case> {
    let two = cases(301, effort.cases[0]).into_iter().filter(|case| case.objects.len() == 2);
    two.chain(cases(301, effort.cases[1]).into_iter().filter(|case| case.objects.len() > 2)).collect()
}

/// Pixels across of the reference cases.
const REFERENCE_PIXELS: u32 = 128;

/// The ways of the reference cases.
fn reference_ways(effort: &CcdEffort) -> Vec<CcdMethod> {
    let once = PairSearch {
        resolution: REFERENCE_PIXELS,
        bins: 1,
        method: CollisionMethod::FragmentBox,
        zoom: false,
    };
    let depth_only = PairSearch { method: CollisionMethod::DepthOnly, ..once };
    let binned = effort.reference_bins.iter().map(|&bins| PairSearch { bins, ..once });
    let images = [depth_only].into_iter().chain(binned).chain([PairSearch::default()]).map(CcdMethod::Images);
    let sweeps = effort.reference_bins.iter().map(|&bins| sweeps(REFERENCE_PIXELS, bins));
    [CcdMethod::ObjectBoxes, CcdMethod::TriangleBoxes].into_iter().chain(sweeps).chain(images).collect()
}

/// Two sweeps over all objects.
fn sweeps(resolution: u32, bins: u32) -> CcdMethod {
    CcdMethod::Sweeps(Sweeps { method: CollisionMethod::FragmentBox, resolution, bins })
}

/// All ways, from the cheapest on.
fn ways(effort: &CcdEffort) -> Vec<CcdMethod> {
    let search = PairSearch { resolution: 0, bins: 1, method: CollisionMethod::FragmentBox, zoom: false };
    let each = effort.resolutions.iter().flat_map(|&resolution| {
        let search = PairSearch { resolution, ..search };
        let binned = effort.bins.iter().map(move |&bins| PairSearch { bins, ..search });
        let others = [
            PairSearch { method: CollisionMethod::DepthOnly, ..search },
            PairSearch { method: CollisionMethod::BoxBox, ..search },
            PairSearch { zoom: true, bins: PairSearch::default().bins, ..search },
        ];
        let swept = effort.bins.iter().map(move |&bins| sweeps(resolution, bins));
        swept.chain(binned.chain(others).map(CcdMethod::Images))
    });
    [CcdMethod::ObjectBoxes, CcdMethod::TriangleBoxes].into_iter().chain(each).collect()
}

impl Study for CcdChart {
    const NAME: &'static str = "ccd";
    const ABOUT: &'static str =
        "False positives of collision detection, over resolution, bins of time and cost, and where it fails";
    const PICTURES: &'static [&'static str] = &["ccd", "ccd_failures", "ccd_narrowing"];
    const FILES: &'static [&'static str] = &["ccd.csv", "ccd.json"];

    type Effort = CcdEffort;
    const FULL: CcdEffort = CcdEffort {
        cases: [12, 2],
        resolutions: &[8, 16, 32, 64],
        bins: &[1, 4, 16],
        gaps: &[0.3, 0.1, 0.03, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6],
        slides: 16,
        reference_cases: [12, 3],
        reference_bins: &[1, 16, 64],
        balls: 12,
    };
    const QUICK: CcdEffort = CcdEffort {
        cases: [3, 1],
        resolutions: &[4, 16],
        bins: &[1, 4],
        gaps: &[0.3, 0.1, 1e-2, 1e-3],
        slides: 6,
        reference_cases: [1, 1],
        reference_bins: &[1, 16],
        balls: 4,
    };

    fn measure(effort: CcdEffort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let sets = [
            (Set::Families, all_cases(&effort), ways(&effort)),
            (
                Set::LikeReference,
                reference_cases(1, effort.reference_cases[0], effort.reference_cases[1]),
                reference_ways(&effort),
            ),
        ];
        let bar = progress.bar("ways", sets.iter().map(|(_, _, ways)| ways.len() as u64).sum());
        let mut rows = Vec::new();
        for (set, cases, ways) in &sets {
            for way in ways {
                rows.push(row(way, *set, cases)?);
                bar.inc();
            }
        }
        let slides = slides(&effort, progress);
        let narrowed = narrowed(&effort, progress)?;
        let [pairs, reference_pairs] = sets.each_ref().map(|(_, cases, _)| pairs(cases));
        Ok(Self { effort, pairs, reference_pairs, rows, slides, narrowed })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let title = "False positives of collision detection";
        to.chart("ccd", [title, &subject(&self.pairs)], self.panels())?;
        let title = "Where collision detection fails: grazing contact";
        let subject = "plates of 72 triangles that slide along each other without touching, any way round, looked at closer: the false positive rate over orientations. \
             Marked: nine in ten and more at every resolution, where a run warns (collision-near-everywhere)";
        to.chart("ccd_failures", [title, subject], vec![self.failures()])?;
        let title = "What narrowing gains on the GPU";
        let subject = format!(
            "quintile run ccd, {} balls, {} pixels across and more: two sweeps over all objects along each axis, as in the paper, and pairs narrowed by the CPU \
             from axis to axis",
            self.effort.balls, self.effort.resolutions[0]
        );
        to.chart("ccd_narrowing", [title, &subject], self.gains())
    }

    fn tables(&self) -> Vec<Sheet> {
        let ways = |set: Set, below: String| {
            TableBuilder::of(self.rows.iter().filter(move |row| row.cases == set))
                .shown("", |row| row.way.as_str(), plain)
                .shown("px", |row| row.resolution, |px| if px == 0 { "-".to_owned() } else { px.to_string() })
                .shown("two objects", |row| row.two, fixed(3))
                .shown("many", |row| row.many, fixed(4))
                .shown("missed", |row| row.missed, plain)
                .shown("ms a pair", |row| row.pair_s, millis(3))
                .after(below)
        };
        let families = ways(Set::Families, format!("{}\n", subject(&self.pairs)));
        let below = format!("{}, cases like the reference cases\n", subject(&self.reference_pairs));
        let reference = ways(Set::LikeReference, below);
        let slides = TableBuilder::of(&self.slides)
            .shown("plates that slide: gap", |slide| slide.gap, |gap| format!("{gap:e}"))
            .shown("px", |slide| slide.resolution, plain)
            .shown("false positive rate", |slide| slide.kept, fixed(2));
        let narrowed = TableBuilder::of(&self.narrowed)
            .shown("on the GPU", |row| row.name(), plain)
            .shown("px", |row| row.resolution, plain)
            .shown("pairs kept", |row| row.kept, fixed(3))
            .shown("ms", |row| row.gpu_s, millis(3))
            .shown("mJ", |row| row.gpu_j, millis(3));
        let rows = TableBuilder::of(&self.rows)
            .data("cases", |row| row.cases.name())
            .data("way", |row| row.way.as_str())
            .data("resolution", |row| row.resolution)
            .data("two", |row| row.two)
            .data("many", |row| row.many)
            .data("missed", |row| row.missed)
            .data("pair_s", |row| row.pair_s)
            .csv("ccd.csv");
        vec![families.sheet(), reference.sheet(), slides.sheet(), narrowed.sheet(), rows.sheet()]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let both = |row: &CcdRow| {
            let level = if row.resolution == 0 { String::new() } else { format!("{} px", row.resolution) };
            [("two objects", row.two), ("many objects", row.many)].map(|(kind, rate)| {
                let rate = Metric::new("false positive rate", "", rate).beside(0.0);
                let cost = Metric::new("CPU time of a pair", "s", row.pair_s);
                let subject = format!("pairs that may collide ({kind})");
                TradeoffPoint::new(subject, [&row.way, &level], [rate, cost])
            })
        };
        self.rows.iter().filter(|row| row.cases == Set::Families).flat_map(both).collect()
    }

    /// Pairs that collide and were not kept by some way.
    fn fault(&self) -> Option<String> {
        let missed: usize = self.rows.iter().map(|row| row.missed).sum();
        let fault =
            || format!("{missed} pairs that collide were not kept: a bound does not hold; please report it");
        (missed > 0).then(fault)
    }
}

/// Subtitle: the pairs that shares refer to.
fn subject([[two_hit, two], [many_hit, many]]: &[[usize; 2]; 2]) -> String {
    format!(
        "shares of pairs that do not collide: {two} of two objects (beside {two_hit} that do), {many} of many ({many_hit})"
    )
}

/// The share from which on a run warns.
const NEARLY_ALWAYS: f64 = 0.9;

impl CcdChart {
    /// Two objects and many over resolution, and over time.
    fn panels(&self) -> Vec<ChartPanel> {
        let mut names: Vec<&str> = Vec::new();
        let in_images = || self.rows.iter().filter(|row| row.cases == Set::Families && row.resolution > 0);
        for row in in_images() {
            if !names.contains(&row.way.as_str()) {
                names.push(&row.way);
            }
        }
        let curves = |point: &dyn Fn(&CcdRow) -> (f64, f64)| -> Vec<Series> {
            let of = |name: &&str| {
                let rows = in_images().filter(|row| row.way == *name);
                Series::curve(*name, rows.map(point))
            };
            names.iter().map(of).collect()
        };
        let panel = |title: &str, across: &str, scale, point: &dyn Fn(&CcdRow) -> (f64, f64)| {
            ChartPanel::new(title, [across, "false positive rate"], curves(point)).on(scale, Scale::Even)
        };
        let pixels = |row: &CcdRow| f64::from(row.resolution);
        vec![
            panel("two objects", "pixels across", Scale::Doublings, &|row| (pixels(row), row.two)),
            panel("many objects", "pixels across", Scale::Doublings, &|row| (pixels(row), row.many)),
            panel("many objects", "CPU time of a pair (ms)", Scale::Decades, &|row| {
                (1e3 * row.pair_s, row.many)
            }),
        ]
    }

    /// Share of pairs kept over time and energy.
    fn gains(&self) -> Vec<ChartPanel> {
        let panel = |across: &str, cost: fn(&Narrowing) -> f64| {
            let curve = |narrow: bool| {
                let rows = || self.narrowed.iter().filter(move |row| row.narrow == narrow);
                let name = rows().next().map_or("", Narrowing::name);
                Series::curve(name, rows().map(|row| (1e3 * cost(row), row.kept)))
            };
            let curves = [false, true].map(curve).into();
            ChartPanel::new("", [across, "pairs kept of those whose boxes touch"], curves)
                .on(Scale::Decades, Scale::FromZero)
        };
        vec![panel("time on the GPU (ms)", |row| row.gpu_s), panel("energy (mJ)", |row| row.gpu_j)]
    }

    fn failures(&self) -> ChartPanel {
        let curve = |&resolution: &u32| {
            let of = self.slides.iter().filter(|slide| slide.resolution == resolution);
            Series::curve(format!("{resolution} px"), of.map(|slide| (slide.gap, slide.kept)))
        };
        let curves = self.effort.resolutions.iter().map(curve).collect();
        ChartPanel::new("false positive rate", ["gap (lengths of a plate)", "share of ways to lie"], curves)
            .on(Scale::Decades, Scale::Even)
            .failing(self.failing_gap().map(|gap| 0.0..gap), "fails")
    }

    /// The widest gap at which, as at all below, plates are kept nearly always whatever the resolution.
    fn failing_gap(&self) -> Option<f64> {
        let kept =
            |gap: f64| self.slides.iter().filter(move |slide| slide.gap == gap).map(|slide| slide.kept);
        let mut gaps = self.effort.gaps.to_vec();
        gaps.sort_by(f64::total_cmp);
        gaps.into_iter().take_while(|&gap| kept(gap).all(|kept| kept >= NEARLY_ALWAYS)).last()
    }
}

/// Whether a case is one of many objects, as an index.
fn kind(case: &Case) -> usize {
    usize::from(case.objects.len() > 2)
}

/// Pairs that collide and pairs that do not, of two objects and of many.
fn pairs(cases: &[Case]) -> [[usize; 2]; 2] {
    let mut pairs = [[0; 2]; 2];
    for case in cases {
        let all = case.objects.len() * (case.objects.len() - 1) / 2;
        pairs[kind(case)][0] += case.collide.len();
        pairs[kind(case)][1] += all - case.collide.len();
    }
    pairs
}

/// All cases by one way, on a thread of its own so that its time is its own.
fn row(way: &CcdMethod, set: Set, cases: &[Case]) -> Result<CcdRow, StudyError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(pool.install(|| {
        let (mut vain, mut missed, mut candidates) = ([0; 2], 0, 0);
        let started = ThreadTime::now();
        for case in cases {
            let kept = kept(way, case, &mut candidates);
            let hit = kept.iter().filter(|pair| case.collide.contains(pair)).count();
            missed += case.collide.len() - hit;
            vain[kind(case)] += kept.len() - hit;
        }
        let pair_s = started.elapsed().as_secs_f64() / f64::from(candidates.max(1));
        let of = pairs(cases);
        let share = |kind: usize| f64::from(vain[kind] as u32) / of[kind][1].max(1) as f64;
        let (two, many) = (share(0), share(1));
        CcdRow { cases: set, way: way.name(), resolution: way.resolution(), two, many, missed, pair_s }
    }))
}

/// The pairs that are kept; counts those whose swept boxes touch.
fn kept(way: &CcdMethod, case: &Case, touching: &mut u32) -> Vec<(usize, usize)> {
    let objects = &case.objects;
    match way {
        CcdMethod::Images(search) => {
            let answers = detect(objects, search);
            *touching += answers.len() as u32;
            let kept = answers.into_iter().filter(|answer| answer.verdict.may_collide());
            kept.map(|answer| (answer.a, answer.b)).collect()
        }
        CcdMethod::Sweeps(sweeps) => {
            *touching += candidates(objects).len() as u32;
            sweeps.detect(objects).pairs(objects)
        }
        CcdMethod::ObjectBoxes | CcdMethod::TriangleBoxes => {
            let mut pairs = candidates(objects);
            *touching += pairs.len() as u32;
            pairs.retain(|&(a, b)| {
                *way == CcdMethod::ObjectBoxes || triangles_boxes_touch(&objects[a], &objects[b])
            });
            pairs
        }
    }
}

/// Plates that slide at each gap and resolution, with refinement.
fn slides(effort: &CcdEffort, progress: &Progress) -> Vec<Slide> {
    let bar = progress.bar("sliding plates", (effort.resolutions.len() * effort.gaps.len()) as u64);
    let each = effort.resolutions.iter().flat_map(|&resolution| {
        effort.gaps.iter().map(move |&gap| (PairSearch { resolution, ..PairSearch::default() }, gap))
    });
    let measured = each.map(|(search, gap)| {
        let kept = |seed: &usize| {
            let answers = detect(&slide(*seed as u64, gap), &search);
            answers.iter().any(|answer| answer.verdict.may_collide())
        };
        let count = (0..effort.slides).filter(kept).count();
        bar.inc();
        Slide { resolution: search.resolution, gap, kept: count as f64 / effort.slides as f64 }
    });
    measured.collect()
}

/// Frames of `quintile run ccd` at each resolution, with and without narrowing.
fn narrowed(effort: &CcdEffort, progress: &Progress) -> Result<Vec<Narrowing>, RunError> {
    let gpu = GpuSpec::load("reference")?;
    let model = PowerModel::new(&EnergyTable::builtin("28nm")?, &Platform::builtin("reference")?)?;
    let each =
        [false, true].into_iter().flat_map(|narrow| effort.resolutions.iter().map(move |px| (narrow, *px)));
    let bar = progress.bar("narrowing", 2 * effort.resolutions.len() as u64);
    let frame = |(narrow, resolution): (bool, u32)| {
        let options = [
            ("narrow", narrow.to_string()),
            ("resolution", resolution.to_string()),
            ("balls", effort.balls.to_string()),
        ];
        let set = options.map(|(name, value)| (name.to_owned(), value)).into();
        let request = JobRequest { overrides: &Overrides::default(), seed: 1 };
        let frame = JobFrame::new(&*job(&OptionSource { file: None, set }, &request)?, 0, &gpu, &model)?;
        let fact = |name: &str| {
            frame.drawn.facts.iter().find(|fact| fact.name == name).map_or(0.0, |fact| fact.value)
        };
        let kept = fact("pairs_that_may_collide") / fact("pairs_whose_boxes_touch").max(1.0);
        let (gpu_s, gpu_j) = (frame.power.duration_s(), frame.power.energy().total_j());
        bar.inc();
        Ok(Narrowing { narrow, resolution, kept, gpu_s, gpu_j })
    };
    each.map(frame).collect()
}
