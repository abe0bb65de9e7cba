//! Clip planes across lens, shutter and image, and motion and blur thresholds.

use crate::common::*;
use glam::Vec3;
use pipeline::sampling::Sample;
use pipeline::visibility::{SampleLayout, Visibility, resolve};
use pipeline::*;
use proptest::prelude::*;

const NOTHING: u32 = u32::MAX;
const ALL: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];

struct Scene {
    soup: Soup,
    lens: bool,
    table: SampleTable,
}

impl Scene {
    /// Result of the fast visibility engine.
    fn see_fast(&self, frame: Clip) -> Vec<(u32, u32)> {
        let camera = camera(self.lens).with_clip(frame);
        let layout =
            SampleLayout::new(&camera, viewport(), &self.table, self.soup.open != self.soup.close).unwrap();
        let mut seen = Visibility::new(&layout);
        resolve(&layout, &self.soup.draw(&Plain, Cull::None).geometry, Cull::None, &mut seen);
        seen.in_image_order(&layout).into_iter().map(|(id, depth)| (id, depth.to_bits())).collect()
    }

    fn see(&self, features: Features, frame: Clip, draw: Clip) -> Vec<(u32, u32)> {
        self.see_in(DrawState::new(Cull::None), features, frame, draw)
    }

    fn see_in(&self, state: DrawState, features: Features, frame: Clip, draw: Clip) -> Vec<(u32, u32)> {
        let spec = spec(features);
        let settings =
            Settings { spec: &spec, viewport: viewport(), samples: &self.table, background: Vec3::ZERO };
        let mut drawn = self.soup.draw(&Plain, Cull::None).with_state(state);
        drawn.geometry = drawn.geometry.with_clip(draw);
        RasterPass::new(&camera(self.lens).with_clip(frame), &[drawn], &settings).visibility().unwrap()
    }
}

fn viewport() -> Viewport {
    Viewport::new(40, 26).unwrap()
}

