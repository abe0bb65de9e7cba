//! Textures made by code.

use pipeline::{Texture, Wrap};

/// A checkerboard of 2 x 2 fields in two sRGB colours, repeating, `side` texels (2 to 4096) along each edge, with a
/// darker joint around each field so that blur shows.
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
