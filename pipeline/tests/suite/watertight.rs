//! Watertight: a patch that projects one to one covers each sample once, including those on its inner edges
//! and vertices, at any lens position and time.

use crate::common::meshes::*;
use crate::common::*;
use pipeline::sampling::Sample;
use pipeline::*;
use proptest::prelude::*;

/// Cells along a side of a patch, and the size of one in pixels; the patch extends beyond the tile of 8x8
/// pixels on no side.
const CELLS: usize = 5;
const CELL_PX: f32 = 1.3;

/// A patch around `centre`: a jittered grid with a random diagonal in each cell. Its depth is a plane in the
/// scene, from which a height field lifts the vertices. Its motion is a similarity of the image, the same for
/// all vertices.
fn patch(r: &mut Uniform, centre: [f32; 2], dims: Dims, lift: f32) -> Mesh {
    let half = 0.5 * CELL_PX * CELLS as f32;
    let (nearness, tilt) = (r.within(0.15, 0.5), [r.within(-0.004, 0.004), r.within(-0.004, 0.004)]);
    let (turn, grow) = (r.within(-0.4, 0.4), r.within(0.85, 1.1));
    let (drift, deeper) = ([r.within(-1.0, 1.0), r.within(-1.0, 1.0)], r.within(0.6, 1.6));
    let mut vertices = Vec::new();
    for i in 0..(CELLS + 1) * (CELLS + 1) {
        let grid = [i % (CELLS + 1), i / (CELLS + 1)].map(|step| step as f32 * CELL_PX - half);
        let at = grid.map(|c| c + CELL_PX * r.within(-0.11, 0.11));
        let plane = nearness + tilt[0] * at[0] + tilt[1] * at[1] + lift * r.within(-1.0, 1.0);
        // The image shift by a lens is linear in 1 / w in perspective, and in w in an orthographic view.
        let w = if dims.parallel { 4.0 * plane } else { 1.0 / plane };
        let open = dims.vertex([centre[0] + at[0], centre[1] + at[1]], w);
        let (sin, cos) = (grow * libm::sinf(turn), grow * libm::cosf(turn));
        let turned = [cos * at[0] - sin * at[1] + drift[0], sin * at[0] + cos * at[1] + drift[1]];
        let w = w * deeper;
        let close = dims.vertex([centre[0] + turned[0], centre[1] + turned[1]], w);
        vertices.push(MovingVertex { open, close: if dims.moving { close } else { open } });
    }
    let mut triangles = Vec::new();
    for cell in 0..CELLS * CELLS {
        let a = cell / CELLS * (CELLS + 1) + cell % CELLS;
        let [b, c, d] = [a + 1, a + CELLS + 2, a + CELLS + 1];
        // Soup and order must not matter, so corners start anywhere and some triangles have inverted winding.
        let pair = if r.next() < 0.5 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
        for mut triangle in pair {
            triangle.rotate_left((r.next() * 3.0) as usize);
            if r.next() < 0.3 {
                triangle.swap(0, 1);
            }
            triangles.push(triangle);
        }
    }
    Mesh { vertices, triangles }
}

/// Vertices of the outline of a patch, in order.
fn outline() -> Vec<usize> {
    let side = CELLS + 1;
    let top = (0..CELLS).collect::<Vec<_>>();
    let right = (0..CELLS).map(|i| i * side + CELLS).collect::<Vec<_>>();
    let bottom = (0..CELLS).map(|i| side * side - 1 - i).collect::<Vec<_>>();
    let left = (0..CELLS).map(|i| (CELLS - i) * side).collect::<Vec<_>>();
    [top, right, bottom, left].concat()
}

