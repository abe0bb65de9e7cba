//! Ranks of designs, as far as the stated errors decide them.

use super::design::Cost;

/// For each cost the best and the worst rank that it can have within the stated errors, from 1. Both are the same if the rank is
/// decided; that of costs equal to the last bit is not.
pub(crate) fn ranks(costs: &[&Cost]) -> Vec<[usize; 2]> {
    let ends: Vec<[f64; 2]> = costs.iter().map(|cost| ends(cost)).collect();
    let sorted = |end: usize| {
        let mut values: Vec<f64> = ends.iter().map(|ends| ends[end]).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let [lows, highs] = [0, 1].map(sorted);
    let of = |[low, high]: &[f64; 2]| {
        let surely_before = highs.partition_point(|other| other < low);
        let surely_after = lows.len() - lows.partition_point(|other| other <= high);
        [1 + surely_before, costs.len() - surely_after]
    };
    ends.iter().map(of).collect()
}

/// Interval of a cost by the stated error of its timing level.
fn ends(cost: &Cost) -> [f64; 2] {
    [cost.value / (1.0 + cost.error), cost.value * (1.0 + cost.error)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ranked(costs: &[(f64, f64)]) -> Vec<[usize; 2]> {
        let cost = |&(value, error)| Cost { value, deviation: 0.0, error, low: value, high: value };
        let costs: Vec<Cost> = costs.iter().map(cost).collect();
        ranks(&costs.iter().collect::<Vec<_>>())
    }

    #[test]
    fn ranks_within_the_error_are_undecided() {
        let exact = 0.0;
        assert_eq!(ranked(&[(2.0, exact), (1.0, exact), (3.0, exact)]), [[2, 2], [1, 1], [3, 3]]);
        let five = 0.05;
        assert_eq!(ranked(&[(1.0, five), (1.08, five), (2.0, five)]), [[1, 2], [1, 2], [3, 3]]);
        assert_eq!(ranked(&[(1.0, exact), (5.0, 9.0), (2.0, exact)]), [[1, 2], [1, 3], [2, 3]]);
        assert_eq!(ranked(&[(1.0, exact), (1.0, exact)]), [[1, 2], [1, 2]]);
    }

    proptest! {
        #[test]
        fn oracle_by_comparing_all_pairs(costs in prop::collection::vec((1_u8..20, 0_u8..30), 0..30)) {
            let costs: Vec<(f64, f64)> =
                costs.into_iter().map(|(a, b)| (f64::from(a), f64::from(b) / 100.0)).collect();
            let ends = |(value, error): (f64, f64)| [value / (1.0 + error), value * (1.0 + error)];
            let expected: Vec<[usize; 2]> = costs.iter().map(|&own| {
                let [low, high] = ends(own);
                let count = |is: &dyn Fn([f64; 2]) -> bool| costs.iter().filter(|&&other| is(ends(other))).count();
                [1 + count(&|other| other[1] < low), costs.len() - count(&|other| other[0] > high)]
            }).collect();
            prop_assert_eq!(ranked(&costs), expected);
        }
    }
}
