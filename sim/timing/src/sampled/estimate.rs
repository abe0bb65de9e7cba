//! Estimates for all units from the representatives: combined regression estimator and its error.

use super::{Design, student_t};

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
    /// Whether `truth` is in the interval, ends included.
    pub fn holds(&self, truth: f64) -> bool {
        (self.low..=self.high).contains(&truth)
    }

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
