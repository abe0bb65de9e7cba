//! The files of the chart.

use workloads::caustics::Method;

use super::{CausticsChart, Ocean, Row, failures};
use output::dir::BoxError;
use output::plot::{Chart, ChartPanel, HeatMapPlot, HeatTile, Look, Picture, Scale, Series, Shading};
use output::table::Table;
use output::{Claim, OutDir, OutputError};

/// The files of the chart.
pub fn claim() -> Claim {
    Claim::new("chart caustics")
        .plots([
            "caustics",
            "caustics_failures",
            "caustics_map_moving",
            "caustics_map_refined",
            "caustics_map_hull",
            "caustics_map_prism",
        ])
        .files(["caustics.csv", "caustics.json"])
}

/// Writes pictures and numbers; `caustics.json` comes last.
pub(super) fn write(chart: &CausticsChart, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
    chart.picture(look).write(dir, "caustics")?;
    failures::picture(chart, look).write(dir, "caustics_failures")?;
    for (method, name) in Method::ALL.into_iter().zip(["moving", "refined", "hull", "prism"]) {
        chart.ocean.map(method, look).write(dir, &format!("caustics_map_{name}"))?;
    }
    dir.write_file("caustics.csv", |out| chart.csv(out))?;
    dir.write_json("caustics.json", chart)?;
    Ok(())
}

/// Pixels along a side of a rectangle of a map.
const MAP_PX: u32 = 4;

impl Ocean {
    /// Executions of a method at every pixel (Fig. 8), in colours that are the same for all methods.
    pub fn map(&self, method: Method, look: &Look) -> Picture {
        let place = Method::ALL.iter().position(|known| *known == method).unwrap_or(0);
        let values = (0..self.runs.len()).flat_map(|place| self.tiles(place)).map(|tile| tile.value);
        HeatMapPlot {
            title: &format!("Shader executions of a pixel: {}", method.name()),
            subject: &format!(
                "{} volumes under waves, {}x{} pixels; {} executions in all, {:.2} of the prism's; the same colours for all methods",
                self.volumes,
                self.size[0],
                self.size[1],
                self.executions[place],
                self.executions[place] as f64 / self.executions[3] as f64
            ),
            label: "executions",
            size: self.size,
            tiles: &self.tiles(place),
            shading: Shading::UpTo(values.fold(0.0, f64::max)),
            brightness: &[],
        }
        .picture(look)
    }

    /// Means over squares of pixels of the executions of the method at `place`.
    fn tiles(&self, place: usize) -> Vec<HeatTile> {
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
        rows.flat_map(|y| (0..width).step_by(MAP_PX as usize).map(move |x| (x, y)))
            .map(|(x, y)| mean(x, y))
            .collect()
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
        let crossed = failures::table(self);
        format!("{} volumes\n{table}\n{sweep}\n{coarse}\n{crossed}\n", ocean.volumes)
    }

    /// The first promise that was found broken.
    pub fn fault(&self) -> Option<String> {
        let other = self.rows.iter().find(|row| row.difference > 0.0).map(|row| row.method.name());
        let pleated =
            self.crossed.iter().find(|row| row.difference > 0.0).map(|_| "a body about pleated beams");
        let name = other.or(pleated)?;
        Some(format!("{name} draws another image than the moving triangles; please report it"))
    }

    fn picture(&self, look: &Look) -> Picture {
        let by_method = |of: fn(&Row) -> f64| {
            let curve = |method: Method| {
                let rows = self.rows.iter().filter(move |row| row.method == method);
                Series::curve(method.name(), rows.map(|row| (row.slope, of(row))))
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
            ChartPanel::new(title, [slope, up], curves).on(Scale::Decades, Scale::Even)
        };
        let panels = vec![
            panel("cost", "shader executions", runs),
            panel("use", "share of executions that find light", useful),
            panel("cost", "CPU time (ms)", time),
        ];
        Chart::new("Caustics: beams and bodies about them", &subject, panels).picture(look)
    }

    fn csv(&self, out: &mut (dyn std::io::Write + Send)) -> Result<(), BoxError> {
        let mut table = csv::WriterBuilder::new().has_headers(false).from_writer(out);
        table.write_record([
            "sweep",
            "slope_or_pleat",
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
        for row in &self.crossed {
            for (place, method) in Method::ALL.into_iter().enumerate() {
                let (executions, useful) = (row.executions[place], row.useful[place]);
                let (cells, crossing, error) = (row.cells, row.crossing, row.floor_error);
                table.serialize((
                    "pleat",
                    row.pleat,
                    cells,
                    crossing,
                    method,
                    executions,
                    useful,
                    row.difference,
                    "",
                    error,
                ))?;
            }
        }
        Ok(table.flush()?)
    }
}
