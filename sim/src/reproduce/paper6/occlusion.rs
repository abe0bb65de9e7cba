//! Rows VI-4 and VI-5: occlusion queries by intervals.

use super::super::figure::over_doublings;
use super::super::row::{Kind, Row, Verdict, numbers};
use super::super::{Done, Effort};
use crate::chart::occlusion::{Effort as Size, Kind as Blur, OcclusionChart, Row as Asked, measure};
use crate::output::plot::Curve;
use crate::output::progress::Progress;
use crate::run::RunError;

/// Both rows.
pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    let size = if effort == Effort::QUICK { Size::QUICK } else { Size::FULL };
    let chart = measure(size, progress).map_err(RunError::setting)?;
    Ok(vec![rate(&chart), cost(&chart)])
}

/// VI-4: the rate grows with the boxes in time.
fn rate(chart: &OcclusionChart) -> Done {
    let tile = 8;
    let rows: Vec<&Asked> =
        chart.intervals.iter().filter(|row| row.kind == Blur::Motion && row.tile_px == Some(tile)).collect();
    let rates: Vec<(f64, f64)> =
        rows.iter().filter_map(|row| Some((f64::from(row.boxes?[2]), row.rate()))).collect();
    let wrong: u64 =
        chart.intervals.iter().chain(&chart.samples).chain(&chart.failing).map(|row| row.wrong).sum();
    let grows = rates.is_sorted_by(|a, b| a.1 <= b.1)
        && rates.first().zip(rates.last()).is_some_and(|(first, last)| last.1 > first.1);
    let listed: Vec<String> = rates.iter().map(|(boxes, rate)| format!("{boxes}: {rate:.3}")).collect();
    let (first, last) = (rates.first().map_or(0.0, |r| r.1), rates.last().map_or(0.0, |r| r.1));
    let row = Row {
        id: "VI-4",
        kind: Kind::Order,
        claim: "more boxes per tile, more found hidden",
        paper: "with more subdivisions in time, efficiency for moving occluders increases",
        ours: format!(
            "share of hidden objects found, by boxes in t: {}; {wrong} that are seen called hidden",
            listed.join(", ")
        ),
        verdict: Verdict::of(grows && wrong == 0),
        note: format!(
            "holds where the share never falls and grows in all; {tile}-pixel tiles, walls and objects behind them moving"
        ),
        numbers: numbers([("share_1_box", first), ("share_16_boxes", last), ("wrong", wrong as f64)]),
        figure: None,
        figures: Vec::new(),
    };
    let figure = over_doublings(
        "VI_occlusion",
        [
            "Occlusion rate over boxes in time (Paper VI, section 3)",
            "share of the objects hidden from every sample that a query by intervals finds",
        ],
        ["boxes in t", "share found"],
        vec![Curve::new(format!("{tile}-pixel tiles"), rates)],
    );
    Done { row, figures: vec![figure] }
}

/// VI-5: what a query costs.
fn cost(chart: &OcclusionChart) -> Done {
    let pairs = || chart.samples.chunks_exact(2).map(|pair| (&pair[0], &pair[1]));
    let least = |of: fn(&Asked) -> f64| {
        pairs().map(|(sampled, interval)| of(sampled) / of(interval)).fold(f64::INFINITY, f64::min)
    };
    let [tests, bytes, madds] = [least(|row| row.tests), least(|row| row.bytes), least(|row| row.madds)];
    let first = pairs().next();
    let shown = first.map_or(String::new(), |(sampled, interval)| {
        format!(
            "; {} at {} samples: {:.0} tests and {:.0} bytes against {:.0} and {:.0}",
            sampled.kind.name(),
            sampled.samples,
            interval.tests,
            interval.bytes,
            sampled.tests,
            sampled.bytes
        )
    });
    let row = Row {
        id: "VI-5",
        kind: Kind::Order,
        claim: "an interval query costs far less than a sampled one",
        paper: "individual samples need not be touched; 16 to 64 of them in a pixel otherwise",
        ours: format!(
            "at least {tests:.1} times fewer tests, {bytes:.1} times fewer bytes, {madds:.1} times fewer multiply-adds{shown}"
        ),
        verdict: Verdict::of(tests > 2.0 && bytes > 2.0),
        note: "holds where tests and bytes are less than half in every case; means over all objects of a scene; the query by intervals ends as soon as it sees that an object is visible, the sampled one counts samples to the end".to_owned(),
        numbers: numbers([("least_tests_ratio", tests), ("least_bytes_ratio", bytes), ("least_madds_ratio", madds)]),
        figure: None,
        figures: Vec::new(),
    };
    Done { row, figures: Vec::new() }
}
