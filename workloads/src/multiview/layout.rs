//! Layout of views on the camera line.

use std::ops::Range;

use pipeline::sampling::{LensRegion, LensRegions};
use serde::{Deserialize, Serialize};

use crate::error::LoadError;

/// Equidistant views on a camera line, from left to right.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Layout {
    /// Number of views.
    pub views: u32,
    /// Distance between neighbouring views, scene units.
    pub spacing: f64,
    /// Radius of each view's aperture across the line, and along it for separate lenses; scene units.
    pub aperture: f64,
    /// Steps of the line that a view's box filter covers: 1 for adjacent views, 2 for views that overlap by
    /// half, and so on. 0 for separate views, each with a small lens.
    pub overlap: u32,
}

impl Default for Layout {
    fn default() -> Self {
        Self::stereo(0.28, 0.11)
    }
}

/// Most views, so that their samples fit in a pixel.
const MAX_VIEWS: u32 = 128;

/// Least length in scene units that single precision represents.
const MIN_LENGTH: f64 = 1e-35;

/// Largest half length of the camera line relative to the aperture, a hundredth of single precision's
/// resolution.
const MAX_RADIUS_PER_APERTURE: f64 = 1e5;

impl Layout {
    /// Two small lenses of radius `aperture`, with centres `spacing` apart.
    pub const fn stereo(spacing: f64, aperture: f64) -> Self {
        Self { views: 2, spacing, aperture, overlap: 0 }
    }

    /// `views` views on a line of the given length, with box filters that overlap by half.
    pub fn line(views: u32, length: f64, aperture: f64) -> Self {
        Self { views, spacing: length / f64::from(views + 1), aperture, overlap: 2 }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// [`LoadError`] with the first invalid value, and a valid one.
    pub fn check(&self) -> Result<(), LoadError> {
        let refused = |setting, message| Err(LoadError::Setting { setting, message });
        if !(1..=MAX_VIEWS).contains(&self.views) {
            return refused("views", format!("{}: there can be 1 to {MAX_VIEWS}", self.views));
        }
        for (setting, value) in [("spacing", self.spacing), ("aperture", self.aperture)] {
            if !(value >= MIN_LENGTH && value.is_finite()) {
                return refused(
                    setting,
                    format!("{value:?}: it has to be a finite length of {MIN_LENGTH:e} or more"),
                );
            }
        }
        if self.overlap == 0 && self.views > 1 && self.spacing < 2.0 * self.aperture {
            let message = format!(
                "{:?}: apart, lenses of radius {:?} need twice that; or give an `overlap` of 1 or more",
                self.spacing, self.aperture
            );
            return refused("spacing", message);
        }
        if self.overlap > 16 {
            return refused("overlap", format!("{}: a filter takes 0 to 16 steps", self.overlap));
        }
        if self.radius() > MAX_RADIUS_PER_APERTURE * self.aperture {
            let message = format!(
                "{:e}: half the line of views is {:e} long, and single precision keeps nothing of lenses of radius {:e} on it: it has to be at most \
                 {MAX_RADIUS_PER_APERTURE} of them; move the views closer or widen the aperture",
                self.spacing,
                self.radius(),
                self.aperture
            );
            return refused("spacing", message);
        }
        Ok(())
    }

    /// Number of strips of the lens that have their own samples.
    pub fn strips(&self) -> u32 {
        self.views + self.overlap.max(1) - 1
    }

    /// Half the length of the camera line, or of the lens across it if that is longer; scene units.
    pub fn radius(&self) -> f64 {
        let along = match self.overlap {
            0 => 0.5 * f64::from(self.views - 1) * self.spacing + self.aperture,
            _ => 0.5 * f64::from(self.strips()) * self.spacing,
        };
        along.max(self.aperture)
    }

    /// Centre of a view on the line, in lens coordinates.
    pub fn middle(&self, view: u32) -> f64 {
        (f64::from(view) - 0.5 * f64::from(self.views - 1)) * self.spacing / self.radius()
    }

    /// Lens regions, one per strip.
    pub fn regions(&self) -> LensRegions {
        let (radius, steps) = (self.radius(), f64::from(self.strips()));
        let high = ((self.aperture / radius) as f32).min(1.0);
        let edge = |at: f64| ((at * self.spacing / radius) as f32).clamp(-1.0, 1.0);
        let region = |strip: u32| {
            let u = match self.overlap {
                0 => [-1.0, 1.0].map(|side| {
                    ((self.middle(strip) + side * self.aperture / radius) as f32).clamp(-1.0, 1.0)
                }),
                _ => [0.0, 1.0].map(|next| edge(f64::from(strip) + next - 0.5 * steps)),
            };
            LensRegion { u: (u[0], u[1]), v: (-high, high) }
        };
        LensRegions::Rectangles((0..self.strips()).map(region).collect())
    }

    /// Range of samples of each view, with `per_strip` samples per strip.
    pub fn runs(&self, per_strip: u32) -> Vec<Range<u32>> {
        let strips = self.overlap.max(1);
        (0..self.views).map(|view| view * per_strip..(view + strips) * per_strip).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_small_lenses_lie_at_the_ends_of_a_wide_one() {
        let stereo = Layout::stereo(0.3, 0.1);
        assert!((stereo.radius() - 0.25).abs() < 1e-12 && stereo.strips() == 2);
        let regions = stereo.regions().rectangles().unwrap();
        assert!((regions[0].u.0 + 1.0).abs() < 1e-6 && (regions[0].u.1 + 0.2).abs() < 1e-6, "{regions:?}");
        assert_eq!(regions[0].v.1, 0.4);
        assert_eq!(stereo.runs(8), [0..8, 8..16]);
        assert!((stereo.middle(0) + 0.6).abs() < 1e-12 && stereo.middle(0) == -stereo.middle(1));
    }

    #[test]
    fn overlapping_filters_share_strips_and_cover_the_line() {
        let seven = Layout::line(7, 0.8, 0.1);
        assert_eq!((seven.strips(), seven.runs(4)[1].clone()), (8, 4..12));
        let regions = seven.regions().rectangles().unwrap();
        assert_eq!((regions[0].u.0, regions[7].u.1), (-1.0, 1.0));
        for view in 0..7 {
            let middle = 0.5 * (regions[view].u.0 + regions[view + 1].u.1);
            assert!((f64::from(middle) - seven.middle(view as u32)).abs() < 1e-6);
        }
    }

    #[test]
    fn invalid_layouts_are_refused() {
        let base = Layout::default();
        for bad in [
            Layout { views: 0, ..base },
            Layout { spacing: 0.1, ..base },
            Layout { spacing: 1.99 * base.aperture, ..base },
            Layout { aperture: f64::NAN, ..base },
            Layout { overlap: 99, ..base },
        ] {
            assert!(bad.check().unwrap_err().is_usage());
        }
        assert!(base.check().is_ok() && Layout { views: 1, spacing: 0.1, ..base }.check().is_ok());
        assert!(Layout { spacing: 2.0 * base.aperture, ..base }.check().is_ok(), "they may touch");
    }
}
