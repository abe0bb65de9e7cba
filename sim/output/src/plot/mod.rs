//! Plots of runs and charts. Each is described once as a [`Picture`], and rendered as SVG, PNG and PDF. A
//! [`PlotStyle`] sets the width and the font size.
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
pub use heat_map::{CaptionedImage, HeatMapPlot, HeatScale, HeatTile, Images, Matrix, MatrixPanel};
pub use picture::{COLUMN_MM, Picture, PlotStyle, undrawable};
pub use render::PlotError;
pub use run_plots::{FrameEnergyPlot, FrameEnergyPoint, PowerRun};
pub use series::{Paint, PlotMark, Series, SpreadPoint};

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
