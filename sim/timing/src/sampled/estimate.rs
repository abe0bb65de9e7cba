//! From the representatives to all units: the combined regression estimator and its error.

use super::{Design, student_t};

/// A value and the ends of the interval that holds the truth with the probability that was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The most likely value.
    pub value: f64,
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

impl Interval {
    /// Whether `truth` is inside, ends included.
    pub fn holds(&self, truth: f64) -> bool {
        (self.low..=self.high).contains(&truth)
    }

    /// Half the width over the value.
    pub fn relative(&self) -> f64 {
        let half = 0.5 * (self.high - self.low);
        if half == 0.0 { 0.0 } else { half / self.value.abs() }
    }

    /// The same times `by`, which is not negative.
    pub fn scaled(self, by: f64) -> Self {
        Self { value: self.value * by, low: self.low * by, high: self.high * by }
    }
}

/// What one quantity of all units comes to, from its values for the representatives.
///
/// In stratum `h` unit `i` is predicted as `mean_h(y) + b (x_i - mean_h(x))`, means over its representatives, with one slope `b`
/// for all (least squares through all representatives). The sum over units is the combined regression estimator (Cochran 1977,
/// eq. 7.53 with a slope of the whole sample), and measured values in the place of predicted ones leave it as it is.
///
/// Its variance is `sum over h of N_h^2 (1 - n_h / N_h) s_h^2 / n_h`, with `s_h^2` the variance of the residuals of the line within
/// a stratum (Cochran 1977, eqs. 5.13 and 7.56), times `f / (f - r)`: the slope took `r` of the `f` degrees of freedom within strata.
/// To that comes `(sum over h of N_h (X_h - mean_h(x)))^2 s^2 / S_xx`, what the line carries from the representatives to the units
/// they stand for, times the variance of its slope (Royall and Cumberland 1981): draws that lie to one side know less.
/// The interval is that of Student with the effective degrees of freedom of such a sum, spreads taken as equal (Cochran 1977,
/// eq. 5.16; Satterthwaite 1946), less `r`, rounded down.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// A prediction for every unit, the representatives' own not in their place.
    predicted: Vec<f64>,
    /// For each stratum, what the line leaves of its representatives.
    residuals: Vec<Vec<f64>>,
    /// The square of what the slope is multiplied by in the total, over the spread that it is known from.
    lever: f64,
    shape: Shape,
}

/// What the errors of all quantities share.
#[derive(Clone, Debug, PartialEq)]
struct Shape {
    /// Units and representatives of each stratum.
    sizes: Vec<[usize; 2]>,
    /// Degrees of freedom within strata, and how many of them the slope took.
    within: f64,
    slope: f64,
}

impl Estimate {
    /// `covariate` holds a number known for every unit; `measured` says the quantity of a representative.
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
            // Where all are measured nothing is carried, whatever rounding says.
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

    /// The prediction for a unit.
    pub fn predicted(&self, unit: usize) -> f64 {
        self.predicted[unit]
    }

    /// The sum over all units, with its interval.
    pub fn total(&self, confidence: f64) -> Interval {
        let total = self.predicted.iter().sum();
        self.shape.interval(total, self.shape.variance(&self.residuals, self.lever), confidence)
    }

    /// The sum of this quantity over that of another of the same design, with its interval: the variance is that of what is left of
    /// `y - R x` (Cochran 1977, eq. 6.13).
    pub fn ratio(&self, to: &Self, confidence: f64) -> Interval {
        let [above, below]: [f64; 2] = [self, to].map(|estimate| estimate.predicted.iter().sum());
        let ratio = above / below;
        let left = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - ratio * b).collect();
        let left: Vec<Vec<f64>> = self.residuals.iter().zip(&to.residuals).map(left).collect();
        let shape = if self.shape.slope > to.shape.slope { &self.shape } else { &to.shape };
        let lever = self.lever.max(to.lever);
        shape.interval(ratio, shape.variance(&left, lever) / (below * below), confidence)
    }

    /// The interval of a single unit of a stratum, in which its own value lies with the probability `confidence`: half of its width.
    pub fn half_width_of_one(&self, stratum: usize, confidence: f64) -> f64 {
        let [_, chosen] = self.shape.sizes[stratum];
        let variance = self.shape.pooled(&self.residuals) * (1.0 + 1.0 / chosen as f64);
        student_t(confidence, self.shape.freedom()) * variance.sqrt()
    }
}

impl Shape {
    /// What a stratum's variance counts for in that of the whole.
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

    /// The variance of what the line leaves, over all strata.
    fn pooled(&self, residuals: &[Vec<f64>]) -> f64 {
        let squares: f64 = residuals.iter().flatten().map(|left| left * left).sum();
        if squares == 0.0 { 0.0 } else { squares / (self.within - self.slope) }
    }

    fn variance(&self, residuals: &[Vec<f64>], lever: f64) -> f64 {
        let of = |(left, [units, chosen]): (&Vec<f64>, &[usize; 2])| {
            let spread = left.iter().map(|left| left * left).sum::<f64>() / (*chosen as f64 - 1.0);
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

/// The slope of the line through all representatives.
struct Slope {
    slope: f64,
    /// The share of the covariate's spread that lies within strata: the degrees of freedom the slope takes there.
    within: f64,
    /// The covariate's spread over all representatives.
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
        // A signature that says nothing: equal for all.
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
