//! The pictures of a sweep: methods by families, and each family along its parameter.

use workloads::stress::Family;

use super::choice::{Choice, Choices};
use super::measure::Row;
use super::methods::METHODS;
use super::report::Report;
use crate::output::plot::{Matrix, MatrixPanel, Picture, Sweep, SweepCurve, SweepPanel};

/// Cost over that of the best method, by method and family: at the first and at the worst value.
pub(super) fn matrix(report: &Report) -> Picture {
    let panel = |name, first| MatrixPanel {
        name,
        rows: METHODS
            .iter()
            .map(|method| {
                let over = |family| report.over_best(family, method.name, first);
                (method.name, report.families.iter().map(|family| over(family)).collect())
            })
            .collect(),
    };
    let subject = format!(
        "multiply-adds of tile and sample tests over those of the best method; images of {} pixels a side; {} samples lost",
        report.size.side_px,
        report.summary().samples_lost
    );
    Matrix {
        title: "Which test pays where",
        subject: &subject,
        scale: ["the best", "32 times as much"],
        columns: report.families.iter().map(|family| family.name).collect(),
        panels: vec![
            panel("at the harmless end of each family", true),
            panel("at the value of each family that is worst for the method", false),
        ],
    }
    .picture()
}

/// `auto` and every test on, over the best fixed choice: of each family as a whole, and at the value that is worst for it.
pub(super) fn auto(choices: &Choices) -> Picture {
    type Cost = fn(&Choice) -> f64;
    let costs: [(&str, Cost); 2] = [
        ("auto", |choice| choice.over_best),
        ("all", |choice| choice.all_madds.max(1) as f64 / choice.best_madds.max(1) as f64),
    ];
    let worst = |family: &Choice, cost: Cost| {
        let values = choices.values.iter().filter(|value| value.family == family.family);
        values.map(cost).reduce(f64::max)
    };
    let whole = costs.map(|(name, cost)| (name, choices.families.iter().map(|f| Some(cost(f))).collect()));
    let values = costs.map(|(name, cost)| (name, choices.families.iter().map(|f| worst(f, cost)).collect()));
    Matrix {
        title: "What auto takes beside the best fixed choice of tests",
        subject: "multiply-adds over those of the best of all combinations of tests",
        scale: ["the best", "32 times as much"],
        columns: choices.families.iter().map(|family| family.family).collect(),
        panels: vec![
            MatrixPanel {
                name: "each family as a whole, one choice for all its values",
                rows: whole.to_vec(),
            },
            MatrixPanel { name: "the worst value, with a choice for it alone", rows: values.to_vec() },
        ],
    }
    .picture()
}

/// Cost, efficiency and width of intervals of one family along its parameter.
pub(super) fn family(report: &Report, family: &Family) -> Picture {
    let rows: Vec<&Row> = report.of(family).collect();
    let mut values: Vec<String> = rows.iter().map(|row| row.value.to_string()).collect();
    values.dedup();
    let by_method = |of: &dyn Fn(&Row) -> Option<f64>| -> Vec<SweepCurve<'_>> {
        let curve = |name| SweepCurve {
            name,
            points: rows.iter().filter(|row| row.method == name).map(|row| of(row)).collect(),
        };
        METHODS.iter().map(|method| curve(method.name)).collect()
    };
    let per_triangle = |row: &Row| Some(row.work.madds().max(1) as f64 / row.triangles.max(1) as f64);
    let subject = format!(
        "{}; {} samples lost; true intervals from {}",
        family.what,
        rows.iter().map(|row| row.samples_lost).sum::<u64>(),
        rows.last().map_or("nothing", |row| row.truth),
    );
    let title = format!("Where methods fail: {}", family.name);
    Sweep {
        title: &title,
        subject: &subject,
        x: family.parameter,
        values: &values,
        panels: vec![
            SweepPanel { name: "multiply-adds per triangle", log: true, series: by_method(&per_triangle) },
            SweepPanel {
                name: "sample test efficiency (%)",
                log: false,
                series: by_method(&|row| row.work.efficiency().map(|share| 100.0 * share)),
            },
            SweepPanel { name: "mean width of boxes (%)", log: false, series: widths(&rows) },
        ],
    }
    .picture()
}

/// The boxes that the side planes leave, and the true ones.
fn widths(rows: &[&Row]) -> Vec<SweepCurve<'static>> {
    let curve = |name, of: fn(&Row) -> f64| SweepCurve {
        name,
        points: rows.iter().filter(|row| row.method == "sides").map(|row| Some(100.0 * of(row))).collect(),
    };
    vec![
        curve("t, side planes", |row| row.intervals.t_width),
        curve("t, true", |row| row.intervals.t_true),
        curve("u, side planes", |row| row.intervals.u_width),
        curve("u, true", |row| row.intervals.u_true),
        curve("tiles kept by side planes", |row| {
            row.intervals.pairs_kept as f64 / row.intervals.pairs.max(1) as f64
        }),
        curve("tiles truly touched", |row| {
            row.intervals.pairs_touching as f64 / row.intervals.pairs.max(1) as f64
        }),
    ]
}
