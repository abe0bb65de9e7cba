//! Sample test over a range of samples of a tile, sixteen at a time, and its cost.
//!
//! One generic source serves all combinations of dimensions and all vector widths. Fused multiply-adds are
//! explicit, so all variants give the same bytes.

use std::ops::Range;

use super::{Crossing, SampleRows, View, block_of, hit, vertices_seen};
use crate::sampling::TileSamples;
use crate::setup::Triangle;
use crate::simd::{Kernel, LANES, Lanes, Mask, VectorWidth, dispatch};
use crate::traversal::{Box5, Screen};

/// Stored samples of a tile, in the order of its [`TileSamples`].
pub struct StoredSamples<'a> {
    /// Depth of the nearest hit so far, infinite without a hit.
    pub depth: &'a mut [f32],
    /// Triangle of the nearest hit so far; undefined without a hit.
    pub triangle: &'a mut [u32],
}

/// A sample inside a triangle and beyond the near depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covered {
    /// Place of the sample in its tile.
    pub slot: u16,
    /// Whether the triangle is counter-clockwise as the sample sees it.
    pub counter_clockwise: bool,
    /// Depth of the triangle.
    pub depth: f32,
}

/// Result of a range of sample tests.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hits {
    /// Samples screened by the linearized edges.
    pub screened: u32,
    /// Samples tested.
    pub tested: u32,
    /// Samples inside the triangle and beyond the near depth.
    pub hit: u32,
    /// Slots of samples that now see the triangle, in order.
    pub written: Vec<u16>,
    /// Pixels of the tile whose stored depth was read.
    pub read_pixels: u64,
    /// Pixels of the tile whose stored depth was written.
    pub written_pixels: u64,
    /// The same by pixel of the tile, if requested.
    pub by_pixel: Option<Box<PixelHits>>,
    /// If requested, samples are listed here instead of being stored. Those that two tests share are listed twice.
    pub covered: Option<Vec<Covered>>,
}

/// Sample events of each pixel of a tile, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PixelHits {
    /// Samples screened.
    pub screened: [u32; 64],
    /// Samples tested.
    pub tested: [u32; 64],
    /// Samples inside the triangle and beyond the near depth.
    pub hit: [u32; 64],
    /// Samples with a new depth or stencil value.
    pub written: [u32; 64],
    /// Samples with a new colour.
    pub coloured: [u32; 64],
}

impl Default for PixelHits {
    fn default() -> Self {
        Self { screened: [0; 64], tested: [0; 64], hit: [0; 64], written: [0; 64], coloured: [0; 64] }
    }
}

impl Hits {
    /// Clear the result but keep its memory.
    pub fn clear(&mut self) {
        self.written.clear();
        let by_pixel = self.by_pixel.take().map(|mut pixels| {
            *pixels = PixelHits::default();
            pixels
        });
        let covered = self.covered.take().map(|mut covered| {
            covered.clear();
            covered
        });
        *self = Self { written: std::mem::take(&mut self.written), by_pixel, covered, ..Self::default() };
    }
}

/// Test the samples of a tile in the box against `triangle`, and store those that see it.
pub fn test_run(
    triangle: &Triangle,
    samples: &TileSamples,
    within: &Box5,
    near: f32,
    target: &mut StoredSamples<'_>,
    hits: &mut Hits,
) {
    SampleTest { triangle, samples, within, image: None, screen: None, near, target, hits }
        .run(VectorWidth::widest());
}

/// A triangle to be tested against the samples of a tile, and the memory of the result.
pub struct SampleTest<'a, 'b> {
    /// The triangle.
    pub triangle: &'a Triangle,
    /// Samples of the tile.
    pub samples: &'a TileSamples,
    /// The part of lens and time that is tested.
    pub within: &'a Box5,
    /// Range of image coordinates x and y that is tested, ends included, unless all are.
    pub image: Option<[[f32; 2]; 2]>,
    /// If given, only samples that pass it are tested.
    pub screen: Option<&'a Screen>,
    /// Near depth.
    pub near: f32,
    /// Stored samples, updated with those that see the triangle.
    pub target: &'a mut StoredSamples<'b>,
    /// Counts and written samples.
    pub hits: &'a mut Hits,
}

