//! Shading of every sample at its own position, the alternative to the shading cache.

use crate::common::stage::quad;
use crate::common::{Flat, Plain, QUAD, Soup, SoupKind, camera, pixel_camera, rectangle, spec};
use activity::{Counts, Event};
use glam::{Vec2, Vec3, Vec4};
use pipeline::*;

const SIDE: u32 = 16;

/// A shader of the position, with an optional texture.
struct ByPlace<F: Fn(&ShadingPoint, Vec4) -> f32 + Sync>(F, Option<Texture>);

impl<F: Fn(&ShadingPoint, Vec4) -> f32 + Sync> Shader for ByPlace<F> {
    fn texture(&self) -> Option<&Texture> {
        self.1.as_ref()
    }

    fn shade(&self, _lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        Vec3::splat((self.0)(at, texel)).extend(1.0)
    }
}

fn render_with(shading: Shading, per_pixel: u32, draws: &[Draw<'_>]) -> Rendered {
    let viewport = Viewport::new(SIDE, SIDE).unwrap();
    let table = SampleTable::low_discrepancy(per_pixel, 3, LensShape::Disk).unwrap();
    let spec = PipelineSpec { shading, ..spec(Features::ALL) };
    let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
    RasterPass::new(&pixel_camera(viewport, 0.25), draws, &settings).render(|_, _| ()).unwrap()
}

/// Larger than the image.
fn all(z: f32) -> [Vec3; 4] {
    rectangle([-40.0, 40.0], [-40.0, 40.0], z)
}

fn lanes(counts: &Counts) -> u64 {
    counts[Event::PixelInvocations] - counts[Event::HelperInvocations]
}

#[test]
fn a_constant_colour_gives_a_constant_image() {
    let viewport = Viewport::new(40, 40).unwrap();
    let table = SampleTable::low_discrepancy(8, 3, LensShape::Disk).unwrap();
    for kind in [SoupKind::Still, SoupKind::Moving, SoupKind::Crossing] {
        let soup = Soup::new(kind, 60, 5);
        let images = [Shading::Cached, Shading::PerSample].map(|shading| {
            let spec = PipelineSpec { shading, ..spec(Features::ALL) };
            let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
            let shader = Flat(Vec3::new(0.25, 0.5, 1.0));
            RasterPass::new(&camera(true), &[soup.draw(&shader, Cull::None)], &settings)
                .render(|_, _| ())
                .unwrap()
                .into_image()
        });
        assert_eq!(images[0], images[1], "{kind:?}");
    }
}

#[test]
fn smooth_shading_converges_to_the_same_image() {
    let corners = all(2.0);
    let shader = ByPlace(|at, _| 0.5 + 0.02 * at.position.x + 0.01 * at.position.y, None);
    let worst = |per_pixel| {
        let image =
            |shading| render_with(shading, per_pixel, &[quad(&corners, &corners, &shader)]).into_image();
        let [cached, own] = [image(Shading::Cached), image(Shading::PerSample)];
        cached.iter().zip(&own).map(|(a, b)| (a.x - b.x).abs()).fold(0.0, f32::max)
    };
    // A pixel spans 0.04 of the colour at depth 2; its mean is the colour of its centre.
    let [few, some, many] = [4, 32, 256].map(worst);
    assert!(few < 0.02 && some < 0.5 * few && many < 0.2 * some, "{few} {some} {many}");
}

#[test]
fn a_sample_is_shaded_at_its_own_time() {
    // The plane moves by 8 pixels while its colour is fixed in the world: a step that its motion must not
    // blur.
    let (open, close) = (all(1.0), all(1.0).map(|p| p + Vec3::new(8.0, 0.0, 0.0)));
    let shader = ByPlace(|at, _| f32::from(at.position.x > 0.0), None);
    let row = |shading| {
        render_with(shading, 64, &[quad(&open, &close, &shader)]).images[0][..SIDE as usize].to_vec()
    };
    for (x, colour) in row(Shading::PerSample).iter().enumerate() {
        assert_eq!(colour.x, if x < 8 { 0.0 } else { 1.0 }, "column {x}");
    }
    // At mid-shutter the points seen in a pixel are up to 4 pixels to either side.
    assert!((0.2..0.8).contains(&row(Shading::Cached)[8].x));
}

#[test]
fn every_visible_sample_is_a_lane_and_nothing_is_looked_up() {
    for kind in [SoupKind::Still, SoupKind::Moving, SoupKind::Layers] {
        let soup = Soup::new(kind, 60, 8);
        let counts = render_with(Shading::PerSample, 8, &[soup.draw(&Plain, Cull::None)]).counts;
        assert!(counts[Event::DepthWrites] > 0);
        assert_eq!(lanes(&counts), counts[Event::DepthWrites], "{kind:?}");
        assert_eq!(counts[Event::PixelInvocations], 4 * counts[Event::QuadsShaded]);
        assert_eq!(counts[Event::ShadingLookups] + counts[Event::ShadingHits], 0);
    }
}

#[test]
fn a_whole_quad_needs_no_helper_and_a_column_needs_half() {
    let helpers = |x: [f32; 2]| {
        // One triangle, so that no diagonal divides a quad: its corner is far outside.
        let corners =
            [Vec3::new(x[0], -400.0, 1.0), Vec3::new(x[1], -400.0, 1.0), Vec3::new(x[0], 400.0, 1.0)];
        let shader = Flat(Vec3::ONE);
        let geometry = Geometry::new(&corners, &corners, &[[0, 1, 2]]).unwrap();
        let counts = render_with(Shading::PerSample, 4, &[Draw::new(geometry, &shader, Cull::None)]);
        (counts.counts[Event::HelperInvocations], counts.counts[Event::QuadsShaded])
    };
    let quads = u64::from(SIDE * SIDE / 4 * 4);
    assert_eq!(helpers([-8.0, 800.0]), (0, quads));
    // From the last column to the right edge, the left half of each quad is not requested.
    assert_eq!(helpers([7.0, 800.0]), (2 * 4 * u64::from(SIDE / 2), 4 * u64::from(SIDE / 2)));
}

#[test]
fn textures_are_fetched_by_every_lane() {
    let texels = (0..64 * 64).map(|i| [(i % 64 * 4) as u8, (i / 64 * 4) as u8, 0, 255]).collect();
    let texture = Texture::from_srgb8(64, 64, texels, [Wrap::Clamp; 2]).unwrap();
    let shader = ByPlace(|_, texel| texel.x, Some(texture));
    let corners = rectangle([-8.0, 8.0], [-8.0, 8.0], 1.0);
    // A texel is two pixels wide: one bilinear fetch per lane.
    let uvs = [[0.0, 0.0], [0.125, 0.0], [0.125, 0.125], [0.0, 0.125]].map(Vec2::from_array);
    let geometry = Geometry::new(&corners, &corners, &QUAD).unwrap().with_uvs(&uvs).unwrap();
    let draws = [Draw::new(geometry, &shader, Cull::None)];
    let [own, cached] = [Shading::PerSample, Shading::Cached].map(|shading| render_with(shading, 16, &draws));
    assert_eq!(own.counts[Event::TextureFetches], own.counts[Event::PixelInvocations]);
    assert!(own.counts[Event::TextureLines] >= own.counts[Event::QuadsShaded]);
    assert!(own.counts[Event::TextureFetches] > 8 * cached.counts[Event::TextureFetches]);
    let worst =
        own.images[0].iter().zip(&cached.images[0]).map(|(a, b)| (a.x - b.x).abs()).fold(0.0, f32::max);
    assert!(worst < 0.01, "{worst}");
}

#[test]
fn threads_change_nothing() {
    let soup = Soup::new(SoupKind::Moving, 80, 11);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render_with(Shading::PerSample, 8, &[soup.draw(&Plain, Cull::None)]))
    };
    let (one, three) = (with(1), with(3));
    assert_eq!((one.images, one.counts), (three.images, three.counts));
}

