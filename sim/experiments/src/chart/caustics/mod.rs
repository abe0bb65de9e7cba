//! `quintile chart caustics`: shader executions and images of caustics by bounding volume, and failure modes:
//! too few triangles, and crossed sides.

pub(crate) mod measure;

use output::OutputError;
use output::plot::{ChartPanel, HeatMapPlot, HeatScale, HeatTile, Picture, PlotStyle, Scale, Series};
use output::terminal::Progress;
use serde::Serialize;
use workloads::caustics::{BeamMethod, MAX_CROSSED_SHARE};

use crate::study::table::{Sheet, TableBuilder, count, fixed, millis, plain};
use crate::study::{Gallery, Study, StudyError};

pub use measure::{Crossed, MethodFrame, OceanCounts, ocean};

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CausticsEffort {
    /// Squares along a side of the ocean of the paper's figure; 255 are 130,050 volumes.
    pub ocean_cells: u32,
    /// Pixels of its image.
    pub ocean_px: [u32; 2],
    /// Squares along a side of the ocean whose waves get steeper, and pixels of its image.
    pub sweep_cells: u32,
    /// Pixels of its image.
    pub sweep_px: [u32; 2],
    /// Slopes of its waves.
    pub slopes: &'static [f64],
    /// Squares along a side of an ocean that gets coarser.
    pub coarse_cells: &'static [u32],
    /// Squares along a side of oceans whose triangles are pleated along the light.
    pub pleated_cells: &'static [u32],
    /// Pleats of the pleated oceans.
    pub pleats: &'static [f64],
    /// Photons across and down that surfaces are compared with.
    pub rays: u32,
    /// Pixels along a side of the floor they light.
    pub floor_px: u32,
    /// Times are medians of so many.
    pub repeats: usize,
    /// Squares along a side of the ocean that is timed on the reference GPU.
    pub frame_cells: u32,
    /// Pixels of its image.
    pub frame_px: [u32; 2],
    /// Slopes of its waves.
    pub frame_slopes: &'static [f64],
}

/// One method on one surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CausticsRow {
    /// Root mean square of the slope of the surface.
    pub slope: f64,
    /// For how much of their length sides of beams cross.
    pub crossing: f64,
    /// How beams are bounded.
    pub method: BeamMethod,
    /// Shader executions.
    pub executions: u64,
    /// The share of them that finds light.
    pub useful: f64,
    /// Largest difference of a pixel from the image of the moving triangles.
    pub difference: f64,
    /// CPU time of one thread, for coverage and shading.
    pub cpu_s: f64,
}

/// A surface made of fewer and fewer triangles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CoarseSurface {
    /// Squares along a side.
    pub cells: u32,
    /// Root mean square of the slope of the surface.
    pub slope: f64,
    /// For how much of their length sides of beams cross.
    pub crossing: f64,
    /// Mean difference from photons refracted at the waves themselves, as a part of its mean.
    pub error: f64,
    /// Error of other photons of that kind.
    pub noise: f64,
    /// Whether the run warns.
    pub warned: bool,
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct CausticsChart {
    /// How much was measured.
    pub effort: CausticsEffort,
    /// The ocean of the paper's figure.
    pub ocean: OceanCounts,
    /// Squares along a side of the coarser oceans from which on a run does not warn that they are too few.
    pub resolved_cells: f64,
    /// By slope and method.
    pub rows: Vec<CausticsRow>,
    /// By slope and number of triangles.
    pub coarse: Vec<CoarseSurface>,
    /// By number of triangles and pleat.
    pub crossed: Vec<Crossed>,
    /// On the reference GPU, by slope and method.
    pub frames: Vec<MethodFrame>,
}

/// Short names of the methods, in the order of [`BeamMethod::ALL`].
const KEYS: [&str; 4] = ["moving", "refined", "hull", "prism"];
/// Names of the maps of the methods, in the order of [`BeamMethod::ALL`].
const MAPS: [&str; 4] =
    ["caustics_map_moving", "caustics_map_refined", "caustics_map_hull", "caustics_map_prism"];

