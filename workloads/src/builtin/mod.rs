//! Built-in scenes.

use pipeline::{Texture, Wrap};

use crate::error::LoadError;
use crate::scene::Scene;

mod showcase;
mod tiny;

type Maker = fn() -> Result<Scene, LoadError>;

const SCENES: [(&str, &str, Maker); 2] = [
    (
        "default",
        "gears, tori, spheres and propellers over a tiled floor: fast motion and deep defocus, 1280x720, 36 frames",
        showcase::scene,
    ),
    ("tiny", "a handful of moving, defocused, textured triangles for tests, 64x48, 4 frames", tiny::scene),
];

/// Names of the built-in scenes, each with a description in a line.
pub fn builtin_names() -> impl Iterator<Item = (&'static str, &'static str)> {
    SCENES.iter().map(|(name, description, _)| (*name, *description))
}

/// The built-in scene with a name, if it exists.
///
/// # Errors
/// None are expected: the scenes are tested.
pub fn builtin(name: &str) -> Option<Result<Scene, LoadError>> {
    SCENES.iter().find(|(known, ..)| *known == name).map(|(.., make)| make())
}

/// A repeating checkerboard of 2 x 2 fields in two sRGB colours, `side` texels (2 to 4096) along each edge. A
/// darker joint around each field makes blur visible.
pub fn checker(side: u32, colors: [[u8; 3]; 2]) -> Option<Texture> {
    let side = side.clamp(2, 4096) / 2 * 2;
    let (field, joint) = (side / 2, side / 64);
    let texel = |x: u32, y: u32| {
        let color = colors[((x / field + y / field) % 2) as usize];
        let edge = |at: u32| at % field < joint || at % field >= field - joint;
        let shade = if joint > 0 && (edge(x) || edge(y)) { 3 } else { 4 };
        let [r, g, b] = color.map(|channel| (u16::from(channel) * shade / 4) as u8);
        [r, g, b, 255]
    };
    let texels = (0..side).flat_map(|y| (0..side).map(move |x| texel(x, y))).collect();
    Texture::from_srgb8(side, side, texels, [Wrap::Repeat; 2]).ok()
}
