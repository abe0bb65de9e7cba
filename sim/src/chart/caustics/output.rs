//! The files of the chart.

use workloads::caustics::{CROSSED, Method};

use super::{CausticsChart, Coarse, Ocean, Row};
use crate::output::dir::BoxError;
use crate::output::plot::{Curve, CurvePanel, Curves, HeatMapPlot, HeatTile, Picture, Scale};
use crate::output::table::Table;
use crate::output::{OutDir, OutputError};

/// What an earlier chart left: should this one die on the way, nothing old may stand in for it.
pub(super) fn remove_stale(dir: &OutDir) -> Result<(), OutputError> {
    dir.remove_stale("", "caustics", &["svg", "png", "csv", "json"])
}

/// Writes pictures and numbers; `caustics.json` comes last.
pub(super) fn write(chart: &CausticsChart, dir: &OutDir) -> Result<(), OutputError> {
    chart.picture().write(dir, "caustics")?;
    chart.failures().write(dir, "caustics_failures")?;
    for (method, name) in Method::ALL.into_iter().zip(["moving", "refined", "hull", "prism"]) {
        chart.ocean.map(method).write(dir, &format!("caustics_map_{name}"))?;
    }
    dir.write_atomic("caustics.csv", |out| chart.csv(out))?;
    dir.write_json("caustics.json", chart)?;
    Ok(())
}

/// Pixels along a side of a rectangle of a map.
const MAP_PX: u32 = 4;

impl Ocean {
    /// Executions of a method at every pixel (Fig. 8).
    pub fn map(&self, method: Method) -> Picture {
        let place = Method::ALL.iter().position(|known| *known == method).unwrap_or(0);
        let ([width, height], runs) = (self.size, &self.runs[place]);
        let mean = |x: u32, y: u32| {
            let size = [MAP_PX.min(width - x), MAP_PX.min(height - y)];
            let rows = (y..y + size[1]).map(|row| (row * width + x) as usize);
            let sum: u64 = rows
                .flat_map(|first| &runs[first..first + size[0] as usize])
                .map(|runs| u64::from(*runs))
                .sum();
            HeatTile { origin: [x, y], size, value: sum as f64 / f64::from(size[0] * size[1]) }
        };
        let rows = (0..height).step_by(MAP_PX as usize);
        let tiles: Vec<_> = rows
            .flat_map(|y| (0..width).step_by(MAP_PX as usize).map(move |x| (x, y)))
            .map(|(x, y)| mean(x, y))
            .collect();
        HeatMapPlot {
            title: &format!("Shader executions of a pixel: {}", method.name()),
            subject: &format!(
                "{} volumes under waves, {width}x{height} pixels; {} executions in all, {:.2} of the prism's",
                self.volumes,
                self.executions[place],
                self.executions[place] as f64 / self.executions[3] as f64
            ),
            label: "executions",
            size: self.size,
            tiles: &tiles,
        }
        .picture()
    }
}

impl CausticsChart {
    /// What is printed.
    pub fn text(&self) -> String {
        let mut table = Table::new(["ocean", "executions", "a pixel", "most", "of the prism's"]);
        let ocean = &self.ocean;
        let pixels = f64::from(ocean.size[0] * ocean.size[1]);
        for (place, method) in Method::ALL.into_iter().enumerate() {
            let total = ocean.executions[place];
            table.row([
                method.name().to_owned(),
                total.to_string(),
                format!("{:.1}", total as f64 / pixels),
                ocean.most[place].to_string(),
                format!("{:.3}", total as f64 / ocean.executions[3] as f64),
            ]);
        }
        let mut sweep = Table::new(["slope", "crossed", "method", "executions", "find light", "CPU ms"]);
        for row in &self.rows {
            sweep.row([
                row.slope.to_string(),
                format!("{:.4}", row.crossing),
                row.method.name().to_owned(),
                row.executions.to_string(),
                format!("{:.3}", row.useful),
                format!("{:.1}", 1e3 * row.cpu_s),
            ]);
        }
        let mut coarse = Table::new(["slope", "cells", "crossed", "error", "warns"]);
        for row in &self.coarse {
            coarse.row([
                row.slope.to_string(),
                row.cells.to_string(),
                format!("{:.4}", row.crossing),
                format!("{:.3}", row.error),
                if row.warned { "yes" } else { "no" }.to_owned(),
            ]);
        }
        format!("{} volumes\n{table}\n{sweep}\n{coarse}\n", ocean.volumes)
    }

