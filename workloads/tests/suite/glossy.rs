//! Glossy reflection and refraction on planar receivers.

use glam::{DVec3, Vec3};
use pipeline::sampling::SampleSource;
use pipeline::{Cull, Draw, Geometry, Gpu, LensShape, SampleSpec, SampleTable};
use workloads::Overrides;
use workloads::accumulation::{RayCaster, RayWork, SharedSamples};
use workloads::glossy::{Glossy, GlossyEffect, GlossyOptions, Lobe, Map, Receiver, default_scene, receiver};
use workloads::job::Job;

use crate::common::{White, drawn_on, rmse, spec};

const EYE: (DVec3, DVec3) = (DVec3::new(0.3, 2.0, 0.4), DVec3::new(-0.1, -1.0, -0.2));

fn table(samples: u32, shape: LensShape) -> SampleTable {
    SampleTable::new(&SampleSpec { lens: shape, ..SampleSpec::default() }, samples, 7).unwrap()
}

/// The map of a white half plane at a height, with its edge across the receiver, and the brightness of each
/// column.
fn edge(height: f64, radius: f64, effect: GlossyEffect) -> (Map, Vec<f64>) {
    let map = Map::new(&Receiver::lying(DVec3::ZERO, [1.0, 0.5]), EYE, effect, radius, 64).unwrap();
    let side = if effect == GlossyEffect::Reflection { 1.0 } else { -1.0 };
    let y = (side * height) as f32;
    let corners = [[0.0, -99.0], [99.0, -99.0], [99.0, 99.0], [0.0, 99.0]].map(|[x, z]| Vec3::new(x, y, z));
    let triangles = [[0, 1, 2], [0, 2, 3]];
    let geometry = Geometry::new(&corners, &corners, &triangles).unwrap();
    let draws = [Draw::new(geometry, &White, Cull::None)];
    let samples = table(64, LensShape::Square);
    let image = map
        .one_pass(&draws, &samples, Vec3::ZERO, &mut Gpu::without_packets(&spec()).unwrap())
        .unwrap()
        .into_image();
    let width = map.viewport.width() as usize;
    let column = |x: usize| {
        image.iter().skip(x).step_by(width).map(|p| f64::from(p.x)).sum::<f64>()
            / f64::from(map.viewport.height())
    };
    (map, (0..width).map(column).collect())
}

/// Width of a linear ramp, from the variance of its slope. The box filters of a texel and of a difference add
/// their own variance.
fn ramp(columns: &[f64]) -> f64 {
    let slopes: Vec<f64> = columns.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let total: f64 = slopes.iter().sum();
    let moment =
        |power: i32| slopes.iter().enumerate().map(|(x, s)| s * (x as f64).powi(power)).sum::<f64>() / total;
    (12.0 * (moment(2) - moment(1).powi(2)) - 2.0).max(0.0).sqrt()
}

/// Contact hardening: the blur on the plane is 2 R h / (d + h) wide, through a square lens a linear ramp.
#[test]
fn the_blur_widens_with_height_as_in_the_closed_form() {
    for effect in [GlossyEffect::Reflection, GlossyEffect::Refraction(1.4)] {
        let mut last = 0.0;
        for height in [0.05, 0.3, 1.0, 2.0] {
            let (map, columns) = edge(height, 0.2, effect);
            let (found, expected) = (ramp(&columns) * map.texel(), map.blur(height));
            assert!(
                (found - expected).abs() < 0.03 * expected + 0.6 * map.texel(),
                "{height}: {found} {expected}"
            );
            assert!(found > last - 1e-9, "{height}");
            last = found;
        }
    }
    let (_, mirror) = edge(1.0, 0.0, GlossyEffect::Reflection);
    assert!(
        mirror.iter().filter(|c| (0.01..0.99).contains(*c)).count() <= 2,
        "without a lens the edge is sharp"
    );
}

