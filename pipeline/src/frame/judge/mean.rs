//! Running means.

/// A running mean.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Mean {
    sum: f64,
    pub weight: f64,
}

/// The weight at which a mean begins to forget, in that of what it is told.
const MEMORY: f64 = 256.0;

impl Mean {
    /// Adds `value` with `weight`.
    pub fn add(&mut self, value: f64, weight: f64) {
        let kept = if self.weight > MEMORY * weight.max(1.0) { 1.0 - 1.0 / MEMORY } else { 1.0 };
        self.sum = self.sum * kept + value * weight;
        self.weight = self.weight * kept + weight;
    }

    pub fn join(&mut self, other: &Self) {
        self.sum += other.sum;
        self.weight += other.weight;
    }

    /// The mean, `guess` being worth as much as the weight `prior`.
    pub fn or(&self, guess: f64, prior: f64) -> f64 {
        let weight = self.weight + prior;
        if weight > 0.0 { (self.sum + guess * prior) / weight } else { guess }
    }
}
