//! The `.m5d` format: moving triangles with their camera.

use std::iter;
use std::path::Path;

use glam::{Affine3A, DVec3, Vec3};
use pipeline::{Camera, Lens, LensShape, Viewport};

use super::{MovingMesh, VisibilityScene};
use crate::error::LoadError;
use crate::import::reader::{self, Bytes};

/// First bytes of the file.
pub(super) const MAGIC: &[u8; 8] = b"M5DSCN1\0";

const TRIANGLE_BYTES: u64 = 18 * 4;

/// Reads the `.m5d` file at `path`, gzipped or not.
pub(super) fn load(path: &Path) -> Result<VisibilityScene, LoadError> {
    parse(path, &reader::contents(path)?)
}

/// Parses `data`, an uncompressed `.m5d` file; `path` is for messages.
///
/// # Errors
/// [`LoadError`] for a truncated file, or values that do not make a camera or image.
pub fn parse(path: &Path, data: &[u8]) -> Result<VisibilityScene, LoadError> {
    let mut bytes = Bytes::new(path, data, MAGIC)?;
    let (count, _flags) = (bytes.u32()?, bytes.u32()?);
    let (width, height, per_pixel, shape) = (bytes.u32()?, bytes.u32()?, bytes.u32()?, bytes.u32()?);
    let seed = bytes.u64()?;
    let [_vertical_fov, tan_half, radius, focus, near] =
        [bytes.f64()?, bytes.f64()?, bytes.f64()?, bytes.f64()?, bytes.f64()?];
    let viewport = Viewport::new(width, height)
        .ok_or_else(|| bytes.wrong(format!("{width}x{height}: each side has to be 1 to 16384 pixels")))?;
    let shape = match shape {
        0 => LensShape::Disk,
        1 => LensShape::Square,
        other => return Err(bytes.wrong(format!("lens shape {other}; it is 0 for a disk or 1 for a square"))),
    };
    let camera = camera([tan_half, radius, focus, near]).map_err(|message| bytes.wrong(message))?;
    let [open, close] = corners(&mut bytes, count)?;
    let triangles = (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let objects = iter::once(0..count).collect();
    let (fitted, warnings) = (None, Vec::new());
    Ok(VisibilityScene {
        viewport,
        per_pixel,
        seed,
        camera,
        shape,
        open,
        close,
        triangles,
        objects,
        fitted,
        warnings,
    })
}

/// Corners of the triangles at both ends of the shutter.
fn corners(bytes: &mut Bytes<'_>, count: u32) -> Result<[Vec<Vec3>; 2], LoadError> {
    bytes.expect_records(u64::from(count), TRIANGLE_BYTES)?;
    let [mut open, mut close] = [0; 2].map(|_| Vec::with_capacity(3 * count as usize));
    for _ in 0..count {
        for corners in [&mut open, &mut close] {
            for _ in 0..3 {
                corners.push(Vec3::new(bytes.f32()?, bytes.f32()?, bytes.f32()?));
            }
        }
    }
    Ok([open, close])
}

/// The triangles in a right-handed world, for another camera. The file's own camera is at the origin and
/// looks at (0, 0, -1).
pub(super) fn world(scene: &VisibilityScene) -> MovingMesh {
    let mirrored = |points: &[Vec3]| {
        points.iter().map(|p| (*p * Vec3::new(1.0, 1.0, -1.0)).as_dvec3()).collect::<Vec<DVec3>>()
    };
    MovingMesh {
        open: mirrored(&scene.open),
        close: mirrored(&scene.close),
        triangles: scene.triangles.clone(),
    }
}

fn camera([tan_half, radius, focus, near]: [f64; 4]) -> Result<Camera, String> {
    let camera =
        Camera::new(Affine3A::IDENTITY, tan_half as f32, near as f32).map_err(|error| error.to_string())?;
    if radius == 0.0 {
        return Ok(camera);
    }
    let lens = Lens::new(radius as f32, focus as f32).map_err(|error| error.to_string())?;
    Ok(camera.with_lens(Some(lens)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file() -> Vec<u8> {
        let mut data = b"M5DSCN1\0".to_vec();
        for word in [1_u32, 0, 64, 48, 4, 0] {
            data.extend(word.to_le_bytes());
        }
        data.extend(7_u64.to_le_bytes());
        for number in [60.0_f64, 0.577, 0.25, 8.0, 0.1] {
            data.extend(number.to_le_bytes());
        }
        for corner in 0..18 {
            data.extend((corner as f32).to_le_bytes());
        }
        data
    }

    fn message(data: &[u8]) -> String {
        parse(Path::new("a.m5d"), data).unwrap_err().to_string()
    }

    #[test]
    fn a_file_is_read_as_written() {
        let scene = parse(Path::new("a.m5d"), &file()).unwrap();
        assert_eq!(
            (scene.viewport.width(), scene.viewport.height(), scene.per_pixel, scene.seed),
            (64, 48, 4, 7)
        );
        assert_eq!(scene.open[2], Vec3::new(6.0, 7.0, 8.0));
        assert_eq!(scene.close[0], Vec3::new(9.0, 10.0, 11.0));
        assert!(scene.camera.lens().is_some());
    }

    #[test]
    fn broken_files_say_where() {
        let good = file();
        assert!(message(&good[..40]).contains("truncated"));
        assert!(message(&good[..good.len() - 4]).contains("68 bytes follow"));
        assert!(message(b"M5DSMP1\0").contains("M5DSCN1"));
        let mut huge = good.clone();
        huge[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(message(&huge).contains("announced"));
        let mut nan = good.clone();
        nan[80..84].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(message(&nan).contains("byte 84"), "{}", message(&nan));
    }
}
