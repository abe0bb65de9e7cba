//! Orthographic views with a known closed form, and as the limit of distant perspective views.

use crate::common::stage::*;
use crate::common::*;
use glam::{Affine3A, Vec3, Vec4};
use pipeline::sampling::Sample;
use pipeline::*;

/// A stage on which `(x, y, z)` appears at `(x, -y)` pixels from the centre of the image.
fn stage(width: u32, height: u32, table: SampleTable) -> Stage {
    let camera = Camera::orthographic(Affine3A::IDENTITY, 0.5 * height as f32, NEAR).unwrap();
    Stage { camera, ..Stage::new(width, height, table) }
}

fn table(per_pixel: u32) -> SampleTable {
    SampleTable::low_discrepancy(per_pixel, 1, LensShape::Disk).unwrap()
}

/// A rectangle of the scene, `x0..x1` by `y0..y1`, with a depth for each position.
fn sheet(x: [f32; 2], y: [f32; 2], depth: impl Fn(f32, f32) -> f32) -> [Vec3; 4] {
    rectangle(x, y, 1.0).map(|p| Vec3::new(p.x, p.y, depth(p.x, p.y)))
}

#[test]
fn a_square_is_as_large_at_any_depth() {
    let stage = stage(40, 24, table(8));
    for depth in [0.5_f32, 3.0, 1e4] {
        let corners = sheet([-8.0, 5.0], [-3.0, 7.0], |_, _| depth);
        for (px, s, id, found) in stage.see(&[still(&corners, &RED)]) {
            let [x, y] = stage.at(px, &s);
            let inside = (-8.0..5.0).contains(&x) && (-3.0..7.0).contains(&y);
            assert_eq!((id < 2, found == depth), (inside, inside), "{x} {y} at {depth}");
        }
    }
}

/// The plane z = x / 2 is visible beyond the near depth; vertices behind the camera plane are not mirrored.
#[test]
fn a_slanted_plane_has_its_depth_and_ends_at_the_near_depth() {
    let stage = stage(40, 24, table(8));
    let corners = sheet([-40.0, 40.0], [-20.0, 20.0], |x, _| 0.5 * x);
    for (px, s, id, depth) in stage.see(&[still(&corners, &RED)]) {
        let x = stage.at(px, &s)[0];
        if (0.5 * x - NEAR).abs() > 1e-5 {
            assert_eq!(id < 2, 0.5 * x > NEAR, "{x}");
            assert!(id >= 2 || (depth - 0.5 * x).abs() < 1e-5, "{x}: {depth}");
        }
    }
}

#[test]
fn a_square_moves_as_far_whatever_its_depth() {
    let stage = stage(40, 24, table(16));
    for depth in [1.0, 16.0] {
        let open = sheet([-8.0, 2.0], [-6.0, 6.0], |_, _| depth);
        let close = open.map(|p| p + Vec3::new(4.0, -2.0, 3.0));
        for (px, s, id, found) in stage.see(&[quad(&open, &close, &RED)]) {
            let [x, y] = stage.at(px, &s);
            let from = [x - 4.0 * s.t, y + 2.0 * s.t];
            let sides = [from[0] + 8.0, 2.0 - from[0], from[1] + 6.0, 6.0 - from[1]];
            let inside = sides.into_iter().fold(f32::INFINITY, f32::min);
            if inside.abs() > 1e-4 {
                assert_eq!(id < 2, inside > 0.0, "{px:?} {s:?}");
                assert!(id >= 2 || (found - (depth + 3.0 * s.t)).abs() < 1e-4, "{found} at {}", s.t);
            }
        }
    }
}

/// x' = x + u R (z / F - 1), to the right and upwards: zero at the focus depth and linear in depth.
#[test]
fn a_lens_shears_by_depth() {
    let lens = [0.5, -0.25];
    let block = vec![Sample { x: 0.5, y: 0.5, u: lens[0], v: lens[1], t: 0.0 }; 64];
    let mut stage = stage(64, 64, repeated(1, &block));
    stage.camera = stage.camera.with_lens(Some(Lens::new(8.0, 8.0).unwrap()));
    for depth in [4.0_f32, 8.0, 24.0] {
        let corners = sheet([-2.0, 2.0], [-2.0, 2.0], |_, _| depth);
        let image = stage.draw(&[still(&corners, &RED)]);
        let moved = lens.map(|place| place * 8.0 * (depth / 8.0 - 1.0));
        let lit: Vec<_> = (0..64 * 64_u32).filter(|&i| image[i as usize].x > 0.0).collect();
        let mean =
            |part: fn(u32) -> u32| lit.iter().map(|&i| part(i) as f32 + 0.5).sum::<f32>() / lit.len() as f32;
        assert_eq!(lit.len(), 16, "depth {depth}");
        assert_eq!([mean(|i| i % 64), mean(|i| i / 64)], [32.0 + moved[0], 32.0 - moved[1]], "depth {depth}");
    }
}

