//! Sampled simulation: which frames of an animation to simulate, and estimates of the others.
//!
//! Frames are sorted by a cheap *signature* and split into strata. Some frames of each stratum are drawn at
//! random and simulated. A regression on the signature estimates the others, with confidence intervals.
//!
//! - [`Design`]: strata and representatives (Cochran 1977, chapter 5).
//! - [`Estimate`]: totals, single frames and their intervals (Cochran 1977, sections 7.10 and 5.4).
//! - [`student_t`]: width of an interval from few representatives.
//!
//! The method combines representatives found by the signatures of program phases (SimPoint: Sherwood,
//! Perelman, Hamerly and Calder 2002) with sampling whose error is estimated from the samples themselves
//! (SMARTS: Wunderlich, Wenisch, Falsafi and Hoe 2003).
//!
//! The module is independent of frames: units are numbered from 0, and values have any unit.

use std::f64::consts::{FRAC_PI_2, PI};

/// Fewest representatives per stratum; one would not show the variance.
const MIN_PER_STRATUM: usize = 2;
/// Fewest representatives in all: two strata, so the regression has residuals.
const MIN_REPRESENTATIVES: usize = 2 * MIN_PER_STRATUM;

/// Units with neighbouring signatures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stratum {
    /// Units of the stratum, sorted by signature.
    pub members: Vec<usize>,
    /// Representatives of the stratum, in the same order.
    pub chosen: Vec<usize>,
}

/// The strata, and the stratum of every unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Design {
    strata: Vec<Stratum>,
    /// Stratum of each unit.
    of: Vec<usize>,
}

impl Design {
    /// Split units into strata of (nearly) equal size, in the order of `signature`, and draw two or three
    /// representatives from each without replacement. Ties are in the order of the units. There are as many
    /// strata as `representatives` has pairs. `random` returns a random word for each unit; equal words give
    /// equal designs. The unit `certain` is measured in any case: it counts as a representative and forms the
    /// last stratum by itself.
    ///
    /// Equal sizes with equal draws give every unit the same probability, so a stratified mean is a plain
    /// mean (Cochran 1977, 5.3). Doubling `representatives` keeps those of the first design: strata are
    /// halved, and the units drawn from a stratum are drawn from its halves.
    ///
    /// At least 4 representatives are drawn, and at most all units.
    pub fn draw(
        signature: &[f64],
        certain: Option<usize>,
        representatives: usize,
        random: impl Fn(u64) -> u64,
    ) -> Self {
        let mut order: Vec<usize> = (0..signature.len()).filter(|&unit| Some(unit) != certain).collect();
        let units = order.len();
        let wanted = representatives.saturating_sub(certain.iter().len()).max(MIN_REPRESENTATIVES).min(units);
        order.sort_by(|&a, &b| signature[a].total_cmp(&signature[b]).then(a.cmp(&b)));
        let parts = (wanted / MIN_PER_STRATUM).max(1);
        let share = |whole: usize, part: usize| whole * part / parts;
        let mut strata: Vec<Stratum> = (0..parts)
            .map(|part| {
                let members = order[share(units, part)..share(units, part + 1)].to_vec();
                let count = share(wanted, part + 1) - share(wanted, part);
                let chosen = draw(&members, count.min(members.len()), &random);
                Stratum { members, chosen }
            })
            .collect();
        strata.retain(|stratum| !stratum.members.is_empty());
        strata.extend(certain.map(|unit| Stratum { members: vec![unit], chosen: vec![unit] }));
        let mut of = vec![0; signature.len()];
        for (stratum, at) in strata.iter().zip(0..) {
            stratum.members.iter().for_each(|&unit| of[unit] = at);
        }
        Self { strata, of }
    }

    /// All strata, in the order of their signatures; the certain unit's is the last.
    pub fn strata(&self) -> &[Stratum] {
        &self.strata
    }

    /// The stratum of a unit.
    pub fn stratum_of(&self, unit: usize) -> usize {
        self.of[unit]
    }

    /// Number of units.
    pub fn units(&self) -> usize {
        self.of.len()
    }

