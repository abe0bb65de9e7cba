//! Speed against accuracy, the same few numbers for every method that has levels.

use serde::Serialize;

use super::collision::{CollisionChart, Set};
use super::frames::{Axis, FramesChart, Outcome, Way};
use super::glossy::GlossyChart;
use super::growth::GrowthChart;
use super::points::PointsChart;
use super::sampled::SampledChart;
use super::sampling::SamplingChart;
use super::shadows::ShadowsChart;
use super::tile_tests::TileTests;
use super::timing::TimingChart;
use super::views::ViewsChart;

/// A level of a method: what it costs and how wrong it is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Standing {
    /// What is found, for example `time of a frame`.
    pub subject: String,
    /// The level, for example `packet`.
    pub level: String,
    /// How wrong it is.
    pub error: String,
    /// What it costs, or saves.
    pub cost: String,
}

/// A chart whose levels stand somewhere between speed and accuracy.
pub trait Standings {
    /// A row for each level.
    fn standings(&self) -> Vec<Standing>;
}

fn standing(subject: &str, level: &str, error: String, cost: String) -> Standing {
    Standing { subject: subject.to_owned(), level: level.to_owned(), error, cost }
}

impl Standings for TimingChart {
    fn standings(&self) -> Vec<Standing> {
        let row = |(name, f): (&&str, &super::timing::Figures)| {
            let error = format!(
                "cycles {:.2} % (worst {:.1} %), energy {:.2} % (worst {:.1} %)",
                f.cycle_error_median_percent,
                f.cycle_error_worst_percent,
                f.energy_error_median_percent,
                f.energy_error_worst_percent
            );
            let cost = format!("{:.0} times as fast as stepped", f.speedup_over_stepped);
            standing("time of a frame", name, error, cost)
        };
        self.levels.iter().map(row).collect()
    }
}

impl Standings for SampledChart {
    fn standings(&self) -> Vec<Standing> {
        let errors = self.figures.iter().map(|f| {
            format!(
                "{} {:.2} % (95 %: {:.2} %), {:.0} % of intervals hold the truth",
                f.quantity, f.error_median_percent, f.error_p95_percent, f.inside_percent
            )
        });
        let errors = errors.collect::<Vec<_>>().join("; ");
        let row = |cost: &super::sampled::Cost| {
            let level = format!("{} of {} frames simulated, {}", cost.simulated, cost.frames, cost.scene);
            let cost = format!("{:.1} times less host time", cost.times_faster);
            standing("an animation", &level, errors.clone(), cost)
        };
        self.costs.iter().map(row).collect()
    }
}

impl Standings for SamplingChart {
    fn standings(&self) -> Vec<Standing> {
        let row = |row: &super::sampling::Row| {
            let last = row.points.last()?;
            let level = format!("{}, {} samples a pixel", row.table, last.samples_per_pixel);
            Some(standing(
                &format!("an image ({})", row.scene),
                &level,
                format!("RMSE {:.5}", last.rmse),
                format!("{:.2} s", last.host_s),
            ))
        };
        self.rows.iter().filter_map(row).collect()
    }
}

impl Standings for TileTests {
    fn standings(&self) -> Vec<Standing> {
        // Of combinations that cost and gain the same, the first.
        let same = |a: &&super::tile_tests::Row, b: &&super::tile_tests::Row| {
            (&a.scene, a.madds_per_triangle, a.efficiency) == (&b.scene, b.madds_per_triangle, b.efficiency)
        };
        let mut front: Vec<_> = self.rows.iter().filter(|row| row.on_efficiency_front).collect();
        front.dedup_by(|a, b| same(a, b));
        let row = |row: &super::tile_tests::Row| {
            standing(
                &format!("samples of a triangle ({})", row.scene),
                &row.tests,
                format!("{:.0} % of tested samples hit, {} lost", row.efficiency * 100.0, row.samples_lost),
                format!("{:.0} multiply-adds a triangle", row.madds_per_triangle),
            )
        };
        front.into_iter().map(row).collect()
    }
}