impl SampleTest<'_, '_> {
    /// Run the test with vectors of a given width; all widths give the same bytes.
    pub fn run(self, width: VectorWidth) {
        if self.samples.parallel { start_in::<true>(width, self) } else { start_in::<false>(width, self) }
    }
}

/// A run of the kernel in the dimensions it needs.
struct Run<'a, 'b, const MOTION: bool, const LENS: bool, const PARALLEL: bool>(SampleTest<'a, 'b>);

fn start_in<const PARALLEL: bool>(width: VectorWidth, job: SampleTest<'_, '_>) {
    match (job.triangle.moving, job.within.lens) {
        (false, false) => dispatch(width, Run::<false, false, PARALLEL>(job)),
        (true, false) => dispatch(width, Run::<true, false, PARALLEL>(job)),
        (false, true) => dispatch(width, Run::<false, true, PARALLEL>(job)),
        (true, true) => dispatch(width, Run::<true, true, PARALLEL>(job)),
    }
}

impl<const MOTION: bool, const LENS: bool, const PARALLEL: bool> Kernel
    for Run<'_, '_, MOTION, LENS, PARALLEL>
{
    #[inline(always)]
    fn run<V: Lanes>(self) {
        let mut job = self.0;
        let within = job.within;
        let run = if MOTION { job.samples.between(within.t[0], within.t[1]) } else { 0..job.samples.len };
        let mut base = run.start / LANES * LANES;
        while base < run.end {
            let mut active = lanes(&run, base) & if LENS { job.in_lens_box::<V>(base) } else { Mask::MAX };
            active &= job.image.map_or(Mask::MAX, |image| job.in_image::<V>(image, base));
            if active != 0
                && let Some(screen) = job.screen
            {
                job.hits.screened += active.count_ones();
                job.note(base, active, |pixels| &mut pixels.screened);
                active &= job.pass::<V, MOTION, LENS>(screen, base);
            }
            if active != 0 {
                job.hits.tested += active.count_ones();
                job.note(base, active, |pixels| &mut pixels.tested);
                let view = View::<V, MOTION, LENS, PARALLEL>::load(&SampleRows::of(job.samples, base));
                job.store(base, &Crossing::new(&job.triangle.corners, &view), active);
            }
            base += LANES;
        }
    }
}

impl SampleTest<'_, '_> {
    /// Lanes with a lens position in the box.
    #[inline(always)]
    fn in_lens_box<V: Lanes>(&self, base: usize) -> Mask {
        let (u, v) = (V::load(block_of(&self.samples.u, base)), V::load(block_of(&self.samples.v, base)));
        within(u, self.within.u) & within(v, self.within.v)
    }

    /// Lanes between the clip planes across the image.
    #[inline(always)]
    fn in_image<V: Lanes>(&self, [across, down]: [[f32; 2]; 2], base: usize) -> Mask {
        let (x, y) = (V::load(block_of(&self.samples.x, base)), V::load(block_of(&self.samples.y, base)));
        within(x, across) & within(y, down)
    }

    /// Lanes that no pair of linearized edges places outside.
    #[inline(always)]
    fn pass<V: Lanes, const MOTION: bool, const LENS: bool>(&self, screen: &Screen, base: usize) -> Mask {
        let samples = self.samples;
        let from = [&samples.from_middle[0], &samples.from_middle[1], &samples.u, &samples.v, &samples.t];
        let mut at = [V::splat(0.0); 5];
        for axis in 0..5 {
            if axis < 2 || (axis < 4 && LENS) || (axis == 4 && MOTION) {
                at[axis] = V::load(block_of(from[axis], base));
            }
        }
        let (mut below, mut above) = (0, 0);
        for edge in 0..3 {
            let slope = &screen.gradient[edge];
            let mut value =
                (V::splat(screen.base[edge]) + V::splat(slope[0]) * at[0]) + V::splat(slope[1]) * at[1];
            if LENS {
                value = (value + V::splat(slope[2]) * at[2]) + V::splat(slope[3]) * at[3];
            }
            if MOTION {
                value = value + V::splat(slope[4]) * at[4];
            }
            below |= V::splat(-screen.margin[edge]).gt(value);
            above |= value.gt(V::splat(screen.margin[edge]));
        }
        !(below & above)
    }

