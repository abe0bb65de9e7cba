//! Plots of runs and charts. Each is described once as a [`Picture`], and rendered as SVG, PNG and PDF. A
//! [`Look`] sets the width and the font size.
//!
//! Plots of a run:
//!
//! - [`PowerRun`]: power over the whole run, with every spike.
//! - [`FramePowerPlot`]: power of one frame over time, stacked by part.
//! - [`FrameEnergyPlot`]: energy of each frame, measured and true.
//! - [`UnitPlot`]: how busy each unit was over one frame, or what it waited for.
//! - [`HeatMapPlot`]: a value over the image.
//!
//! Other plots:
//!
//! - [`Chart`]: panels of [`Series`] over axes of any [`Scale`].
//! - [`Images`]: images in colour beside each other.
//! - [`Matrix`]: costs of methods by test case.
//!
//! A unit has the same colour in all plots ([`part_colour`]). Without anything to draw (no samples, no
//! frames, no finite value) the plot says so; this is no error. Only `render` and `text` use the crate
//! `plotters`.

mod axis;
mod chart;
mod chart_panel;
mod frame_plots;
mod heat_map;
mod panel;
mod picture;
mod render;
mod run_plots;
mod series;

use activity::Unit;
use power_model::Part;

pub use axis::{AxisSpec, Scale};
pub use chart::Chart;
pub use chart_panel::ChartPanel;
pub use frame_plots::{FramePowerPlot, PowerPart, StallLane, UnitLane, UnitPlot};
pub use heat_map::{CaptionedImage, HeatMapPlot, HeatTile, Images, Matrix, MatrixPanel, Shading};
pub use picture::{COLUMN_MM, Look, Picture, undrawable};
pub use render::PlotError;
pub use run_plots::{FrameEnergyPlot, FrameEnergyPoint, PowerRun};
pub use series::{Mark, Paint, Series, Spread};

/// An sRGB colour with opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colour {
    /// Red, green, blue, 8-bit sRGB.
    pub rgb: [u8; 3],
    /// Opacity, 0 to 1.
    pub alpha: f64,
}

impl Colour {
    /// An opaque colour from its hexadecimal number.
    const fn hex(number: u32) -> Self {
        Self { rgb: [(number >> 16) as u8, (number >> 8) as u8, number as u8], alpha: 1.0 }
    }

    /// The same colour at another opacity.
    const fn alpha(self, alpha: f64) -> Self {
        Self { alpha, ..self }
    }

    /// As CSS and SVG write it, opacity left out: `#4c78a8`.
    pub fn css(self) -> String {
        let [r, g, b] = self.rgb;
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}

const BACKGROUND: Colour = Colour::hex(0xff_ffff);
const INK: Colour = Colour::hex(0x1f_2430);
const MUTED: Colour = Colour::hex(0x5b_6472);
const GRID: Colour = Colour::hex(0xe6_e9ee);
const AXIS: Colour = Colour::hex(0x9a_a2ae);
/// Grid and background lines.
const FAINT: Colour = Colour::hex(0xc4_cad3);
const MEASURED: Colour = Colour::hex(0x2f_6db3);
const TRUTH: Colour = Colour::hex(0xd9_5f0e);
const MARK: Colour = Colour::hex(0xf2_c14e);

/// Colour of a unit in every plot. Neighbouring units, which are neighbours in stacks, differ most.
const fn unit_colour(unit: Unit) -> Colour {
    Colour::hex(match unit {
        Unit::Command => 0x8f_e7c0,
        Unit::Shader => 0xbe_6426,
        Unit::Compute => 0x14_0028,
        Unit::Setup => 0x7f_ccff,
        Unit::Traversal => 0xe4_8e1b,
        Unit::ZCull => 0x97_464f,
        Unit::SampleTest => 0xfa_d24d,
        Unit::Depth => 0x42_74cc,
        Unit::ShadingCache => 0x7d_0700,
        Unit::Texture => 0x62_b994,
        Unit::Colour => 0x62_1c56,
        Unit::L2 => 0x68_9fd8,
        Unit::Llc => 0x00_00f0,
        Unit::Edram => 0x00_0000,
        Unit::Dram => 0x05_4aa1,
    })
}

/// Colour of a part in every plot and in the report. Power that does not depend on activity is grey.
pub const fn part_colour(part: Part) -> Colour {
    match part {
        Part::Unit(unit) => unit_colour(unit),
        Part::Constant => Colour::hex(0x82_8489),
        Part::Leakage => Colour::hex(0xba_bdc5),
        Part::ClockTree => Colour::hex(0x46_474a),
        Part::Idle => Colour::hex(0xe6_eaf3),
    }
}

/// Colour of the unit called `name`; `None` for an unknown name.
fn named_unit_colour(name: &str) -> Option<Colour> {
    Unit::ALL.into_iter().find(|unit| unit.name() == name).map(unit_colour)
}

/// Colours of series, in order. The first four avoid red beside green.
const SERIES: [Colour; 8] = [
    Colour::hex(0x05_4aa1),
    Colour::hex(0xe4_8e1b),
    Colour::hex(0x68_9fd8),
    Colour::hex(0x62_1c56),
    Colour::hex(0x62_b994),
    Colour::hex(0xbe_6426),
    Colour::hex(0x7d_0700),
    Colour::hex(0x97_464f),
];

/// Colours of the states of a unit: busy, starved, blocked.
const STATES: [Colour; 3] = [MEASURED, Colour::hex(0xf0_b64a), Colour::hex(0x7a_2a4f)];

/// Colours of classes of a map; the first is that of no class.
const CLASSES: [Colour; 4] =
    [Colour::hex(0xf0_f2f5), Colour::hex(0xf0_b64a), Colour::hex(0x05_4aa1), Colour::hex(0x7a_2a4f)];

/// Stops of the scale from idle to busy: light to dark, so that it also works in greyscale.
const HEAT: [[u8; 3]; 6] =
    [[246, 248, 251], [208, 225, 242], [137, 190, 220], [66, 146, 198], [23, 92, 162], [10, 40, 92]];

/// Colour of a `fraction` in [0, 1] on the scale from idle to busy.
fn heat(fraction: f64) -> Colour {
    let place = fraction.clamp(0.0, 1.0) * (HEAT.len() - 1) as f64;
    let below = (place as usize).min(HEAT.len() - 2);
    let t = place - below as f64;
    let mix = |i: usize| {
        let (a, b) = (f64::from(HEAT[below][i]), f64::from(HEAT[below + 1][i]));
        (a + (b - a) * t + 0.5) as u8
    };
    Colour { rgb: [mix(0), mix(1), mix(2)], alpha: 1.0 }
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod colour_tests {
    use super::*;

    type Rgb = [f64; 3];
    type Matrix = [[f64; 3]; 3];

    /// Normal vision, complete protanopia and deuteranopia, on linear RGB: Machado, Oliveira and Fernandes, "A
    /// Physiologically-based Model for Simulation of Color Vision Deficiency", 2009, severity 1.
    const VISIONS: [Matrix; 3] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
    ];

    fn product(matrix: &Matrix, v: Rgb) -> Rgb {
        [0, 1, 2].map(|row| (0..3).map(|column| matrix[row][column] * v[column]).sum())
    }

    fn linear(colour: Colour) -> Rgb {
        colour.rgb.map(|part| {
            let part = f64::from(part) / 255.0;
            if part <= 0.040_45 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }
        })
    }

