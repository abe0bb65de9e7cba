//! Rails that are the sum of others and would count twice.

use super::columns::RowBatch;
use super::rows::Rows;
use super::{ReadError, ReadOptions};
use std::fmt::{Display, Formatter, Result as Written};
use std::path::Path;

/// Rows that are compared.
const CHECKED_ROWS: usize = 1 << 12;
/// Fewest rows that decide.
const MIN_ROWS: usize = 8;
/// Largest deviation of a sum, as a share of its highest power, for rounded numbers.
const MAX_DEVIATION: f64 = 2e-3;
/// Two equal rails count as one and its sum if they vary by more than this share of their highest power.
const MIN_VARIATION: f64 = 0.01;
/// Names of sums. As a part of a name they decide nothing: `gpu_total` may stand beside `cpu_total`.
const SUM_WORDS: [&str; 5] = ["total", "sum", "all", "overall", "combined"];

/// A rail among several that seems to be the sum of the others.
#[derive(Clone, Debug, PartialEq)]
pub struct SumOfRails {
    /// Its name; empty if its columns carry none.
    pub rail: String,
    /// The others, in order.
    pub others: Vec<String>,
    /// Whether it follows from the values, not from the name alone.
    pub by_values: bool,
}

impl Display for SumOfRails {
    fn fmt(&self, f: &mut Formatter<'_>) -> Written {
        let rail = if self.rail.is_empty() { "the rail without a name" } else { &self.rail };
        let how = if self.by_values { "is, to rounding," } else { "is by its name" };
        write!(f, "{rail} {how} the sum of {}, and all are added up", self.others.join(", "))
    }
}

/// Searches the first rows of a file whose rails are all added up for a rail that is the sum of the others.
///
/// # Errors
/// [`ReadError`] if the file cannot be read.
pub fn rail_of_sums(path: &Path, options: &ReadOptions) -> Result<Option<SumOfRails>, ReadError> {
    let mut rows = Rows::open(path, options)?;
    if rows.rails().len() < 2 {
        return Ok(None);
    }
    let mut batch = RowBatch::default();
    rows.next(CHECKED_ROWS, &mut batch)?;
    let powers_w = rows.powers_w(&mut batch);
    let names = rows.rails();
    let by_values = (0..names.len()).rev().find(|&rail| is_sum(rail, &powers_w));
    let by_name = || names.iter().position(|name| SUM_WORDS.contains(&name.as_str()));
    let found = by_values.or_else(by_name);
    Ok(found.map(|rail| SumOfRails {
        rail: names[rail].clone(),
        others: names
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != rail)
            .map(|(_, name)| name.clone())
            .collect(),
        by_values: by_values.is_some(),
    }))
}

/// Whether a rail's power is that of all others together, in every row that has all.
fn is_sum(rail: usize, powers_w: &[Vec<f64>]) -> bool {
    let rows = powers_w[rail].len();
    let others_w = |row: usize| powers_w.iter().map(|powers| powers[row]).sum::<f64>() - powers_w[rail][row];
    let whole: Vec<(f64, f64)> = (0..rows).map(|row| (powers_w[rail][row], others_w(row))).collect();
    let whole: Vec<_> =
        whole.into_iter().filter(|(sum, others)| sum.is_finite() && others.is_finite()).collect();
    let high = whole.iter().map(|(sum, _)| *sum).fold(f64::NEG_INFINITY, f64::max);
    let low = whole.iter().map(|(sum, _)| *sum).fold(f64::INFINITY, f64::min);
    let decided =
        whole.len() >= MIN_ROWS && high > 0.0 && (powers_w.len() > 2 || high - low > MIN_VARIATION * high);
    decided && whole.iter().all(|(sum, others)| (sum - others).abs() <= MAX_DEVIATION * high)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum_in(names: &str, row: impl Fn(u32) -> String) -> Option<(String, bool)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        let rows: String = (0..100).map(|i| format!("{},{}\n", f64::from(i) / 100.0, row(i))).collect();
        std::fs::write(&path, format!("time_s,{names}\n{rows}")).unwrap();
        let found = rail_of_sums(&path, &ReadOptions::default()).unwrap();
        found.map(|sum| (sum.rail, sum.by_values))
    }

    #[test]
    fn sums_are_found_by_values_or_name_and_other_rails_are_not() {
        let [cpu, gpu] = [|i: u32| f64::from(i % 7), |i: u32| f64::from(i % 11)];
        let names = "cpu_power_W,board_power_W,gpu_power_W";
        let sum = |i: u32| format!("{},{:.2},{}", cpu(i), cpu(i) + gpu(i) + 0.003, gpu(i));
        assert_eq!(sum_in(names, sum), Some(("board".to_owned(), true)));
        assert_eq!(sum_in(names, |i| format!("{},{},{}", cpu(i), f64::from(i % 5), gpu(i))), None);
        let two = "cpu_power_W,total_power_mW";
        let total = Some(("total".to_owned(), false));
        assert_eq!(sum_in(two, |i| format!("{},{}", cpu(i), 1e3 * (cpu(i) + 2.0))), total);
        assert_eq!(
            sum_in("a_power_W,b_power_W", |i| format!("{0},{0}", cpu(i))),
            Some(("b".to_owned(), true))
        );
        let parts = "gpu_total_power_W,cpu_total_power_W";
        assert_eq!(sum_in(parts, |i| format!("{},{}", cpu(i), gpu(i))), None);
        assert_eq!(sum_in("a_power_W,b_power_W", |_| "2,2".to_owned()), None);
    }
}
