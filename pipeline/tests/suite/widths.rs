//! All vector widths of this machine find the same hits with the same depths.

use crate::common::*;
use pipeline::sample_test::{Hits, SampleTest, StoredSamples, VectorWidth};
use pipeline::sampling::TileSamples;
use pipeline::setup::{SetupResult, set_up};
use pipeline::traversal::Box5;
use pipeline::*;

fn hits_at(
    width: VectorWidth,
    kind: SoupKind,
    Optics { lens, parallel }: Optics,
) -> (Vec<u32>, Vec<u32>, Hits) {
    let (soup, viewport) = (Soup::new(kind, 200, 5), Viewport::new(64, 64).unwrap());
    let shear = if lens { Shear::new([12.0, -12.0], [2.0, -2.0]) } else { Shear::default() };
    let shear = Shear { parallel, ..shear };
    let mut samples = TileSamples::default();
    samples.fill(&border_table(9), viewport, &shear, [32, 24], 8);
    let (mut depth, mut seen) = (vec![f32::INFINITY; samples.len], vec![u32::MAX; samples.len]);
    let mut hits = Hits::default();
    let scale = if parallel { 10.0 } else { 46.0 };
    let image = |p: glam::Vec3| [scale * p.x, -scale * p.y, p.z];
    for (id, corners) in soup.triangles.iter().enumerate() {
        let v = corners
            .map(|c| c as usize)
            .map(|c| MovingVertex { open: image(soup.open[c]), close: image(soup.close[c]) });
        let SetupResult::Ready(ready) =
            set_up(id as u32, [&v[0], &v[1], &v[2]], Cull::None, &shear, 0.25, [32.0; 2])
        else {
            continue;
        };
        let mut target = StoredSamples { depth: &mut depth, triangle: &mut seen };
        let (within, target, hits) = (&Box5::whole(lens), &mut target, &mut hits);
        let (triangle, samples, screen, near) = (&ready, &samples, None, 0.25);
        SampleTest { triangle, samples, within, image: None, screen, near, target, hits }.run(width);
    }
    (seen, depth.into_iter().map(f32::to_bits).collect(), hits)
}

#[test]
fn every_width_gives_the_same_bytes() {
    let widths: Vec<VectorWidth> = VectorWidth::available().collect();
    println!("widths of this machine: {widths:?}");
    for kind in [SoupKind::Still, SoupKind::Moving, SoupKind::Crossing, SoupKind::Slivers, SoupKind::Grid] {
        for ways in 0..4 {
            let optics = Optics { lens: ways & 1 != 0, parallel: ways & 2 != 0 };
            let plain = hits_at(widths[0], kind, optics);
            assert!(plain.2.hit > 0, "{kind:?} is hit");
            for &width in &widths[1..] {
                assert_eq!(hits_at(width, kind, optics), plain, "{width:?} on {kind:?}, {optics:?}");
            }
        }
    }
}