    /// Oklab, in which distances are about as large as they look (B. Ottosson, 2020).
    fn oklab(rgb: Rgb) -> Rgb {
        let cones = product(
            &[
                [0.412_221_470_8, 0.536_332_536_3, 0.051_445_992_9],
                [0.211_903_498_2, 0.680_699_545_1, 0.107_396_956_6],
                [0.088_302_461_9, 0.281_718_837_6, 0.629_978_700_5],
            ],
            rgb.map(|part| part.clamp(0.0, 1.0)),
        );
        product(
            &[
                [0.210_454_255_3, 0.793_617_785_0, -0.004_072_046_8],
                [1.977_998_495_1, -2.428_592_205_0, 0.450_593_709_9],
                [0.025_904_037_1, 0.782_771_766_2, -0.808_675_766_0],
            ],
            cones.map(f64::cbrt),
        )
    }

    /// Smallest difference of two colours over all kinds of vision.
    fn distance(a: Colour, b: Colour) -> f64 {
        let in_vision = |vision: &Matrix| {
            let [a, b] = [a, b].map(|colour| oklab(product(vision, linear(colour))));
            a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
        };
        VISIONS.iter().map(in_vision).fold(f64::INFINITY, f64::min)
    }

    fn least(colours: &[Colour]) -> f64 {
        let pairs =
            colours.iter().enumerate().flat_map(|(i, a)| colours[..i].iter().map(|b| distance(*a, *b)));
        pairs.fold(f64::INFINITY, f64::min)
    }

    /// For comparison: the eight colours of Okabe and Ito are 0.076 apart by this measure.
    #[test]
    fn units_differ_in_every_vision() {
        let units = Unit::ALL.map(unit_colour);
        assert!(least(&units) > 0.12, "{}", least(&units));
        let neighbours =
            units.windows(2).map(|pair| distance(pair[0], pair[1])).fold(f64::INFINITY, f64::min);
        assert!(neighbours > 0.24, "{neighbours}");
        let parts = Part::ALL.map(part_colour);
        assert!(least(&parts) > 0.05, "{}", least(&parts));
    }

    #[test]
    fn series_states_and_classes_differ_in_every_vision() {
        assert!(least(&SERIES) > 0.12 && least(&STATES) > 0.15 && least(&CLASSES) > 0.14);
        assert!(least(&[MEASURED, TRUTH, MARK, BACKGROUND]) > 0.14);
        assert!(SERIES.iter().all(|colour| distance(*colour, BACKGROUND) > 0.2), "seen on white");
    }

    #[test]
    fn heat_grows_darker_in_every_vision() {
        for vision in &VISIONS {
            let lightness = |step: u32| oklab(product(vision, linear(heat(f64::from(step) / 20.0))))[0];
            assert!((0..20).all(|step| lightness(step) > lightness(step + 1) + 0.01));
        }
    }

    #[test]
    fn a_unit_is_known_by_its_name() {
        assert!(Unit::ALL.into_iter().all(|unit| named_unit_colour(unit.name()) == Some(unit_colour(unit))));
        assert_eq!(named_unit_colour("leakage"), None);
    }
}
