//! The fast visibility engine equals brute force over all samples, bit for bit.

use crate::common::*;
use pipeline::sample_test::VectorWidth;
use pipeline::sampling::{Sample, SampleSource};
use pipeline::visibility::{SampleLayout, Visibility, resolve_at};
use pipeline::*;
use proptest::prelude::*;

type Seen = Vec<(u32, u32)>;

/// Result of the engine; unused dimensions are not divided.
fn seen(
    soup: &Soup,
    cull: Cull,
    lens: bool,
    viewport: Viewport,
    source: &dyn SampleSource,
    width: VectorWidth,
) -> Seen {
    let layout = SampleLayout::new(&camera(lens), viewport, source, soup.open != soup.close).unwrap();
    seen_in(&layout, soup, cull, width)
}

fn seen_in(layout: &SampleLayout, soup: &Soup, cull: Cull, width: VectorWidth) -> Seen {
    let mut visibility = Visibility::new(layout);
    let geometry = soup.draw(&Plain, cull).geometry;
    // Twice, as the second run must not depend on the first.
    resolve_at(width, layout, &geometry, cull, &mut visibility);
    let tally = resolve_at(width, layout, &geometry, cull, &mut visibility);
    assert!(tally.hits <= 16 * tally.packets);
    visibility.in_image_order(layout).into_iter().map(|(id, depth)| (id, depth.to_bits())).collect()
}

/// Report the first sample that differs, not all of them.
fn agree(found: &Seen, expected: &Seen) -> Result<(), TestCaseError> {
    prop_assert_eq!(found.len(), expected.len());
    let differs = (0..found.len()).find(|&i| found[i] != expected[i]);
    let shown = differs.map(|i| (i, found[i], expected[i]));
    prop_assert!(shown.is_none(), "(sample, found, expected) {:?}", shown);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn the_engine_equals_brute_force(
        kind in kinds(), cull in culls(), lens: bool, seed: u64,
        per_pixel in prop_oneof![Just(1_u32), Just(2), Just(3), Just(5), Just(16), Just(40)],
        width in 1_u32..90, height in 1_u32..70,
    ) {
        let soup = Soup::new(kind, 60, seed);
        let viewport = Viewport::new(width, height).unwrap();
        let table = SampleTable::low_discrepancy(per_pixel, seed, LensShape::Disk).unwrap();
        let expected = brute_force(&soup, cull, lens, viewport, &table);
        agree(&seen(&soup, cull, lens, viewport, &table, VectorWidth::widest()), &expected)?;
    }

    #[test]
    fn samples_on_the_borders_of_everything_are_not_lost(kind in kinds(), lens: bool, seed: u64) {
        let soup = Soup::new(kind, 80, seed);
        let viewport = Viewport::new(70, 50).unwrap();
        let table = border_table(seed);
        let expected = brute_force(&soup, Cull::None, lens, viewport, &table);
        agree(&seen(&soup, Cull::None, lens, viewport, &table, VectorWidth::widest()), &expected)?;
    }

    #[test]
    fn scale_does_not_matter(kind in kinds(), lens: bool, seed: u64, power in -20_i32..20) {
        let mut soup = Soup::new(kind, 40, seed);
        let scale = 2.0_f32.powi(power);
        for p in soup.open.iter_mut().chain(&mut soup.close) {
            p.x *= scale;
            p.y *= scale;
        }
        let viewport = Viewport::new(64, 48).unwrap();
        let table = SampleTable::low_discrepancy(4, seed, LensShape::Square).unwrap();
        let expected = brute_force(&soup, Cull::None, lens, viewport, &table);
        agree(&seen(&soup, Cull::None, lens, viewport, &table, VectorWidth::widest()), &expected)?;
    }
}