    /// All representatives, sorted.
    pub fn chosen(&self) -> Vec<usize> {
        let mut all: Vec<usize> = self.strata.iter().flat_map(|stratum| stratum.chosen.clone()).collect();
        all.sort_unstable();
        all
    }
}

/// Draw `count` of `members`: those with the smallest random words, which depend on the unit alone.
fn draw(members: &[usize], count: usize, random: &impl Fn(u64) -> u64) -> Vec<usize> {
    let mut words: Vec<(u64, usize)> =
        members.iter().zip(0..).map(|(&unit, at)| (random(unit as u64), at)).collect();
    words.sort_unstable();
    let mut positions: Vec<usize> = words[..count].iter().map(|&(_, at)| at).collect();
    positions.sort_unstable();
    positions.into_iter().map(|at| members[at]).collect()
}

/// A value and its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Most likely value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Half the width over the value.
    pub fn relative(&self) -> f64 {
        let half = 0.5 * (self.high - self.low);
        if half == 0.0 { 0.0 } else { half / self.value.abs() }
    }

    /// The interval times `by`, which is at least 0.
    pub fn scaled(self, by: f64) -> Self {
        Self { value: self.value * by, low: self.low * by, high: self.high * by }
    }
}

/// Estimate of one quantity of all units from its values for the representatives.
///
/// In stratum `h` unit `i` is predicted as `mean_h(y) + b (x_i - mean_h(x))`. The means are over its
/// representatives, and the slope `b` is the same for all strata (least squares through all representatives).
/// The sum over units is the combined regression estimator (Cochran 1977, eq. 7.53, with a slope of the whole
/// sample). Replacing predicted by measured values leaves the sum unchanged.
///
/// Its variance is `sum over h of N_h^2 (1 - n_h / N_h) s_h^2 / n_h` times `f / (f - r)`. Here `s_h^2` is the
/// variance of the residuals in a stratum (Cochran 1977, eqs. 5.13 and 7.56), and the slope takes `r` of the
/// `f` degrees of freedom within strata. The variance of the slope adds `(sum over h of N_h (X_h -
/// mean_h(x)))^2 s^2 / S_xx` (Royall and Cumberland 1981): unbalanced draws are less accurate. The interval
/// uses Student's t with the effective degrees of freedom of such a sum, assuming equal variances (Cochran
/// 1977, eq. 5.16; Satterthwaite 1946), less `r`, rounded down.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Prediction for every unit, also for the representatives.
    predicted: Vec<f64>,
    /// Residuals of the representatives, by stratum.
    residuals: Vec<Vec<f64>>,
    /// Squared coefficient of the slope in the total, over the spread of the covariate.
    lever: f64,
    shape: Shape,
}

/// Properties shared by all quantities of a design.
#[derive(Clone, Debug, PartialEq)]
struct Shape {
    /// Units and representatives of each stratum.
    sizes: Vec<[usize; 2]>,
    /// Degrees of freedom within strata, and how many of them the slope takes.
    within: f64,
    slope: f64,
}

impl Estimate {
    /// Estimate from `covariate`, a known number per unit, and `measured`, the quantity of a representative.
    pub fn new(design: &Design, covariate: &[f64], measured: impl Fn(usize) -> f64) -> Self {
        let slope = Slope::new(design, covariate, &measured);
        let mut predicted = vec![0.0; design.units()];
        let mut residuals = Vec::new();
        let mut carried = 0.0;
        for stratum in design.strata() {
            let mean_x = mean(stratum.chosen.iter().map(|&unit| covariate[unit]));
            let mean_y = mean(stratum.chosen.iter().map(|&unit| measured(unit)));
            let at = |unit: usize| mean_y + slope.slope * (covariate[unit] - mean_x);
            stratum.members.iter().for_each(|&unit| predicted[unit] = at(unit));
            // If all units are measured the coefficient is 0, whatever rounding gives.
            if stratum.chosen.len() < stratum.members.len() {
                carried += stratum.members.iter().map(|&unit| covariate[unit] - mean_x).sum::<f64>();
            }
            residuals.push(stratum.chosen.iter().map(|&unit| measured(unit) - at(unit)).collect());
        }
        let sizes: Vec<[usize; 2]> =
            design.strata().iter().map(|stratum| [stratum.members.len(), stratum.chosen.len()]).collect();
        let within: usize = sizes.iter().map(|[_, chosen]| chosen - 1).sum();
        let shape = Shape { sizes, within: within as f64, slope: slope.within };
        let lever = if slope.spread > 0.0 { carried * carried / slope.spread } else { 0.0 };
        Self { predicted, residuals, lever, shape }
    }

