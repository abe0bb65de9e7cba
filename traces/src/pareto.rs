//! Frontiers of time and energy (Paper IV): the settings that no other dominates.

use crate::table::{InputTable, TableReadError};
use crate::units::{PhysicalQuantity, UnitError, scale_with};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;
use thiserror::Error;

/// One setting, measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParetoPoint {
    /// Name of the point.
    pub label: String,
    /// Time, s.
    pub time_s: f64,
    /// Energy, J.
    pub energy_j: f64,
    /// Standard deviation of the time, s; 0 if it is not known.
    pub time_deviation_s: f64,
    /// Standard deviation of the energy, J.
    pub energy_deviation_j: f64,
}

/// A setting, compared with all others.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RatedPoint {
    /// The point; its energy is as given.
    #[serde(flatten)]
    pub point: ParetoPoint,
    /// Energy including idling until the slowest setting is done, J: without idle power the energy as given.
    pub compensated_j: f64,
    /// Whether it is Pareto-optimal: no other is at least as good in both and better in one.
    pub on_frontier: bool,
    /// Share of random draws, by the deviations, in which it is Pareto-optimal.
    pub probability: f64,
}

/// Number of random draws for probabilities.
pub const DRAWS: u32 = 4096;

/// Which points are on the frontier. With `idle_w`, the faster of two is charged idling for the time it saves
/// (Paper IV, section 5): all are charged up to the slowest, so that any two are compared in the same way.
pub fn frontier(points: &[ParetoPoint], idle_w: f64, seed: u64) -> Vec<RatedPoint> {
    let slowest_s = points.iter().map(|point| point.time_s).fold(0.0, f64::max);
    let compensated = |time_s: f64, energy_j: f64| energy_j + idle_w * (slowest_s - time_s);
    let pairs: Vec<(f64, f64)> =
        points.iter().map(|p| (p.time_s, compensated(p.time_s, p.energy_j))).collect();
    let on = nondominated(&pairs);
    let certain = points.iter().all(|p| p.time_deviation_s == 0.0 && p.energy_deviation_j == 0.0);
    let mut counts = vec![0_u32; points.len()];
    for draw in 0..if certain { 0 } else { DRAWS } {
        let moved = points.iter().enumerate().map(|(index, p)| {
            let (a, b) = normal(seed, u64::from(draw) * points.len() as u64 + index as u64);
            let time_s = p.time_s + a * p.time_deviation_s;
            (time_s, compensated(time_s, p.energy_j + b * p.energy_deviation_j))
        });
        let moved: Vec<(f64, f64)> = moved.collect();
        nondominated(&moved).iter().zip(&mut counts).for_each(|(on, count)| *count += u32::from(*on));
    }
    let tradeoff = |(index, point): (usize, &ParetoPoint)| RatedPoint {
        point: point.clone(),
        compensated_j: pairs[index].1,
        on_frontier: on[index],
        probability: if certain {
            f64::from(u8::from(on[index]))
        } else {
            f64::from(counts[index]) / f64::from(DRAWS)
        },
    };
    points.iter().enumerate().map(tradeoff).collect()
}

/// Whether each pair is dominated by no other (Kung, Luccio and Preparata 1975: sorted by one, a running
/// minimum of the other). Equal pairs do not dominate one another.
pub fn nondominated(pairs: &[(f64, f64)]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..pairs.len()).collect();
    order.sort_by(|&a, &b| pairs[a].0.total_cmp(&pairs[b].0).then(pairs[a].1.total_cmp(&pairs[b].1)));
    let mut on = vec![false; pairs.len()];
    let mut best: Option<(f64, f64)> = None;
    for index in order {
        on[index] = best.is_none_or(|best| pairs[index].1 < best.1 || pairs[index] == best);
        if on[index] {
            best = Some(pairs[index]);
        }
    }
    on
}

/// Two independent standard normal numbers for a draw (Box and Muller 1958).
fn normal(seed: u64, draw: u64) -> (f64, f64) {
    crate::stats::Random::new(seed, 0).normals(draw)
}

