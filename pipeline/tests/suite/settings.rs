//! Invalid settings are refused with a message that names the field and the allowed values.

use crate::common::*;
use glam::{Affine3A, Vec2, Vec3};
use pipeline::frame::PipelineSpecError;
use pipeline::sampling::{Sample, SampleTableError};
use pipeline::*;

fn refused(change: impl FnOnce(&mut PipelineSpec)) -> PipelineSpecError {
    let mut spec = spec(Features::ALL);
    spec.validate().unwrap();
    change(&mut spec);
    spec.validate().unwrap_err()
}

#[test]
fn invalid_sizes_are_reported_with_the_allowed_values() {
    for (found, field) in [
        (refused(|s| s.tile_px = 0), "tile_px"),
        (refused(|s| s.tile_px = 3), "tile_px"),
        (refused(|s| s.tile_px = 16), "tile_px"),
        (refused(|s| s.coarse_tile_px = 0), "coarse_tile_px"),
        (refused(|s| s.coarse_tile_px = 12), "coarse_tile_px"),
        (refused(|s| s.coarse_tile_px = 264), "coarse_tile_px"),
        (refused(|s| s.coarse_tile_px = u32::MAX), "coarse_tile_px"),
        (refused(|s| s.batch_triangles = 0), "batch_triangles"),
        (refused(|s| s.batch_triangles = (1 << 24) + 1), "batch_triangles"),
        (refused(|s| s.vertex_reuse = 0), "vertex_reuse"),
        (refused(|s| s.vertex_reuse = 4097), "vertex_reuse"),
        (refused(|s| s.depth.boxes = [1, 0, 1]), "depth.boxes"),
        (refused(|s| s.depth.boxes = [1, 1, 17]), "depth.boxes"),
    ] {
        assert!(matches!(found, PipelineSpecError::Size { field: named, .. } if named == field), "{found:?}");
        let text = found.to_string();
        assert!(text.starts_with(&format!("`{field}` is ")) && text.contains("it has to be"), "{text}");
    }
}

#[test]
fn caches_that_cannot_be_are_named() {
    let odd = CacheSpec::lru(9, 4);
    let none = CacheSpec::lru(0, 1);
    let no_way = CacheSpec::lru(8, 0);
    for (found, field) in [
        (refused(|s| s.shading_cache = odd), "shading_cache"),
        (refused(|s| s.memory.depth = none), "memory.depth"),
        (refused(|s| s.memory.colour = no_way), "memory.colour"),
        (refused(|s| s.memory.texture = odd), "memory.texture"),
        (refused(|s| s.memory.l2 = CacheSpec::lru(u32::MAX, 1)), "memory.l2"),
    ] {
        assert!(
            matches!(found, PipelineSpecError::Cache { field: named, .. } if named == field),
            "{found:?}"
        );
        assert!(found.to_string().starts_with(&format!("`{field}`: a cache of ")), "{found}");
    }
}

#[test]
fn the_limits_themselves_are_accepted() {
    for (tile_px, coarse_tile_px) in [(1, 1), (1, 256), (2, 6), (4, 4), (8, 256)] {
        let limits = PipelineSpec { tile_px, coarse_tile_px, ..spec(Features::ALL) };
        assert_eq!(limits.validate(), Ok(()));
    }
    let large = PipelineSpec { batch_triangles: 1 << 24, vertex_reuse: 4096, ..spec(Features::NONE) };
    assert_eq!(large.validate(), Ok(()));
}

#[test]
fn a_cache_that_cannot_be_is_an_error_to_the_renderer_not_a_panic() {
    let mut bad = spec(Features::ALL);
    bad.memory.depth = CacheSpec::lru(7, 2);
    let table = SampleTable::low_discrepancy(1, 1, LensShape::Disk).unwrap();
    let viewport = Viewport::new(4, 4).unwrap();
    let settings = Settings { spec: &bad, viewport, samples: &table, background: Vec3::ZERO };
    assert!(RasterPass::new(&camera(false), &[], &settings).render(|_, _| ()).is_err());
    assert!(RasterPass::new(&camera(false), &[], &settings).visibility().is_err());
}