    /// Resolve ties, apply facing and the near depth, and store the nearest hits.
    #[inline(always)]
    fn store<V: Lanes>(&mut self, base: usize, crossing: &Crossing<V>, active: Mask) {
        if self.hits.covered.is_some() {
            return self.list(base, crossing, active);
        }
        let inside = crossing.shown(self.triangle.faces) & active;
        if inside != 0 {
            self.keep_inside(base, inside, crossing.depth());
        }
        let tie = crossing.tie() & active;
        if tie != 0 {
            lanes_of(tie).for_each(|lane| self.keep_exact(base, lane));
        }
    }

    /// Store the nearest hits among the lanes `inside`.
    #[inline(always)]
    fn keep_inside<V: Lanes>(&mut self, base: usize, inside: Mask, depth: V) {
        let (Some(depths), Some(owners)) =
            (block_mut(self.target.depth, base), block_mut(self.target.triangle, base))
        else {
            let mut each = [0.0; LANES];
            depth.store(&mut each);
            return self.keep_each(base, inside, &each);
        };
        let seen = depth.gt(V::splat(self.near)) & inside;
        let stored = V::load(depths);
        let mut nearer = stored.gt(depth) & seen;
        for lane in lanes_of(depth.equal(stored) & seen) {
            nearer |= Mask::from(self.triangle.id < owners[lane]) << lane;
        }
        depth.or_else(nearer, stored).store(depths);
        V::put(nearer, self.triangle.id, owners);
        self.hits.hit += seen.count_ones();
        self.note(base, seen, |pixels| &mut pixels.hit);
        self.note(base, nearer, |pixels| &mut pixels.written);
        let pixels = self.pixels_of(base, seen);
        self.hits.read_pixels |= pixels;
        self.hits.written_pixels |= if nearer == seen { pixels } else { self.pixels_of(base, nearer) };
        self.hits.written.extend(lanes_of(nearer).map(|lane| (base + lane) as u16));
    }

    /// The same, lane by lane, at the end of a tile that does not fill its last block.
    #[cold]
    fn keep_each(&mut self, base: usize, inside: Mask, depths: &[f32; LANES]) {
        lanes_of(inside).for_each(|lane| self.keep(base + lane, depths[lane]));
    }

    /// Pixels of some samples of a block.
    #[inline(always)]
    fn pixels_of(&self, base: usize, mask: Mask) -> u64 {
        let pixels = &self.samples.pixel[base..base + LANES];
        let mut found = 0;
        for lane in lanes_of(mask) {
            found |= 1 << pixels[lane];
        }
        found
    }

    /// Record the pixels of samples, if requested.
    #[inline(always)]
    fn note(&mut self, base: usize, active: Mask, of: fn(&mut PixelHits) -> &mut [u32; 64]) {
        if self.hits.by_pixel.is_some() {
            self.note_pixels(base, active, of);
        }
    }

    #[cold]
    fn note_pixels(&mut self, base: usize, active: Mask, of: fn(&mut PixelHits) -> &mut [u32; 64]) {
        let Some(pixels) = &mut self.hits.by_pixel else { return };
        let counts = of(pixels);
        (0..LANES).filter(|lane| active >> lane & 1 == 1).for_each(|lane| {
            counts[usize::from(self.samples.pixel[base + lane])] += 1;
        });
    }

    #[cold]
    fn keep_exact(&mut self, base: usize, lane: usize) {
        let seen = vertices_seen(&self.triangle.corners, &SampleRows::of(self.samples, base), lane);
        if let Some((depth, _)) = hit(&seen, self.triangle.faces) {
            self.keep(base + lane, depth);
        }
    }

    /// List the samples that see the triangle.
    #[inline(always)]
    fn list<V: Lanes>(&mut self, base: usize, crossing: &Crossing<V>, active: Mask) {
        let shown = crossing.shown(self.triangle.faces) & active;
        let mut depth = [0.0; LANES];
        crossing.depth().store(&mut depth);
        let block = SeenBlock {
            shown,
            tie: crossing.tie() & active,
            counter_clockwise: crossing.shown([false, true]),
            depth,
        };
        self.list_block(base, &block);
    }