#[test]
fn every_width_and_number_of_threads_gives_the_same_bytes() {
    let viewport = Viewport::new(150, 90).unwrap();
    let table = SampleTable::low_discrepancy(8, 3, LensShape::Disk).unwrap();
    for kind in [SoupKind::Moving, SoupKind::Crossing, SoupKind::Slivers, SoupKind::Grid] {
        let soup = Soup::new(kind, 300, 11);
        let expected = brute_force(&soup, Cull::None, true, viewport, &table);
        for width in VectorWidth::available() {
            for threads in [1, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let found = pool.install(|| seen(&soup, Cull::None, true, viewport, &table, width));
                assert!(found == expected, "{kind:?} at {width:?} on {threads} threads");
            }
        }
    }
}

/// The engine does not support orthographic cameras.
#[test]
fn an_orthographic_camera_is_refused() {
    let table = SampleTable::low_discrepancy(1, 1, LensShape::Disk).unwrap();
    let camera = camera(Optics { lens: false, parallel: true });
    assert!(SampleLayout::new(&camera, Viewport::new(8, 8).unwrap(), &table, false).is_none());
}

#[test]
fn dividing_time_for_still_scenes_changes_nothing() {
    let (soup, viewport) = (Soup::new(SoupKind::Still, 200, 4), Viewport::new(64, 64).unwrap());
    let table = SampleTable::low_discrepancy(16, 3, LensShape::Disk).unwrap();
    for lens in [false, true] {
        let [divided, whole] = [true, false].map(|moving| {
            let layout = SampleLayout::new(&camera(lens), viewport, &table, moving).unwrap();
            seen_in(&layout, &soup, Cull::None, VectorWidth::widest())
        });
        assert!(divided == whole, "lens {lens}");
    }
}

#[test]
fn coordinates_out_of_all_proportion_are_seen_as_brute_force_sees_them() {
    let viewport = Viewport::new(48, 48).unwrap();
    let table = SampleTable::low_discrepancy(4, 1, LensShape::Disk).unwrap();
    for scale in [1e-38_f32, 1e-30, 1e-20, 1e-10, 1e10, 1e18, 1e25, 1e34] {
        for kind in [SoupKind::Moving, SoupKind::Crossing] {
            let mut soup = Soup::new(kind, 60, 8);
            // Only some of them, so that the others stay to be hidden.
            for p in soup.open.iter_mut().chain(&mut soup.close).step_by(2) {
                *p *= scale;
            }
            for lens in [false, true] {
                let expected = brute_force(&soup, Cull::None, lens, viewport, &table);
                let found = seen(&soup, Cull::None, lens, viewport, &table, VectorWidth::widest());
                assert!(found == expected, "{kind:?} times {scale}, lens {lens}");
            }
        }
    }
}

/// A triangle that comes nearer early in the shutter is tested first. Where both are later at equal depth, up
/// to rounding, the one with the lower number is visible nevertheless.
#[test]
fn at_equal_depth_the_lower_number_is_visible_in_any_order() {
    let wall =
        |depth: f32| [(-40.0, -40.0), (40.0, -40.0), (0.0, 60.0)].map(|(x, y)| glam::Vec3::new(x, y, depth));
    let (still, first, last) = (wall(4.0), wall(2.0), wall(6.0));
    let open = [still, first].concat();
    let close = [still, last].concat();
    let soup = Soup { open, close, triangles: vec![[0, 1, 2], [3, 4, 5]] };
    let viewport = Viewport::new(32, 32).unwrap();
    let at_half = (0..64 * 64 * 4)
        .map(|i| Sample { x: 0.5, y: (i % 4) as f32 / 4.0, u: 0.0, v: 0.0, t: 0.5 })
        .collect();
    let table = SampleTable::programmed(4, 1, at_half).unwrap();
    let expected = brute_force(&soup, Cull::None, false, viewport, &table);
    assert!(expected.iter().all(|&(id, depth)| (id, f32::from_bits(depth)) == (0, 4.0)), "{:?}", expected[0]);
    assert!(seen(&soup, Cull::None, false, viewport, &table, VectorWidth::widest()) == expected);
}