impl Study for CausticsChart {
    const NAME: &'static str = "caustics";
    const ABOUT: &'static str =
        "Shader executions and images of caustics, by how beams are bounded, and where beams fail";
    const PICTURES: &'static [&'static str] =
        &["caustics", "caustics_frames", "caustics_failures", MAPS[0], MAPS[1], MAPS[2], MAPS[3]];
    const FILES: &'static [&'static str] = &["caustics.csv", "caustics_frames.csv", "caustics.json"];

    type Effort = CausticsEffort;
    const FULL: CausticsEffort = CausticsEffort {
        ocean_cells: 255,
        ocean_px: [512, 288],
        sweep_cells: 24,
        sweep_px: [128, 72],
        slopes: &[0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0],
        coarse_cells: &[8, 16, 32, 64, 128],
        pleated_cells: &[24, 48, 96],
        pleats: &[0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
        rays: 2400,
        floor_px: 512,
        repeats: 3,
        frame_cells: 64,
        frame_px: [512, 288],
        frame_slopes: &[0.05, 0.15, 0.4, 1.0],
    };
    const QUICK: CausticsEffort = CausticsEffort {
        ocean_cells: 48,
        ocean_px: [192, 108],
        sweep_cells: 10,
        sweep_px: [64, 36],
        slopes: &[0.02, 0.1, 0.4, 1.0],
        coarse_cells: &[8, 16, 32, 64],
        pleated_cells: &[32],
        pleats: &[0.0, 0.05, 0.2, 0.5],
        rays: 1000,
        floor_px: 192,
        repeats: 1,
        frame_cells: 16,
        frame_px: [128, 72],
        frame_slopes: &[0.15, 1.0],
    };

    fn measure(effort: CausticsEffort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        measure::measure(effort, progress)
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let subject = format!(
            "light in the water under {} generator triangles; the image is the same by every method",
            2 * self.effort.sweep_cells * self.effort.sweep_cells
        );
        to.chart("caustics", ["Caustics: light volumes and their bounding volumes", &subject], self.costs())?;
        let [width, height] = self.effort.frame_px;
        let subject = format!(
            "first frame of `quintile run caustics`, {} generator triangles, {width}x{height} pixels, GPU reference",
            2 * self.effort.frame_cells * self.effort.frame_cells
        );
        to.chart("caustics_frames", ["Caustics on the modelled hardware", &subject], self.on_hardware())?;
        let title = "Where caustics fail: coarse surfaces and crossed sides";
        let subject = format!(
            "light on the floor in squares of 8x8 pixels against {} photons, refracted at the waves themselves; for crossed sides the light and the number of \
             triangles stay the same, they only stand ever more along the light",
            self.effort.rays * self.effort.rays
        );
        to.chart("caustics_failures", [title, &subject], panels(self))?;
        let mut maps = BeamMethod::ALL.into_iter().zip(MAPS);
        maps.try_for_each(|(method, stem)| to.add(stem, &self.ocean.map(method, to.plot_style())))
    }

    fn tables(&self) -> Vec<Sheet> {
        let (ocean, yes_no) = (&self.ocean, |yes: bool| if yes { "yes" } else { "no" }.to_owned());
        let pixels = f64::from(ocean.size[0] * ocean.size[1]);
        let methods = TableBuilder::of(BeamMethod::ALL.into_iter().enumerate())
            .shown("ocean", |(_, method)| method.name(), plain)
            .shown("executions", |(place, _)| ocean.executions[*place], count)
            .shown("a pixel", |(place, _)| ocean.executions[*place] as f64 / pixels, fixed(1))
            .shown("most", |(place, _)| ocean.most[*place], count)
            .shown("of the prism's", |(place, _)| ocean.of_the_prism(*place), fixed(3))
            .before(format!("{} volumes\n", ocean.volumes));
        let sweep = TableBuilder::of(&self.rows)
            .shown("slope", |row| row.slope, plain)
            .shown("crossed", |row| row.crossing, fixed(4))
            .shown("method", |row| row.method.name(), plain)
            .shown("executions", |row| row.executions, count)
            .shown("find light", |row| row.useful, fixed(3))
            .shown("CPU ms", |row| row.cpu_s, millis(1));
        let coarse = TableBuilder::of(&self.coarse)
            .shown("slope", |row| row.slope, plain)
            .shown("cells", |row| row.cells, plain)
            .shown("crossed", |row| row.crossing, fixed(4))
            .shown("error", |row| row.error, fixed(3))
            .shown("warns", |row| row.warned, yes_no);
        let mut crossed = TableBuilder::of(&self.crossed)
            .shown("cells", |row| row.cells, plain)
            .shown("pleat", |row| row.pleat, plain)
            .shown("crossed", |row| row.crossing, fixed(4))
            .shown("floor", |row| row.floor_error, fixed(4))
            .shown("noise", |row| row.noise, fixed(4))
            .shown("volume", |row| row.volume_error, fixed(4))
            .shown("missing", |row| row.missing, fixed(5))
            .shown("lost", |row| row.lost, fixed(5));
        for (place, method) in KEYS.into_iter().enumerate() {
            crossed = crossed.shown(method, |row| row.useful[place], fixed(3));
        }
        let crossed = crossed.shown("warns", |row| row.warned, yes_no).after("\n");
        let frames = TableBuilder::of(&self.frames)
            .column("slope", "slope", |row| row.slope, plain)
            .column("method", "method", |row| row.method.name(), plain)
            .column("triangles", "triangles", |row| row.triangles as u64, count)
            .column("tests", "pixels tested", |row| row.tests, count)
            .column("executions", "executions", |row| row.executions, count)
            .column("shader_ops", "operations", |row| row.shader_ops, count)
            .column("frame_s", "frame (ms)", |row| row.frame_s, millis(2))
            .column("frame_j", "frame (mJ)", |row| row.frame_j, millis(2))
            .csv("caustics_frames.csv");
        vec![methods.sheet(), frames.sheet(), sweep.sheet(), coarse.sheet(), crossed.sheet(), self.lines()]
    }

    /// The first promise that was found broken.
    fn fault(&self) -> Option<String> {
        let other = self.rows.iter().find(|row| row.difference > 0.0).map(|row| row.method.name());
        let pleated =
            self.crossed.iter().find(|row| row.difference > 0.0).map(|_| "a body about pleated beams");
        let name = other.or(pleated)?;
        Some(format!("{name} draws another image than the moving triangles; please report it"))
    }
}

