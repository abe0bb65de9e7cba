//! Images without counts equal those of the modelled hardware, bit for bit.

use crate::common::{Plain, Soup, SoupKind, camera, spec};
use glam::Vec3;
use pipeline::sampling::{HashedSamples, SampleSource};
use pipeline::*;

/// Images and visible samples to the bit.
type Bits = (Vec<Vec<[u32; 3]>>, Vec<(u32, u32)>);

fn bits(drawn: &Rendered) -> Bits {
    let image = |image: &Vec<Vec3>| image.iter().map(|pixel| pixel.to_array().map(f32::to_bits)).collect();
    (drawn.images.iter().map(image).collect(), drawn.visible.clone())
}

/// Draws a pass with and without counts, compares both, and returns whether it was drawn without.
fn is_uncounted(pass: &RasterPass<'_>, what: &str) -> bool {
    let pass = pass.with_visible();
    let counted = Gpu::without_packets(pass.settings.spec).unwrap().draw(&pass).unwrap();
    let mut gpu = Gpu::images_only(pass.settings.spec).unwrap();
    let drawn = gpu.draw(&pass).unwrap();
    assert!(bits(&counted) == bits(&drawn), "{what}");
    assert!(counted.counts.reported().any(|(_, count)| count > 0));
    drawn.counts.reported().all(|(_, count)| count == 0)
}

/// Two draws of the same soup, the second with its front faces culled.
fn with<R>(kind: SoupKind, lens: bool, run: impl FnOnce(&Camera, &[Draw<'_>]) -> R) -> R {
    let soups = [Soup::new(kind, 60, 11), Soup::new(kind, 60, 12)];
    let draws = [(0, Cull::None), (1, Cull::Front)].map(|(which, cull)| {
        let soup: &Soup = &soups[which];
        Draw::new(Geometry::new(&soup.open, &soup.close, &soup.triangles).unwrap(), &Plain, cull)
    });
    run(&camera(lens), &draws)
}

fn settings<'a>(spec: &'a PipelineSpec, samples: &'a dyn SampleSource) -> Settings<'a> {
    let viewport = Viewport::new(150, 70).unwrap();
    Settings { spec, viewport, samples, background: Vec3::new(0.1, 0.2, 0.3) }
}

#[test]
fn the_engine_draws_the_same_images() {
    let spec = spec(Features::ALL);
    for (kind, lens) in [SoupKind::Still, SoupKind::Moving, SoupKind::Crossing, SoupKind::Layers]
        .map(|k| [(k, false), (k, true)])
        .concat()
    {
        with(kind, lens, |camera, draws| {
            for per_pixel in [1, 4, 5, 8, 24] {
                let table = SampleTable::low_discrepancy(per_pixel, 3, LensShape::Disk).unwrap();
                let hashed = HashedSamples::new(3, 150, per_pixel, LensShape::Disk).unwrap();
                for samples in [&table as &dyn SampleSource, &hashed] {
                    let settings = settings(&spec, samples);
                    let pass = RasterPass::new(camera, draws, &settings);
                    let what = format!("{kind:?} {lens} {per_pixel}");
                    assert!(is_uncounted(&pass, &what));
                    if per_pixel == 8 {
                        assert!(is_uncounted(&pass.shaded_per_sample(), &what));
                        assert!(is_uncounted(&pass.onto(Target::Depth), &what));
                        assert!(is_uncounted(&pass.onto(Target::Views(&[0..8, 0..3, 2..5, 7..7])), &what));
                    }
                }
            }
        });
    }
}

#[test]
fn other_tiles_give_the_same_images() {
    with(SoupKind::Moving, true, |camera, draws| {
        let table = SampleTable::low_discrepancy(8, 3, LensShape::Disk).unwrap();
        for tile_px in [1, 2, 4, 8] {
            let spec = PipelineSpec { tile_px, coarse_tile_px: 4 * tile_px, ..spec(Features::NONE) };
            assert!(is_uncounted(&RasterPass::new(camera, draws, &settings(&spec, &table)), "tiles"));
        }
    });
}

/// What the engine cannot draw to the same bytes is drawn as on other GPUs.
#[test]
fn other_passes_are_drawn_by_the_hardware() {
    with(SoupKind::Moving, true, |camera, draws| {
        let table = SampleTable::low_discrepancy(4, 3, LensShape::Disk).unwrap();
        let all = spec(Features::ALL);
        let with_state = |change: &dyn Fn(Draw<'_>) -> bool| {
            let changed: Vec<bool> = draws.iter().map(|draw| change(*draw)).collect();
            changed.into_iter().all(|uncounted| uncounted)
        };
        let draw_of = |draw: Draw<'_>| {
            let settings = settings(&all, &table);
            is_uncounted(&RasterPass::new(camera, &[draw], &settings), "state")
        };
        assert!(with_state(&draw_of));
        let blended = DrawState { blend: Blend::Over, ..DrawState::new(Cull::None) };
        let later = Clip::new([-1.0, 1.0], [-1.0, 1.0], [0.25, 1.0]).unwrap();
        assert!(!with_state(&|draw| draw_of(draw.with_state(blended))));
        assert!(!with_state(&|draw| draw_of(Draw { geometry: draw.geometry.with_clip(later), ..draw })));
        let settled = spec(Features { still_px: 1.0, ..Features::ALL });
        assert!(!is_uncounted(&RasterPass::new(camera, draws, &settings(&settled, &table)), "still"));
        let clipped = camera.with_clip(later);
        assert!(is_uncounted(&RasterPass::new(&clipped, draws, &settings(&all, &table)), "camera's planes"));
    });
}
