//! One sample.

/// One sample of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Position within the pixel, [0, 1).
    pub x: f32,
    /// Position within the pixel, [0, 1), downwards.
    pub y: f32,
    /// Lens position, [-1, 1].
    pub u: f32,
    /// Lens position, [-1, 1], upwards.
    pub v: f32,
    /// Time, [0, 1) over the shutter.
    pub t: f32,
}

impl Sample {
    /// Whether it lies in its pixel, in the square of the lens and in the shutter.
    pub fn is_in_range(&self) -> bool {
        let unit = 0.0..1.0;
        let lens = -1.0..=1.0;
        [self.x, self.y, self.t].iter().all(|c| unit.contains(c))
            && [self.u, self.v].iter().all(|c| lens.contains(c))
    }
}