/// A line of `caustics.csv`: what a sweep has of a surface and a method.
#[derive(Default)]
struct Line {
    sweep: &'static str,
    slope_or_pleat: f64,
    cells: u32,
    crossing: f64,
    method: &'static str,
    executions: Option<u64>,
    useful: Option<f64>,
    difference: Option<f64>,
    cpu_s: Option<f64>,
    error: Option<f64>,
}

impl Line {
    fn of_slope(row: &CausticsRow, cells: u32) -> Self {
        let place = BeamMethod::ALL.iter().position(|method| *method == row.method).unwrap_or(0);
        Self {
            sweep: "slope",
            slope_or_pleat: row.slope,
            cells,
            crossing: row.crossing,
            method: KEYS[place],
            executions: Some(row.executions),
            useful: Some(row.useful),
            difference: Some(row.difference),
            cpu_s: Some(row.cpu_s),
            error: None,
        }
    }

    fn of_cells(row: &CoarseSurface) -> Self {
        let (sweep, method, error) = ("cells", KEYS[0], Some(row.error));
        let (slope_or_pleat, cells, crossing) = (row.slope, row.cells, row.crossing);
        Self { sweep, slope_or_pleat, cells, crossing, method, error, ..Self::default() }
    }

    fn of_pleat(row: &Crossed) -> [Self; 4] {
        [0, 1, 2, 3].map(|place| Self {
            sweep: "pleat",
            slope_or_pleat: row.pleat,
            cells: row.cells,
            crossing: row.crossing,
            method: KEYS[place],
            executions: Some(row.executions[place]),
            useful: Some(row.useful[place]),
            difference: Some(row.difference),
            cpu_s: None,
            error: Some(row.floor_error),
        })
    }
}

impl CausticsChart {
    /// All sweeps in one file.
    fn lines(&self) -> Sheet {
        let slopes = self.rows.iter().map(|row| Line::of_slope(row, self.effort.sweep_cells));
        let lines = slopes.chain(self.coarse.iter().map(Line::of_cells));
        TableBuilder::of(lines.chain(self.crossed.iter().flat_map(Line::of_pleat)))
            .data("sweep", |line| line.sweep)
            .data("slope_or_pleat", |line| line.slope_or_pleat)
            .data("cells", |line| line.cells)
            .data("crossing", |line| line.crossing)
            .data("method", |line| line.method)
            .data("executions", |line| line.executions)
            .data("useful", |line| line.useful)
            .data("difference", |line| line.difference)
            .data("cpu_s", |line| line.cpu_s)
            .data("error", |line| line.error)
            .csv("caustics.csv")
            .sheet()
    }