impl ParetoPoint {
    /// Mean power, W.
    pub fn power_w(&self) -> f64 {
        self.energy_j / self.time_s
    }

    /// Standard deviation of the mean power, W: the relative ones of time and energy, added as independent
    /// errors.
    pub fn power_deviation_w(&self) -> f64 {
        let relative =
            libm::hypot(self.time_deviation_s / self.time_s, self.energy_deviation_j / self.energy_j);
        (self.power_w() * relative).abs()
    }
}

/// The columns of a table of settings. Units are taken from their names, or from the metadata of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SettingColumns {
    /// Times.
    pub time: String,
    /// Energies.
    pub energy: String,
    /// Standard deviations of the times.
    pub time_deviation: Option<String>,
    /// Standard deviations of the energies.
    pub energy_deviation: Option<String>,
    /// Names; by default the number of the row.
    pub label: Option<String>,
    /// Columns whose values make groups, each with a frontier of its own.
    pub groups: Vec<String>,
}

/// Why the frontiers of a table cannot be computed.
#[derive(Debug, Error)]
pub enum ParetoError {
    /// The table.
    #[error(transparent)]
    Table(#[from] TableReadError),
    /// The unit of a column.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// The table has no row.
    #[error("{path}: has no row: give one for each setting", path = path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// A row that is not a setting.
    #[error("{path}: row {row}: {reason}: fix or drop the row", path = path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// The row, from 1.
        row: usize,
        /// The error.
        reason: String,
    },
}

/// The settings of a table by group, each compared with the others of its group by [`frontier`]. A group is
/// named by its columns and values; without such columns there is one, with an empty name.
///
/// # Errors
/// [`ParetoError`] names the file and the row or column.
pub fn frontiers(
    table: &InputTable,
    columns: &SettingColumns,
    idle_w: f64,
    seed: u64,
) -> Result<BTreeMap<String, Vec<RatedPoint>>, ParetoError> {
    let numbers = |column: &str, scale: f64| -> Result<Vec<f64>, ParetoError> {
        let values = table.numbers(column)?;
        Ok(values.into_iter().map(|value| value * scale).collect())
    };
    let unit = |column: &str, of: PhysicalQuantity| scale_with(column, table.unit(column), of);
    // A deviation without a unit in its name has that of the column it belongs to.
    let deviations = |column: &Option<String>, (of, quantity): (&str, PhysicalQuantity)| match column {
        Some(column) => numbers(column, unit(column, quantity)?.or(unit(of, quantity)?).unwrap_or(1.0)),
        None => Ok(vec![0.0; table.rows()]),
    };
    let texts = |column: &String| table.texts(column);
    let (time, energy) = (
        (columns.time.as_str(), PhysicalQuantity::Time),
        (columns.energy.as_str(), PhysicalQuantity::Energy),
    );
    let [times, energies] =
        [time, energy].map(|(column, of)| numbers(column, unit(column, of)?.unwrap_or(1.0)));
    let (times, energies) = (times?, energies?);
    let time_deviations = deviations(&columns.time_deviation, time)?;
    let energy_deviations = deviations(&columns.energy_deviation, energy)?;
    let labels = columns.label.as_ref().map(texts).transpose()?;
    let keys = columns.groups.iter().map(texts).collect::<Result<Vec<_>, _>>()?;
    check_settings(table, &columns.time, &times, [&time_deviations, &energy_deviations])?;
    let mut groups: BTreeMap<String, Vec<ParetoPoint>> = BTreeMap::new();
    for row in 0..table.rows() {
        let named =
            columns.groups.iter().zip(&keys).map(|(column, values)| format!("{column}={}", values[row]));
        groups.entry(named.collect::<Vec<_>>().join(", ")).or_default().push(ParetoPoint {
            label: labels.as_ref().map_or_else(|| (row + 1).to_string(), |labels| labels[row].clone()),
            time_s: times[row],
            energy_j: energies[row],
            time_deviation_s: time_deviations[row],
            energy_deviation_j: energy_deviations[row],
        });
    }
    Ok(groups.into_iter().map(|(key, points)| (key, frontier(&points, idle_w, seed))).collect())
}

