//! What a RON scene file holds.
//!
//! Lengths are in scene units, times in seconds, angles in degrees, colours in linear RGB; `y` is up. Fields
//! that are left out take their defaults, unknown ones are errors.

use pipeline::Clip;
use serde::Deserialize;

use crate::bounded;
use crate::material::Alpha;
use crate::scene::{CameraSpec, InterpolationSpec};

/// A scene file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneSpec {
    /// Name in reports; the file's own by default.
    pub name: Option<String>,
    /// Size of the image, sampling, time and lens.
    #[serde(default)]
    pub settings: SettingsSpec,
    /// The camera; without one it is placed by itself.
    pub camera: Option<CameraSpec>,
    /// The light; by default a lamp over the camera's shoulder under a pale sky.
    pub light: Option<LightSpec>,
    /// Radiance where nothing is hit.
    #[serde(default, deserialize_with = "bounded::color")]
    pub background: Option<[f32; 3]>,
    /// What there is to see, at least one.
    pub objects: Vec<ObjectSpec>,
}

/// How the scene is rendered unless the command line says otherwise.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SettingsSpec {
    /// Pixels across, 1280 by default.
    #[serde(deserialize_with = "bounded::side")]
    pub width: Option<u32>,
    /// Pixels down, 720 by default.
    #[serde(deserialize_with = "bounded::side")]
    pub height: Option<u32>,
    /// Samples in a pixel, 8 by default.
    #[serde(deserialize_with = "bounded::samples")]
    pub samples: Option<u32>,
    /// Frames in a second, 60 by default.
    #[serde(deserialize_with = "bounded::frame_rate")]
    pub frame_rate_hz: Option<f64>,
    /// Fraction of the frame period for which the shutter is open, 0 to 1, 0.5 by default.
    #[serde(deserialize_with = "bounded::fraction")]
    pub shutter: Option<f64>,
    /// First frame and the one after the last, (0, 12) by default.
    #[serde(deserialize_with = "bounded::frames")]
    pub frames: Option<(u32, u32)>,
    /// Radius of the lens; zero, the default, is a pinhole.
    #[serde(deserialize_with = "bounded::radius")]
    pub lens_radius: Option<f32>,
    /// Depth at which the lens is sharp; the camera's target by default.
    #[serde(deserialize_with = "bounded::depth")]
    pub focus: Option<f32>,
    /// A sample table: a name, or a `.ron` or `.smp` file relative to the scene file; `owen` by default.
    pub table: Option<String>,
}

/// One lamp at infinity, and a sky over a ground.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LightSpec {
    /// From the scene to the lamp, of any length; over the camera's right shoulder by default.
    #[serde(default, deserialize_with = "bounded::vector")]
    pub toward: Option<[f64; 3]>,
    /// Radiance that a white surface facing the lamp sends back.
    #[serde(default, deserialize_with = "bounded::color")]
    pub color: Option<[f32; 3]>,
    /// Radiance of a white surface looking up, from the sky alone.
    #[serde(default, deserialize_with = "bounded::color")]
    pub sky: Option<[f32; 3]>,
    /// The same of one looking down.
    #[serde(default, deserialize_with = "bounded::color")]
    pub ground: Option<[f32; 3]>,
}

/// Something to see: a file or a shape, placed and perhaps moving.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectSpec {
    /// Name in messages.
    pub name: Option<String>,
    /// A `.gltf`, `.glb`, `.obj`, `.ply`, `.off` or `.stl` file, the last four also gzipped, relative to the
    /// scene file.
    pub file: Option<String>,
    /// Or a shape.
    pub shape: Option<ShapeSpec>,
    /// A second file of equal topology that holds a surface: vertices go there on straight lines.
    pub end: Option<String>,
    /// When they arrive; by default after one frame period. They stay there.
    #[serde(default, deserialize_with = "bounded::moment")]
    pub end_s: Option<f64>,
    /// Which animation clip of a glTF file plays, by name or number; the first by default.
    pub clip: Option<String>,
    /// Part of lens, shutter and image in which it is drawn (user clip planes).
    pub visible: Option<VisibleSpec>,
    /// Material; glTF files bring their own materials, which this one replaces.
    pub material: Option<MaterialSpec>,
    /// Position.
    #[serde(default, deserialize_with = "bounded::coordinates")]
    pub position: [f64; 3],
    /// Rotation: about x, then y, then z, right-handed.
    #[serde(default, deserialize_with = "bounded::angles")]
    pub rotation_deg: [f64; 3],
    /// Scale, as a factor along each axis; a negative one mirrors.
    #[serde(default, deserialize_with = "bounded::vector")]
    pub scale: Option<[f64; 3]>,
    /// Steady motion, in units per second.
    #[serde(default, deserialize_with = "bounded::coordinates")]
    pub velocity: [f64; 3],
    /// Steady turning about an axis of its own.
    pub spin: Option<SpinSpec>,
    /// Where it is when, instead of `position`, `rotation_deg` and `scale`.
    #[serde(default)]
    pub keyframes: Vec<ObjectKey>,
    /// Interpolation.
    #[serde(default)]
    pub interpolation: InterpolationSpec,
    /// Whether the keys start over after the last.
    #[serde(default)]
    pub repeat: bool,
}