/// Multisample antialiasing: coverage and depth by sample, one shade per pixel and triangle, or per sample on
/// request.
#[test]
fn multisampling_shades_once_per_pixel() {
    let viewport = Viewport::new(SIDE, SIDE).unwrap();
    let (left, whole) = (rectangle([-40.0, 0.24], [-40.0, 40.0], 1.0), all(2.0));
    let (red, blue) = (Flat(Vec3::X), Flat(Vec3::Z));
    let draws = [quad(&whole, &whole, &blue), quad(&left, &left, &red)];
    let render = |shading, per_pixel| {
        let table = SampleTable::new(&SampleSpec::named("msaa").unwrap(), per_pixel, 1).unwrap();
        let spec = PipelineSpec { shading, ..spec(Features::ALL) };
        let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
        RasterPass::new(&pixel_camera(viewport, 0.25), &draws, &settings).render(|_, _| ()).unwrap()
    };
    let quads = |shading, per_pixel| render(shading, per_pixel).counts[Event::QuadsShaded];
    // The edge is a quarter into its column: samples more than 4 sixteenths left of the centre are covered.
    for (per_pixel, covered) in [(1, 0), (2, 0), (4, 1), (8, 2), (16, 4)] {
        let drawn = render(Shading::Cached, per_pixel);
        let red = covered as f32 / per_pixel as f32;
        for (i, &pixel) in (0..).zip(&drawn.images[0]) {
            let expected = match i % SIDE {
                0..8 => Vec3::X,
                8 => Vec3::new(red, 0.0, 1.0 - red),
                _ => Vec3::Z,
            };
            assert_eq!(pixel, expected, "{per_pixel} samples, pixel {i}");
        }
        if covered > 0 {
            assert_eq!(quads(Shading::Cached, per_pixel), quads(Shading::Cached, 4));
        }
        let by_sample = quads(Shading::PerSample, per_pixel) as f64 / quads(Shading::PerSample, 1) as f64;
        assert!((0.9..1.1).contains(&(by_sample / f64::from(per_pixel))), "{by_sample}");
    }
}
