//! Interlacing for a display with slanted lenticular lenses.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::error::LoadError;

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
