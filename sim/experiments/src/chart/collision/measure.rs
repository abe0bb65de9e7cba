//! Pairs kept and missed, and what that takes.

use cpu_time::ThreadTime;
use workloads::collision::families::{Case, slide, triangles_boxes_touch};
use workloads::collision::{Search, candidates, detect};

use super::{Effort, Row, Set, Slide, Way};
use crate::study::StudyError;
use output::progress::Progress;

/// Whether a case is one of many objects, as an index.
fn kind(case: &Case) -> usize {
    usize::from(case.objects.len() > 2)
}

/// Pairs that collide and pairs that do not, of two objects and of many.
pub(super) fn pairs(cases: &[Case]) -> [[usize; 2]; 2] {
    let mut pairs = [[0; 2]; 2];
    for case in cases {
        let all = case.objects.len() * (case.objects.len() - 1) / 2;
        pairs[kind(case)][0] += case.collide.len();
        pairs[kind(case)][1] += all - case.collide.len();
    }
    pairs
}

/// All cases by one way, on a thread of its own so that its time is its own.
pub(super) fn row(way: &Way, set: Set, cases: &[Case]) -> Result<Row, StudyError> {
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
        Row { cases: set, way: way.name(), resolution: way.resolution(), two, many, missed, pair_s }
    }))
}

/// The pairs that are kept; counts those whose swept boxes touch.
fn kept(way: &Way, case: &Case, touching: &mut u32) -> Vec<(usize, usize)> {
    let objects = &case.objects;
    match way {
        Way::Images(search) => {
            let answers = detect(objects, search);
            *touching += answers.len() as u32;
            let kept = answers.into_iter().filter(|answer| answer.verdict.may_collide());
            kept.map(|answer| (answer.a, answer.b)).collect()
        }
        Way::ObjectBoxes | Way::TriangleBoxes => {
            let mut pairs = candidates(objects);
            *touching += pairs.len() as u32;
            pairs.retain(|&(a, b)| {
                *way == Way::ObjectBoxes || triangles_boxes_touch(&objects[a], &objects[b])
            });
            pairs
        }
    }
}

/// Plates that slide at each gap and resolution, by looking closer.
pub(super) fn slides(effort: &Effort, progress: &Progress) -> Vec<Slide> {
    let bar = progress.bar("sliding plates", (effort.resolutions.len() * effort.gaps.len()) as u64);
    let each = effort.resolutions.iter().flat_map(|&resolution| {
        effort.gaps.iter().map(move |&gap| (Search { resolution, ..Search::default() }, gap))
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