/// Refuses rows that are not settings.
fn check_settings(
    table: &InputTable,
    time: &str,
    times: &[f64],
    deviations: [&Vec<f64>; 2],
) -> Result<(), ParetoError> {
    let path = || table.path().to_owned();
    if times.is_empty() {
        return Err(ParetoError::Empty { path: path() });
    }
    if let Some(row) = times.iter().position(|time_s| *time_s <= 0.0) {
        return Err(ParetoError::Row {
            path: path(),
            row: row + 1,
            reason: format!("{time} is not above 0"),
        });
    }
    match deviations.into_iter().flatten().position(|deviation| *deviation < 0.0) {
        Some(at) => {
            let (row, reason) = (at % times.len() + 1, "a standard deviation is below 0".to_owned());
            Err(ParetoError::Row { path: path(), row, reason })
        }
        None => Ok(()),
    }
}

/// Writes the settings of all groups as CSV.
///
/// # Errors
/// The errors of `out`.
pub fn write_csv(groups: &BTreeMap<String, Vec<RatedPoint>>, out: &mut impl Write) -> std::io::Result<()> {
    let mut rows = csv::Writer::from_writer(out);
    rows.write_record([
        "group",
        "label",
        "time_s",
        "energy_J",
        "compensated_J",
        "on_frontier",
        "probability",
    ])?;
    for (group, settings) in groups {
        for s in settings {
            rows.write_record([
                group.clone(),
                s.point.label.clone(),
                s.point.time_s.to_string(),
                s.point.energy_j.to_string(),
                s.compensated_j.to_string(),
                u8::from(s.on_frontier).to_string(),
                s.probability.to_string(),
            ])?;
        }
    }
    rows.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point(time_s: f64, energy_j: f64, deviation: f64) -> ParetoPoint {
        let label = String::new();
        ParetoPoint { label, time_s, energy_j, time_deviation_s: deviation, energy_deviation_j: deviation }
    }

    #[test]
    fn idle_charged_to_the_faster_one_turns_the_frontier() {
        let points = [point(1.0, 10.0, 0.0), point(2.0, 11.0, 0.0)];
        let on = |idle_w| frontier(&points, idle_w, 1).iter().map(|s| s.on_frontier).collect::<Vec<_>>();
        assert_eq!(on(0.0), [true, false]);
        // 14 W for the second saved: 24 J against 11 J.
        assert_eq!(frontier(&points, 14.0, 1)[0].compensated_j, 24.0);
        assert_eq!(on(14.0), [true, true]);
    }

    #[test]
    fn two_equal_points_share_the_frontier_and_two_blurred_ones_its_probability() {
        assert_eq!(nondominated(&[(1.0, 1.0), (1.0, 1.0), (1.0, 2.0)]), [true, true, false]);
        // Each is dominated by the other in a quarter of all draws.
        let blurred = frontier(&[point(1.0, 1.0, 0.1), point(1.0, 1.0, 0.1)], 0.0, 7);
        assert!(blurred.iter().all(|tradeoff| (tradeoff.probability - 0.75).abs() < 0.03), "{blurred:?}");
    }

    proptest! {
        #[test]
        fn oracle_by_comparing_all_pairs(pairs in prop::collection::vec((0_u8..12, 0_u8..12), 0..40)) {
            let pairs: Vec<(f64, f64)> = pairs.into_iter().map(|(a, b)| (f64::from(a), f64::from(b))).collect();
            let naive: Vec<bool> = pairs.iter().map(|p| {
                !pairs.iter().any(|q| q.0 <= p.0 && q.1 <= p.1 && q != p)
            }).collect();
            prop_assert_eq!(nondominated(&pairs), naive);
        }
    }
}