/// Compares every texel with rays from the mirrored viewer.
#[test]
fn one_pass_accumulation_and_rays_agree() {
    for (effect, below) in [(GlossyEffect::Reflection, false), (GlossyEffect::Refraction(1.33), true)] {
        let scene = default_scene(below).unwrap();
        let frame = scene.frame(0).unwrap();
        let draws: Vec<_> = frame.draws(&scene).unwrap().into_iter().map(|d| d.culling(Cull::None)).collect();
        let world = frame.camera.open().inverse();
        let eye = (world.translation.as_dvec3(), world.matrix3.z_axis.as_dvec3());
        let map = Map::new(&receiver(), eye, effect, 0.3, 24).unwrap();
        let colours: Vec<_> =
            frame.meshes.iter().map(|mesh| scene.materials()[mesh.material].base_color).collect();
        let rays = RayCaster::new(&draws);
        let samples = table(64, LensShape::Disk);
        let sky = scene.background();
        let (traced, work) =
            map.by_rays((&rays, &colours), &[&samples as &dyn SampleSource], sky, Lobe::Lens);
        assert_eq!(work.rays, 64 * traced.len() as u64);
        assert!(work.triangles < work.rays * rays.faces().len() as u64 / 4, "{work:?}");
        let drawn = map
            .one_pass(&draws, &samples, sky, &mut Gpu::without_packets(&spec()).unwrap())
            .unwrap()
            .into_image();
        // The samples are the same, so only samples on edges may differ, by rounding.
        assert!(rmse(&drawn, &traced) < 2e-3, "{effect:?}: {}", rmse(&drawn, &traced));
        assert!(rmse(&drawn, &vec![sky; drawn.len()]) > 0.05, "there is something to see");
        let set = SharedSamples::interleaved(&SampleSpec::default(), 64, 3).unwrap();
        let added =
            map.accumulated(&draws, &set, sky, &mut Gpu::without_packets(&spec()).unwrap()).unwrap().0;
        assert!(rmse(&added, &traced) < 0.04, "{}", rmse(&added, &traced));
        let one = map
            .one_pass(&draws, &set, sky, &mut Gpu::without_packets(&spec()).unwrap())
            .unwrap()
            .into_image();
        assert!(rmse(&added, &one) < 2e-3, "the same set: {}", rmse(&added, &one));
    }
}

#[test]
fn more_samples_reduce_the_error() {
    let scene = default_scene(false).unwrap();
    let frame = scene.frame(0).unwrap();
    let draws = frame.draws(&scene).unwrap();
    let world = frame.camera.open().inverse();
    let eye = (world.translation.as_dvec3(), world.matrix3.z_axis.as_dvec3());
    let map = Map::new(&receiver(), eye, GlossyEffect::Reflection, 0.3, 16).unwrap();
    let image = |seed, samples| {
        let table = SampleTable::new(&SampleSpec::default(), samples, seed).unwrap();
        map.one_pass(&draws, &table, scene.background(), &mut Gpu::without_packets(&spec()).unwrap())
            .unwrap()
            .into_image()
    };
    let truth = image(99, 256);
    let [few, more, most] = [4, 16, 64].map(|samples| rmse(&image(1, samples), &truth));
    assert!(more < 0.75 * few && most < 0.75 * more, "{few} {more} {most}");
}

fn drawn(options: GlossyOptions) -> (Vec<Vec3>, Vec<&'static str>) {
    let overrides = Overrides { size: Some((48, 27)), samples: Some(4), ..Overrides::default() };
    let job = Glossy::new(GlossyOptions { texels: 16, ..options }, &overrides, 1).unwrap();
    let (drawn, _) = drawn_on(&spec(), &job, 0);
    (drawn.image, drawn.warnings.iter().map(|warning| warning.code.name()).collect())
}

