//! Section 3.2: continuous collision detection.

use workloads::collision::families::{Case, cases};
use workloads::collision::{Method, Object, Search, detect};

use super::super::figure::over_doublings;
use super::super::row::{Kind, Row, Verdict, numbers};
use super::super::{Done, Effort};
use crate::output::plot::Curve;
use crate::output::progress::Progress;
use crate::run::RunError;

/// As the paper has it: one look at this resolution.
const ONCE: Search = Search { resolution: 32, bins: 1, method: Method::FragmentBox, zoom: false };

pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    let each = effort.repeats as usize;
    let all = cases(12, each.div_ceil(6));
    let bar = progress.bar("collisions", 3);
    let done = [missed, dodged, tighter].map(|row| {
        let done = row(&all);
        bar.inc();
        done
    });
    Ok(done.into())
}

/// The pairs of a case that a search keeps.
fn kept(case: &Case, search: &Search) -> Vec<(usize, usize)> {
    let answers = detect(&case.objects, search).into_iter();
    answers.filter(|answer| answer.verdict.may_collide()).map(|answer| (answer.a, answer.b)).collect()
}

/// VI-1: no pair that collides is missed.
fn missed(all: &[Case]) -> Done {
    let searches = [
        ONCE,
        Search { resolution: 8, ..ONCE },
        Search { bins: 4, ..ONCE },
        Search { method: Method::BoxBox, ..ONCE },
        Search { method: Method::DepthOnly, ..ONCE },
        Search::default(),
    ];
    let (mut missed, mut collide) = (0, 0);
    for case in all {
        collide += case.collide.len();
        for search in &searches {
            let kept = kept(case, search);
            missed += case.collide.iter().filter(|pair| !kept.contains(pair)).count();
        }
    }
    let row = Row {
        id: "VI-1",
        kind: Kind::Equality,
        claim: "the potentially colliding set has no false negative",
        paper: "conservative: no collision is missed (section 3.2)",
        ours: format!("{missed} missed of {collide} that collide, by {} searches each", searches.len()),
        verdict: Verdict::of(missed == 0 && collide > 0),
        note: "families whose truth is known by how they are made; `quintile chart collision` has more"
            .to_owned(),
        numbers: numbers([("missed", missed as f64), ("collide", collide as f64)]),
        figure: None,
        figures: Vec::new(),
    };
    Done { row, figures: Vec::new() }
}

/// Two objects whose ways cross at different times: the toaster and the ball of Fig. 6.
fn dodging() -> Vec<Object> {
    let tetra = |at: [f64; 3]| {
        let corner = |k: usize| [0, 1, 2].map(|axis| at[axis] + if axis + 1 == k { 0.4 } else { 0.0 });
        [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]].map(|face: [usize; 3]| face.map(corner))
    };
    let object = |from, to| {
        let faces = tetra(from).into_iter().zip(tetra(to)).map(|(open, close)| [open, close]);
        Object::from_ends(faces.collect(), 0.0)
    };
    [object([-4.0, 0.0, 0.0], [4.0, 0.0, 0.0]), object([0.0, -7.0, 0.1], [0.0, 1.5, 0.1])]
        .into_iter()
        .flatten()
        .collect()
}

/// VI-2: time tells apart what space alone cannot.
fn dodged(_: &[Case]) -> Done {
    let objects = dodging();
    let may = |search: &Search| detect(&objects, search).iter().any(|answer| answer.verdict.may_collide());
    let [ours, depth] = [ONCE, Search { method: Method::DepthOnly, ..ONCE }].map(|search| may(&search));
    let kept = |may: bool| if may { "keeps" } else { "clears" };
    let row = Row {
        id: "VI-2",
        kind: Kind::Order,
        claim: "boxes of time and depth tell apart what depth alone cannot (Fig. 6)",
        paper: "3 passes clear the pair, the 6 passes by depth (Govindaraju et al.) do not",
        ours: format!("3 passes: {} the pair; 6 passes by depth: {} it", kept(ours), kept(depth)),
        verdict: Verdict::of(!ours && depth && objects.len() == 2),
        note: "two tetrahedra whose ways cross, the second late; 32 pixels".to_owned(),
        numbers: numbers([("ours_keeps", f64::from(ours)), ("depth_keeps", f64::from(depth))]),
        figure: None,
        figures: Vec::new(),
    };
    Done { row, figures: Vec::new() }
}

/// Pixels across at which both are compared.
const RESOLUTIONS: [u32; 5] = [2, 4, 8, 16, 32];

/// VI-3: a fragment against a box is at least as tight as a box against a box.
fn tighter(all: &[Case]) -> Done {
    let (mut left, mut right) = (Vec::new(), Vec::new());
    for resolution in RESOLUTIONS {
        let vain = |method| {
            let search = Search { method, resolution, ..ONCE };
            let vain =
                |case: &Case| kept(case, &search).iter().filter(|pair| !case.collide.contains(pair)).count();
            all.iter().map(vain).collect::<Vec<_>>()
        };
        left.push(vain(Method::BoxBox));
        right.push(vain(Method::FragmentBox));
    }
    let each = || right.iter().flatten().zip(left.iter().flatten());
    let (worse, better) = (each().filter(|(r, l)| r > l).count(), each().filter(|(r, l)| r < l).count());
    let sums =
        |of: &[Vec<usize>]| of.iter().map(|vain| vain.iter().sum::<usize>() as f64).collect::<Vec<f64>>();
    let (boxes, fragments) = (sums(&left), sums(&right));
    let row = Row {
        id: "VI-3",
        kind: Kind::Order,
        claim: "a fragment against a box is at least as tight as a box against a box (Fig. 5)",
        paper: "tighter (section 3.2); no number",
        ours: format!(
            "kept in vain at 2 to 32 pixels: {fragments:?} against {boxes:?}; fewer in {better} of {} cases, more in {worse}",
            each().count()
        ),
        verdict: Verdict::of(worse == 0 && better > 0),
        note: "one bin of time".to_owned(),
        numbers: numbers([("cases_better", better as f64), ("cases_worse", worse as f64)]),
        figure: None,
        figures: Vec::new(),
    };
    let curve = |name: &str, kept: &[f64]| {
        Curve::new(name, RESOLUTIONS.into_iter().map(f64::from).zip(kept.iter().copied()))
    };
    let figure = over_doublings(
        "VI_fig5",
        [
            "Pairs kept in vain: fragment against box, box against box",
            "families of moving objects, one bin of time",
        ],
        ["pixels across", "pairs kept in vain"],
        vec![curve("fragment-box", &fragments), curve("box-box", &boxes)],
    );
    Done { row, figures: vec![figure] }
}
