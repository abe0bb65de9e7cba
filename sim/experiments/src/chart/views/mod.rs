//! `quintile chart views`: stereo and multi-view in one pass against view by view and accumulation.
//!
//! What is shaded once serves all views, the lens and the shutter. The measure is pixel shader lanes run, over those that one of the
//! views takes alone on the same hardware.

mod gloss;
mod measure;
mod tables;

use pipeline::Replacement;
use serde::Serialize;
use workloads::multiview::Layout;

use super::ChartError;
use output::OutDir;
use output::plot::Look;
use output::progress::{Bar, Progress};

pub use measure::{Angle, Bench, Cached, Lanes, Row, Run};
pub use tables::claim;

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Effort {
    /// The built-in scene, and its frame.
    pub scene: (&'static str, u32),
    /// Pixels of each view, across and down.
    pub size: [u32; 2],
    /// Numbers of views.
    pub views: &'static [u32],
    /// Entries of the shading cache.
    pub entries: &'static [u32],
    /// Lengths of the camera line over the distance of what is in focus, for view-dependent shading.
    pub baselines: &'static [f64],
}

impl Effort {
    /// The chart of the book.
    pub const FULL: Self = Self {
        scene: ("default", 18),
        size: [320, 180],
        views: &[1, 2, 7, 9, 64],
        entries: &[4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16_384],
        baselines: &[0.02, 0.05, 0.1, 0.2, 0.4, 0.8],
    };
    /// A look in seconds.
    pub const QUICK: Self = Self {
        size: [128, 72],
        views: &[1, 2, 7, 64],
        entries: &[4, 16, 64, 256, 1024, 16_384],
        baselines: &[0.05, 0.4],
        ..Self::FULL
    };
}

/// Samples for each view of a pixel (thesis, Paper VI, section 8).
pub const SAMPLES: u32 = 8;
/// From eye to eye, scene units, which are metres in the built-in scenes: the mean of adults is 63 mm (Dodgson 2004). The photographer's
/// rule, a thirtieth of the distance of what is nearest, says 80 mm for `default`.
const EYES: f64 = 0.065;
/// Radius of the lens of an eye, scene units: as wide as it can be with something left between the eyes, for defocus to be seen.
const APERTURE: f64 = 0.4 * EYES;

/// Two eyes.
pub fn stereo() -> Layout {
    Layout::stereo(EYES, APERTURE)
}

/// So many views on a line as long as both eyes and their lenses take, each with a box filter that overlaps half of the next.
pub fn line(views: u32) -> Layout {
    Layout::line(views, EYES + 2.0 * APERTURE, APERTURE)
}

/// The policies, each with its name.
pub const POLICIES: [(&str, Replacement); 3] =
    [("lru", Replacement::Lru), ("fifo", Replacement::Fifo), ("random", Replacement::Random { seed: 1 })];

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct ViewsChart {
    /// How much was measured.
    pub effort: Effort,
    /// By number of views.
    pub rows: Vec<Row>,
    /// Views near to each other and far apart, by policy and entries of the cache.
    pub caches: Vec<Case>,
    /// What shading for the middle of the line leaves out, by its length.
    pub angles: Vec<Angle>,
}

/// Views for which caches are tried.
#[derive(Clone, Debug, Serialize)]
pub struct Case {
    /// What they are.
    pub name: &'static str,
    /// By policy and entries of the cache.
    pub rows: Vec<Cached>,
}

/// The length, over the distance of what is in focus, of a line of views so far apart that each needs what the others have forgotten.
const FAR_APART: f64 = 0.8;

/// Views for which caches are tried, with what they are.
fn layouts(focus: f64) -> [(&'static str, Layout); 3] {
    let far = Layout::line(7, FAR_APART * focus, APERTURE);
    [("two views", stereo()), ("seven views", line(7)), ("seven views far apart", far)]
}

/// Measures the chart and writes it into `dir`.
///
/// # Errors
/// [`ChartError`], above all when `dir` cannot be written to.
pub fn chart(
    effort: Effort,
    dir: &OutDir,
    look: &Look,
    progress: &Progress,
) -> Result<ViewsChart, ChartError> {
    let chart = measure(effort, progress)?;
    tables::write(&chart, dir, look)?;
    Ok(chart)
}

/// Measures without writing.
///
/// # Errors
/// [`ChartError`] when the scene cannot be drawn.
pub fn measure(effort: Effort, progress: &Progress) -> Result<ViewsChart, ChartError> {
    let steps = effort.views.len() + 3 * POLICIES.len() * effort.entries.len() + effort.baselines.len();
    let bar = progress.bar("views", steps as u64);
    let bench = Bench::new(effort.scene, effort.size)?;
    let rows = effort.views.iter().map(|&views| ticked(bench.row(views), &bar));
    let rows = rows.collect::<Result<_, _>>()?;
    let mut caches = Vec::new();
    for (name, layout) in layouts(bench.focus()) {
        let each = POLICIES
            .into_iter()
            .flat_map(|policy| effort.entries.iter().map(move |&entries| (policy, entries)));
        let rows = each.map(|(policy, entries)| ticked(bench.cached(layout, policy, entries), &bar));
        caches.push(Case { name, rows: rows.collect::<Result<_, _>>()? });
    }
    let angles = effort.baselines.iter().map(|&baseline| ticked(bench.angle(baseline), &bar));
    let angles = angles.collect::<Result<_, _>>()?;
    Ok(ViewsChart { effort, rows, caches, angles })
}

fn ticked<T>(done: T, bar: &Bar) -> T {
    bar.inc();
    done
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: Effort = Effort {
        scene: ("tiny", 1),
        size: [40, 30],
        views: &[1, 2, 7],
        entries: &[16, 1024],
        baselines: &[0.05, 0.8],
    };

    #[test]
    fn one_pass_shades_less_than_its_rivals_and_errs_more_on_a_longer_line() {
        let chart = measure(LEAST, &Progress::new(true)).unwrap();
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
        let (near, far) = (&chart.angles[0], &chart.angles[1]);
        // No highlight is in sight in `tiny`: what shininess adds is the chart's matter.
        assert!(far.rmse_matt > near.rmse_matt && far.rmse_shiny > near.rmse_shiny, "{near:?} {far:?}");
    }

    #[test]
    fn the_files_are_all_there() {
        let folder = tempfile::tempdir().unwrap();
        let effort = Effort { views: &[1, 2], entries: &[64], baselines: &[0.1], ..LEAST };
        OutDir::with(folder.path(), claim(), |dir| {
            chart(effort, dir, &Look::default(), &Progress::new(true))
        })
        .unwrap()
        .unwrap();
        for file in ["views.csv", "views.json", "views_cost.svg", "views_cache.png", "views_failures.svg"] {
            assert!(folder.path().join(file).exists(), "{file}");
        }
    }
}