/// Position of a point relative to an outline: strictly inside, strictly outside, or `None` within `margin`
/// of it.
fn inside(at: [f64; 2], outline: &[[f64; 2]], margin: f64) -> Option<bool> {
    let mut odd = false;
    for (p, q) in outline.iter().zip(outline.iter().cycle().skip(1)) {
        let [d, from] = [[q[0] - p[0], q[1] - p[1]], [at[0] - p[0], at[1] - p[1]]];
        let along = ((from[0] * d[0] + from[1] * d[1]) / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
        let off = [from[0] - along * d[0], from[1] - along * d[1]];
        if off[0].hypot(off[1]) < margin {
            return None;
        }
        odd ^= (p[1] > at[1]) != (q[1] > at[1]) && at[0] < p[0] + d[0] * (from[1] / d[1]);
    }
    Some(odd)
}

/// Check how often each sample is covered against the outline.
fn check_patch(mesh: &Mesh, probe: &Probe, far: bool) {
    let mut covered = vec![0; probe.samples.len];
    for triangle in 0..mesh.triangles.len() {
        for (slot, seen) in probe.see(mesh.corners(triangle), Cull::None).iter().enumerate() {
            covered[slot] += u32::from(seen.is_some());
        }
    }
    let margin = if far { 0.02 } else { 1e-4 };
    let rim = outline();
    let (mut within, mut without) = (0, 0);
    for (slot, &count) in covered.iter().enumerate() {
        let position = probe.at(slot);
        assert_one_to_one(mesh, probe, &position);
        let rim: Vec<_> = rim.iter().map(|&v| image(&mesh.vertices[v], &position, &probe.shear)).collect();
        match inside([position.x, position.y], &rim, margin) {
            Some(true) => assert_eq!(count, 1, "a sample inside is covered {count} times: {position:?}"),
            Some(false) => assert_eq!(count, 0, "a sample outside is covered {count} times: {position:?}"),
            None => assert!(count <= 1, "a sample on the outline is covered {count} times: {position:?}"),
        }
        within += u32::from(count == 1);
        without += u32::from(count == 0);
    }
    assert!(within > 100 && without > 0, "{within} samples inside and {without} outside show little");
}

fn image(vertex: &MovingVertex, position: &SamplePosition, shear: &Shear) -> [f64; 2] {
    let [x, y, w] = position.sheared(vertex, shear);
    [x, y].map(|c| c / weight(shear, w))
}

/// Precondition of the property: no triangle of the patch is turned over, as seen by this sample.
fn assert_one_to_one(mesh: &Mesh, probe: &Probe, position: &SamplePosition) {
    let seen: Vec<_> = mesh.vertices.iter().map(|v| image(v, position, &probe.shear)).collect();
    for cell in 0..CELLS * CELLS {
        let a = cell / CELLS * (CELLS + 1) + cell % CELLS;
        let around = [a, a + 1, a + CELLS + 2, a + CELLS + 1].map(|v| seen[v]);
        for k in 0..4 {
            let [p, q, r] = [0, 1, 2].map(|step| around[(k + step) % 4]);
            let area = (q[0] - p[0]) * (r[1] - p[1]) - (r[0] - p[0]) * (q[1] - p[1]);
            assert!(area > 0.05, "the patch of this test folds over: {area} at {position:?}");
        }
    }
}

fn patch_case(dims: Dims, lifted: bool, far: bool, borders: bool, seed: u64) {
    let mut r = Uniform::new(seed);
    let (viewport, origin, origin_px) = place(far);
    let centre = [0, 1].map(|axis| origin_px[axis] + 4.0);
    // A lens of 2.5 pixels moves a lifted vertex by 0.02 * 2.5 pixels, well within the limits of the grid.
    let mesh = patch(&mut r, centre, dims, if lifted { 0.02 } else { 0.0 });
    let shear = random_shear(&mut r, dims, 2.5);
    let table = if borders { border_table(seed) } else { on_edges(&mut r, &mesh, &shear, origin_px, dims) };
    check_patch(&mesh, &Probe::new(&table, viewport, shear, origin, 1e-3), far);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 160, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn a_patch_covers_each_sample_once(dims in dims(), lifted: bool, far: bool, seed: u64) {
        patch_case(dims, lifted, far, false, seed);
    }

    #[test]
    fn a_patch_covers_each_sample_on_borders_once(dims in dims(), lifted: bool, seed: u64) {
        patch_case(dims, lifted, false, true, seed);
    }
}

/// Vertices and samples on corners and centres of pixels, with numbers short enough for every operation to be
/// exact: ties everywhere, at every time and lens position.
#[test]
fn every_sample_on_a_corner_of_a_grid_has_one_owner() {
    for ways in 0..8 {
        let [moving, lens, parallel] = [1, 2, 4].map(|bit| ways & bit != 0);
        let shear = if lens { Shear::new([4.0, -4.0], [1.0, -1.0]) } else { Shear::default() };
        let (shear, weight) = (Shear { parallel, ..shear }, if parallel { 1.0 } else { 2.0 });
        // A grid of 4x4 cells of 4 pixels, at depth 2 throughout: half of the lens moves it by half a pixel.
        let vertex = |i: usize| {
            let at = [i % 5, i / 5].map(|step| step as f32 * 4.0 - 8.0);
            let (open, shift) =
                ([at[0] * weight, at[1] * weight, 2.0], if moving { 2.0 * weight } else { 0.0 });
            MovingVertex { open, close: [open[0] + shift, open[1] - shift, 2.0] }
        };
        let mut triangles = Vec::new();
        for cell in 0..16 {
            let a = cell / 4 * 5 + cell % 4;
            let flip = (cell + cell / 4) % 2 == 0;
            let pair = if flip {
                [[a, a + 1, a + 6], [a, a + 6, a + 5]]
            } else {
                [[a, a + 1, a + 5], [a + 1, a + 6, a + 5]]
            };
            triangles.extend(pair);
        }
        let mesh = Mesh { vertices: (0..25).map(vertex).collect(), triangles };
        let block: Vec<_> = (0..64 * 4)
            .map(|i| {
                let half = |bit: u32| 0.5 * ((i >> bit) & 1) as f32;
                Sample { x: half(0), y: half(1), u: 2.0 * half(2) - 0.5, v: half(3), t: half(4) }
            })
            .collect();
        let table = repeated(4, &block);
        let viewport = Viewport::new(24, 24).unwrap();
        let (mut once, mut columns) = (0, 0);
        for tile in 0..9 {
            let probe = Probe::new(&table, viewport, shear, [tile % 3 * 8, tile / 3 * 8], 1e-3);
            let mut covered = vec![0; probe.samples.len];
            for triangle in 0..mesh.triangles.len() {
                let seen = probe.see(mesh.corners(triangle), Cull::None);
                covered.iter_mut().zip(seen).for_each(|(count, seen)| *count += u32::from(seen.is_some()));
            }
            for (slot, &count) in covered.iter().enumerate() {
                let position = probe.at(slot);
                // Half open: the sample is moved by an infinitely small step towards +x and, smaller still,
                // +y.
                let from = image(&mesh.vertices[0], &position, &shear);
                let at = [position.x - from[0], position.y - from[1]];
                let expected = at.iter().all(|c| (0.0..16.0).contains(c));
                assert_eq!(count, u32::from(expected), "moving {moving} {shear:?}: {at:?} {position:?}");
                once += count;
                columns += u32::from(at[0] % 4.0 == 0.0 && expected);
            }
        }
        assert_eq!(once, 16 * 16 * 4, "a half-open square of 16 pixels holds the samples of 256 pixels");
        assert!(columns > 50, "samples lie on edges");
    }
}