fn within([lo, hi]: [f32; 2], value: f32) -> bool {
    lo <= value && value < hi
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
    /// Samples between the planes see the same with and without them; samples outside see nothing. Some
    /// samples are on the planes.
    #[test]
    fn a_clipped_draw_is_seen_between_its_planes_only(
        kind in kinds(), lens: bool, switches in 0..SWITCHES, count in 1..60_u32, seed: u64, planes in prop::sample::select(vec![
            [[0.0, 1.0], ALL, ALL], [ALL, [-1.0, 0.0], ALL], [ALL, ALL, [0.5, f32::INFINITY]], [ALL, ALL, [0.0, 0.5]],
            [[-1.0, 0.0], [0.0, f32::INFINITY], [f32::EPSILON, 0.5]], [[0.5, 0.5], ALL, ALL], [[2.0, 3.0], ALL, ALL],
        ]), of_frame: bool,
    ) {
        let scene = Scene { soup: Soup::new(kind, count, seed), lens, table: border_table(seed) };
        let [u, v, t] = planes;
        let clip = Clip::new(u, v, t).unwrap();
        let (frame, draw) = if of_frame { (clip, Clip::NONE) } else { (Clip::NONE, clip) };
        let features = switched(switches);
        let clipped = scene.see(features, frame, draw);
        let whole = scene.see(features, Clip::NONE, Clip::NONE);
        prop_assert!(scene.see_fast(clip) == clipped);
        for ((_, sample), (ours, all)) in sample_positions(&scene.table, viewport()).iter().zip(clipped.iter().zip(&whole)) {
            let inside = within(u, sample.u) && within(v, sample.v) && within(t, sample.t);
            let expected = if inside { *all } else { (NOTHING, f32::INFINITY.to_bits()) };
            prop_assert_eq!(*ours, expected, "{:?}", sample);
        }
    }

    /// The same across the image, alone and with planes across the lens. Some planes are at borders of pixels
    /// and tiles, others cut pixels, and some leave nothing.
    #[test]
    fn a_draw_is_seen_between_its_planes_across_the_image_only(
        kind in kinds(), lens: bool, switches in 0..SWITCHES, count in 1..60_u32, seed: u64, ordered: bool, of_frame: bool,
        x in prop::sample::select(vec![ALL, [0.2, 0.6], [0.0, 0.33], [0.41, 0.42], [0.5, f32::INFINITY], [0.7, 0.7], [1.5, 2.0]]),
        y in prop::sample::select(vec![ALL, [0.25, 0.75], [f32::NEG_INFINITY, 0.4], [8.0 / 26.0, 16.0 / 26.0], [0.9, 3.0]]),
        u in prop::sample::select(vec![ALL, [-0.5, 0.25]]),
    ) {
        let scene = Scene { soup: Soup::new(kind, count, seed), lens, table: border_table(seed) };
        let clip = Clip::new(u, ALL, ALL).unwrap().across_image(x, y).unwrap();
        let (frame, draw) = if of_frame { (clip, Clip::NONE) } else { (Clip::NONE, clip) };
        // Ordered passes list samples before they store them.
        let state = DrawState { blend: if ordered { Blend::Add } else { Blend::Replace }, ..DrawState::new(Cull::None) };
        let features = switched(switches);
        let see = |frame, draw| scene.see_in(state, features, frame, draw);
        let (clipped, whole) = (see(frame, draw), see(Clip::NONE, Clip::NONE));
        prop_assert!(ordered || scene.see_fast(clip) == clipped);
        let side = [viewport().width() as f32, viewport().height() as f32];
        let edge = |share: f32, axis: usize| ((f64::from(share) - 0.5) * f64::from(side[axis])) as f32;
        for (([px, py], sample), (ours, all)) in sample_positions(&scene.table, viewport()).iter().zip(clipped.iter().zip(&whole)) {
            let at = [(*px as f32 - 0.5 * side[0]) + sample.x, (*py as f32 - 0.5 * side[1]) + sample.y];
            let inside = [x, y].iter().enumerate().all(|(axis, range)| within(range.map(|share| edge(share, axis)), at[axis]))
                && within(u, sample.u);
            let expected = if inside { *all } else { (NOTHING, f32::INFINITY.to_bits()) };
            prop_assert_eq!(*ours, expected, "{:?}", sample);
        }
    }

    /// Adjacent parts share no sample and miss none: their counts add up.
    #[test]
    fn parts_side_by_side_make_the_whole(kind in kinds(), lens: bool, seed: u64, axis in 0..3_usize) {
        let scene = Scene { soup: Soup::new(kind, 40, seed), lens, table: border_table(seed) };
        let seen = |range: [f32; 2]| {
            let mut planes = [ALL; 3];
            planes[axis] = range;
            let [u, v, t] = planes;
            let clip = Clip::new(u, v, t).unwrap();
            let hits = scene.see(Features::ALL, Clip::NONE, clip);
            hits.iter().filter(|(id, _)| *id != NOTHING).count()
        };
        let parts = [[f32::NEG_INFINITY, 0.0], [0.0, 0.5], [0.5, 1.0], [1.0, f32::INFINITY]].map(seen);
        prop_assert_eq!(parts.iter().sum::<usize>(), seen(ALL));
    }

    /// Above a threshold of zero, smaller motion or blur is dropped, and nothing else changes.
    #[test]
    fn below_its_threshold_a_scene_is_that_without(seed: u64, lens: bool, blurred: bool) {
        let mut soup = Soup::new(SoupKind::Moving, 40, seed);
        for p in soup.open.iter_mut().chain(&mut soup.close) {
            p.z = p.z.max(0.5);
        }
        let table = SampleTable::low_discrepancy(4, seed, LensShape::Disk).unwrap();
        let scene = Scene { soup, lens, table };
        let zero = scene.see(Features::ALL, Clip::NONE, Clip::NONE);
        let tiny = Features { still_px: f32::MIN_POSITIVE, in_focus_px: f32::MIN_POSITIVE, ..Features::ALL };
        prop_assert_eq!(&zero, &scene.see(tiny, Clip::NONE, Clip::NONE), "nothing is that small");
        let (still_px, in_focus_px) = if blurred { (0.0, 1e6) } else { (1e6, 0.0) };
        let large = scene.see(Features { still_px, in_focus_px, ..Features::ALL }, Clip::NONE, Clip::NONE);
        let still = Soup {
            open: scene.soup.open.iter().zip(&scene.soup.close).map(|(a, b)| (*a + *b) * 0.5).collect(),
            close: scene.soup.open.iter().zip(&scene.soup.close).map(|(a, b)| (*a + *b) * 0.5).collect(),
            triangles: scene.soup.triangles.clone(),
        };
        let table = scene.table.clone();
        let without = if blurred {
            Scene { lens: false, ..scene }.see(Features::ALL, Clip::NONE, Clip::NONE)
        } else {
            Scene { soup: still, lens, table }.see(Features::ALL, Clip::NONE, Clip::NONE)
        };
        let same = large.iter().zip(&without).filter(|(a, b)| a.0 == b.0).count();
        // The middle of a motion is rounded in another order in world space than on the image plane.
        prop_assert!(same * 1000 >= large.len() * 995, "{} of {}", same, large.len());
    }
}

/// A triangle drawn still is off by the threshold at most: a single edge moves, and only samples that near to
/// it change.
#[test]
fn dropped_motion_moves_an_outline_by_at_most_the_threshold() {
    let viewport = Viewport::new(32, 32).unwrap();
    let camera = pixel_camera(viewport, 0.25);
    let table = SampleTable::low_discrepancy(64, 3, LensShape::Disk).unwrap();
    let (open, close) =
        (rectangle([-6.0, 6.0], [-40.0, 40.0], 2.0), rectangle([-5.2, 6.8], [-40.0, 40.0], 2.0));
    let draw = Draw::new(Geometry::new(&open, &close, &QUAD).unwrap(), &Plain, Cull::None);
    let see = |still_px: f32| {
        let spec = spec(Features { still_px, ..Features::ALL });
        let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
        RasterPass::new(&camera, &[draw], &settings).visibility().unwrap()
    };
    let (exact, below, above) = (see(0.0), see(0.39), see(0.41));
    assert_eq!(exact, below, "it moves 0.4 pixels each way");
    let mut changed = 0;
    for (([px, _], Sample { x, .. }), (a, b)) in
        sample_positions(&table, viewport).iter().zip(exact.iter().zip(&above))
    {
        if (a.0 == NOTHING) != (b.0 == NOTHING) {
            let place = *px as f32 + x - 16.0;
            let off = (place + 5.6).abs().min((place - 6.4).abs());
            assert!(off <= 0.4001, "a sample {off} pixels from the edge changed");
            changed += 1;
        }
    }
    assert!(changed > 100, "{changed}");
}