    /// Work, time and energy of a frame over the slope of the waves, by method.
    fn on_hardware(&self) -> Vec<ChartPanel> {
        let panel = |title: &str, up: &str, of: fn(&MethodFrame) -> f64| {
            let curve = |method: BeamMethod| {
                let rows = self.frames.iter().filter(move |row| row.method == method);
                Series::curve(method.name(), rows.map(|row| (row.slope, of(row))))
            };
            ChartPanel::new(
                title,
                ["slope of the waves (root mean square)", up],
                BeamMethod::ALL.map(curve).into(),
            )
            .on(Scale::Decades, Scale::Even)
        };
        vec![
            panel("tests", "pixels tested", |row| row.tests as f64),
            panel("shading", "shader executions", |row| row.executions as f64),
            panel("time", "frame (ms)", |row| 1e3 * row.frame_s),
            panel("energy", "frame (mJ)", |row| 1e3 * row.frame_j),
        ]
    }

    fn costs(&self) -> Vec<ChartPanel> {
        let by_method = |of: fn(&CausticsRow) -> f64| {
            let curve = |method: BeamMethod| {
                let rows = self.rows.iter().filter(move |row| row.method == method);
                Series::curve(method.name(), rows.map(|row| (row.slope, of(row))))
            };
            BeamMethod::ALL.map(curve).into()
        };
        let panel = |title: &str, up: &str, of| {
            ChartPanel::new(title, ["slope of the waves (root mean square)", up], by_method(of))
                .on(Scale::Decades, Scale::Even)
        };
        vec![
            panel("cost", "shader executions", |row| row.executions as f64),
            panel("use", "share of executions that find light", |row| row.useful),
            panel("cost", "CPU time (ms)", |row| 1e3 * row.cpu_s),
        ]
    }
}

/// Pixels along a side of a rectangle of a map.
const MAP_PX: u32 = 4;

impl OceanCounts {
    /// Executions of a method at every pixel (Fig. 8), in colours that are the same for all methods.
    pub fn map(&self, method: BeamMethod, plot_style: &PlotStyle) -> Picture {
        let place = BeamMethod::ALL.iter().position(|known| *known == method).unwrap_or(0);
        let values = (0..self.runs.len()).flat_map(|place| self.tiles(place)).map(|tile| tile.value);
        HeatMapPlot {
            title: &format!("Shader executions of a pixel: {}", method.name()),
            subject: &format!(
                "{} volumes under waves, {}x{} pixels; {} executions in all, {:.2} of the prism's; the same colours for all methods",
                self.volumes,
                self.size[0],
                self.size[1],
                self.executions[place],
                self.of_the_prism(place)
            ),
            label: "executions",
            size: self.size,
            tiles: &self.tiles(place),
            shading: HeatScale::UpTo(values.fold(0.0, f64::max)),
            brightness: &[],
        }
        .picture(plot_style)
    }