    /// Prediction for a unit.
    pub fn predicted(&self, unit: usize) -> f64 {
        self.predicted[unit]
    }

    /// Sum over all units, with its interval.
    pub fn total(&self, confidence: f64) -> Interval {
        let total = self.predicted.iter().sum();
        self.shape.interval(total, self.shape.variance(&self.residuals, self.lever), confidence)
    }

    /// Ratio of this quantity's sum to another's of the same design, with its interval. The variance is that
    /// of the residuals of `y - R x` (Cochran 1977, eq. 6.13).
    pub fn ratio(&self, to: &Self, confidence: f64) -> Interval {
        let [numerator, denominator]: [f64; 2] = [self, to].map(|estimate| estimate.predicted.iter().sum());
        let ratio = numerator / denominator;
        let residual = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - ratio * b).collect();
        let residual: Vec<Vec<f64>> = self.residuals.iter().zip(&to.residuals).map(residual).collect();
        let shape = if self.shape.slope > to.shape.slope { &self.shape } else { &to.shape };
        let lever = self.lever.max(to.lever);
        shape.interval(ratio, shape.variance(&residual, lever) / (denominator * denominator), confidence)
    }

    /// Half width of the prediction interval of a single unit of a stratum.
    pub fn half_width_of_one(&self, stratum: usize, confidence: f64) -> f64 {
        let [_, chosen] = self.shape.sizes[stratum];
        let variance = self.shape.pooled(&self.residuals) * (1.0 + 1.0 / chosen as f64);
        student_t(confidence, self.shape.freedom()) * variance.sqrt()
    }
}

impl Shape {
    /// Weight of a stratum's variance in the variance of the total.
    fn weight([units, chosen]: [usize; 2]) -> f64 {
        let (all, some) = (units as f64, chosen as f64);
        all * (all - some) / some
    }

    /// Effective degrees of freedom.
    fn freedom(&self) -> u32 {
        let (mut sum, mut squares) = (0.0, 0.0);
        for &[units, chosen] in self.sizes.iter().filter(|[_, chosen]| *chosen > 1) {
            let weight = Self::weight([units, chosen]);
            sum += weight;
            squares += weight * weight / (chosen as f64 - 1.0);
        }
        if squares > 0.0 { (sum * sum / squares - self.slope).max(1.0) as u32 } else { 1 }
    }

    /// Pooled variance of the residuals.
    fn pooled(&self, residuals: &[Vec<f64>]) -> f64 {
        let squares: f64 = residuals.iter().flatten().map(|residual| residual * residual).sum();
        if squares == 0.0 { 0.0 } else { squares / (self.within - self.slope) }
    }

    fn variance(&self, residuals: &[Vec<f64>], lever: f64) -> f64 {
        let of = |(residual, [units, chosen]): (&Vec<f64>, &[usize; 2])| {
            let spread =
                residual.iter().map(|residual| residual * residual).sum::<f64>() / (*chosen as f64 - 1.0);
            Self::weight([*units, *chosen]) * spread
        };
        let sum: f64 = residuals.iter().zip(&self.sizes).filter(|(_, [_, chosen])| *chosen > 1).map(of).sum();
        let drawn = if sum == 0.0 { 0.0 } else { sum * self.within / (self.within - self.slope) };
        if lever == 0.0 { drawn } else { drawn + lever * self.pooled(residuals) }
    }

    fn interval(&self, value: f64, variance: f64, confidence: f64) -> Interval {
        let half = student_t(confidence, self.freedom()) * variance.sqrt();
        Interval { value, low: value - half, high: value + half }
    }
}

/// Slope of the regression through all representatives.
struct Slope {
    slope: f64,
    /// Fraction of the covariate's spread within strata: the degrees of freedom that the slope takes there.
    within: f64,
    /// Spread of the covariate over all representatives.
    spread: f64,
}

