//! The list of studies.

use crate::chart::anchors::AnchorsChart;
use crate::chart::caustics::CausticsChart;
use crate::chart::ccd::CcdChart;
use crate::chart::compute::ComputeChart;
use crate::chart::deferred::DeferredChart;
use crate::chart::frames::FramesChart;
use crate::chart::glossy::GlossyChart;
use crate::chart::growth::GrowthChart;
use crate::chart::memory::MemoryChart;
use crate::chart::multiview::MultiviewChart;
use crate::chart::occlusion::OcclusionChart;
use crate::chart::points::PointsChart;
use crate::chart::sampled::SampledChart;
use crate::chart::sampling::SamplingChart;
use crate::chart::soft_shadows::SoftShadowsChart;
use crate::chart::stated_errors::StatedErrorsChart;
use crate::chart::tile_tests::TileTests;
use crate::chart::timing::TimingChart;
use crate::stress::Report;
use crate::study::Entry;

/// The charts of the book.
pub static CHARTS: &[Entry] = &[
    Entry::of::<AnchorsChart>(),
    Entry::of::<CausticsChart>(),
    Entry::of::<CcdChart>(),
    Entry::of::<ComputeChart>(),
    Entry::of::<DeferredChart>(),
    Entry::of::<FramesChart>(),
    Entry::of::<GlossyChart>(),
    Entry::of::<GrowthChart>(),
    Entry::of::<MemoryChart>(),
    Entry::of::<MultiviewChart>(),
    Entry::of::<OcclusionChart>(),
    Entry::of::<PointsChart>(),
    Entry::of::<SampledChart>(),
    Entry::of::<SamplingChart>(),
    Entry::of::<SoftShadowsChart>(),
    Entry::of::<StatedErrorsChart>(),
    Entry::of::<TileTests>(),
    Entry::of::<TimingChart>(),
];

/// The failure catalogue, which has a command of its own.
pub static STRESS: Entry = Entry::of::<Report>();

/// Name and one line of `chart all`.
pub const ALL: (&str, &str) = (
    "all",
    "Every chart, the failure catalogue of `quintile stress`, and `index.html`: speed against accuracy on one page",
);

/// The charts and the failure catalogue.
pub fn all() -> impl Iterator<Item = &'static Entry> {
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
