//! The files of the chart.

use workloads::multiview::{MOST_DEG, MOST_RUNS};

use super::{Angle, Cached, Case, POLICIES, Row, Run, ViewsChart};
use output::plot::{Chart, ChartPanel, Look, Scale, Series};
use output::table::Table;
use output::{Claim, OutDir, OutputError};

/// The files of the chart.
pub fn claim() -> Claim {
    Claim::new("chart views").plots(["views_cost", "views_cache", "views_failures"]).files([
        "views.csv",
        "views_cache.csv",
        "views.json",
    ])
}

/// Writes pictures and numbers; `views.json` comes last.
pub(super) fn write(chart: &ViewsChart, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
    let [width, height] = chart.effort.size;
    let subject =
        format!("{}, {width}x{height} pixels a view, 8 samples each where they fit", chart.effort.scene.0);
    let title = "Many views: one pass against its rivals";
    Chart::new(title, &subject, costs(chart)).picture(look).write(dir, "views_cost")?;
    let title = "Pixel shader lanes of one pass over the shading cache";
    let marked = format!(
        "{subject}. Marked: a cache smaller than what is in use at a time, where a run warns (shading-cache-small)"
    );
    Chart::new(title, &marked, caches(chart)).picture(look).write(dir, "views_cache")?;
    let title = "Where one pass fails: shading that depends on who looks";
    Chart::new(title, &subject, angles(chart)).picture(look).write(dir, "views_failures")?;
    dir.write_file("views.csv", |out| {
        let mut table = csv::WriterBuilder::new().has_headers(false).from_writer(out);
        table.write_record([
            "views",
            "samples_per_view",
            "method",
            "passes",
            "invocations",
            "over_one_view",
            "vertices",
            "dram_bytes",
            "host_s",
        ])?;
        for row in &chart.rows {
            for (method, run) in runs(row) {
                table.serialize((row.views, row.samples_per_view, method, run))?;
            }
        }
        Ok(table.flush()?)
    })?;
    dir.write_file("views_cache.csv", |out| {
        let mut table = csv::WriterBuilder::new().has_headers(false).from_writer(out);
        table.write_record(CACHE_HEADER)?;
        chart.cached().try_for_each(|row| table.serialize(row))?;
        Ok(table.flush()?)
    })?;
    dir.write_json("views.json", chart)?;
    Ok(())
}

fn runs(row: &Row) -> [(&'static str, &Run); 3] {
    [("one pass", &row.one_pass), ("view by view", &row.view_by_view), ("accumulation", &row.accumulation)]
}

fn costs(chart: &ViewsChart) -> Vec<ChartPanel> {
    let panel = |title: &str, up: &str, of: fn(&Run) -> f64| {
        let curve = |method: usize| {
            let points = chart.rows.iter().map(|row| (f64::from(row.views), of(runs(row)[method].1)));
            Series::curve(runs(&chart.rows[0])[method].0, points)
        };
        ChartPanel::new(title, ["views", up], (0..3).map(curve).collect())
            .on(Scale::Doublings, Scale::Decades)
    };
    vec![
        panel("pixel shader lanes", "over those of one view", |run| run.over_one_view),
        panel("vertex shader runs", "runs", |run| run.vertices as f64),
        panel("memory", "bytes", |run| run.dram_bytes as f64),
        panel("host", "seconds", |run| run.host_s),
    ]
}

/// Caches in which what is in use at a time has no room are marked.
fn caches(chart: &ViewsChart) -> Vec<ChartPanel> {
    let panel = |case: &Case| {
        let curve = |(policy, _): &(&'static str, _)| {
            let rows = case.rows.iter().filter(|cached| cached.policy == *policy);
            Series::curve(
                *policy,
                rows.map(|cached| (f64::from(cached.entries), cached.invocations_per_pixel)),
            )
        };
        let axes = ["entries of the shading cache", "lanes of all views for a pixel of one"];
        ChartPanel::new(case.name, axes, POLICIES.iter().map(curve).collect())
            .on(Scale::Doublings, Scale::Even)
            .failing(case.too_small().map(|entries| 0.0..entries), "a run warns")
    };
    chart.caches.iter().map(panel).collect()
}

impl Case {
    /// The most entries with which the shader runs so much more often than with the largest cache that a run warns.
    fn too_small(&self) -> Option<f64> {
        let rows = || self.rows.iter().filter(|cached| cached.policy == POLICIES[0].0);
        let least = rows().map(|cached| cached.invocations_per_pixel).reduce(f64::min)?;
        let small = rows().filter(|cached| cached.invocations_per_pixel > MOST_RUNS * least);
        small.map(|cached| f64::from(cached.entries)).reduce(f64::max)
    }
}

fn angles(chart: &ViewsChart) -> Vec<ChartPanel> {
    let of = |error: fn(&Angle) -> f64| chart.angles.iter().map(move |angle| (angle.baseline, error(angle)));
    let curves = vec![
        Series::curve("shading that is the same for all", of(|angle| angle.rmse_matt)),
        Series::curve("with a highlight", of(|angle| angle.rmse_shiny)),
    ];
    let axes = [
        "length of the camera line over the distance of what is in focus",
        "RMSE against cameras of their own",
    ];
    // Close to the angle from which on a run warns, angles grow with the line.
    let off = |angle: &&Angle| (angle.degrees / MOST_DEG).ln().abs();
    let nearest = chart.angles.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
    let warned = nearest.map(|angle| angle.baseline * MOST_DEG / angle.degrees);
    let panel = ChartPanel::new("error of the outer views", axes, curves);
    vec![panel.failing(warned.map(|baseline| baseline..f64::INFINITY), "a run warns: view-dependent-shading")]
}

const CACHE_HEADER: [&str; 7] =
    ["case", "views", "policy", "entries", "invocations_per_pixel", "one_view_per_pixel", "increase"];

impl ViewsChart {
    fn cached(&self) -> impl Iterator<Item = (&'static str, &Cached)> {
        self.caches.iter().flat_map(|case| case.rows.iter().map(|cached| (case.name, cached)))
    }

    /// What is printed.
    pub fn text(&self) -> String {
        let mut table =
            Table::new(["views", "method", "passes", "lanes over one view", "vertices", "host s"]);
        for row in &self.rows {
            for (method, run) in runs(row) {
                table.row([
                    row.views.to_string(),
                    method.to_owned(),
                    run.passes.to_string(),
                    format!("{:.3}", run.over_one_view),
                    run.vertices.to_string(),
                    format!("{:.3}", run.host_s),
                ]);
            }
        }
        let mut caches = Table::new(["views", "policy", "entries", "lanes a pixel", "over one view"]);
        for (case, cached) in self.cached() {
            caches.row([
                case.to_owned(),
                cached.policy.to_owned(),
                cached.entries.to_string(),
                format!("{:.3}", cached.invocations_per_pixel),
                format!("{:+.1} %", 100.0 * cached.increase),
            ]);
        }
        let mut angles = Table::new(["camera line over distance", "RMSE matt", "RMSE with a highlight"]);
        for angle in &self.angles {
            let [matt, shiny] = [angle.rmse_matt, angle.rmse_shiny].map(|rmse| format!("{rmse:.4}"));
            angles.row([angle.baseline.to_string(), matt, shiny]);
        }
        format!("{table}\n{caches}\n{angles}")
    }
}
