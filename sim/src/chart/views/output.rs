//! The files of the chart.

use super::{Cached, POLICIES, Row, Run, ViewsChart};
use crate::output::plot::{Curve, CurvePanel, Curves};
use crate::output::table::Table;
use crate::output::{OutDir, OutputError};

/// Writes pictures and numbers; `views.json` comes last.
pub(super) fn write(chart: &ViewsChart, dir: &OutDir) -> Result<(), OutputError> {
    let [width, height] = chart.effort.size;
    let subject =
        format!("{}, {width}x{height} pixels a view, 8 samples each where they fit", chart.effort.scene.0);
    let title = "Many views: one pass against its rivals";
    Curves { title, subject: &subject, panels: costs(chart) }.picture().write(dir, "views_cost")?;
    let title = "Pixel shader lanes of one pass over the shading cache";
    Curves { title, subject: &subject, panels: caches(chart) }.picture().write(dir, "views_cache")?;
    let title = "Where one pass fails: shading that depends on who looks";
    Curves { title, subject: &subject, panels: angles(chart) }.picture().write(dir, "views_failures")?;
    dir.write_atomic("views.csv", |out| {
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
    dir.write_atomic("views_cache.csv", |out| {
        let mut table = csv::Writer::from_writer(out);
        chart.caches.iter().try_for_each(|cached| table.serialize(cached))?;
        Ok(table.flush()?)
    })?;
    dir.write_json("views.json", chart)?;
    Ok(())
}

fn runs(row: &Row) -> [(&'static str, &Run); 3] {
    [("one pass", &row.one_pass), ("view by view", &row.view_by_view), ("accumulation", &row.accumulation)]
}

fn costs(chart: &ViewsChart) -> Vec<CurvePanel> {
    let panel = |title: &str, up: &str, of: fn(&Run) -> f64| {
        let curve = |method: usize| Curve {
            name: runs(&chart.rows[0])[method].0.to_owned(),
            note: String::new(),
            points: chart.rows.iter().map(|row| (f64::from(row.views), of(runs(row)[method].1))).collect(),
        };
        CurvePanel {
            title: title.to_owned(),
            across: "views".to_owned(),
            up: up.to_owned(),
            doubling: true,
            curves: (0..3).map(curve).collect(),
        }
    };
    vec![
        panel("pixel shader lanes", "over those of one view", |run| run.over_one_view),
        panel("vertex shader runs", "runs", |run| run.vertices as f64),
        panel("memory", "bytes", |run| run.dram_bytes as f64),
        panel("host", "seconds", |run| run.host_s),
    ]
}

fn caches(chart: &ViewsChart) -> Vec<CurvePanel> {
    let of = |views: u32, policy: &'static str| {
        chart.caches.iter().filter(move |cached| cached.views == views && cached.policy == policy)
    };
    let panel = |views: u32, title: String, up: &str, y: fn(&Cached) -> f64| CurvePanel {
        title,
        across: "entries of the shading cache".to_owned(),
        up: up.to_owned(),
        doubling: true,
        curves: POLICIES
            .iter()
            .map(|(policy, _)| Curve {
                name: (*policy).to_owned(),
                note: String::new(),
                points: of(views, policy).map(|cached| (f64::from(cached.entries), y(cached))).collect(),
            })
            .collect(),
    };
    [2, 7]
        .into_iter()
        .flat_map(|views| {
            [
                panel(views, format!("{views} views"), "lanes a pixel", |cached| {
                    cached.invocations_per_pixel
                }),
                panel(views, format!("{views} views over one"), "increase", |cached| cached.increase),
            ]
        })
        .collect()
}

fn angles(chart: &ViewsChart) -> Vec<CurvePanel> {
    let curve = |name: &str, of: fn(&super::Angle) -> f64| Curve {
        name: name.to_owned(),
        note: String::new(),
        points: chart.angles.iter().map(|angle| (angle.baseline, of(angle))).collect(),
    };
    vec![CurvePanel {
        title: "error of the outer views".to_owned(),
        across: "camera line over distance".to_owned(),
        up: "RMSE against cameras of their own".to_owned(),
        doubling: false,
        curves: vec![curve("matt", |angle| angle.rmse_matt), curve("highlight", |angle| angle.rmse_shiny)],
    }]
}

impl ViewsChart {
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
        for cached in &self.caches {
            caches.row([
                cached.views.to_string(),
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
