//! Rails that are the sum of others, which would count twice.

use super::{Chunk, Rows};
use crate::io::columns::Rail;
use crate::io::{ReadError, ReadOptions};
use std::fmt::{Display, Formatter, Result as Written};
use std::path::Path;

/// Rows that are looked at.
const ROWS: usize = 1 << 12;
/// Fewer tell nothing.
const LEAST: usize = 8;
/// How far a sum may be off, as a share of its highest power: rounded numbers are.
const OFF: f64 = 2e-3;
/// Two rails that are the same count as one and its sum if they vary by more than this share of their highest power.
const VARIES: f64 = 0.01;
/// Names of sums. As a part of a name they tell nothing: `gpu_total` may stand beside `cpu_total`.
const WORDS: [&str; 5] = ["total", "sum", "all", "overall", "combined"];

/// A rail among several that seems to be the sum of the others.
#[derive(Clone, Debug, PartialEq)]
pub struct SumOfRails {
    /// Its name; empty if its columns carry none.
    pub rail: String,
    /// The others, in order.
    pub others: Vec<String>,
    /// Whether its values tell, not its name alone.
    pub by_values: bool,
}

impl Display for SumOfRails {
    fn fmt(&self, f: &mut Formatter<'_>) -> Written {
        let rail = if self.rail.is_empty() { "the rail without a name" } else { &self.rail };
        let how = if self.by_values { "is, to rounding," } else { "is by its name" };
        write!(f, "{rail} {how} the sum of {}, and all are added up", self.others.join(", "))
    }
}

/// Looks at the first rows of a file whose rails are all added up for one that is the sum of the others.
///
/// # Errors
/// [`ReadError`] if the file cannot be read.
pub fn rail_of_sums(path: &Path, options: &ReadOptions) -> Result<Option<SumOfRails>, ReadError> {
    let mut rows = Rows::open(path, options)?;
    if rows.rails().len() < 2 {
        return Ok(None);
    }
    let mut chunk = Chunk::default();
    rows.next(ROWS, &mut chunk)?;
    let powers_w = rows.powers_w(&mut chunk);
    let names = rows.rails();
    let by_values = (0..names.len()).rev().find(|&rail| is_sum(rail, &powers_w));
    let by_name = || names.iter().position(|name| WORDS.contains(&name.as_str()));
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
    let told = whole.len() >= LEAST && high > 0.0 && (powers_w.len() > 2 || high - low > VARIES * high);
    told && whole.iter().all(|(sum, others)| (sum - others).abs() <= OFF * high)
}

impl Rows {
    /// The power of each rail in each row of a chunk, W.
    fn powers_w(&self, chunk: &mut Chunk) -> Vec<Vec<f64>> {
        self.layout.scale(&mut chunk.values);
        let rows = chunk.values.first().map_or(0, Vec::len);
        let of = |rail: &Rail| (0..rows).map(|row| rail.power_w(&chunk.values, row)).collect();
        self.layout.rails.iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn looked_at(names: &str, row: impl Fn(u32) -> String) -> Option<(String, bool)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        let rows: String = (0..100).map(|i| format!("{},{}\n", f64::from(i) / 100.0, row(i))).collect();
        std::fs::write(&path, format!("time_s,{names}\n{rows}")).unwrap();
        let found = rail_of_sums(&path, &ReadOptions::default()).unwrap();
        found.map(|sum| (sum.rail, sum.by_values))
    }

    #[test]
    fn sums_are_told_by_their_values_or_their_name_and_other_rails_are_not() {
        let [cpu, gpu] = [|i: u32| f64::from(i % 7), |i: u32| f64::from(i % 11)];
        let names = "cpu_power_W,board_power_W,gpu_power_W";
        let sum = |i: u32| format!("{},{:.2},{}", cpu(i), cpu(i) + gpu(i) + 0.003, gpu(i));
        assert_eq!(looked_at(names, sum), Some(("board".to_owned(), true)));
        assert_eq!(looked_at(names, |i| format!("{},{},{}", cpu(i), f64::from(i % 5), gpu(i))), None);
        let two = "cpu_power_W,total_power_mW";
        let total = Some(("total".to_owned(), false));
        assert_eq!(looked_at(two, |i| format!("{},{}", cpu(i), 1e3 * (cpu(i) + 2.0))), total);
        assert_eq!(
            looked_at("a_power_W,b_power_W", |i| format!("{0},{0}", cpu(i))),
            Some(("b".to_owned(), true))
        );
        let parts = "gpu_total_power_W,cpu_total_power_W";
        assert_eq!(looked_at(parts, |i| format!("{},{}", cpu(i), gpu(i))), None);
        assert_eq!(looked_at("a_power_W,b_power_W", |_| "2,2".to_owned()), None);
    }
}
