//! Evidence for a candidate: the linear discriminant of two normal populations, starts and others (Fisher 1936).

use super::Candidate;

/// Number of features: logarithms of the distance by shape and by summed squares.
pub(super) const FEATURES: usize = 2;
/// Least and greatest evidence of a single candidate, in nats: content and clock may have changed.
const EVIDENCE_LIMITS: [f64; 2] = [-4.0, 10.0];
/// Least evidence where power levels have changed, in nats: an even period of similar frames weighs as much.
const MIN_CHANGED_EVIDENCE: f64 = -3.0;
/// Weight of a mark, in nats.
const MARK_WEIGHT: f64 = 1e3;
/// Variance added to each feature, as a share of its variance over all candidates; more for the summed
/// squares, which depend on idle power and clock as well.
const SHRINKAGE: [f64; FEATURES] = [0.2, 0.4];

/// The class of an example.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Label {
    Start,
    Rest,
    Neither,
}

/// The discriminant.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Evidence {
    direction: [f64; FEATURES],
    middle: f64,
    /// No candidate weighs less.
    least: f64,
}

impl Evidence {
    /// From examples. A feature by which starts are farther than the rest is left out: nearer is never less
    /// likely. Where power levels have changed, shape alone speaks, and less.
    pub fn learn(candidates: &[Candidate], labels: &[Label], levels_changed: bool) -> Self {
        let of = |label: Label| -> Vec<[f64; FEATURES]> {
            let labelled = candidates.iter().zip(labels).filter(|(_, l)| **l == label);
            labelled.map(|(candidate, _)| candidate.features).collect()
        };
        let (starts, rest) = (of(Label::Start), of(Label::Rest));
        let (m1, m0) = (mean(&starts), mean(&rest));
        let all: Vec<_> = candidates.iter().map(|candidate| candidate.features).collect();
        let total = covariance(&all, mean(&all));
        let (s1, s0) = (covariance(&starts, m1), covariance(&rest, m0));
        let mut pooled = [[0.0; FEATURES]; FEATURES];
        for i in 0..FEATURES {
            for j in 0..FEATURES {
                pooled[i][j] = 0.5 * (s1[i][j] + s0[i][j]);
            }
            pooled[i][i] += 1e-4 + SHRINKAGE[i] * total[i][i];
        }
        let apart = [m1[0] - m0[0], m1[1] - m0[1]];
        let direction = if levels_changed {
            [(apart[0] / pooled[0][0]).min(0.0), 0.0]
        } else {
            discriminant(pooled, apart)
        };
        let least = if levels_changed { MIN_CHANGED_EVIDENCE } else { EVIDENCE_LIMITS[0] };
        let middle = (0..FEATURES).map(|i| direction[i] * 0.5 * (m1[i] + m0[i])).sum();
        Self { direction, middle, least }
    }

    /// The evidence for one candidate, nats.
    pub fn weight(&self, candidate: &Candidate, marks: &[usize]) -> f64 {
        if marks.contains(&candidate.offset) {
            return MARK_WEIGHT;
        }
        let along: f64 = self.direction.iter().zip(&candidate.features).map(|(a, b)| a * b).sum();
        (along - self.middle).clamp(self.least, EVIDENCE_LIMITS[1])
    }
}

/// `S^-1 d`; if that would count a greater distance for a start, the better feature alone.
fn discriminant(s: [[f64; FEATURES]; FEATURES], d: [f64; FEATURES]) -> [f64; FEATURES] {
    let determinant = s[0][0] * s[1][1] - s[0][1] * s[1][0];
    let both =
        [(s[1][1] * d[0] - s[0][1] * d[1]) / determinant, (s[0][0] * d[1] - s[1][0] * d[0]) / determinant];
    if both[0] <= 0.0 && both[1] <= 0.0 {
        return both;
    }
    let alone = [(d[0] / s[0][0]).min(0.0), (d[1] / s[1][1]).min(0.0)];
    if d[1] * alone[1] > d[0] * alone[0] { [0.0, alone[1]] } else { [alone[0], 0.0] }
}

fn mean(set: &[[f64; FEATURES]]) -> [f64; FEATURES] {
    let mut mean = [0.0; FEATURES];
    for features in set {
        for (sum, value) in mean.iter_mut().zip(features) {
            *sum += value / set.len() as f64;
        }
    }
    mean
}

fn covariance(set: &[[f64; FEATURES]], mean: [f64; FEATURES]) -> [[f64; FEATURES]; FEATURES] {
    let mut covariance = [[0.0; FEATURES]; FEATURES];
    for features in set {
        for i in 0..FEATURES {
            for j in 0..FEATURES {
                covariance[i][j] += (features[i] - mean[i]) * (features[j] - mean[j]) / set.len() as f64;
            }
        }
    }
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidates(features: &[[f64; 2]]) -> Vec<Candidate> {
        let candidate = |(offset, &features): (usize, &[f64; 2])| Candidate { offset, features, weight: 0.0 };
        features.iter().enumerate().map(candidate).collect()
    }

    #[test]
    fn nearer_weighs_more_and_within_bounds() {
        let features: Vec<[f64; 2]> =
            (0..40).map(|i| [f64::from(i % 2) + 0.01 * f64::from(i), 3.0 + f64::from(i % 2)]).collect();
        let labels: Vec<Label> =
            (0..40).map(|i| if i % 2 == 0 { Label::Start } else { Label::Rest }).collect();
        let evidence = Evidence::learn(&candidates(&features), &labels, false);
        let weight = |features| evidence.weight(&candidates(&[features])[0], &[]);
        assert!(weight([0.0, 3.0]) > 1.0 && weight([1.4, 4.0]) < -1.0);
        assert_eq!((weight([-900.0, 3.0]), weight([900.0, 3.0])), (10.0, -4.0));
        assert_eq!(evidence.weight(&candidates(&[[0.0, 0.0]])[0], &[0]), MARK_WEIGHT);
    }

    #[test]
    fn a_feature_that_points_the_wrong_way_is_left_out() {
        let features: Vec<[f64; 2]> = (0..40).map(|i| [f64::from(i % 2), -f64::from(i % 2)]).collect();
        let labels: Vec<Label> =
            (0..40).map(|i| if i % 2 == 0 { Label::Start } else { Label::Rest }).collect();
        let evidence = Evidence::learn(&candidates(&features), &labels, false);
        assert!(evidence.direction[0] < 0.0 && evidence.direction[1] == 0.0, "{evidence:?}");
    }

    #[test]
    fn where_levels_have_changed_squares_say_nothing_and_shape_less_against() {
        let features: Vec<[f64; 2]> = (0..40).map(|i| [f64::from(i % 2), f64::from(i % 2)]).collect();
        let labels: Vec<Label> =
            (0..40).map(|i| if i % 2 == 0 { Label::Start } else { Label::Rest }).collect();
        let evidence = Evidence::learn(&candidates(&features), &labels, true);
        let weight = |features| evidence.weight(&candidates(&[features])[0], &[]);
        assert_eq!(weight([0.2, -5.0]), weight([0.2, 5.0]));
        assert_eq!(weight([900.0, 0.0]), MIN_CHANGED_EVIDENCE);
    }

    #[test]
    fn without_examples_nothing_is_said() {
        let evidence = Evidence::learn(&[], &[], false);
        assert_eq!(evidence.weight(&candidates(&[[1.0, 1.0]])[0], &[]), 0.0);
    }
}
