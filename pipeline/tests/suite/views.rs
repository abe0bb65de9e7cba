//! Several images from one pass, and passes without images.

use std::ops::Range;

use crate::common::{Plain, Soup, SoupKind, camera, spec};
use activity::{Counts, Event, Unit};
use glam::Vec3;
use pipeline::sampling::{Sample, SampleSource};
use pipeline::*;

const PER_PIXEL: u32 = 8;

/// A range of the samples of another source.
#[derive(Debug)]
struct Run<'a>(&'a SampleTable, Range<u32>);

impl SampleSource for Run<'_> {
    fn per_pixel(&self) -> u32 {
        self.1.len() as u32
    }

    fn pixel_into(&self, px: u32, py: u32, into: &mut [Sample]) {
        into.copy_from_slice(&self.0.pixel(px, py)[self.1.start as usize..self.1.end as usize]);
    }
}

fn with<R>(kind: SoupKind, run: impl FnOnce(&Camera, &[Draw<'_>], &SampleTable, Viewport) -> R) -> R {
    let soup = Soup::new(kind, 80, 11);
    let table = SampleTable::low_discrepancy(PER_PIXEL, 3, LensShape::Disk).unwrap();
    let geometry = Geometry::new(&soup.open, &soup.close, &soup.triangles).unwrap();
    let draws = [Draw::new(geometry, &Plain, Cull::None)];
    run(&camera(true), &draws, &table, Viewport::new(43, 37).unwrap())
}

fn settings<'a>(spec: &'a PipelineSpec, viewport: Viewport, samples: &'a dyn SampleSource) -> Settings<'a> {
    Settings { spec, viewport, samples, background: Vec3::new(0.1, 0.2, 0.3) }
}

fn bits(image: &[Vec3]) -> Vec<[u32; 3]> {
    image.iter().map(|pixel| pixel.to_array().map(f32::to_bits)).collect()
}

#[test]
fn each_view_is_the_image_of_its_samples_alone() {
    for kind in [SoupKind::Still, SoupKind::Moving, SoupKind::Crossing, SoupKind::Layers] {
        with(kind, |camera, draws, table, viewport| {
            let spec = spec(Features::ALL);
            let views = [0..8, 0..4, 4..8, 2..5, 6..7];
            let settings_of_all = settings(&spec, viewport, table);
            let pass = RasterPass::new(camera, draws, &settings_of_all).onto(Target::Views(&views));
            let Rendered { images, counts, .. } = pass.render(|_, _| ()).unwrap();
            for (view, image) in views.iter().zip(&images) {
                let run = Run(table, view.clone());
                let alone = RasterPass::new(camera, draws, &settings(&spec, viewport, &run))
                    .render(|_, _| ())
                    .unwrap();
                assert_eq!(bits(image), bits(&alone.images[0]), "{kind:?} {view:?}");
            }
            assert_eq!(counts[Event::PixelsResolved], (viewport.pixels() * views.len()) as u64);
        });
    }
}

#[test]
fn a_single_view_equals_render_packet_by_packet() {
    with(SoupKind::Moving, |camera, draws, table, viewport| {
        let spec = spec(Features::ALL);
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        let settings = settings(&spec, viewport, table);
        let all: Vec<_> = std::iter::once(0..PER_PIXEL).collect();
        let images = RasterPass::new(camera, draws, &settings)
            .onto(Target::Views(&all))
            .render(|p, _| ours.push(*p))
            .unwrap()
            .images;
        let image =
            RasterPass::new(camera, draws, &settings).render(|p, _| theirs.push(*p)).unwrap().into_image();
        assert_eq!(bits(&images[0]), bits(&image));
        assert_eq!(ours, theirs);
    });
}

#[test]
fn runs_beyond_the_samples_are_cut_and_empty_ones_black() {
    with(SoupKind::Still, |camera, draws, table, viewport| {
        let spec = spec(Features::ALL);
        let settings = settings(&spec, viewport, table);
        let images = RasterPass::new(camera, draws, &settings)
            .onto(Target::Views(&[4..99, 4..8, 9..12]))
            .render(|_, _| ())
            .unwrap()
            .images;
        assert_eq!(bits(&images[0]), bits(&images[1]));
        let touched = images[2].iter().filter(|pixel| **pixel == Vec3::ZERO).count();
        assert!(touched > 0, "pixels that were drawn into have no samples in that view");
    });
}

#[test]
fn a_pass_without_an_image_sees_the_same_shades_nothing_and_keeps_its_depths() {
    for kind in [SoupKind::Moving, SoupKind::Layers] {
        with(kind, |camera, draws, table, viewport| {
            let spec = spec(Features::ALL);
            let settings = settings(&spec, viewport, table);
            let mut sum = Counts::default();
            let pass = RasterPass::new(camera, draws, &settings).with_visible();
            let depths = pass.onto(Target::Depth).render(|packet, _| sum += &packet.counts).unwrap();
            let Rendered { visible: seen, counts, images, .. } = depths;
            assert_eq!((sum, images.len()), (counts, 0));
            let drawn = pass.render(|_, _| ()).unwrap();
            assert_eq!(seen, drawn.visible);
            let drawn = drawn.counts;
            for unit in [Unit::ShadingCache, Unit::Texture, Unit::Colour] {
                assert!(!counts.uses(unit), "{unit:?}");
            }
            for event in [Event::SamplesTested, Event::SamplesHit, Event::DepthWrites] {
                assert_eq!(counts[event], drawn[event], "{event:?}");
            }
            // Lines that hold the clear value when the pass ends are stored, too: every line goes to memory.
            assert!(counts[Event::DepthLines] >= drawn[Event::DepthLines]);
            let bytes = 4 * seen.len() as u64;
            assert!(counts[Event::DramWriteBytes] >= bytes, "{} {bytes}", counts[Event::DramWriteBytes]);
        });
    }
}