    #[inline(never)]
    fn list_block(&mut self, base: usize, block: &SeenBlock) {
        let SeenBlock { shown, tie, counter_clockwise, depth } = *block;
        for lane in (0..LANES).filter(|lane| (shown | tie) >> lane & 1 == 1) {
            let found = if tie >> lane & 1 == 1 {
                let seen = vertices_seen(&self.triangle.corners, &SampleRows::of(self.samples, base), lane);
                hit(&seen, self.triangle.faces)
            } else {
                Some((depth[lane], counter_clockwise >> lane & 1 == 1))
            };
            let Some((depth, counter_clockwise)) = found.filter(|(depth, _)| self.sees(base + lane, *depth))
            else {
                continue;
            };
            let covered = Covered { slot: (base + lane) as u16, counter_clockwise, depth };
            self.hits.covered.get_or_insert_default().push(covered);
        }
    }

    /// Whether a depth is beyond the near depth; if so, the hit is counted.
    #[inline(always)]
    fn sees(&mut self, slot: usize, depth: f32) -> bool {
        if depth <= self.near || depth.is_nan() {
            return false;
        }
        self.hits.hit += 1;
        self.hits.read_pixels |= 1 << self.samples.pixel[slot];
        if let Some(pixels) = &mut self.hits.by_pixel {
            pixels.hit[usize::from(self.samples.pixel[slot])] += 1;
        }
        true
    }

    fn keep(&mut self, slot: usize, depth: f32) {
        if !self.sees(slot, depth) {
            return;
        }
        let pixel = 1_u64 << self.samples.pixel[slot];
        let (stored, owner) = (self.target.depth[slot], self.target.triangle[slot]);
        if depth < stored || (depth == stored && self.triangle.id < owner) {
            self.target.depth[slot] = depth;
            self.target.triangle[slot] = self.triangle.id;
            self.hits.written.push(slot as u16);
            self.hits.written_pixels |= pixel;
            if let Some(pixels) = &mut self.hits.by_pixel {
                pixels.written[usize::from(self.samples.pixel[slot])] += 1;
            }
        }
    }
}

/// What sixteen samples see of a triangle.
struct SeenBlock {
    /// Lanes inside that show a drawn face.
    shown: Mask,
    /// Lanes that [`weights`](super::weights) decides.
    tie: Mask,
    counter_clockwise: Mask,
    depth: [f32; LANES],
}

/// Lanes with a position in the range. No closure, as that would be compiled for the baseline of the target.
#[inline(always)]
fn within<V: Lanes>(position: V, [lo, hi]: [f32; 2]) -> Mask {
    position.ge(V::splat(lo)) & V::splat(hi).ge(position)
}

/// The whole block from `base` on.
#[inline(always)]
fn block_mut<T>(array: &mut [T], base: usize) -> Option<&mut [T; LANES]> {
    array.get_mut(base..base + LANES)?.first_chunk_mut()
}

/// Numbers of the lanes of a mask.
#[inline(always)]
fn lanes_of(mut mask: Mask) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (lane < LANES).then_some(lane)
    })
}

/// Lanes of the block at `base` that belong to `run`.
fn lanes(run: &Range<usize>, base: usize) -> Mask {
    let first = run.start.saturating_sub(base);
    let last = (run.end - base).min(LANES);
    (((1_u32 << last) - 1) & !((1_u32 << first) - 1)) as Mask
}