    /// The first promise that was found broken.
    pub fn fault(&self) -> Option<String> {
        let other = self.rows.iter().find(|row| row.difference > 0.0)?;
        Some(format!(
            "{} draws another image than the moving triangles; please report it",
            other.method.name()
        ))
    }

    fn picture(&self) -> Picture {
        let by_method = |of: fn(&Row) -> f64| {
            let curve = |method: Method| {
                let rows = self.rows.iter().filter(move |row| row.method == method);
                Curve::new(method.name(), rows.map(|row| (row.slope, of(row))))
            };
            Method::ALL.map(curve).into()
        };
        let slope = "slope of the waves (root mean square)";
        let runs = by_method(|row| row.executions as f64);
        let useful = by_method(|row| row.useful);
        let time = by_method(|row| 1e3 * row.cpu_s);
        let subject = format!(
            "light in the water under {} generator triangles; the image is the same by every method",
            2 * self.effort.sweep_cells * self.effort.sweep_cells
        );
        let panel = |title: &str, up: &str, curves| {
            CurvePanel::new(title, [slope, up], curves).on(Scale::Decades, Scale::Even)
        };
        let panels = vec![
            panel("cost", "shader executions", runs),
            panel("use", "share of executions that find light", useful),
            panel("cost", "CPU time (ms)", time),
        ];
        Curves { title: "Caustics: beams and bodies about them", subject: &subject, panels }.picture()
    }

    /// Where beams fail: the error over the number of triangles, and over how much their sides cross.
    fn failures(&self) -> Picture {
        let all = |of: fn(&Coarse) -> f64| {
            let mut values: Vec<f64> = self.coarse.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values.dedup();
            values
        };
        let of_slope = |slope: f64| {
            let rows = self.coarse.iter().filter(move |row| row.slope == slope);
            Curve::new(format!("slope {slope}"), rows.map(|row| (f64::from(row.cells), row.error)))
        };
        let of_cells = |cells: f64| {
            let crossed = self.coarse.iter().filter(|row| row.crossing > 0.0);
            let rows = crossed.filter(move |row| f64::from(row.cells) == cells);
            let mut points: Vec<_> = rows.map(|row| (100.0 * row.crossing, row.error)).collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            Curve::new(format!("{cells} squares along a side"), points)
        };
        let up = "error over mean";
        let slopes = all(|row| row.slope).into_iter().map(of_slope).collect();
        let cells = all(|row| f64::from(row.cells)).into_iter().map(of_cells);
        let cells = cells.filter(|curve| curve.points.len() > 1).collect();
        let crossed = "length of beams for which their sides cross (%)";
        let panels = vec![
            CurvePanel::new("too few triangles", ["squares along a side", up], slopes)
                .on(Scale::Doublings, Scale::Decades)
                .failing(Some(0.0..self.resolved_cells), "a run warns: caustics-coarse"),
            CurvePanel::new("crossed sides: dots are slopes", [crossed, up], cells)
                .failing(Some(100.0 * CROSSED..f64::INFINITY), "caustics-crossed"),
        ];
        let subject = format!(
            "light on the floor of ever steeper waves by moving triangles, in squares of 8x8 pixels, against {} squares along a side",
            self.effort.reference_cells
        );
        Curves { title: "Where caustics fail: coarse surfaces and crossed sides", subject: &subject, panels }
            .picture()
    }

    fn csv(&self, out: &mut (dyn std::io::Write + Send)) -> Result<(), BoxError> {
        let mut table = csv::WriterBuilder::new().has_headers(false).from_writer(out);
        table.write_record([
            "sweep",
            "slope",
            "cells",
            "crossing",
            "method",
            "executions",
            "useful",
            "difference",
            "cpu_s",
            "error",
        ])?;
        for row in &self.rows {
            let cells = self.effort.sweep_cells;
            table.serialize((
                "slope",
                row.slope,
                cells,
                row.crossing,
                row.method,
                row.executions,
                row.useful,
                row.difference,
                row.cpu_s,
                "",
            ))?;
        }
        for row in &self.coarse {
            let method = Method::Moving;
            table.serialize((
                "cells",
                row.slope,
                row.cells,
                row.crossing,
                method,
                "",
                "",
                "",
                "",
                row.error,
            ))?;
        }
        Ok(table.flush()?)
    }
}
