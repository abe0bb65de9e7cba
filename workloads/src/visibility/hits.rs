//! What each sample sees, as a file.

use std::io::{self, Write};

use pipeline::Viewport;

/// Writes the triangle of each sample (`u32::MAX` for none) and its depth (infinite for none), both in the order of
/// `(py * width + px) * per_pixel + s`.
///
/// # Errors
/// Those of `out`.
pub fn write_hits(
    viewport: Viewport,
    per_pixel: u32,
    triangles: &[u32],
    depths: &[f32],
    out: &mut dyn Write,
) -> io::Result<()> {
    out.write_all(b"M5DHIT1\0")?;
    for word in [viewport.width(), viewport.height(), per_pixel, 0] {
        out.write_all(&word.to_le_bytes())?;
    }
    for triangle in triangles {
        out.write_all(&triangle.to_le_bytes())?;
    }
    for depth in depths {
        out.write_all(&depth.to_le_bytes())?;
    }
    Ok(())
}