/// A very distant perspective view, through a lens that grows with the distance, gives the same picture.
#[test]
fn an_orthographic_view_is_the_limit_of_distant_perspective() {
    const FAR: f32 = 8192.0;
    let (radius, focus, height) = (1.5, 6.0, 48);
    for moving in [false, true] {
        for lens in [false, true] {
            let mut r = Uniform::new(3);
            let mut corner = || Vec3::new(r.within(-30.0, 30.0), r.within(-20.0, 20.0), r.within(2.0, 12.0));
            let open: Vec<_> = (0..60).map(|_| corner()).collect();
            let close: Vec<_> = open.iter().map(|p| *p + 0.2 * corner()).collect();
            let close = if moving { close } else { open.clone() };
            let triangles: Vec<[u32; 3]> = (0..20).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            let geometry = Geometry::new(&open, &close, &triangles).unwrap();
            let draws = [Draw::new(geometry, &RED, Cull::None)];
            let mut near = stage(64, height, table(8));
            near.camera = near.camera.with_lens(lens.then(|| Lens::new(radius, focus).unwrap()));
            let back = Affine3A::from_translation(Vec3::new(0.0, 0.0, FAR));
            let far = Camera::new(back, 0.5 * height as f32 / FAR, FAR).unwrap();
            let long = || Lens::new(radius * (FAR + focus) / focus, FAR + focus).unwrap();
            let far = Stage { camera: far.with_lens(lens.then(long)), ..stage(64, height, table(8)) };
            let (near, far) = (near.see(&draws), far.see(&draws));
            let hits = near.iter().filter(|seen| seen.2 != u32::MAX).count();
            let differ = near.iter().zip(&far).filter(|(near, far)| near.2 != far.2).count();
            println!("moving {moving}, lens {lens}: {differ} of {hits} hits differ");
            assert!(hits > 5_000 && differ < hits / 50, "moving {moving}, lens {lens}: {differ} of {hits}");
        }
    }
}

/// A shader of the position and of the direction to the viewer.
struct Placed;

impl Shader for Placed {
    fn shade(&self, _lane: &Lane, at: &ShadingPoint, _texel: Vec4) -> Vec4 {
        // Everything is seen from the same side.
        if at.to_camera == Vec3::NEG_Z { at.position.extend(1.0) } else { Vec4::NAN }
    }
}

/// A cell is shaded at the surface point that its centre sees, and so is each sample.
#[test]
fn surfaces_are_shaded_at_their_visible_points() {
    let block = vec![Sample { x: 0.5, y: 0.5, u: 0.0, v: 0.0, t: 0.5 }; 64];
    let mut stage = stage(32, 32, repeated(1, &block));
    let depth = |x: f32, y: f32| 20.0 + 0.25 * x - 0.5 * y;
    let open = sheet([-40.0, 40.0], [-30.0, 30.0], depth);
    let close = open.map(|p| p + Vec3::new(1.0, 2.0, 0.0));
    for (lens, end) in [(None, &open), (Lens::new(4.0, 9.0).ok(), &open), (None, &close)] {
        stage.camera = stage.camera.with_lens(lens);
        for shading in [Shading::Cached, Shading::PerSample] {
            let spec = PipelineSpec { shading, ..spec(Features::ALL) };
            let settings = Settings {
                spec: &spec,
                viewport: stage.viewport,
                samples: &stage.table,
                background: Vec3::ZERO,
            };
            let geometry = Geometry::new(&open, end, &QUAD).unwrap();
            let draws = [Draw::new(geometry, &Placed, Cull::None)];
            let image =
                RasterPass::new(&stage.camera, &draws, &settings).render(|_, _| ()).unwrap().into_image();
            let moved = 0.5 * (end[0] - open[0]);
            for (i, found) in (0_u32..).zip(&image) {
                let [x, y] = [(i % 32) as f32 - 15.5, 15.5 - (i / 32) as f32];
                let expected = Vec3::new(x, y, depth(x - moved.x, y - moved.y));
                assert!((*found - expected).length() < 1e-3, "{lens:?} {shading:?} {found} {expected}");
            }
        }
    }
}

#[test]
fn a_moving_camera_is_a_scene_that_moves_the_other_way() {
    let corners = sheet([-8.0, 8.0], [-5.0, 5.0], |x, y| 8.0 + 0.25 * x + 0.5 * y);
    let way = Vec3::new(-0.5, 2.0, 0.25);
    let mut fixed = stage(64, 40, table(4));
    fixed.camera = fixed.camera.with_lens(Lens::new(8.0, 2.0).ok());
    let moving_scene = fixed.see(&[quad(&corners, &corners.map(|p| p + way), &RED)]);
    fixed.camera = fixed.camera.moving(Affine3A::IDENTITY, Affine3A::from_translation(way)).unwrap();
    let moving_camera = fixed.see(&[still(&corners, &RED)]);
    assert!(moving_scene == moving_camera);
    assert!(moving_scene.iter().filter(|seen| seen.2 != u32::MAX).count() > 500);
}