#[test]
fn an_unknown_field_of_a_cache_is_reported_with_its_neighbour() {
    let error = activity::spec::parse::<CacheSpec>("(entries: 8, weys: 2)", "gpu.ron").unwrap_err();
    assert!(error.to_string().contains("did you mean `ways`?"), "{error}");
}

fn programmed(change: impl FnOnce(&mut Vec<Sample>)) -> Result<SampleTable, SampleTableError> {
    let mut samples = vec![Sample { x: 0.5, y: 0.5, u: 0.0, v: 0.0, t: 0.5 }; 64 * 64];
    change(&mut samples);
    SampleTable::programmed(1, 0, samples)
}

#[test]
fn a_sample_outside_pixel_lens_or_shutter_is_reported_by_its_place() {
    assert!(programmed(|_| ()).is_ok());
    let bad: [fn(&mut Sample); 10] = [
        |s| s.x = 1.0,
        |s| s.x = -f32::EPSILON,
        |s| s.y = 1.0,
        |s| s.y = f32::NAN,
        |s| s.u = 1.000_000_2,
        |s| s.u = f32::NAN,
        |s| s.v = -1.000_000_2,
        |s| s.v = f32::INFINITY,
        |s| s.t = 1.0,
        |s| s.t = -0.25,
    ];
    for (place, spoil) in (0..).step_by(100).zip(bad) {
        let error = programmed(|samples| spoil(&mut samples[place])).unwrap_err();
        assert_eq!(error, SampleTableError::Range(place));
        assert!(error.to_string().contains(&format!("sample {place} ")), "{error}");
    }
    let good: [fn(&mut Sample); 4] =
        [|s| (s.x, s.y) = (0.0, 0.0), |s| (s.u, s.v) = (1.0, -1.0), |s| s.t = 0.0, |s| s.t = 0.999_999_94];
    assert!(good.into_iter().all(|limit| programmed(|samples| limit(&mut samples[5])).is_ok()));
}

#[test]
fn a_block_of_samples_has_to_be_filled() {
    let error = programmed(|samples| samples.truncate(4095)).unwrap_err();
    assert_eq!(error, SampleTableError::Length { found: 4095, expected: 4096 });
    assert!(error.to_string().contains("4095") && error.to_string().contains("4096"), "{error}");
    assert_eq!(
        programmed(|s| s.push(s[0])).unwrap_err(),
        SampleTableError::Length { found: 4097, expected: 4096 }
    );
    for per_pixel in [0, 257, u32::MAX] {
        let error = SampleTable::programmed(per_pixel, 0, Vec::new()).unwrap_err();
        assert_eq!(error, SampleTableError::PerPixel(per_pixel));
        assert!(error.to_string().contains("1 to 256"), "{error}");
    }
}

const CORNERS: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];
const FACE: [[u32; 3]; 1] = [[0, 1, 2]];

#[test]
fn arrays_over_the_same_vertices_have_the_same_length() {
    let geometry = Geometry::new(&CORNERS, &CORNERS, &FACE).unwrap();
    for (error, what, found) in [
        (Geometry::new(&CORNERS, &CORNERS[..2], &FACE).unwrap_err(), "the closing positions", 2),
        (geometry.with_normals(&CORNERS[..1]).unwrap_err(), "the normals", 1),
        (geometry.with_uvs(&[]).unwrap_err(), "the texture coordinates", 0),
    ] {
        assert_eq!(error, DrawError::Length { what, found, expected: 3 });
        assert!(error.to_string().contains(&format!("{what} has {found} entries for 3")), "{error}");
    }
}

