//! `quintile chart multiview`: stereo and multi-view in one pass against view by view and accumulation.
//!
//! Pixels that are shaded once serve all views, the lens and the shutter. The measure is pixel shader lanes
//! run, over those that one of the views takes alone on the same hardware.

mod measure;

use pipeline::Replacement;
use serde::Serialize;
use workloads::multiview::{Layout, MAX_RUNS_OVER_INFINITE_CACHE, MAX_VIEW_ANGLE_DEG};

use crate::study::table::{Sheet, TableBuilder, count, fixed, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError};
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::terminal::{Bar, Progress};

pub use measure::{Angle, Cached, MultiviewBench, RegionTests, TileTestCosts, ViewLanes, ViewsRow, ViewsRun};

/// Effort of the measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MultiviewEffort {
    /// The built-in scene, and its frame.
    pub scene: (&'static str, u32),
    /// Pixels of each view, across and down.
    pub size: [u32; 2],
    /// Numbers of views.
    pub views: &'static [u32],
    /// Entries of the shading cache.
    pub entries: &'static [u32],
    /// Lengths of the camera line over the distance of what is in focus, for view-dependent shading and for
    /// separate tests of the regions of the lens.
    pub baselines: &'static [f64],
}

/// Samples for each view of a pixel (thesis, Paper VI, section 8).
pub const SAMPLES: u32 = 8;
/// From eye to eye, scene units, which are metres in the built-in scenes: the mean of adults is 63 mm
/// (Dodgson 2004). The photographer's rule, a thirtieth of the distance of what is nearest, says 80 mm for
/// `default`.
const EYES: f64 = 0.065;
/// Radius of the lens of an eye, scene units: as wide as it can be with something left between the eyes, for
/// defocus to be seen.
const APERTURE: f64 = 0.4 * EYES;

/// Two eyes.
pub fn stereo() -> Layout {
    Layout::stereo(EYES, APERTURE)
}

/// So many views on a line as long as both eyes and their lenses take, each with a box filter that overlaps
/// half of the next.
pub fn line(views: u32) -> Layout {
    Layout::line(views, EYES + 2.0 * APERTURE, APERTURE)
}

/// The policies, each with its name.
const POLICIES: [(&str, Replacement); 3] =
    [("lru", Replacement::Lru), ("fifo", Replacement::Fifo), ("random", Replacement::Random { seed: 1 })];

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct MultiviewChart {
    /// Effort of the measurement.
    pub effort: MultiviewEffort,
    /// By number of views.
    pub rows: Vec<ViewsRow>,
    /// Views near to each other and far apart, by policy and entries of the cache.
    pub caches: Vec<CacheCase>,
    /// Error of shading for the middle of the line, by its length.
    pub angles: Vec<Angle>,
    /// Separate tests of the regions of the lens, by views and length of the camera line.
    pub regions: Vec<RegionTests>,
}

/// Kinds of views whose regions of the lens are tested each on their own: apart, and with box filters on
/// adjoining strips.
const KINDS: [&str; 3] = ["two eyes", "seven lenses", "seven overlapping views"];

/// Views for which caches are tried.
#[derive(Clone, Debug, Serialize)]
pub struct CacheCase {
    /// Name of the views.
    pub name: &'static str,
    /// By policy and entries of the cache.
    pub rows: Vec<Cached>,
}

/// The length, over the distance of what is in focus, of a line of views so far apart that each needs what
/// the others have forgotten.
const FAR_APART: f64 = 0.8;

