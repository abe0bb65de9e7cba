//! Pictures of the report.

use output::plot::{AxisSpec, Chart, ChartPanel, Look, Mark, Paint, Picture, Series};

use traces::pareto::nondominated;

use super::{RatedDesign, Report};

/// A quantity of a design: name, unit, and its value.
type Quantity = (&'static str, &'static str, fn(&RatedDesign) -> Option<f64>);

const TIME: Quantity = ("busy time", "s", |rated| Some(rated.design.time_s.value));
const ENERGY: Quantity = ("busy energy", "J", |rated| Some(rated.design.energy_j.value));
const AREA: Quantity = ("area", "mm2", |rated| rated.design.area_mm2);

/// Most designs on the frontier that are named.
const MAX_NAMES: usize = 12;

impl Report {
    /// Designs over each two of time, energy and area. The frontier is over all three; steps are that of the two that are shown.
    pub(super) fn picture(&self, look: &Look) -> Picture {
        let pairs = [(TIME, ENERGY), (AREA, TIME), (AREA, ENERGY)];
        let panels = pairs.into_iter().filter_map(|(x, y)| self.panel(x, y)).collect();
        Chart::new("Designs", &self.sweep, panels).picture(look)
    }

    fn panel(&self, x: Quantity, y: Quantity) -> Option<ChartPanel> {
        let at = |rated: &RatedDesign| Some((x.2(rated)?, y.2(rated)?));
        let mut series = Vec::new();
        for (number, (workload, designs)) in self.workloads.iter().enumerate() {
            let steps = steps(&designs.iter().filter_map(at).collect::<Vec<_>>());
            if steps.len() > 1 {
                series.push(
                    Series::new(workload.clone(), Mark::Steps(steps)).painted(Paint::Like(2 + number % 6)),
                );
            }
        }
        let all = || self.workloads.values().flatten();
        // Many names would hide the points.
        let named = all().filter(|rated| rated.on_frontier).count() <= MAX_NAMES;
        let of = |on: bool| -> Vec<(f64, f64, String)> {
            let name =
                |rated: &RatedDesign| if on && named { rated.design.design.clone() } else { String::new() };
            let chosen = all().filter(|rated| rated.on_frontier == on);
            chosen.filter_map(|rated| at(rated).map(|(x, y)| (x, y, name(rated)))).collect()
        };
        let (others, frontier) = (of(false), of(true));
        if frontier.is_empty() {
            return None;
        }
        series.push(Series::new("dominated", Mark::Rings(others)).painted(Paint::Like(0)));
        series.push(Series::new("on the frontier", Mark::Dots(frontier)).painted(Paint::Like(0)));
        let axes = [x, y].map(|(name, unit, _)| AxisSpec::even(name, unit));
        Some(ChartPanel::over("", axes, series))
    }
}

/// Points that no other dominates in both coordinates, from left to right.
fn steps(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let on = nondominated(points);
    let mut steps: Vec<_> =
        points.iter().copied().zip(on).filter_map(|(point, on)| on.then_some(point)).collect();
    steps.sort_by(|a, b| a.0.total_cmp(&b.0));
    steps.dedup();
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_fall_from_left_to_right() {
        let points = vec![(2.0, 1.0), (1.0, 3.0), (1.0, 2.0), (3.0, 1.0), (1.5, 2.5), (2.0, 1.0)];
        assert_eq!(steps(&points), [(1.0, 2.0), (2.0, 1.0)]);
    }
}
