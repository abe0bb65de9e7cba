//! Rates that others published, with the part they were measured on.

use pipeline::{Blend, Format};
use run::{GpuError, GpuSpec};

use super::Work;

/// A rate as it was published.
#[derive(Clone, Copy, Debug)]
pub(super) struct Published {
    pub part: Part,
    /// What was done.
    pub quantity: &'static str,
    pub value: f64,
    pub unit: Unit,
    /// The work that comes nearest.
    pub work: Work,
    /// Whether the file of the part has this very number, which then is no test of the model.
    pub is_input: bool,
    /// Who published it, and where.
    pub source: &'static str,
}

/// Unit of a rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    /// 1e9 of a second.
    Giga(&'static str),
    /// 1e6 of a second.
    Mega(&'static str),
    /// Of a clock of the core.
    Clock(&'static str),
}

impl Unit {
    /// Name of the unit.
    pub fn name(self) -> String {
        match self {
            Self::Giga(what) => format!("G{what}/s"),
            Self::Mega(what) => format!("M{what}/s"),
            Self::Clock(what) => format!("{what}/clock"),
        }
    }

    /// A rate of a second in this unit.
    pub fn of(self, per_s: f64, core_hz: f64) -> f64 {
        per_s
            / match self {
                Self::Giga(_) => 1e9,
                Self::Mega(_) => 1e6,
                Self::Clock(_) => core_hz,
            }
    }
}

/// A part whose rates were published.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Hd7970,
    Hd6970,
    Gtx580,
    Gtx460,
    Sgx543Mp2,
    MaliT760,
    Skybox,
}

impl Part {
    /// Name of the part.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hd7970 => "HD 7970",
            Self::Hd6970 => "HD 6970",
            Self::Gtx580 => "GTX 580",
            Self::Gtx460 => "GTX 460",
            Self::Sgx543Mp2 => "SGX543MP2",
            Self::MaliT760 => "Mali-T760",
            Self::Skybox => "Skybox",
        }
    }

    /// The part as a GPU file.
    pub fn gpu(self) -> Result<GpuSpec, GpuError> {
        let (file, text) = match self {
            Self::Hd7970 => return GpuSpec::load("discrete"),
            Self::Hd6970 => ("hd_6970.ron", include_str!("../../../parts/hd_6970.ron")),
            Self::Gtx580 => ("gtx_580.ron", include_str!("../../../parts/gtx_580.ron")),
            Self::Gtx460 => ("gtx_460.ron", include_str!("../../../parts/gtx_460.ron")),
            Self::Sgx543Mp2 => ("sgx543mp2.ron", include_str!("../../../parts/sgx543mp2.ron")),
            Self::MaliT760 => ("mali_t760.ron", include_str!("../../../parts/mali_t760.ron")),
            Self::Skybox => ("skybox.ron", include_str!("../../../parts/skybox.ron")),
        };
        GpuSpec::parse(text, file)
    }
}

const PIXEL: Unit = Unit::Giga("pixel");
const fn fill(
    part: Part,
    quantity: &'static str,
    value: f64,
    targets: &'static [Format],
    blend: Blend,
    source: &'static str,
) -> Published {
    Published {
        part,
        quantity,
        value,
        unit: PIXEL,
        work: Work::Fill { targets, blend },
        is_input: false,
        source,
    }
}

/// Two targets in place of one of 128 bits, which surfaces do not have.
const FOUR_FLOATS: &[Format] = &[Format::Rg32f, Format::Rg32f];
const GPU_PRO: &str = "GPU Pro, figure 4.6";
const ANANDTECH_4216: &str = "AnandTech 4216, GLBenchmark 2.0";
const ARM: &str = "Arm, Mali GPU data sheet";

const fn gtx_460(quantity: &'static str, value: f64, targets: &'static [Format], blend: Blend) -> Published {
    fill(Part::Gtx460, quantity, value, targets, blend, GPU_PRO)
}

const fn sgx(quantity: &'static str, value: f64, what: &'static str, work: Work) -> Published {
    let (part, unit) = (Part::Sgx543Mp2, Unit::Mega(what));
    Published { part, quantity, value, unit, work, is_input: false, source: ANANDTECH_4216 }
}

const fn mali(
    quantity: &'static str,
    value: f64,
    what: &'static str,
    work: Work,
    is_input: bool,
) -> Published {
    Published { part: Part::MaliT760, quantity, value, unit: Unit::Clock(what), work, is_input, source: ARM }
}

/// All of them.
pub(super) const PUBLISHED: [Published; 22] = [
    fill(
        Part::Hd7970,
        "blended fill, 4 x 16 bits",
        13.33,
        &[Format::Rgba16f],
        Blend::Over,
        "AnandTech 5261, 3DMark Vantage",
    ),
    // 13.33 is 51 % more than it.
    fill(
        Part::Hd6970,
        "blended fill, 4 x 16 bits",
        8.83,
        &[Format::Rgba16f],
        Blend::Over,
        "AnandTech 5261, 3DMark Vantage",
    ),
    fill(Part::Gtx580, "fill, 4 x 8 bits", 23.3, &[Format::Rgba8], Blend::Replace, "Hardware.fr 806"),
    gtx_460("fill, 4 x 8 bits", 8.28, &[Format::Rgba8], Blend::Replace),
    gtx_460("fill, 4 x 16 bits", 4.61, &[Format::Rgba16f], Blend::Replace),
    gtx_460("fill, 4 x 32 bits", 2.42, FOUR_FLOATS, Blend::Replace),
    gtx_460("fill, 2 x 16 bits", 8.07, &[Format::R32f], Blend::Replace),
    gtx_460("fill, 2 x 32 bits", 4.56, &[Format::Rg32f], Blend::Replace),
    gtx_460("blended fill, 4 x 8 bits", 8.28, &[Format::Rgba8], Blend::Over),
    gtx_460("blended fill, 4 x 16 bits", 4.56, &[Format::Rgba16f], Blend::Over),
    gtx_460("blended fill, 4 x 32 bits", 1.10, FOUR_FLOATS, Blend::Over),
    gtx_460("blended fill, 2 x 16 bits", 4.52, &[Format::R32f], Blend::Over),
    gtx_460("blended fill, 2 x 32 bits", 1.99, &[Format::Rg32f], Blend::Over),
    sgx("textured triangles", 29.0, "triangle", Work::Triangles { lit: false }),
    sgx("lit triangles", 19.7, "triangle", Work::Triangles { lit: true }),
    sgx("texels", 890.1, "texel", Work::Texels { lod: 0.0 }),
    mali("fill", 1.0, "pixel", Work::Fill { targets: &[Format::Rgba8], blend: Blend::Replace }, true),
    mali("bilinear texels", 1.0, "texel", Work::Texels { lod: 0.0 }, true),
    mali("trilinear texels", 0.5, "texel", Work::Texels { lod: 0.5 }, false),
    mali("depths read", 0.5, "texel", Work::Depths, false),
    Published {
        part: Part::Hd7970,
        quantity: "bilinear texels",
        value: 118.4,
        unit: Unit::Giga("texel"),
        work: Work::Texels { lod: 0.0 },
        is_input: true,
        source: "listed",
    },
    // 16 pixels a clock of 230 MHz.
    Published {
        is_input: true,
        ..fill(Part::Skybox, "peak fill", 3.7, &[Format::Rgba8], Blend::Replace, "Tine et al., ASPLOS 2023")
    },
];