impl Slope {
    fn new(design: &Design, covariate: &[f64], measured: impl Fn(usize) -> f64) -> Self {
        let chosen = design.chosen();
        let mean_x = mean(chosen.iter().map(|&unit| covariate[unit]));
        let mean_y = mean(chosen.iter().map(|&unit| measured(unit)));
        let (mut xx, mut xy, mut within) = (0.0, 0.0, 0.0);
        for stratum in design.strata() {
            let own_x = mean(stratum.chosen.iter().map(|&unit| covariate[unit]));
            for &unit in &stratum.chosen {
                let x = covariate[unit] - mean_x;
                xx += x * x;
                xy += x * (measured(unit) - mean_y);
                within += (covariate[unit] - own_x) * (covariate[unit] - own_x);
            }
        }
        // A constant covariate has no slope.
        let slope = |by: f64| if xx > 0.0 { by / xx } else { 0.0 };
        Self { slope: slope(xy), within: slope(within), spread: xx }
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value;
        count += 1.0;
    }
    sum / f64::max(count, 1.0)
}

/// Half width, in standard errors, of an interval that contains the truth with probability `confidence` (0 to
/// 1). The standard error is estimated with `freedom` degrees of freedom, at least 1.
///
/// Student (1908). For integer degrees of freedom the distribution is a finite sum (Abramowitz and Stegun
/// 1964, 26.7.3 and 26.7.4), inverted here by bisection to the last bits of an f64.
pub fn student_t(confidence: f64, freedom: u32) -> f64 {
    let inside = |angle: f64| within(angle, freedom.max(1));
    let (mut low, mut high) = (0.0, FRAC_PI_2);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if inside(middle) < confidence { low = middle } else { high = middle }
    }
    libm::tan(low) * f64::from(freedom.max(1)).sqrt()
}

/// Probability of |t| < sqrt(n) tan(angle) for `n` degrees of freedom.
fn within(angle: f64, n: u32) -> f64 {
    let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
    let square = cosine * cosine;
    // The sum runs over every other factor: 2/3 4/5 ... for odd n, 1/2 3/4 ... for even n.
    let odd = n % 2;
    let terms = if odd == 1 { (n - 1) / 2 } else { n / 2 };
    let (mut term, mut sum) = (1.0, 0.0);
    for k in 1..=terms {
        sum += term;
        let k = 2.0 * f64::from(k);
        term *= square * if odd == 1 { k / (k + 1.0) } else { (k - 1.0) / k };
    }
    if odd == 1 { (angle + sine * cosine * sum) * 2.0 / PI } else { sine * sum }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fisher and Yates 1938, table III, two-sided.
    #[test]
    fn golden_values_of_the_published_table() {
        let rows = [
            (1, 0.95, 12.706),
            (2, 0.95, 4.303),
            (3, 0.95, 3.182),
            (4, 0.95, 2.776),
            (5, 0.95, 2.571),
            (10, 0.95, 2.228),
            (30, 0.95, 2.042),
            (120, 0.95, 1.980),
            (1, 0.5, 1.0),
            (3, 0.99, 5.841),
            (10, 0.9, 1.812),
        ];
        for (freedom, confidence, expected) in rows {
            let found = student_t(confidence, freedom);
            assert!((found - expected).abs() < 6e-4, "{freedom} {confidence}: {found}, not {expected}");
        }
    }

    /// One degree is the Cauchy distribution; two have a closed form.
    #[test]
    fn closed_forms() {
        for confidence in [0.5, 0.8, 0.95, 0.999] {
            let cauchy = libm::tan(FRAC_PI_2 * confidence);
            assert!((student_t(confidence, 1) / cauchy - 1.0).abs() < 1e-9);
            let two = confidence * (2.0 / (1.0 - confidence * confidence)).sqrt();
            assert!((student_t(confidence, 2) / two - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn the_interval_narrows_with_freedom_and_0_counts_as_1() {
        let widths: Vec<f64> = (1..60).map(|n| student_t(0.95, n)).collect();
        assert!(widths.windows(2).all(|pair| pair[1] < pair[0]));
        assert!(widths[58] > 1.95996);
        assert_eq!(student_t(0.95, 0), student_t(0.95, 1));
    }
}