/// Views for which caches are tried, with what they are.
fn layouts(focus: f64) -> [(&'static str, Layout); 3] {
    let far = Layout::line(7, FAR_APART * focus, APERTURE);
    [("two views", stereo()), ("seven views", line(7)), ("seven views far apart", far)]
}

impl Study for MultiviewChart {
    const NAME: &'static str = "multiview";
    const ABOUT: &'static str = "Stereo and multi-view: shader runs over views and caches, one pass against its rivals, tests by lens region";
    const PICTURES: &'static [&'static str] =
        &["multiview_cost", "multiview_cache", "multiview_failures", "multiview_regions"];
    const FILES: &'static [&'static str] =
        &["multiview.csv", "multiview_cache.csv", "multiview_regions.csv", "multiview.json"];

    type Effort = MultiviewEffort;
    const FULL: MultiviewEffort = MultiviewEffort {
        scene: ("default", 18),
        size: [320, 180],
        views: &[1, 2, 7, 9, 64],
        entries: &[4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16_384],
        baselines: &[0.02, 0.05, 0.1, 0.2, 0.4, 0.8],
    };
    const QUICK: MultiviewEffort = MultiviewEffort {
        size: [128, 72],
        views: &[1, 2, 7, 64],
        entries: &[4, 16, 64, 256, 1024, 16_384],
        baselines: &[0.05, 0.4],
        ..Self::FULL
    };

    fn measure(effort: MultiviewEffort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let lengths = effort.baselines.len();
        let steps =
            effort.views.len() + 3 * POLICIES.len() * effort.entries.len() + (1 + KINDS.len()) * lengths;
        let bar = progress.bar("multiview", steps as u64);
        let bench = MultiviewBench::new(effort.scene, effort.size)?;
        let rows = effort.views.iter().map(|&views| ticked(bench.row(views), &bar));
        let rows = rows.collect::<Result<_, _>>()?;
        let mut caches = Vec::new();
        for (name, layout) in layouts(bench.focus()) {
            let each = POLICIES
                .into_iter()
                .flat_map(|policy| effort.entries.iter().map(move |&entries| (policy, entries)));
            let rows = each.map(|(policy, entries)| ticked(bench.cached(layout, policy, entries), &bar));
            caches.push(CacheCase { name, rows: rows.collect::<Result<_, _>>()? });
        }
        let angles = effort.baselines.iter().map(|&baseline| ticked(bench.angle(baseline), &bar));
        let angles = angles.collect::<Result<_, _>>()?;
        let each = KINDS.into_iter().flat_map(|views| effort.baselines.iter().map(move |&at| (views, at)));
        let regions = each.map(|(views, at)| ticked(bench.regions(views, at), &bar));
        let regions = regions.collect::<Result<_, _>>()?;
        Ok(Self { effort, rows, caches, angles, regions })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let [width, height] = self.effort.size;
        let subject =
            format!("{}, {width}x{height} pixels a view, 8 samples each where they fit", self.effort.scene.0);
        to.chart("multiview_cost", ["Many views: one pass against its rivals", &subject], self.costs())?;
        let title = "Pixel shader lanes of one pass over the shading cache";
        let marked = format!(
            "{subject}. Marked: a cache smaller than what is in use at a time, where a run warns (shading-cache-small)"
        );
        let caches = self.caches.iter().map(CacheCase::panel).collect();
        to.chart("multiview_cache", [title, &marked], caches)?;
        let title = "Where one pass fails: shading that depends on who looks";
        to.chart("multiview_failures", [title, &subject], vec![self.failures()])?;
        let title = "Tile tests of each region of the lens, over those of the whole lens";
        to.chart("multiview_regions", [title, &subject], self.region_panels())
    }

    fn fault(&self) -> Option<String> {
        let differs = self.regions.iter().any(|row| !row.equal);
        differs.then(|| "separate tests of the regions change an image; please report it".to_owned())
    }

    fn tables(&self) -> Vec<Sheet> {
        let each = self.rows.iter().flat_map(|row| runs(row).map(|(method, run)| (row, method, run)));
        let runs = TableBuilder::of(each)
            .column("views", "views", |(row, ..)| row.views, plain)
            .data("samples_per_view", |(row, ..)| row.samples_per_view)
            .column("method", "method", |(_, method, _)| *method, plain)
            .column("passes", "passes", |(.., run)| run.passes, plain)
            .data("invocations", |(.., run)| run.invocations)
            .column("over_one_view", "lanes over one view", |(.., run)| run.over_one_view, fixed(3))
            .column("vertices", "vertices", |(.., run)| run.vertices, count)
            .data("dram_bytes", |(.., run)| run.dram_bytes)
            .column("host_s", "host s", |(.., run)| run.host_s, fixed(3));
        let cached = self.caches.iter().flat_map(|case| case.rows.iter().map(|row| (case.name, row)));
        let caches = TableBuilder::of(cached)
            .column("case", "views", |(case, _)| *case, plain)
            .data("views", |(_, row)| row.views)
            .column("policy", "policy", |(_, row)| row.policy, plain)
            .column("entries", "entries", |(_, row)| row.entries, plain)
            .column("invocations_per_pixel", "lanes a pixel", |(_, row)| row.invocations_per_pixel, fixed(3))
            .data("one_view_per_pixel", |(_, row)| row.one_view_per_pixel)
            .column(
                "increase",
                "over one view",
                |(_, row)| row.increase,
                |increase| format!("{:+.1} %", 100.0 * increase),
            );
        let angles = TableBuilder::of(&self.angles)
            .shown("camera line over distance", |angle| angle.baseline, plain)
            .shown("RMSE matt", |angle| angle.rmse_matt, fixed(4))
            .shown("RMSE with a highlight", |angle| angle.rmse_shiny, fixed(4));
        let both = self
            .regions
            .iter()
            .flat_map(|row| [(row, "whole lens", &row.whole), (row, "each region", &row.each)]);
        let regions = TableBuilder::of(both)
            .column("views", "views", |(row, ..)| row.views, plain)
            .column("baseline", "line over distance", |(row, ..)| row.baseline, plain)
            .column("test", "test", |(_, test, _)| *test, plain)
            .column("tiles_culled", "tiles culled", |(.., tests)| tests.tiles_culled, count)
            .column("tile_madds", "tile madds", |(.., tests)| tests.tile_madds, count)
            .column("samples", "samples left", |(.., tests)| tests.samples, count)
            .column("all_madds", "all madds", |(.., tests)| tests.all_madds, count)
            .data("equal", |(row, ..)| row.equal)
            .csv("multiview_regions.csv");
        let runs = runs.csv("multiview.csv");
        vec![runs.sheet(), caches.csv("multiview_cache.csv").sheet(), angles.sheet(), regions.sheet()]
    }

    /// No method has an error of its own besides that of shading for the middle of the line.
    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let point = |row: &ViewsRow, method: &str, run: &ViewsRun| {
            let cost = Metric::new("shader runs over those of one view", "", run.over_one_view);
            let metrics =
                [Metric::new("error of many views", "", 0.0), cost.beside(row.view_by_view.over_one_view)];
            TradeoffPoint::new(format!("{} views", row.views), [method, ""], metrics)
        };
        let each = self.rows.iter().flat_map(|row| runs(row).map(|(method, run)| point(row, method, run)));
        each.collect()
    }
}

