//! Golden images: small frames compared with stored ones to the last bit.
//!
//! `golden/NAME.ppm` is the image in sRGB, for viewing. Its comment line is a digest of the exact radiances,
//! depths and triangles. After an intended change, `QUINTILE_BLESS=1 cargo test -p pipeline --test suite --
//! golden` rewrites the files; review them before committing.

use std::fmt::Write as _;
use std::path::PathBuf;

use crate::common::*;
use glam::{Vec2, Vec3, Vec4};
use pipeline::random::mix;
use pipeline::*;

const SIDE_PX: u32 = 32;

/// A textured surface lit from above the camera.
struct Lit(Texture);

impl Shader for Lit {
    fn texture(&self) -> Option<&Texture> {
        Some(&self.0)
    }

    fn shade(&self, _lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        let light = Vec3::new(0.25, 0.75, -0.5).normalize();
        (texel.truncate() * (0.2 + 0.8 * at.normal.dot(light).max(0.0))).extend(1.0)
    }
}

fn checker() -> Texture {
    let texel = |i: u32| {
        let (x, y) = (i % 16, i / 16);
        if (x / 4 + y / 4) % 2 == 0 {
            [230, 120 + 8 * x as u8, 40, 255]
        } else {
            [30, 60, 90 + 10 * y as u8, 255]
        }
    };
    Texture::from_srgb8(16, 16, (0..256).map(texel).collect(), [Wrap::Repeat; 2]).unwrap()
}

/// A pyramid over a floor, at one end of the shutter.
fn pyramid(turn: f32, lift: Vec3) -> Vec<Vec3> {
    let (sin, cos) = (libm::sinf(turn), libm::cosf(turn));
    let turned = |x: f32, y: f32, z: f32| Vec3::new(cos * x + sin * z, y, cos * z - sin * x) + lift;
    vec![
        turned(-1.0, -0.7, -1.0),
        turned(1.0, -0.7, -1.0),
        turned(1.0, -0.7, 1.0),
        turned(-1.0, -0.7, 1.0),
        turned(0.0, 1.1, 0.0),
    ]
}

const SIDES: [[u32; 3]; 4] = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];

/// The image as text; the comment line is a digest of the exact values.
fn image(moving: bool, lens: bool, textured: bool) -> String {
    let open = pyramid(0.4, Vec3::new(0.0, 0.0, 5.0));
    let close = if moving { pyramid(0.9, Vec3::new(0.5, 0.25, 4.5)) } else { open.clone() };
    let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y, Vec2::new(0.5, 0.3)].map(|uv| uv * 1.7);
    let floor = [(-6.0, 2.0), (6.0, 2.0), (6.0, 14.0), (-6.0, 14.0)].map(|(x, z)| Vec3::new(x, -0.9, z));
    let floor_uvs = [Vec2::ZERO, Vec2::X * 4.0, Vec2::splat(4.0), Vec2::Y * 4.0];
    let lit = Lit(checker());
    let shader: &dyn Shader = if textured { &lit } else { &Plain };
    let mut solid = Geometry::new(&open, &close, &SIDES).unwrap();
    let mut ground = Geometry::new(&floor, &floor, &QUAD).unwrap();
    if textured {
        solid = solid.with_uvs(&uvs).unwrap();
        ground = ground.with_uvs(&floor_uvs).unwrap();
    }
    let draws = [solid, ground].map(|geometry| Draw::new(geometry, shader, Cull::None));
    let table = SampleTable::low_discrepancy(8, 42, LensShape::Disk).unwrap();
    let spec = spec(Features::ALL);
    let viewport = Viewport::new(SIDE_PX, SIDE_PX).unwrap();
    let background = Vec3::new(0.3, 0.5, 0.8);
    let settings = Settings { spec: &spec, viewport, samples: &table, background };
    let camera = camera(false).with_lens(lens.then(|| Lens::new(0.3, 5.0).unwrap()));
    let rendered = RasterPass::new(&camera, &draws, &settings).render(|_, _| ()).unwrap();
    let seen = RasterPass::new(&camera, &draws, &settings).visibility().unwrap();
    text(&rendered.images[0], &seen)
}

fn text(image: &[Vec3], seen: &[(u32, u32)]) -> String {
    let colours = image.iter().flat_map(|pixel| pixel.to_array().map(f32::to_bits));
    let words = colours.chain(seen.iter().flat_map(|&(id, depth)| [id, depth]));
    let digest = words.fold(0_u64, |digest, word| mix(digest.rotate_left(7) ^ u64::from(word)));
    let mut text = format!("P3\n# radiances, triangles and depths: {digest:016x}\n{SIDE_PX} {SIDE_PX} 255\n");
    for pixel in image {
        let [r, g, b] = pixel.to_array().map(linear_to_srgb8);
        writeln!(text, "{r} {g} {b}").unwrap();
    }
    text
}

fn check(name: &str, found: &str) {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/{name}.ppm"));
    if std::env::var_os("QUINTILE_BLESS").is_some_and(|value| value == "1") {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, found).unwrap();
    }
    let rewrite = "QUINTILE_BLESS=1 cargo test -p pipeline --test suite golden rewrites it";
    let stored = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}; {rewrite}", path.display()));
    let differ: Vec<_> = stored.lines().zip(found.lines()).enumerate().filter(|(_, (a, b))| a != b).collect();
    let Some((line, (old, new))) = differ.iter().find(|(line, _)| *line > 2).or(differ.first()) else {
        assert_eq!(stored.lines().count(), found.lines().count(), "{}", path.display());
        return;
    };
    let pixels = differ.iter().filter(|(line, _)| *line > 2).count();
    let place = match line.checked_sub(3) {
        Some(pixel) => format!("first at pixel {}, {}", pixel % SIDE_PX as usize, pixel / SIDE_PX as usize),
        None => "in bits too small to see".to_owned(),
    };
    panic!(
        "{}: {pixels} pixels differ, {place}: stored `{old}`, found `{new}`; if that is intended, {rewrite}",
        path.display()
    );
}

#[test]
fn a_still_scene_through_a_pinhole() {
    check("still-pinhole-2d", &image(false, false, false));
}

#[test]
fn a_moving_scene_through_a_pinhole() {
    check("moving-pinhole-3d", &image(true, false, false));
}

#[test]
fn a_moving_textured_scene_through_a_lens() {
    check("moving-lens-textured-5d", &image(true, true, true));
}