/// Part of lens, shutter and image; what is left out is not limited. A sample on the lower bound is inside,
/// one on the upper bound only at the end of the axis.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct VisibleSpec {
    /// Across the lens, -1 to 1.
    #[serde(default, deserialize_with = "bounded::lens_part")]
    pub u: Option<[f32; 2]>,
    /// Up the lens, -1 to 1.
    #[serde(default, deserialize_with = "bounded::lens_part")]
    pub v: Option<[f32; 2]>,
    /// Within the shutter, 0 to 1.
    #[serde(default, deserialize_with = "bounded::part")]
    pub t: Option<[f32; 2]>,
    /// Across the image from its left, 0 to 1.
    #[serde(default, deserialize_with = "bounded::part")]
    pub x: Option<[f32; 2]>,
    /// Down the image from its top, 0 to 1.
    #[serde(default, deserialize_with = "bounded::part")]
    pub y: Option<[f32; 2]>,
}

impl VisibleSpec {
    pub fn clip(&self) -> Option<Clip> {
        let open = |part: Option<[f32; 2]>, [first, last]: [f32; 2]| {
            let [low, high] = part.unwrap_or([first, last]);
            let low = if low <= first { f32::NEG_INFINITY } else { low };
            [low, if high >= last { f32::INFINITY } else { high }]
        };
        let [t, x, y] = [self.t, self.x, self.y].map(|part| open(part, [0.0, 1.0]));
        Clip::new(open(self.u, [-1.0, 1.0]), open(self.v, [-1.0, 1.0]), t)?.across_image(x, y)
    }
}

/// Where an object is at one time; what is left out is the object's own.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectKey {
    #[serde(deserialize_with = "bounded::time")]
    pub time_s: f64,
    #[serde(default, deserialize_with = "bounded::vector")]
    pub position: Option<[f64; 3]>,
    #[serde(default, deserialize_with = "bounded::optional_angles")]
    pub rotation_deg: Option<[f64; 3]>,
    #[serde(default, deserialize_with = "bounded::vector")]
    pub scale: Option<[f64; 3]>,
}

/// Constant rotation.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SpinSpec {
    /// The axis, of any length, in the object's own space.
    #[serde(deserialize_with = "bounded::coordinates")]
    pub axis: [f64; 3],
    /// Turns in a second, right-handed.
    #[serde(deserialize_with = "bounded::turns")]
    pub rate_hz: f64,
}

/// Shapes centred at the object's origin.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum ShapeSpec {
    /// A sphere with that many segments around.
    Sphere {
        #[serde(deserialize_with = "bounded::length")]
        radius: f64,
        #[serde(default = "segments", deserialize_with = "bounded::segments")]
        segments: u32,
    },
    /// A box with those edges.
    Box {
        #[serde(deserialize_with = "bounded::lengths")]
        size: [f64; 3],
    },
    /// A square looking up, in cells x cells quads, its texture repeated that many times along an edge.
    Plane {
        #[serde(deserialize_with = "bounded::length")]
        size: f64,
        #[serde(default = "one", deserialize_with = "bounded::cells")]
        cells: u32,
        #[serde(default = "unit", deserialize_with = "bounded::repeats")]
        tiles: f64,
    },
    /// A torus about y.
    Torus {
        #[serde(deserialize_with = "bounded::length")]
        ring: f64,
        #[serde(deserialize_with = "bounded::length")]
        tube: f64,
        #[serde(default = "segments", deserialize_with = "bounded::segments")]
        segments: u32,
    },
    /// A gear about z.
    Gear {
        #[serde(deserialize_with = "bounded::teeth")]
        teeth: u32,
        #[serde(deserialize_with = "bounded::length")]
        radius: f64,
        #[serde(deserialize_with = "bounded::length")]
        thickness: f64,
    },
    /// A propeller about z.
    Propeller {
        #[serde(deserialize_with = "bounded::blades")]
        blades: u32,
        #[serde(deserialize_with = "bounded::length")]
        radius: f64,
    },
}

fn segments() -> u32 {
    48
}

fn one() -> u32 {
    1
}

fn unit() -> f64 {
    1.0
}

/// Material of a surface.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialSpec {
    /// Reflectance; multiplies the texture. White with a texture, else grey by default.
    #[serde(default, deserialize_with = "bounded::color")]
    pub color: Option<[f32; 3]>,
    /// Opacity; multiplies that of the texture. 1 by default.
    #[serde(default, deserialize_with = "bounded::share")]
    pub opacity: Option<f32>,
    /// Effect of the opacity. By default surfaces with an opacity below 1 are blended.
    pub alpha: Option<Alpha>,
    /// Colour texture; the object needs texture coordinates.
    pub texture: Option<TextureSpec>,
    /// Whether back faces are drawn; so by default.
    #[serde(default = "yes")]
    pub double_sided: bool,
    /// Whether the colour is shown as it is, whatever the light.
    #[serde(default)]
    pub unlit: bool,
}

fn yes() -> bool {
    true
}

/// Source of a texture.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum TextureSpec {
    /// Two by two fields of two colours, with that many texels along an edge.
    Checker {
        #[serde(deserialize_with = "bounded::colors")]
        colors: [[f32; 3]; 2],
        #[serde(default = "texels", deserialize_with = "bounded::texels")]
        texels: u32,
    },
    /// A PNG or JPEG file, relative to the scene file.
    Image { file: String },
}

fn texels() -> u32 {
    256
}