#[test]
fn values_that_are_not_finite_are_reported_by_their_vertex() {
    let spoilt = |bad: f32| [Vec3::ZERO, Vec3::X, Vec3::new(0.0, bad, 0.0)];
    let geometry = Geometry::new(&CORNERS, &CORNERS, &FACE).unwrap();
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let corners = spoilt(bad);
        for (error, named) in [
            (Geometry::new(&corners, &corners, &FACE).unwrap_err(), "position at the opening"),
            (Geometry::new(&CORNERS, &corners, &FACE).unwrap_err(), "position at the closing"),
            (geometry.with_normals(&corners).unwrap_err(), "normal"),
            (
                geometry.with_uvs(&[Vec2::ZERO, Vec2::ZERO, Vec2::new(bad, 0.0)]).unwrap_err(),
                "texture coordinate",
            ),
        ] {
            assert_eq!(error, DrawError::NotFinite { what: named, vertex: 2 });
            assert!(error.to_string().contains("vertex 2"), "{error}");
        }
    }
}

#[test]
fn an_index_beyond_the_vertices_is_refused_whichever_corner_names_it() {
    for corner in 0..3 {
        for vertex in [3, u32::MAX] {
            let mut faces = [[0, 1, 2], [2, 1, 0]];
            faces[1][corner] = vertex;
            let error = Geometry::new(&CORNERS, &CORNERS, &faces).unwrap_err();
            assert_eq!(error, DrawError::Index { triangle: 1, vertex, vertices: 3 });
        }
    }
    assert!(Geometry::new(&[], &[], &FACE).is_err());
    assert!(Geometry::new(&[], &[], &[]).is_ok());
}

#[test]
fn a_camera_that_is_not_finite_is_refused() {
    let camera = camera(false);
    let nan = Affine3A::from_translation(Vec3::new(0.0, f32::NAN, 0.0));
    assert!(camera.moving(Affine3A::IDENTITY, nan).is_err());
    assert!(camera.moving(nan, Affine3A::IDENTITY).is_err());
    assert!(camera.with_shift(Vec2::new(f32::INFINITY, 0.0)).is_err());
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        for error in [
            Camera::new(Affine3A::IDENTITY, bad, 0.1).unwrap_err(),
            Camera::new(Affine3A::IDENTITY, 0.5, bad).unwrap_err(),
            Camera::orthographic(Affine3A::IDENTITY, bad, 0.1).unwrap_err(),
            Camera::orthographic(Affine3A::IDENTITY, 0.5, bad).unwrap_err(),
            Lens::new(bad, 1.0).unwrap_err(),
            Lens::new(0.1, bad).unwrap_err(),
        ] {
            assert!(error.to_string().contains("has to be a finite number above zero"), "{error}");
        }
    }
}

/// Finite but extreme numbers make a poor image and no panic.
#[test]
fn absurd_numbers_do_not_panic() {
    let sizes = [f32::MAX, 1e30, 1e19, 1e-19, 1e-38, f32::MIN_POSITIVE / 1e3];
    let table = SampleTable::low_discrepancy(2, 1, LensShape::Disk).unwrap();
    let viewport = Viewport::new(17, 9).unwrap();
    let mut r = Uniform::new(2);
    for size in sizes {
        for lens in [None, Lens::new(1e30, 1e-30).ok(), Lens::new(1e-30, 1e30).ok()] {
            let mut point = || [0; 3].map(|_| r.within(-1.0, 1.0) * size);
            let open: Vec<_> = (0..60).map(|_| Vec3::from(point())).collect();
            let close: Vec<_> = (0..60).map(|_| Vec3::from(point())).collect();
            let triangles: Vec<_> = (0..20).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            let geometry = Geometry::new(&open, &close, &triangles).unwrap();
            let draws = [Draw::new(geometry, &Plain, Cull::Back)];
            let flat = |half| Camera::orthographic(Affine3A::IDENTITY, half, 0.25).unwrap();
            for (features, camera) in [Features::ALL, Features::NONE]
                .into_iter()
                .flat_map(|features| [camera(false), flat(1.0), flat(size)].map(|one| (features, one)))
            {
                let spec = spec(features);
                let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
                let rendered =
                    RasterPass::new(&camera.with_lens(lens), &draws, &settings).render(|_, _| ()).unwrap();
                assert_eq!(rendered.images[0].len(), 17 * 9);
            }
        }
    }
}
