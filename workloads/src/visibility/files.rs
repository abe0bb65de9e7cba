//! Files of moving triangles. `.m5d`: with their camera. `.mts`: two instants of a scene of many objects,
//! used for public collision detection data. Little endian: `MTS1`, bytes per scalar (4 or 8), number of
//! objects, zero; for each object its numbers of vertices and triangles; then, object after object, positions
//! at time 0, positions at time 1, indices.

use std::iter;
use std::path::Path;

use glam::{Affine3A, DVec3, Vec3};
use pipeline::{Camera, Lens, LensShape, Viewport};

use super::{MovingMesh, VisibilityScene};
use crate::error::LoadError;
use crate::import::reader::{self, Bytes};

/// First bytes of the file.
pub(super) const M5D_MAGIC: &[u8; 8] = b"M5DSCN1\0";

const M5D_TRIANGLE_BYTES: u64 = 18 * 4;

/// Reads the `.m5d` file at `path`, gzipped or not.
pub(super) fn load(path: &Path) -> Result<VisibilityScene, LoadError> {
    parse_m5d(path, &reader::contents(path)?)
}

/// Parses `data`, an uncompressed `.m5d` file; `path` is for messages.
///
/// # Errors
/// [`LoadError`] for a truncated file, or values that do not make a camera or image.
pub fn parse_m5d(path: &Path, data: &[u8]) -> Result<VisibilityScene, LoadError> {
    let mut bytes = Bytes::new(path, data, M5D_MAGIC)?;
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
    let [open, close] = both_ends(&mut bytes, count)?;
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
fn both_ends(bytes: &mut Bytes<'_>, count: u32) -> Result<[Vec<Vec3>; 2], LoadError> {
    bytes.expect_records(u64::from(count), M5D_TRIANGLE_BYTES)?;
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

/// First bytes of the file.
pub(super) const MTS_MAGIC: &[u8; 4] = b"MTS1";

/// Bytes of the sizes of one object.
const ENTRY_BYTES: u64 = 8;
/// Bytes of the indices of one triangle.
const TRIANGLE_BYTES: u64 = 12;

/// Numbers of vertices and triangles of one object.
type Size = [u32; 2];

/// Reads the objects of the `.mts` file at `path`, gzipped or not. Values are exact, as `f64` contains every
/// `f32`.
///
/// # Errors
/// [`LoadError`] if the file cannot be read, is damaged or truncated, or has values that are not finite or
/// indices out of range.
pub fn load_mts(path: &Path) -> Result<Vec<MovingMesh>, LoadError> {
    parse_mts(path, &reader::contents(path)?)
}

/// Parses `data`, which is uncompressed; `path` is for messages. Allocates memory for the actual content
/// only, whatever the header announces.
///
/// # Errors
/// As [`load_mts`].
pub fn parse_mts(path: &Path, data: &[u8]) -> Result<Vec<MovingMesh>, LoadError> {
    let mut bytes = Bytes::new(path, data, MTS_MAGIC)?;
    let (scalar_bytes, objects, reserved) = (bytes.u32()?, bytes.u32()?, bytes.u32()?);
    let scalar: Scalar = match scalar_bytes {
        4 => |bytes| bytes.take().map(|raw| f64::from(f32::from_le_bytes(raw))),
        8 => |bytes| bytes.take().map(f64::from_le_bytes),
        other => {
            return Err(bytes.wrong_in("byte 4", format!("scalars of {other} bytes; they have to be 4 or 8")));
        }
    };
    if reserved != 0 {
        return Err(
            bytes.wrong_in("byte 12", format!("{reserved}, where a zero has to be; is it another version?"))
        );
    }
    let sizes = sizes(&mut bytes, objects)?;
    expect(&bytes, &sizes, scalar_bytes)?;
    sizes.iter().enumerate().map(|(object, size)| read_object(&mut bytes, object, *size, scalar)).collect()
}

/// Reads one coordinate.
type Scalar = fn(&mut Bytes<'_>) -> Result<f64, LoadError>;

fn sizes(bytes: &mut Bytes<'_>, objects: u32) -> Result<Vec<Size>, LoadError> {
    if u64::from(objects) * ENTRY_BYTES > bytes.remaining() {
        let remaining = bytes.remaining();
        let message =
            format!("{objects} objects are announced, but only {remaining} bytes follow; get the file again");
        return Err(bytes.wrong_in("byte 8", message));
    }
    (0..objects).map(|_| Ok([bytes.u32()?, bytes.u32()?])).collect()
}

/// Checks that exactly the announced content follows.
fn expect(bytes: &Bytes<'_>, sizes: &[Size], scalar_bytes: u32) -> Result<(), LoadError> {
    let vertex_bytes = 2 * 3 * u128::from(scalar_bytes);
    let mut needed = 0;
    let remaining = u128::from(bytes.remaining());
    for (object, [vertices, triangles]) in sizes.iter().enumerate() {
        needed += u128::from(*vertices) * vertex_bytes + u128::from(*triangles) * u128::from(TRIANGLE_BYTES);
        if needed > remaining {
            let message = format!(
                "its {vertices} vertices and {triangles} triangles end at byte {needed} after the header, \
                 but only {remaining} follow; the file is truncated: get it again"
            );
            return Err(bytes.wrong_in(format!("object {object}"), message));
        }
    }
    if needed == remaining {
        return Ok(());
    }
    let message =
        format!("{remaining} bytes follow the header, but its objects have {needed}; get the file again");
    Err(bytes.wrong(message))
}

fn read_object(
    bytes: &mut Bytes<'_>,
    object: usize,
    size: Size,
    scalar: Scalar,
) -> Result<MovingMesh, LoadError> {
    let [vertices, triangles] = size;
    let mut positions = |when: &str| {
        (0..vertices)
            .map(|vertex| {
                let position = DVec3::new(scalar(bytes)?, scalar(bytes)?, scalar(bytes)?);
                if position.is_finite() {
                    return Ok(position);
                }
                let message = format!(
                    "vertex {vertex} at time {when} is {position}, which is not finite; fix the file"
                );
                Err(bytes.wrong_in(format!("object {object}"), message))
            })
            .collect::<Result<Vec<_>, _>>()
    };
    let (open, close) = (positions("0")?, positions("1")?);
    let triangles = (0..triangles).map(|triangle| corners(bytes, object, triangle, vertices));
    let triangles = triangles.collect::<Result<_, _>>()?;
    Ok(MovingMesh { open, close, triangles })
}

fn corners(
    bytes: &mut Bytes<'_>,
    object: usize,
    triangle: u32,
    vertices: u32,
) -> Result<[u32; 3], LoadError> {
    let corners = [bytes.u32()?, bytes.u32()?, bytes.u32()?];
    match corners.iter().find(|&&vertex| vertex >= vertices) {
        None => Ok(corners),
        Some(vertex) => {
            let message = format!(
                "triangle {triangle} uses vertex {vertex}, but there are only {vertices}; fix the file"
            );
            Err(bytes.wrong_in(format!("object {object}"), message))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Objects of one triangle each; object `i` is shifted by `i` and moves by one along y.
    fn file(objects: u32, scalar_bytes: u32) -> Vec<u8> {
        let mut data = MTS_MAGIC.to_vec();
        [scalar_bytes, objects, 0].iter().for_each(|word| data.extend(word.to_le_bytes()));
        (0..objects).for_each(|_| [3_u32, 1].iter().for_each(|word| data.extend(word.to_le_bytes())));
        for object in 0..objects {
            for end in [0.0, 1.0] {
                for [x, y] in [[0.1, 0.0], [1.0, 0.0], [0.0, 1.0]] {
                    for number in [x + f64::from(object), y + end, 0.0] {
                        match scalar_bytes {
                            4 => data.extend((number as f32).to_le_bytes()),
                            _ => data.extend(number.to_le_bytes()),
                        }
                    }
                }
            }
            [0_u32, 1, 2].iter().for_each(|word| data.extend(word.to_le_bytes()));
        }
        data
    }

    fn parse(data: &[u8]) -> Result<Vec<MovingMesh>, LoadError> {
        parse_mts(Path::new("a.mts"), data)
    }

    fn assert_message(data: &[u8], parts: &[&str]) {
        let error = parse(data).unwrap_err();
        assert!(!error.is_usage());
        let text = error.to_string();
        for part in ["a.mts: "].iter().chain(parts) {
            assert!(text.contains(part), "`{part}` is not in: {text}");
        }
    }

    #[test]
    fn objects_are_read_as_written_in_either_precision() {
        for (scalar_bytes, tenth) in [(4, f64::from(0.1_f32)), (8, 0.1)] {
            let objects = parse(&file(2, scalar_bytes)).unwrap();
            assert_eq!(objects.len(), 2);
            assert_eq!(objects[0].open[0], DVec3::new(tenth, 0.0, 0.0));
            assert_eq!(objects[1].open[1], DVec3::new(2.0, 0.0, 0.0));
            assert_eq!(objects[1].close[2], DVec3::new(1.0, 2.0, 0.0));
            assert_eq!(objects[1].triangles, [[0, 1, 2]]);
        }
        assert_eq!(parse(&file(0, 8)).unwrap(), []);
    }

    #[test]
    fn broken_headers_say_where() {
        let good = file(2, 8);
        assert_message(b"MTS", &["truncated"]);
        assert_message(b"MTS2....", &["does not start with `MTS1`"]);
        assert_message(&good[..10], &["byte 8", "truncated"]);
        for (at, word, parts) in [
            (4, 2, ["byte 4: scalars of 2 bytes", "4 or 8"]),
            (8, u32::MAX, ["byte 8: 4294967295 objects", "328 bytes follow"]),
            (12, 7, ["byte 12: 7", "zero"]),
            (16, u32::MAX, ["object 0: its 4294967295 vertices", "truncated"]),
            (28, u32::MAX, ["object 1: its 3 vertices and 4294967295 triangles", "truncated"]),
            (8, 1, ["byte 24: 320 bytes follow", "have 156"]),
        ] {
            let mut data = good.clone();
            data[at..at + 4].copy_from_slice(&u32::to_le_bytes(word));
            assert_message(&data, &parts);
        }
    }

    #[test]
    fn broken_bodies_say_where() {
        let good = file(2, 8);
        assert_message(&good[..good.len() - 1], &["object 1", "only 311 follow", "get it again"]);
        assert_message(&[good.as_slice(), &[0]].concat(), &["313 bytes follow", "have 312"]);
        let (first, second) = (32, 32 + 156);
        let mut nan = good.clone();
        nan[second + 72 + 24..second + 72 + 32].copy_from_slice(&f64::NAN.to_le_bytes());
        assert_message(&nan, &["object 1: vertex 1 at time 1 is [NaN, 1, 0]", "fix"]);
        let mut index = good;
        index[first + 144 + 8..first + 144 + 12].copy_from_slice(&3_u32.to_le_bytes());
        assert_message(&index, &["object 0: triangle 0 uses vertex 3, but there are only 3", "fix"]);
    }

    fn m5d() -> Vec<u8> {
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

    fn m5d_message(data: &[u8]) -> String {
        parse_m5d(Path::new("a.m5d"), data).unwrap_err().to_string()
    }

    #[test]
    fn an_m5d_file_is_read_as_written() {
        let scene = parse_m5d(Path::new("a.m5d"), &m5d()).unwrap();
        assert_eq!(
            (scene.viewport.width(), scene.viewport.height(), scene.per_pixel, scene.seed),
            (64, 48, 4, 7)
        );
        assert_eq!(scene.open[2], Vec3::new(6.0, 7.0, 8.0));
        assert_eq!(scene.close[0], Vec3::new(9.0, 10.0, 11.0));
        assert!(scene.camera.lens().is_some());
    }

    #[test]
    fn broken_m5d_files_say_where() {
        let good = m5d();
        assert!(m5d_message(&good[..40]).contains("truncated"));
        assert!(m5d_message(&good[..good.len() - 4]).contains("68 bytes follow"));
        assert!(m5d_message(b"M5DSMP1\0").contains("M5DSCN1"));
        let mut huge = good.clone();
        huge[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(m5d_message(&huge).contains("announced"));
        let mut nan = good.clone();
        nan[80..84].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(m5d_message(&nan).contains("byte 84"), "{}", m5d_message(&nan));
    }
}
