//! Experiments with the simulator: the charts of the book and the reproduction of papers.
//!
//! - [`study`]: what all of them share: measured, drawn, written and printed in one go.
//! - [`chart`]: charts of the book.
//! - [`stress`]: the failure catalogue, each tile test on each family of triangles.
//! - [`all`]: the list of these studies.
//! - [`reproduce`]: claims of papers, computed and compared with them.
//!
//! A study is measured once with an effort, full or quick. Its result is drawn, put into tables and written
//! as JSON, and gives trade-off points: an error and a cost, which `chart all` draws for all methods in one
//! picture.
//!
//! ```
//! let growth = experiments::all().find(|study| study.name == "growth").expect("a chart of the book");
//! assert!(growth.about.starts_with("Time of the visibility engine"));
//! ```

pub mod chart;
pub mod reproduce;
pub mod stress;
pub mod study;

use self::chart::anchors::AnchorsChart;
use self::chart::caustics::CausticsChart;
use self::chart::ccd::CcdChart;
use self::chart::compute::ComputeChart;
use self::chart::deferred::DeferredChart;
use self::chart::frames::FramesChart;
use self::chart::glossy::GlossyChart;
use self::chart::growth::GrowthChart;
use self::chart::memory::MemoryChart;
use self::chart::multiview::MultiviewChart;
use self::chart::occlusion::OcclusionChart;
use self::chart::points::PointsChart;
use self::chart::sampled::SampledChart;
use self::chart::sampling::SamplingChart;
use self::chart::soft_shadows::SoftShadowsChart;
use self::chart::stated_errors::StatedErrorsChart;
use self::chart::tile_tests::TileTestsChart;
use self::chart::timing::TimingChart;
use self::stress::StressChart;
use self::study::StudyEntry;

/// The charts of the book.
pub static CHARTS: &[StudyEntry] = &[
    StudyEntry::of::<AnchorsChart>(),
    StudyEntry::of::<CausticsChart>(),
    StudyEntry::of::<CcdChart>(),
    StudyEntry::of::<ComputeChart>(),
    StudyEntry::of::<DeferredChart>(),
    StudyEntry::of::<FramesChart>(),
    StudyEntry::of::<GlossyChart>(),
    StudyEntry::of::<GrowthChart>(),
    StudyEntry::of::<MemoryChart>(),
    StudyEntry::of::<MultiviewChart>(),
    StudyEntry::of::<OcclusionChart>(),
    StudyEntry::of::<PointsChart>(),
    StudyEntry::of::<SampledChart>(),
    StudyEntry::of::<SamplingChart>(),
    StudyEntry::of::<SoftShadowsChart>(),
    StudyEntry::of::<StatedErrorsChart>(),
    StudyEntry::of::<TileTestsChart>(),
    StudyEntry::of::<TimingChart>(),
];

/// The failure catalogue, which has a command of its own.
pub static STRESS: StudyEntry = StudyEntry::of::<StressChart>();

/// Name and one line of `chart all`.
pub const ALL: (&str, &str) = (
    "all",
    "Every chart, the failure catalogue of `quintile stress`, and `index.html`: speed against accuracy on one page",
);

/// The charts and the failure catalogue.
pub fn all() -> impl Iterator<Item = &'static StudyEntry> {
    CHARTS.iter().chain([&STRESS])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_study_has_a_name_of_its_own_and_one_line() {
        let mut names: Vec<&str> = all().map(|study| study.name).collect();
        assert!(CHARTS.is_sorted_by_key(|chart| chart.name), "in the order of the help");
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), CHARTS.len() + 1);
        assert!(all().all(|study| !study.about.is_empty() && !study.about.contains('\n')));
    }
}