/// Multiply-adds of one sample test; a separate addition or multiplication counts as one.
///
/// Each vertex: one per coordinate that moves with time, one per axis sheared by the lens, and one per axis
/// translated to the sample, in all views. Each edge: two. The depth: two additions, three multiply-adds and
/// a division.
pub const fn madds(moving: bool, lens: bool) -> u32 {
    let vertex = 2 + if moving { 3 } else { 0 } + if lens { 2 } else { 0 };
    3 * vertex + 3 * 2 + 6
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Shear, Viewport};
    use crate::sampling::{LensShape, SampleTable};
    use crate::setup::Corner;
    use crate::traversal::counted::{Counted, count};
    use crate::traversal::{Number, screen_madds};

    #[test]
    fn lanes_of_a_run() {
        assert_eq!(lanes(&(0..16), 0), 0xFFFF);
        assert_eq!(lanes(&(3..40), 0), 0xFFF8);
        assert_eq!(lanes(&(3..40), 16), 0xFFFF);
        assert_eq!(lanes(&(3..40), 32), 0x00FF);
    }

    /// The first lane, whose operations count.
    impl Lanes for Counted {
        fn splat(value: f32) -> Self {
            Self::from(value)
        }
        fn load(from: &[f32; LANES]) -> Self {
            Self::from(from[0])
        }
        fn store(self, to: &mut [f32; LANES]) {
            to[0] = self.value as f32;
        }
        fn min(self, other: Self) -> Self {
            Number::min(self, other)
        }
        fn max(self, other: Self) -> Self {
            Number::max(self, other)
        }
        fn abs(self) -> Self {
            Number::abs(self)
        }
        fn times_plus(self, by: Self, plus: Self) -> Self {
            self * by + plus
        }
        fn times_from(self, by: Self, from: Self) -> Self {
            from - self * by
        }
        fn gt(self, other: Self) -> Mask {
            Mask::from(self > other)
        }
        fn ge(self, other: Self) -> Mask {
            Mask::from(self >= other)
        }
        fn equal(self, other: Self) -> Mask {
            Mask::from(self == other)
        }
        fn put(mask: Mask, value: u32, to: &mut [u32; LANES]) {
            to[0] = if mask & 1 == 1 { value } else { to[0] };
        }
        fn number(_: Mask, first: u32, to: &mut [u32; LANES]) {
            to[0] = first;
        }
        fn or_else(self, mask: Mask, other: Self) -> Self {
            if mask & 1 == 1 { self } else { other }
        }
        fn largest(self) -> f32 {
            self.value as f32
        }
    }

    /// A tile with samples in a view.
    fn tile(shear: &Shear) -> TileSamples {
        let table = SampleTable::low_discrepancy(1, 1, LensShape::Disk).unwrap();
        let mut samples = TileSamples::default();
        samples.fill(&table, Viewport::new(16, 16).unwrap(), shear, [8, 0], 8);
        samples
    }

    fn test_cost<const MOTION: bool, const LENS: bool, const PARALLEL: bool>(shear: &Shear) -> u32 {
        let (samples, corners) = (tile(shear), [Corner { open: [1.0, 2.0, 3.0], delta: [0.5; 3] }; 3]);
        let see = || {
            let rows = SampleRows::of(&samples, 0);
            let view = View::<Counted, MOTION, LENS, PARALLEL>::load(&rows);
            Crossing::new(&corners, &view).depth()
        };
        count(see).0
    }

    fn screen_cost<const MOTION: bool, const LENS: bool>() -> u32 {
        let (samples, within) = (tile(&Shear::default()), Box5::whole(LENS));
        let triangle = Triangle {
            id: 0,
            corners: [Corner::default(); 3],
            moving: MOTION,
            behind: false,
            faces: [true; 2],
            slack: [0.0; 2],
        };
        let screen = Screen {
            value: [1.0; 3],
            base: [1.0; 3],
            gradient: [[1.0; 5]; 3],
            margin: [0.0; 3],
            extent: [1.0; 3],
        };
        let mut target = StoredSamples { depth: &mut [], triangle: &mut [] };
        let (within, near, hits) = (&within, 0.1, &mut Hits::default());
        let job = SampleTest {
            triangle: &triangle,
            samples: &samples,
            within,
            image: None,
            screen: None,
            near,
            target: &mut target,
            hits,
        };
        count(|| job.pass::<Counted, MOTION, LENS>(&screen, 0)).0
    }

    #[test]
    fn the_cost_of_each_dimension_is_that_of_the_kernel() {
        let shear = Shear::new([9.0, -9.0], [3.0, -3.0]);
        let all = [(false, false), (true, false), (false, true), (true, true)];
        let costs = all.map(|(moving, lens)| madds(moving, lens));
        let counted = [
            test_cost::<false, false, false>(&shear),
            test_cost::<true, false, false>(&shear),
            test_cost::<false, true, false>(&shear),
            test_cost::<true, true, false>(&shear),
        ];
        assert_eq!(counted, costs);
        let parallel = Shear { parallel: true, ..shear };
        let counted = [
            test_cost::<false, false, true>(&parallel),
            test_cost::<true, false, true>(&parallel),
            test_cost::<false, true, true>(&parallel),
            test_cost::<true, true, true>(&parallel),
        ];
        assert_eq!(counted, costs);
        let counted = [
            screen_cost::<false, false>(),
            screen_cost::<true, false>(),
            screen_cost::<false, true>(),
            screen_cost::<true, true>(),
        ];
        assert_eq!(counted, all.map(|(moving, lens)| screen_madds(moving, lens)));
    }
}
