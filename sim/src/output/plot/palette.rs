//! The colours of plots and report.

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
    pub(super) const fn hex(number: u32) -> Self {
        Self { rgb: [(number >> 16) as u8, (number >> 8) as u8, number as u8], alpha: 1.0 }
    }

    /// The same colour at another opacity.
    pub(super) const fn alpha(self, alpha: f64) -> Self {
        Self { alpha, ..self }
    }

    /// As CSS and SVG write it, opacity left out: `#4c78a8`.
    pub fn css(self) -> String {
        let [r, g, b] = self.rgb;
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}

pub(super) const BACKGROUND: Colour = Colour::hex(0xff_ffff);
pub(super) const INK: Colour = Colour::hex(0x1f_2430);
pub(super) const MUTED: Colour = Colour::hex(0x5b_6472);
pub(super) const GRID: Colour = Colour::hex(0xe6_e9ee);
pub(super) const AXIS: Colour = Colour::hex(0x9a_a2ae);
pub(super) const MEASURED: Colour = Colour::hex(0x2f_6db3);
pub(super) const TRUTH: Colour = Colour::hex(0xd9_5f0e);
pub(super) const MARK: Colour = Colour::hex(0xf2_c14e);

/// Hues for units, apart from their neighbours in the list.
const UNITS: [Colour; 14] = [
    Colour::hex(0x4c_78a8),
    Colour::hex(0xf5_8518),
    Colour::hex(0x54_a24b),
    Colour::hex(0xe4_5756),
    Colour::hex(0x72_b7b2),
    Colour::hex(0xee_ca3b),
    Colour::hex(0xb2_79a2),
    Colour::hex(0x9d_755d),
    Colour::hex(0x1f_9ec9),
    Colour::hex(0xff_9da6),
    Colour::hex(0x5f_4690),
    Colour::hex(0x94_c973),
    Colour::hex(0xc4_3e7a),
    Colour::hex(0x2d_6a5f),
];

/// Greys for what is spent whether or not any unit works.
const OVERHEADS: [Colour; 5] = [
    Colour::hex(0x8a_93a1),
    Colour::hex(0xb4_bbc5),
    Colour::hex(0x66_707f),
    Colour::hex(0xd0_d5dc),
    Colour::hex(0x4a_525f),
];

/// The colour of a part: the `index`-th among the units, or among the overheads (constant, leakage, clock tree).
pub fn part_colour(index: usize, overhead: bool) -> Colour {
    if overhead { OVERHEADS[index % OVERHEADS.len()] } else { UNITS[index % UNITS.len()] }
}

/// Stops of the scale from idle to busy, light to dark so that it also reads in grey.
const HEAT: [[u8; 3]; 6] =
    [[246, 248, 251], [208, 225, 242], [137, 190, 220], [66, 146, 198], [23, 92, 162], [10, 40, 92]];

/// The colour of a `fraction` in [0, 1] on the scale from idle to busy.
pub(super) fn heat(fraction: f64) -> Colour {
    let place = fraction.clamp(0.0, 1.0) * (HEAT.len() - 1) as f64;
    let below = (place as usize).min(HEAT.len() - 2);
    let t = place - below as f64;
    let mix = |i: usize| {
        let (a, b) = (f64::from(HEAT[below][i]), f64::from(HEAT[below + 1][i]));
        (a + (b - a) * t + 0.5) as u8
    };
    Colour { rgb: [mix(0), mix(1), mix(2)], alpha: 1.0 }
}
