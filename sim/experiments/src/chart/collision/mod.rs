//! `quintile chart collision`: pairs kept in vain by collision detection, over resolution, bins of time and cost, and where none of
//! its methods tells pairs apart.

mod measure;
mod tables;

use serde::Serialize;
use workloads::collision::families::{Case, cases, like_yardsticks};
use workloads::collision::{Method, Search};

use super::ChartError;
use output::OutDir;
use output::plot::Look;
use output::progress::Progress;

pub use tables::claim;

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Effort {
    /// Cases of each family of two objects, and of each of many.
    pub cases: [usize; 2],
    /// Pixels across.
    pub resolutions: &'static [u32],
    /// Bins of time in a pixel, for the methods that look once.
    pub bins: &'static [u32],
    /// Gaps between plates that slide, in parts of their length.
    pub gaps: &'static [f64],
    /// Ways in which they lie, for each gap.
    pub slides: usize,
    /// Cases of each kind of the yardsticks of the book, of two objects and of many.
    pub yardsticks: [usize; 2],
    /// Bins of time in a pixel for these.
    pub yardstick_bins: &'static [u32],
}

impl Effort {
    /// The chart of the book.
    pub const FULL: Self = Self {
        cases: [12, 2],
        resolutions: &[8, 16, 32, 64],
        bins: &[1, 4, 16],
        gaps: &[0.3, 0.1, 0.03, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6],
        slides: 16,
        yardsticks: [12, 3],
        yardstick_bins: &[1, 16, 64],
    };
    /// A look in seconds.
    pub const QUICK: Self = Self {
        cases: [3, 1],
        resolutions: &[4, 16],
        bins: &[1, 4],
        gaps: &[0.3, 0.1, 1e-2, 1e-3],
        slides: 6,
        yardsticks: [1, 1],
        yardstick_bins: &[1, 16],
    };
}

/// A way to tell pairs apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// By the boxes that whole objects sweep.
    ObjectBoxes,
    /// By the boxes that triangles sweep.
    TriangleBoxes,
    /// By images.
    Images(Search),
}

impl Way {
    /// Its name in the tables.
    pub fn name(&self) -> String {
        match self {
            Self::ObjectBoxes => "swept boxes of objects".to_owned(),
            Self::TriangleBoxes => "swept boxes of triangles".to_owned(),
            Self::Images(Search { zoom: true, .. }) => "looking closer".to_owned(),
            Self::Images(Search { method: Method::DepthOnly, .. }) => "depth only".to_owned(),
            Self::Images(Search { method: Method::BoxBox, bins, .. }) => format!("box-box, bins {bins}"),
            Self::Images(Search { bins, .. }) => format!("fragment-box, bins {bins}"),
        }
    }

    /// Pixels across; none where there is no image.
    pub fn resolution(&self) -> u32 {
        if let Self::Images(search) = self { search.resolution } else { 0 }
    }
}

/// Which cases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Set {
    /// The families.
    Families,
    /// Cases like those that the yardsticks of the book were measured over.
    LikeYardsticks,
}

/// What a way makes of all cases of a set.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The set.
    pub cases: Set,
    /// The way.
    pub way: String,
    /// Pixels across; 0 where there is no image.
    pub resolution: u32,
    /// Pairs of two objects kept in vain, as a share of those that do not collide.
    pub two: f64,
    /// The same of pairs among many.
    pub many: f64,
    /// Pairs that collide and were not kept: there may be none.
    pub missed: usize,
    /// CPU time of a pair whose swept boxes touch, s.
    pub pair_s: f64,
}

/// Plates that slide along each other without touching.
#[derive(Clone, Debug, Serialize)]
pub struct Slide {
    /// Pixels across.
    pub resolution: u32,
    /// The gap in parts of the plates' length.
    pub gap: f64,
    /// The share of ways to lie in which they are kept in vain.
    pub kept: f64,
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct CollisionChart {
    /// How much was measured.
    pub effort: Effort,
    /// Pairs that collide and pairs that do not, of two objects and of many.
    pub pairs: [[usize; 2]; 2],
    /// The same of the cases like those of the yardsticks.
    pub yardstick_pairs: [[usize; 2]; 2],
    /// Way by way: over the families, then over cases like those of the yardsticks.
    pub rows: Vec<Row>,
    /// Plates that slide, looked at closer.
    pub slides: Vec<Slide>,
}

impl CollisionChart {
    /// Pairs that collide and were not kept by some way.
    pub fn missed(&self) -> usize {
        self.rows.iter().map(|row| row.missed).sum()
    }
}

/// Two-object cases, then those of many.
fn all_cases(effort: &Effort) -> Vec<Case> {
    let two = cases(301, effort.cases[0]).into_iter().filter(|case| case.objects.len() == 2);
    two.chain(cases(301, effort.cases[1]).into_iter().filter(|case| case.objects.len() > 2)).collect()
}

/// Pixels across at which the yardsticks were measured.
const YARDSTICK_PIXELS: u32 = 128;

/// The ways of the yardsticks.
fn yardstick_ways(effort: &Effort) -> Vec<Way> {
    let once = Search { resolution: YARDSTICK_PIXELS, bins: 1, method: Method::FragmentBox, zoom: false };
    let depth_only = Search { method: Method::DepthOnly, ..once };
    let binned = effort.yardstick_bins.iter().map(|&bins| Search { bins, ..once });
    let images = [depth_only].into_iter().chain(binned).chain([Search::default()]).map(Way::Images);
    [Way::ObjectBoxes, Way::TriangleBoxes].into_iter().chain(images).collect()
}

/// All ways, from the cheapest on.
fn ways(effort: &Effort) -> Vec<Way> {
    let search = Search { resolution: 0, bins: 1, method: Method::FragmentBox, zoom: false };
    let each = effort.resolutions.iter().flat_map(|&resolution| {
        let search = Search { resolution, ..search };
        let binned = effort.bins.iter().map(move |&bins| Search { bins, ..search });
        let others = [
            Search { method: Method::DepthOnly, ..search },
            Search { method: Method::BoxBox, ..search },
            Search { zoom: true, bins: Search::default().bins, ..search },
        ];
        binned.chain(others).map(Way::Images)
    });
    [Way::ObjectBoxes, Way::TriangleBoxes].into_iter().chain(each).collect()
}

/// Measures and draws the chart into `dir`.
///
/// # Errors
/// When files cannot be written or a thread cannot be started.
pub fn chart(
    effort: Effort,
    dir: &OutDir,
    look: &Look,
    progress: &Progress,
) -> Result<CollisionChart, ChartError> {
    let sets = [
        (Set::Families, all_cases(&effort), ways(&effort)),
        (Set::LikeYardsticks, like_yardsticks(1, effort.yardsticks), yardstick_ways(&effort)),
    ];
    let bar = progress.bar("ways", sets.iter().map(|(_, _, ways)| ways.len() as u64).sum());
    let mut rows = Vec::new();
    for (set, cases, ways) in &sets {
        for way in ways {
            rows.push(measure::row(way, *set, cases)?);
            bar.inc();
        }
    }
    let slides = measure::slides(&effort, progress);
    let [pairs, yardstick_pairs] = sets.each_ref().map(|(_, cases, _)| measure::pairs(cases));
    let chart = CollisionChart { effort, pairs, yardstick_pairs, rows, slides };
    tables::write(&chart, dir, look)?;
    Ok(chart)
}
