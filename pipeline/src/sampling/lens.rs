//! Shapes of the aperture.

use serde::{Deserialize, Serialize};

/// The shape of the aperture, inscribed in the square [-1, 1]^2 of lens coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum LensShape {
    /// A round aperture.
    #[default]
    Disk,
    /// The whole square.
    Square,
}

impl LensShape {
    /// Maps a point of the unit square to the aperture, areas kept in proportion. The disk uses the concentric
    /// map of Shirley and Chiu 1997.
    pub fn map(self, unit: [f32; 2]) -> [f32; 2] {
        let [a, b] = unit.map(|c| f64::from(c) * 2.0 - 1.0);
        match self {
            Self::Square => [a as f32, b as f32],
            Self::Disk if a == 0.0 && b == 0.0 => [0.0, 0.0],
            Self::Disk => {
                let quarter = std::f64::consts::FRAC_PI_4;
                let (radius, angle) =
                    if a.abs() > b.abs() { (a, quarter * b / a) } else { (b, quarter * (2.0 - a / b)) };
                [(radius * libm::cos(angle)) as f32, (radius * libm::sin(angle)) as f32]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_disk_stays_in_the_disk_and_fills_it_evenly() {
        let n = 200;
        let mut inner = 0;
        for i in 0..n * n {
            let unit = [(i % n) as f32 + 0.5, (i / n) as f32 + 0.5].map(|c| c / n as f32);
            let [u, v] = LensShape::Disk.map(unit);
            assert!(u * u + v * v <= 1.000_001);
            inner += u32::from(u * u + v * v < 0.25);
        }
        let share = f64::from(inner) / f64::from(n * n);
        assert!(
            (share - 0.25).abs() < 0.005,
            "a quarter of the area lies within half the radius, found {share}"
        );
    }
}
