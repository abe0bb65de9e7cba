//! Scenes made by code.

mod showcase;
mod texture;
mod tiny;

pub(crate) use texture::checker;

use crate::error::LoadError;
use crate::scene::Scene;

type Maker = fn() -> Result<Scene, LoadError>;

const SCENES: [(&str, &str, Maker); 2] = [
    (
        "default",
        "gears, tori, spheres and propellers over a tiled floor: fast motion and deep defocus, 1280x720, 36 frames",
        showcase::scene,
    ),
    ("tiny", "a handful of moving, defocused, textured triangles for tests, 64x48, 4 frames", tiny::scene),
];

/// Names of the built-in scenes, each with a line that says what it is.
pub fn builtin_names() -> impl Iterator<Item = (&'static str, &'static str)> {
    SCENES.iter().map(|(name, description, _)| (*name, *description))
}

/// The built-in scene called `name`, if there is one.
///
/// # Errors
/// None that is expected: the scenes are tested.
pub fn builtin(name: &str) -> Option<Result<Scene, LoadError>> {
    SCENES.iter().find(|(known, ..)| *known == name).map(|(.., make)| make())
}