fn ticked<T>(done: T, bar: &Bar) -> T {
    bar.inc();
    done
}

fn runs(row: &ViewsRow) -> [(&'static str, &ViewsRun); 3] {
    [("one pass", &row.one_pass), ("view by view", &row.view_by_view), ("accumulation", &row.accumulation)]
}

impl MultiviewChart {
    fn costs(&self) -> Vec<ChartPanel> {
        let panel = |title: &str, up: &str, of: fn(&ViewsRun) -> f64| {
            let curve = |method: usize| {
                let points = self.rows.iter().map(|row| (f64::from(row.views), of(runs(row)[method].1)));
                Series::curve(runs(&self.rows[0])[method].0, points)
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

    /// Work of the tests of each region over that of the test of the whole lens.
    fn region_panels(&self) -> Vec<ChartPanel> {
        let panel = |title: &str, of: fn(&TileTestCosts) -> u64| {
            let curve = |views: &'static str| {
                let rows = self.regions.iter().filter(move |row| row.views == views);
                let ratio = move |row: &RegionTests| of(&row.each) as f64 / of(&row.whole).max(1) as f64;
                Series::curve(views, rows.map(move |row| (row.baseline, ratio(row))))
            };
            let axes = ["length of the camera line over the distance of what is in focus", "each over whole"];
            ChartPanel::new(title, axes, KINDS.map(curve).into()).on(Scale::Doublings, Scale::Even)
        };
        vec![
            panel("samples left", |tests| tests.samples),
            panel("multiply-adds of tile tests", |tests| tests.tile_madds),
            panel("multiply-adds of all tests", |tests| tests.all_madds),
        ]
    }

    /// Errors over the length of the camera line.
    fn failures(&self) -> ChartPanel {
        let of =
            |error: fn(&Angle) -> f64| self.angles.iter().map(move |angle| (angle.baseline, error(angle)));
        let curves = vec![
            Series::curve("shading that is the same for all", of(|angle| angle.rmse_matt)),
            Series::curve("with a highlight", of(|angle| angle.rmse_shiny)),
        ];
        let axes = [
            "length of the camera line over the distance of what is in focus",
            "RMSE against cameras of their own",
        ];
        // Close to the angle from which on a run warns, angles grow with the line.
        let off = |angle: &&Angle| (angle.degrees / MAX_VIEW_ANGLE_DEG).ln().abs();
        let nearest = self.angles.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
        let warned = nearest.map(|angle| angle.baseline * MAX_VIEW_ANGLE_DEG / angle.degrees..f64::INFINITY);
        let panel = ChartPanel::new("error of the outer views", axes, curves);
        panel.failing(warned, "a run warns: view-dependent-shading")
    }
}

impl CacheCase {
    /// Caches in which what is in use at a time has no room are marked.
    fn panel(&self) -> ChartPanel {
        let curve = |(policy, _): &(&'static str, _)| {
            let rows = self.rows.iter().filter(|cached| cached.policy == *policy);
            let points = rows.map(|cached| (f64::from(cached.entries), cached.invocations_per_pixel));
            Series::curve(*policy, points)
        };
        let axes = ["entries of the shading cache", "lanes of all views for a pixel of one"];
        ChartPanel::new(self.name, axes, POLICIES.iter().map(curve).collect())
            .on(Scale::Doublings, Scale::Even)
            .failing(self.too_small().map(|entries| 0.0..entries), "a run warns")
    }

    /// The most entries with which the shader runs so much more often than with the largest cache that a run warns.
    fn too_small(&self) -> Option<f64> {
        let rows = || self.rows.iter().filter(|cached| cached.policy == POLICIES[0].0);
        let least = rows().map(|cached| cached.invocations_per_pixel).reduce(f64::min)?;
        let small =
            rows().filter(|cached| cached.invocations_per_pixel > MAX_RUNS_OVER_INFINITE_CACHE * least);
        small.map(|cached| f64::from(cached.entries)).reduce(f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    const MIN_EFFORT: MultiviewEffort = MultiviewEffort {
        scene: ("tiny", 1),
        size: [40, 30],
        views: &[1, 2, 7],
        entries: &[16, 1024],
        baselines: &[0.05, 0.8],
    };

    #[test]
    fn one_pass_shades_less_than_its_rivals_and_errs_more_on_a_longer_line() {
        let (_folder, chart, _) = written::<MultiviewChart>(MIN_EFFORT);
        for row in &chart.rows[1..] {
            assert!(row.one_pass.over_one_view < row.view_by_view.over_one_view, "{row:?}");
            assert!(row.one_pass.over_one_view < row.accumulation.over_one_view, "{row:?}");
            assert!(
                (row.view_by_view.over_one_view - f64::from(row.views)).abs() < 0.3 * f64::from(row.views)
            );
        }
        for pair in chart.caches.iter().flat_map(|case| case.rows.chunks_exact(2)) {
            assert!(pair[0].invocations_per_pixel > pair[1].invocations_per_pixel, "{pair:?}");
        }
        // The chart fails where an image differs; views apart leave no more samples, and fewer where they are
        // far apart.
        assert!(chart.regions.iter().all(|row| row.equal && row.each.samples <= row.whole.samples));
        assert!(chart.regions[1].each.samples < chart.regions[1].whole.samples, "{:?}", chart.regions[1]);
        let (near, far) = (&chart.angles[0], &chart.angles[1]);
        // No highlight is in sight in `tiny`: what shininess adds is the chart's matter.
        assert!(far.rmse_matt > near.rmse_matt && far.rmse_shiny > near.rmse_shiny, "{near:?} {far:?}");
    }
}