/// Every method at the least noise of the chart, over all scenes.
impl Standings for FramesChart {
    fn standings(&self) -> Vec<Standing> {
        let row = |way: Way| {
            let snr_db = self.values(Axis::Noise).into_iter().reduce(f64::max)?;
            let mean = |of: fn(&Outcome) -> Option<f64>| self.mean(Axis::Noise, snr_db, way, of);
            let (f1, host_s) = (mean(|o| Some(o.f1))?, mean(|o| Some(o.host_s_per_1e6))?);
            let energy =
                mean(|o| o.energy_error).map_or(String::new(), |e| format!(", energy {:.3} %", e * 100.0));
            let cost = format!("{host_s:.2} s for a million samples");
            Some(standing("frames of a trace", way.name(), format!("F1 {f1:.3}{energy}"), cost))
        };
        Way::ALL.into_iter().filter_map(row).collect()
    }
}

impl Standings for PointsChart {
    fn standings(&self) -> Vec<Standing> {
        let row = |row: &super::points::Row| {
            let level = if row.effort == 0 {
                row.method.to_owned()
            } else {
                format!("{} {}", row.method, row.effort)
            };
            standing(
                &format!("points that keep their distance ({}D)", row.dimensions),
                &level,
                format!("largest hole {:.4} r, {:.1e} free", row.hole_over_r, row.free_share),
                format!("{:.0} points a second", row.points_per_s),
            )
        };
        self.rows.iter().map(row).collect()
    }
}

/// Growth has no error: the engine is exact.
impl Standings for GrowthChart {
    fn standings(&self) -> Vec<Standing> {
        Vec::new()
    }
}

impl Standings for CollisionChart {
    fn standings(&self) -> Vec<Standing> {
        let row = |row: &super::collision::Row| {
            let level = match row.resolution {
                0 => row.way.clone(),
                px => format!("{}, {px} px", row.way),
            };
            let error = format!(
                "kept in vain {:.3} of two objects, {:.4} of many; missed {}",
                row.two, row.many, row.missed
            );
            standing("pairs that may collide", &level, error, format!("{:.3} ms a pair", 1e3 * row.pair_s))
        };
        self.rows.iter().filter(|row| row.cases == Set::Families).map(row).collect()
    }
}

impl Standings for ShadowsChart {
    fn standings(&self) -> Vec<Standing> {
        let Some(row) = self.rows.last() else { return Vec::new() };
        let error = format!("RMSE {:.4}", row.rmse);
        let both = [("one pass", &row.one_pass), ("accumulation", &row.accumulation)];
        let both = both.map(|(name, cost)| {
            let level = format!("{name}, {} places on the light", row.points);
            standing("soft shadows", &level, error.clone(), format!("{:.2} s", cost.host_s))
        });
        both.to_vec()
    }
}

/// One pass has no error of its own besides that of shading for the middle of the line.
impl Standings for ViewsChart {
    fn standings(&self) -> Vec<Standing> {
        let row = |row: &super::views::Row| {
            let cost = format!(
                "{:.2} times the shader runs of one view ({:.2} view by view)",
                row.one_pass.over_one_view, row.view_by_view.over_one_view
            );
            standing("many views", &format!("{} views in one pass", row.views), "none".to_owned(), cost)
        };
        self.rows.iter().map(row).collect()
    }
}

impl Standings for GlossyChart {
    fn standings(&self) -> Vec<Standing> {
        let row = |row: &super::glossy::Row| {
            let level = format!("one pass, {} samples a texel", row.samples);
            let subject = format!("glossy {}", row.effect);
            standing(&subject, &level, format!("RMSE {:.4}", row.rmse), format!("{:.3} s", row.host_s))
        };
        self.rows.iter().map(row).collect()
    }
}
