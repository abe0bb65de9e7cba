//! The pictures of a sweep: methods by families, and each family along its parameter, a small panel for each method.

use workloads::stress::Family;

use super::Report;
use super::choice::{Choice, Choices};
use super::measure::{METHODS, StressRow, TestMethod};
use output::plot::{Chart, ChartPanel, Look, Mark, Matrix, MatrixPanel, Paint, Picture, Scale, Series};

/// Cost over that of the best method, by method and family: at the first and at the worst value.
pub(super) fn matrix(report: &Report, look: &Look) -> Picture {
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
    .picture(look)
}

/// `auto` and every test on, over the best fixed choice: of each family as a whole, and at the value that is worst for it.
pub(super) fn auto(choices: &Choices, look: &Look) -> Picture {
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
    .picture(look)
}

/// Panels of a row on a page.
const ACROSS: usize = 7;

/// A measure of a method at each value of a family.
pub(super) struct Measure {
    /// Ending after the family's name in names of files; empty for the cost.
    pub stem: &'static str,
    title: &'static str,
    /// The name of the axis.
    name: &'static str,
    scale: Scale,
    of: fn(&StressRow) -> Option<f64>,
}

/// Cost and efficiency.
pub(super) const MEASURES: [Measure; 2] = [
    Measure {
        stem: "",
        title: "cost",
        name: "madds per triangle",
        scale: Scale::Decades,
        of: |row| Some(row.work.madds().max(1) as f64 / row.triangles.max(1) as f64),
    },
    Measure {
        stem: "_efficiency",
        title: "sample test efficiency",
        name: "efficiency (%)",
        scale: Scale::FromZero,
        of: |row| row.work.efficiency().map(|share| 100.0 * share),
    },
];

/// A measure of one family along its parameter: a small panel for each method, the other methods as grey lines behind it.
pub(super) fn family(report: &Report, family: &Family, measure: &Measure, look: &Look) -> Picture {
    let rows: Vec<&StressRow> = report.of(family).collect();
    let line = |name: &str| -> Vec<(f64, f64)> {
        let values = rows.iter().filter(|row| row.method == name).map(|row| (measure.of)(row)).enumerate();
        values.filter_map(|(place, value)| Some((place as f64, value?))).collect()
    };
    let all: Vec<Vec<(f64, f64)>> = METHODS.iter().map(|method| line(method.name)).collect();
    let panel = |(method, own): (&TestMethod, &Vec<(f64, f64)>)| {
        let others = Series::new("", Mark::Faint(all.clone())).painted(Paint::Grey);
        let own = Series::curve("", own.iter().copied()).painted(Paint::Like(0));
        ChartPanel::new(method.name, ["", measure.name], vec![others, own])
            .on(Scale::Even, measure.scale.clone())
            .along(family.parameter, &values(&rows))
    };
    let title = format!("Failure modes: {}, {}", family.name, measure.title);
    let subject = format!(
        "{}; grey: all other methods; {} samples lost",
        family.what,
        rows.iter().map(|row| row.samples_lost).sum::<u64>()
    );
    let panels = METHODS.iter().zip(&all).map(panel).collect();
    Chart::new(&title, &subject, panels).small(ACROSS).picture(look)
}

fn values(rows: &[&StressRow]) -> Vec<String> {
    let mut values: Vec<String> = rows.iter().map(|row| row.value.to_string()).collect();
    values.dedup();
    values
}

/// Width of the boxes that the side planes leave, and of the true ones.
pub(super) fn intervals(report: &Report, family: &Family, look: &Look) -> Picture {
    let rows: Vec<&StressRow> = report.of(family).collect();
    let curve = |name: &str, of: fn(&StressRow) -> f64| {
        let sides = rows.iter().filter(|row| row.method == "sides").enumerate();
        Series::curve(name, sides.map(|(place, row)| (place as f64, 100.0 * of(row))))
    };
    let panel = |title: &str, curves| {
        ChartPanel::new(title, ["", "share of all (%)"], curves)
            .on(Scale::Even, Scale::FromZero)
            .along(family.parameter, &values(&rows))
    };
    let by = ["side planes", "true"];
    let panels = vec![
        panel(
            "time",
            vec![curve(by[0], |row| row.intervals.t_width), curve(by[1], |row| row.intervals.t_true)],
        ),
        panel(
            "lens, across",
            vec![curve(by[0], |row| row.intervals.u_width), curve(by[1], |row| row.intervals.u_true)],
        ),
        panel(
            "tiles",
            vec![
                curve(by[0], |row| row.intervals.pairs_kept as f64 / row.intervals.pairs.max(1) as f64),
                curve(by[1], |row| row.intervals.pairs_touching as f64 / row.intervals.pairs.max(1) as f64),
            ],
        ),
    ];
    let title = format!("What side planes leave: {}", family.name);
    let subject = format!(
        "{}; means over triangles and tiles; true intervals from {}",
        family.what,
        rows.last().map_or("nothing", |row| row.truth)
    );
    Chart::new(&title, &subject, panels).picture(look)
}