    /// Executions of the method at `place` over those of the prism.
    fn of_the_prism(&self, place: usize) -> f64 {
        self.executions[place] as f64 / self.executions[3] as f64
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

const CROSSING: &str = "length of beams for which their sides cross (%)";

/// Errors over the number of triangles and over how much sides cross, and what bodies lose there.
fn panels(chart: &CausticsChart) -> Vec<ChartPanel> {
    vec![coarse(chart), error(chart), lost(chart), useful(chart)]
}

fn coarse(chart: &CausticsChart) -> ChartPanel {
    let of_slope = |slope: f64| {
        let rows = chart.coarse.iter().filter(move |row: &&CoarseSurface| row.slope == slope);
        Series::curve(format!("slope {slope}"), rows.map(|row| (f64::from(row.cells), row.error)))
    };
    let mut slopes: Vec<f64> = chart.coarse.iter().map(|row| row.slope).collect();
    slopes.dedup();
    let curves = slopes.into_iter().map(of_slope).collect();
    ChartPanel::new("too few triangles", ["squares along a side", "error over mean"], curves)
        .on(Scale::Doublings, Scale::Decades)
        .failing(Some(0.0..chart.resolved_cells), "a run warns: caustics-coarse")
}

/// A curve for each number of triangles.
fn by_cells(chart: &CausticsChart, of: fn(&Crossed) -> f64) -> impl Iterator<Item = Series> {
    chart.effort.pleated_cells.iter().map(move |&cells| {
        let rows = chart.crossed.iter().filter(move |row| row.cells == cells);
        Series::curve(format!("{cells} squares"), rows.map(|row| (100.0 * row.crossing, of(row))))
    })
}

fn over_crossing(title: &str, up: &str, curves: Vec<Series>) -> ChartPanel {
    ChartPanel::new(title, [CROSSING, up], curves)
        .on(Scale::Even, Scale::Even)
        .failing(Some(100.0 * MAX_CROSSED_SHARE..f64::INFINITY), "caustics-crossed")
}

fn error(chart: &CausticsChart) -> ChartPanel {
    let floor = by_cells(chart, |row| row.floor_error);
    let volume = by_cells(chart, |row| row.volume_error)
        .map(|curve| Series { name: format!("{}: in the volume", curve.name), ..curve });
    over_crossing(
        "all methods: on the floor and in the volume",
        "error over mean",
        floor.chain(volume).collect(),
    )
}

fn lost(chart: &CausticsChart) -> ChartPanel {
    let named = |of: fn(&Crossed) -> f64, what: &'static str| {
        by_cells(chart, of).map(move |curve| Series { name: format!("{}: {what}", curve.name), ..curve })
    };
    let all = named(|row| 100.0 * row.missing, "all methods");
    let curves = all.chain(named(|row| 100.0 * row.lost, "lost by the uncut bound")).collect();
    over_crossing("light in the volume", "light missing (%)", curves)
}

/// Panel of the useful share of each bounding volume, at the largest number of triangles.
fn useful(chart: &CausticsChart) -> ChartPanel {
    let most = chart.effort.pleated_cells.last().copied().unwrap_or(0);
    let of = |(place, method): (usize, BeamMethod)| {
        let rows = chart.crossed.iter().filter(move |row| row.cells == most);
        Series::curve(method.name(), rows.map(move |row| (100.0 * row.crossing, row.useful[place])))
    };
    let curves = BeamMethod::ALL.into_iter().enumerate().map(of).collect();
    let title = format!("use, {most} squares along a side");
    over_crossing(&title, "share of executions that find light", curves)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    #[test]
    fn the_files_are_all_there_and_agree() {
        let least = CausticsEffort {
            ocean_cells: 6,
            ocean_px: [48, 27],
            sweep_cells: 4,
            sweep_px: [32, 18],
            slopes: &[0.05, 0.3],
            coarse_cells: &[2, 8],
            pleated_cells: &[24],
            pleats: &[0.0, 0.4],
            rays: 300,
            floor_px: 48,
            repeats: 1,
            frame_cells: 8,
            frame_px: [48, 27],
            frame_slopes: &[0.4],
        };
        let (folder, chart, done) = written::<CausticsChart>(least);
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let json: serde_json::Value = serde_json::from_str(&read("caustics.json")).unwrap();
        assert_eq!(json["rows"].as_array().unwrap().len(), 2 * 4);
        let coarse = json["coarse"].as_array().unwrap().len();
        assert!(coarse >= 2 * 2, "every slope with every number of triangles");
        assert_eq!(read("caustics.csv").lines().count(), 1 + 2 * 4 + coarse + 2 * 4);
        let gentle: Vec<f64> =
            chart.coarse.iter().filter(|row| row.slope == 0.05).map(|row| row.error).collect();
        assert!(
            gentle.len() == 2 && gentle.iter().all(|error| *error < 0.1),
            "close to the photons: {gentle:?}"
        );
        let [straight, crossed] = [&chart.crossed[0], &chart.crossed[1]];
        assert!(crossed.crossing > straight.crossing + 0.02);
        assert!(chart.crossed.iter().all(|row| row.difference == 0.0 && row.floor_error > row.noise));
        assert!(read("caustics.svg").contains("moving"));
        assert!(chart.rows.iter().all(|row| row.difference == 0.0), "the same image by every method");
        assert!(done.text.contains("convex hull"));
        for slope in 0..2 {
            let of = |method: usize| chart.rows[4 * slope + method].executions;
            assert!(of(0) <= of(1) && of(0) <= of(2) && of(2) <= of(3));
        }
        let [moving, refined, hull, prism] = [0, 1, 2, 3].map(|place| chart.frames[place]);
        assert!(moving.executions <= refined.executions.min(hull.executions).min(prism.executions));
        assert!(moving.triangles < prism.triangles && moving.tests > moving.executions);
        assert!(chart.frames.iter().all(|frame| frame.frame_s > 0.0 && frame.frame_j > 0.0));
    }
}