#[test]
fn the_job_shows_the_map_on_its_receiver() {
    let (image, codes) = drawn(GlossyOptions::default());
    assert_eq!((image.len(), codes), (48 * 27, vec![]));
    let (dull, _) = drawn(GlossyOptions { fresnel: 0.0, ..GlossyOptions::default() });
    assert!(rmse(&image, &dull) > 0.02, "what is reflected is seen");
    let (refracted, _) = drawn(GlossyOptions { index: Some(1.3), ..GlossyOptions::default() });
    assert!(rmse(&image, &refracted) > 0.02);
}

/// A perfect mirror: the pixel of a receiver point shows the mirrored scene.
#[test]
fn a_mirror_shows_what_is_mirrored() {
    // The resolution keeps texture filtering small: a pixel is a texel or two.
    const WIDE: usize = 384;
    let options = GlossyOptions {
        roughness: 0.0,
        fresnel: 1.0,
        texels: 256,
        map_samples: 4,
        ..GlossyOptions::default()
    };
    let overrides = Overrides { size: Some((WIDE as u32, 216)), samples: Some(4), ..Overrides::default() };
    let job = Glossy::new(options, &overrides, 1).unwrap();
    let image = job.frame(0, &mut Gpu::without_packets(&spec()).unwrap()).unwrap().image;
    let scene = default_scene(false).unwrap().with_overrides(&overrides).unwrap();
    let frame = scene.frame(0).unwrap();
    let draws = frame.draws(&scene).unwrap();
    let (rays, camera) = (RayCaster::new(&draws), frame.camera);
    let world = camera.open().inverse();
    let (mut right, mut all, work) = (0, 0, &mut RayWork::default());
    for (x, y) in (0..WIDE).flat_map(|x| (0..216).map(move |y| (x, y))) {
        let tan = camera.half_height();
        let at = Vec3::new((x as f32 - 191.5) / 108.0 * tan, -(y as f32 - 107.5) / 108.0 * tan, 1.0);
        let (from, along) = (world.translation.as_dvec3(), (world.matrix3 * at).as_dvec3());
        let met = from - along * (from.y / along.y);
        let hidden = rays.first((from, along), 0.0, 0.0, work).is_some_and(|(_, s)| s < -from.y / along.y);
        if along.y > -1e-3 || met.x.abs() > 1.7 || met.z.abs() > 1.1 || hidden {
            continue;
        }
        let seen = rays.first((met, along * DVec3::new(1.0, -1.0, 1.0)), 0.0, 1e-6, work);
        let colour = |(face, _): (usize, f64)| {
            scene.materials()[frame.meshes[rays.faces()[face].draw].material].base_color
        };
        let expected = seen.map_or(scene.background(), colour);
        all += 1;
        right += u32::from((image[y * WIDE + x] - expected).length() < 0.05);
    }
    assert!(all > 8000 && right * 100 > all * 85, "{right} of {all}: the rest lies on edges");
}

#[test]
fn limitations_and_invalid_options_are_reported() {
    assert_eq!(
        drawn(GlossyOptions { roughness: 1.5, ..GlossyOptions::default() }).1,
        ["lens-wider-than-receiver"]
    );
    for bad in [
        GlossyOptions { roughness: -1.0, ..GlossyOptions::default() },
        GlossyOptions { half: [0.0, 1.0], ..GlossyOptions::default() },
        GlossyOptions { centre: [0.0, 50.0, 0.0], ..GlossyOptions::default() },
        GlossyOptions { map_samples: 0, ..GlossyOptions::default() },
        GlossyOptions { fresnel: 2.0, ..GlossyOptions::default() },
        GlossyOptions { index: Some(-1.0), ..GlossyOptions::default() },
        GlossyOptions { texels: 0, ..GlossyOptions::default() },
    ] {
        let error = Glossy::new(bad.clone(), &Overrides::default(), 1).err().unwrap();
        assert!(error.is_usage(), "{bad:?}: {error}");
    }
}
