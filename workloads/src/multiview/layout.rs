//! Layout of views on the camera line, and interlacing for a display with slanted lenticular lenses.

use std::ops::Range;

use glam::Vec3;
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

/// A panel with vertical stripes of red, green and blue subpixels under lenticular lenses. Subpixel `k` of
/// row `l` (three times the column plus the channel) shows the view
///
/// ```text
/// floor(views frac((k + offset - 3 l slant) / pitch))
/// ```
///
/// (van Berkel 1999, equation 1), counted from the left.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Panel {
    /// Subpixels per lens, along a row.
    pub pitch: f64,
    /// Tangent of the angle between the lenses and the columns.
    pub slant: f64,
    /// Start of the first lens, in subpixels.
    pub offset: f64,
}

/// The panel of van Berkel: seven views, 3.5 subpixels and a slant of 1/6.
impl Default for Panel {
    fn default() -> Self {
        Self { pitch: 3.5, slant: 1.0 / 6.0, offset: 0.0 }
    }
}

/// Largest number of subpixels, and tangent; beyond it, the whole image lies under one lens.
const MAX_SUBPIXELS: f64 = 1e6;

impl Panel {
    /// Checks every value.
    ///
    /// # Errors
    /// [`LoadError`] with the first invalid value.
    pub fn check(&self) -> Result<(), LoadError> {
        let refused = |message| Err(LoadError::Setting { setting: "panel", message });
        if !(1.0..=MAX_SUBPIXELS).contains(&self.pitch) {
            return refused(format!("pitch {:?}: a lens covers 1 to {MAX_SUBPIXELS} subpixels", self.pitch));
        }
        for (name, value) in [("slant", self.slant), ("offset", self.offset)] {
            if !(-MAX_SUBPIXELS..=MAX_SUBPIXELS).contains(&value) {
                return refused(format!(
                    "{name} {value:?}: it has to be -{MAX_SUBPIXELS} to {MAX_SUBPIXELS}"
                ));
            }
        }
        Ok(())
    }

    /// View, of `views`, that a channel of a pixel shows.
    pub fn view(&self, [column, row]: [u32; 2], channel: u32, views: u32) -> u32 {
        let along = f64::from(3 * column + channel) + self.offset - 3.0 * f64::from(row) * self.slant;
        let part = along / self.pitch;
        let part = part - libm::floor(part);
        // Panels are designed so that subpixels meet views exactly. The offset keeps rounding from selecting
        // the previous view.
        ((part * f64::from(views) + 1e-9) as u32).min(views.saturating_sub(1))
    }

    /// Interlaces the images; all are `width` wide.
    pub fn interlace(&self, images: &[Vec<Vec3>], width: u32) -> Vec<Vec3> {
        let pixels = images.first().map_or(0, Vec::len);
        let pixel = |place: usize| {
            let at = [place as u32 % width, place as u32 / width];
            let channel = |c: u32| images[self.view(at, c, images.len() as u32) as usize][place][c as usize];
            Vec3::new(channel(0), channel(1), channel(2))
        };
        (0..pixels).map(pixel).collect()
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

    #[test]
    fn upright_lenses_show_the_views_in_turn() {
        let panel = Panel { pitch: 9.0, slant: 0.0, offset: 0.0 };
        for k in 0..90 {
            assert_eq!(panel.view([k / 3, 4], k % 3, 9), k % 9);
        }
    }

    /// Figure 3 of van Berkel 1999: seven views in a pattern with a period of seven subpixels and two rows,
    /// all with the same frequency.
    #[test]
    fn every_view_has_an_equal_share_of_the_panel() {
        let (panel, mut shares) = (Panel::default(), [0_u32; 7]);
        for (row, k) in (0..28).flat_map(|row| (0..84).map(move |k| (row, k))) {
            let view = panel.view([k / 3, row], k % 3, 7);
            assert_eq!(view, (2 * k + 7 * 28 - row) % 7, "{k} {row}");
            shares[view as usize] += 1;
        }
        assert_eq!(shares, [28 * 12; 7]);
    }

    #[test]
    fn each_channel_comes_from_its_view() {
        let images: Vec<Vec<Vec3>> = (0..3).map(|view| vec![Vec3::splat(view as f32); 2]).collect();
        let panel = Panel { pitch: 3.0, slant: 0.0, offset: 1.0 };
        assert_eq!(panel.interlace(&images, 2), [Vec3::new(1.0, 2.0, 0.0); 2]);
        assert!(Panel { pitch: 0.0, ..panel }.check().is_err());
    }
}
