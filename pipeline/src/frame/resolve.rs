//! Resolve: from the samples of pixels to their means, at the end of a raster pass and as a pass of its own;
//! and the work of the colour unit that does it.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::Range;

use activity::{Event, PacketCounts};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::bin::Bin;
use super::cells::{Grid, own_pixel};
use super::pass::{First, Pass, Plane};
use super::shaded::{SampleView, ShadedTriangle};
use super::{Settings, Shading};
use crate::depth::DepthTile;
use crate::memory::{LINE_BYTES, MemorySystem};
use crate::random::{GOLDEN, mix};
use crate::sampling::TileSamples;
use crate::shading::{QuadAccess, QuadSet, lane_of};
use crate::simd::prefetch;
use crate::surface::{SurfaceSpec, Texels};

/// The images; each pixel is the mean of its samples.
pub(super) fn resolve(pass: &Pass<'_>, bins: &[Bin]) -> Vec<Vec<Vec3>> {
    if pass.views.is_empty() {
        return Vec::new();
    }
    let tiles =
        bins.par_iter().map_init(Scratch::default, |scratch, bin| resolve_bin(pass, bin, scratch)).collect();
    assemble(pass, tiles)
}

/// First pixel of a tile, and the colours of its pixels: view by view and row by row.
pub(super) type TilePixels = ([u32; 2], Vec<Vec3>);

/// The images with the pixels of touched tiles, by bin; all others have the colour of the background.
pub(super) fn assemble(pass: &Pass<'_>, tiles: Vec<Vec<TilePixels>>) -> Vec<Vec<Vec3>> {
    let viewport = pass.settings.viewport;
    let empty = |view: &Range<u32>| if view.is_empty() { Vec3::ZERO } else { pass.settings.background };
    let mut images: Vec<_> = pass.views.iter().map(|view| vec![empty(view); viewport.pixels()]).collect();
    let side = pass.settings.spec.tile_px;
    for (origin, pixels) in tiles.into_iter().flatten() {
        for (image, of_view) in images.iter_mut().zip(pixels.chunks_exact((side * side) as usize)) {
            for (pixel, colour) in (0..).zip(of_view) {
                let [x, y] = [origin[0] + pixel % side, origin[1] + pixel / side];
                if x < viewport.width() && y < viewport.height() {
                    image[y as usize * viewport.width() as usize + x as usize] = *colour;
                }
            }
        }
    }
    images
}

/// Visible triangle and depth bits of every sample, pixel by pixel in rows.
pub(super) fn visible(pass: &Pass<'_>, bins: &[Bin]) -> Vec<(u32, u32)> {
    let (viewport, per_pixel) = (pass.settings.viewport, pass.settings.samples.per_pixel());
    let nothing = (DepthTile::NO_TRIANGLE, pass.clear.depth.to_bits());
    let mut seen = vec![nothing; viewport.pixels() * per_pixel as usize];
    if let First::Loaded(texels) = &pass.depth.first {
        seen.iter_mut().zip(texels.values()).for_each(|(seen, value)| seen.1 = value.x.to_bits());
    }
    let mut samples = TileSamples::default();
    for bin in bins {
        for (index, tile) in bin.tiles.iter().enumerate() {
            let Some(tile) = tile else { continue };
            let (origin, side) = (bin.tile_origin(pass, index), pass.settings.spec.tile_px);
            samples.fill(pass.settings.samples, viewport, &pass.projection.shear, origin, side);
            for slot in 0..samples.len {
                let index = samples.in_image(slot, origin, side, viewport, per_pixel);
                seen[index] = (tile.triangle[slot], tile.depth[slot].to_bits());
            }
        }
    }
    seen
}

/// Contents of the targets of a pass after it: colours, then depths if there are any.
pub(super) fn stored(pass: &Pass<'_>, bins: &[Bin]) -> Vec<Texels> {
    let depth = pass.depth.format.map(|_| &pass.depth);
    let planes: Vec<&Plane> = pass.colours.iter().chain(depth).collect();
    let mut contents: Vec<Texels> = planes.iter().filter_map(|plane| first(pass, plane)).collect();
    let mut samples = TileSamples::default();
    let value = |tile: &DepthTile, target: usize, slot: usize| match tile.colours.get(target) {
        Some(colours) => colours[slot],
        None => {
            Vec4::new(tile.depth[slot], f32::from(tile.stencil.get(slot).copied().unwrap_or(0)), 0.0, 1.0)
        }
    };
    for bin in bins {
        for (index, tile) in bin.tiles.iter().enumerate() {
            let Some(tile) = tile else { continue };
            let origin = bin.tile_origin(pass, index);
            let Settings { spec, viewport, samples: source, .. } = *pass.settings;
            samples.fill(source, viewport, &pass.projection.shear, origin, spec.tile_px);
            for slot in 0..samples.len {
                let at = pass.in_image(&samples, slot, origin);
                contents
                    .iter_mut()
                    .enumerate()
                    .for_each(|(target, texels)| texels.set(at, value(tile, target, slot)));
            }
        }
    }
    contents
}

/// Contents of a target before the first draw.
fn first(pass: &Pass<'_>, plane: &Plane) -> Option<Texels> {
    let (viewport, samples) = (pass.settings.viewport, pass.settings.samples.per_pixel());
    Some(match &plane.first {
        First::Loaded(texels) => Texels::clone(texels),
        First::Cleared(value) => {
            Texels::filled(&SurfaceSpec::new("", viewport, plane.format?).sampled(samples), *value)
        }
    })
}

/// Touched tiles of a bin: first pixel and pixels of each, view by view and row by row.
fn resolve_bin(pass: &Pass<'_>, bin: &Bin, scratch: &mut Scratch) -> Vec<TilePixels> {
    let mut samples = std::mem::take(&mut scratch.samples);
    let mut resolved = Vec::new();
    for (index, tile) in bin.tiles.iter().enumerate() {
        let Some(tile) = tile else { continue };
        let origin = bin.tile_origin(pass, index);
        let settings = pass.settings;
        samples.fill(
            settings.samples,
            settings.viewport,
            &pass.projection.shear,
            origin,
            settings.spec.tile_px,
        );
        resolved.push((origin, resolve_tile(pass, tile, &samples, origin, scratch)));
    }
    scratch.samples = samples;
    resolved
}

/// Memory reused by a worker.
#[derive(Default)]
pub(super) struct Scratch {
    samples: TileSamples,
    slots: SlotsByTriangle,
    /// Cells of one triangle.
    cells: ShadedCells,
}

/// Cells that the samples of one triangle see in a tile, and their colours.
#[derive(Default)]
struct ShadedCells {
    /// Cell of each sample.
    cells: Vec<[i32; 2]>,
    quads: QuadSet,
    /// By quad and lane.
    colours: Vec<Vec3>,
    /// Index in `colours` of each sample.
    of_sample: Vec<u32>,
    known: KnownColours,
}

/// Colours of cells shaded before, in this tile or another one: with blur, many tiles see a cell. Each key
/// has one place, and the last one keeps it.
struct KnownColours(Vec<KnownQuad>);

/// Colours of some cells of a quad.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct KnownQuad {
    triangle: u32,
    quad: [i32; 2],
    /// Mask of the cells that were shaded.
    lanes: u8,
    colours: [Vec3; 4],
}

impl Default for KnownColours {
    fn default() -> Self {
        let none =
            KnownQuad { triangle: DepthTile::NO_TRIANGLE, quad: [0; 2], lanes: 0, colours: [Vec3::ZERO; 4] };
        Self(vec![none; 1 << Self::BITS])
    }
}

impl KnownColours {
    /// Places, as a logarithm: several times the quads of a bin, yet few enough for the L2 cache of the host.
    const BITS: u32 = 13;

    fn place(triangle: u32, quad: [i32; 2]) -> usize {
        let [x, y] = quad.map(|part| u64::from(part as u16));
        let key = u64::from(triangle) << 32 | x << 16 | y;
        (key.wrapping_mul(GOLDEN) >> (64 - Self::BITS)) as usize
    }

    /// Prefetches what is known of a quad.
    fn prefetch(&self, triangle: u32, quad: [i32; 2]) {
        prefetch(&self.0[Self::place(triangle, quad)]);
    }

    /// Colours of the requested cells of a quad. Those that are not known are shaded.
    fn of(
        &mut self,
        triangle: u32,
        access: &QuadAccess,
        shade: impl FnOnce(&QuadAccess) -> [Vec4; 4],
    ) -> &[Vec3; 4] {
        let known = &mut self.0[Self::place(triangle, access.quad)];
        if (known.triangle, known.quad) != (triangle, access.quad) {
            (known.triangle, known.quad, known.lanes) = (triangle, access.quad, 0);
        }
        let lanes = access.lanes & !known.lanes;
        if lanes != 0 {
            let shaded = shade(&QuadAccess { lanes, ..*access });
            for lane in (0..4).filter(|lane| lanes >> lane & 1 == 1) {
                known.colours[lane] = shaded[lane].truncate();
            }
            known.lanes |= lanes;
        }
        &known.colours
    }
}

/// Colours of a tile: those stored, or those of the visible triangles.
fn resolve_tile(
    pass: &Pass<'_>,
    tile: &DepthTile,
    samples: &TileSamples,
    origin: [u32; 2],
    scratch: &mut Scratch,
) -> Vec<Vec3> {
    if pass.is_ordered {
        let colours = tile.colours.first().into_iter().flatten();
        let mut sums = Sums::new(pass, samples);
        colours.enumerate().for_each(|(slot, colour)| sums.add(slot, colour.truncate()));
        return sums.means();
    }
    shade_tile(pass, &tile.triangle, (samples, origin), scratch)
}

/// Colours of a tile whose samples see these triangles. Each cell is shaded once, or every sample.
pub(super) fn shade_tile(
    pass: &Pass<'_>,
    triangles: &[u32],
    (samples, origin): (&TileSamples, [u32; 2]),
    scratch: &mut Scratch,
) -> Vec<Vec3> {
    let mut sums = Sums::new(pass, samples);
    let Scratch { slots, cells, .. } = scratch;
    slots.sort(triangles);
    // Their order fixes that of sums.
    for (triangle, group) in slots.groups() {
        if triangle == DepthTile::NO_TRIANGLE {
            group.iter().for_each(|&slot| sums.add_background(slot as usize));
            continue;
        }
        let add = &mut |slot, colour| sums.add(slot, colour);
        shade_group(pass, (triangle, group), (samples, origin), cells, add);
    }
    sums.means()
}

/// Slots of a tile, sorted by the triangles they see.
#[derive(Default)]
struct SlotsByTriangle {
    /// Triangles, in the order of first sight until they are sorted, each with the number of its slots and
    /// then their end.
    triangles: Vec<(u32, u32, u16)>,
    /// Place in that order of the triangle of each slot.
    of_slot: Vec<u16>,
    /// Where the slots of each triangle go, by place in that order.
    next: Vec<u32>,
    slots: Vec<u16>,
    /// Open hash table by low bits of the triangle: its place in the order of first sight.
    known: Vec<u16>,
}

impl SlotsByTriangle {
    /// Stands for no place.
    const FREE: u16 = u16::MAX;

    /// Sorts the slots of samples that see these triangles: by triangle, then by slot.
    fn sort(&mut self, triangles: &[u32]) {
        self.triangles.clear();
        self.of_slot.clear();
        self.known.clear();
        self.known.resize((2 * triangles.len()).next_power_of_two(), Self::FREE);
        for &triangle in triangles {
            let place = self.place(triangle);
            self.triangles[place].1 += 1;
            self.of_slot.push(place as u16);
        }
        self.triangles.sort_unstable();
        self.next.resize(self.triangles.len(), 0);
        let mut end = 0;
        for (_, count, place) in &mut self.triangles {
            self.next[usize::from(*place)] = end;
            end += *count;
            *count = end;
        }
        self.slots.resize(triangles.len(), 0);
        for (slot, &place) in (0..).zip(&self.of_slot) {
            let next = &mut self.next[usize::from(place)];
            self.slots[*next as usize] = slot;
            *next += 1;
        }
    }

    /// Place of a triangle in the order of first sight.
    #[inline(always)]
    fn place(&mut self, triangle: u32) -> usize {
        let last = self.known.len() - 1;
        let mut at = triangle as usize & last;
        loop {
            let place = self.known[at];
            match self.triangles.get(usize::from(place)) {
                Some((known, ..)) if *known == triangle => return usize::from(place),
                Some(_) => at = (at + 1) & last,
                None => break,
            }
        }
        let place = self.triangles.len();
        self.known[at] = place as u16;
        self.triangles.push((triangle, 0, place as u16));
        place
    }

    /// Each triangle with its slots, the lowest first.
    fn groups(&self) -> impl Iterator<Item = (u32, &[u16])> {
        let first = std::iter::once(0).chain(self.triangles.iter().map(|&(_, end, _)| end));
        first
            .zip(&self.triangles)
            .map(|(first, &(triangle, end, _))| (triangle, &self.slots[first as usize..end as usize]))
    }
}

/// Sums of the colours of a tile, by view and pixel.
struct Sums<'a> {
    pass: &'a Pass<'a>,
    samples: &'a TileSamples,
    sums: Vec<Vec3>,
    /// Samples without a triangle, in the same order.
    missed: Vec<u16>,
    /// Whether there is one view of all samples.
    is_whole: bool,
}

impl<'a> Sums<'a> {
    fn new(pass: &'a Pass<'_>, samples: &'a TileSamples) -> Self {
        let (side, per_pixel) = (pass.settings.spec.tile_px, pass.settings.samples.per_pixel());
        let is_whole = matches!(&pass.views[..], [view] if *view == (0..per_pixel));
        let sums = vec![Vec3::ZERO; (side * side) as usize * pass.views.len()];
        Self { pass, samples, missed: vec![0; sums.len()], sums, is_whole }
    }

    #[inline(always)]
    fn add(&mut self, slot: usize, colour: Vec3) {
        self.add_to(slot, colour, 0);
    }

    /// Adds a colour, and so many samples without a triangle.
    #[inline(always)]
    fn add_to(&mut self, slot: usize, colour: Vec3, missed: u16) {
        let pixel = self.samples.pixel[slot] as usize;
        if self.is_whole {
            self.sums[pixel] += colour;
            self.missed[pixel] += missed;
            return;
        }
        let index = self.samples.in_pixel(slot, self.pass.settings.samples.per_pixel());
        let pixels = self.sums.len() / self.pass.views.len().max(1);
        let views = self.pass.views.iter().enumerate().filter(|(_, samples)| samples.contains(&index));
        views.for_each(|(view, _)| {
            self.sums[view * pixels + pixel] += colour;
            self.missed[view * pixels + pixel] += missed;
        });
    }

    fn add_background(&mut self, slot: usize) {
        self.add_to(slot, self.pass.settings.background, 1);
    }

    /// Means of the samples of each pixel of each view. A pixel without triangles has the colour of the
    /// background to the last bit, as in tiles that no triangle touches.
    fn means(self) -> Vec<Vec3> {
        let Self { pass, sums, missed, .. } = self;
        let pixels = sums.len() / pass.views.len().max(1);
        let pixels = pixels.max(1);
        let views = sums.chunks_exact(pixels).zip(missed.chunks_exact(pixels)).zip(&pass.views);
        let means = views.flat_map(|((sums, missed), view)| {
            let count = view.len() as f32;
            sums.iter().zip(missed).map(move |(sum, &missed)| match view.is_empty() {
                true => Vec3::ZERO,
                false if usize::from(missed) == view.len() => pass.settings.background,
                false => *sum / count,
            })
        });
        means.collect()
    }
}

/// Calls `add` with the colours of the samples in the slots `group` of the tile at `origin`, which see `triangle`.
fn shade_group(
    pass: &Pass<'_>,
    (triangle, group): (u32, &[u16]),
    (samples, origin): (&TileSamples, [u32; 2]),
    cells: &mut ShadedCells,
    add: &mut impl FnMut(usize, Vec3),
) {
    let (side, per_pixel) = (pass.settings.spec.tile_px, pass.settings.samples.per_pixel());
    let (corners, moving) = pass.moving_corners(triangle);
    let slots = group.iter().map(|&slot| slot as usize);
    match pass.shading {
        Shading::PerSample => {
            let surface = ShadedTriangle::new(pass, triangle);
            slots.for_each(|slot| {
                let at = (own_pixel(samples, slot, origin, side), samples.in_pixel(slot, per_pixel));
                let view = SampleView::of_slot(&corners, samples, slot, at);
                add(slot, surface.shade_at(&surface.lane(), &view).truncate());
            });
        }
        Shading::Cached => {
            let grid = Grid::new(pass, (&corners, moving), samples, origin);
            cells.shade(pass, triangle, |cells| grid.cells(group, cells));
            slots.zip(cells.in_order()).for_each(|(slot, colour)| add(slot, colour));
        }
    }
}

impl ShadedCells {
    /// Finds the colours of the cells that samples see on a triangle, which `find` lists.
    fn shade(&mut self, pass: &Pass<'_>, triangle: u32, find: impl FnOnce(&mut Vec<[i32; 2]>)) {
        let Self { cells, quads, colours, of_sample, known } = self;
        quads.clear();
        cells.clear();
        find(cells);
        of_sample.clear();
        of_sample.extend(cells.iter().map(|&cell| (4 * quads.request(cell, 0) + lane_of(cell)) as u32));
        colours.clear();
        quads.quads().iter().for_each(|access| known.prefetch(triangle, access.quad));
        let mut surface = None;
        for access in quads.quads() {
            colours.extend(known.of(triangle, access, |access| {
                let surface = surface.get_or_insert_with(|| ShadedTriangle::new(pass, triangle));
                surface.shade_quad(&surface.lane(), access)
            }));
        }
    }

    /// Colours in the order of the samples.
    fn in_order(&self) -> impl Iterator<Item = Vec3> {
        self.of_sample.iter().map(|&at| self.colours[at as usize])
    }
}

/// Mean of the samples of each pixel of a surface, in linear light and the order of the samples.
pub(super) fn mean_values(texels: &Texels) -> Vec<Vec4> {
    let [width, height] = texels.size();
    let samples = texels.samples() as usize;
    let mean = |pixel: usize| {
        let sum: Vec4 = (0..samples).map(|sample| texels.get(pixel * samples + sample)).sum();
        sum / samples as f32
    };
    (0..width as usize * height as usize).into_par_iter().map(mean).collect()
}

/// A line of samples that is read to resolve them.
pub(super) struct SampleLine {
    pub address: u64,
    /// Whether it holds its clear value.
    pub is_fresh: bool,
    /// Lines that are no longer needed afterwards.
    pub dropped: [Option<u64>; 2],
}

/// Samples of a tile that become pixels: work of the colour unit.
#[derive(Default)]
pub(super) struct TileResolve {
    /// Words of samples.
    pub samples: u32,
    /// Words of pixels.
    pub pixels: u32,
    pub reads: Vec<SampleLine>,
    /// Numbers of the lines that are written whole.
    pub writes: Vec<u64>,
}

impl TileResolve {
    /// Reads the samples, then writes the pixels.
    pub fn count(&self, memory: &mut MemorySystem, counts: &mut PacketCounts) {
        counts[Event::SamplesResolved] = self.samples;
        counts[Event::PixelsResolved] = self.pixels;
        for SampleLine { address, is_fresh, dropped } in &self.reads {
            memory.colour(*address, false, *is_fresh, counts);
            dropped.iter().flatten().for_each(|line| memory.discard(*line));
        }
        self.writes.iter().for_each(|line| memory.colour(line * LINE_BYTES, true, true, counts));
    }
}

/// Call `each` for every line that holds one of `pixels` of a tile, with the mask of these pixels. The first
/// byte of the tile and the bytes of a pixel are given.
pub(super) fn tile_lines([first_byte, pixel_bytes]: [u64; 2], pixels: u64, mut each: impl FnMut(u64, u64)) {
    if LINE_BYTES.is_multiple_of(pixel_bytes) && first_byte.is_multiple_of(LINE_BYTES) {
        return tile_lines_of_pixels(
            first_byte / LINE_BYTES,
            (LINE_BYTES / pixel_bytes) as u32,
            pixels,
            each,
        );
    }
    let (mut remaining, mut open) = (pixels, None);
    while remaining != 0 {
        let pixel = u64::from(remaining.trailing_zeros());
        remaining &= remaining - 1;
        let first = first_byte + pixel * pixel_bytes;
        for line in first / LINE_BYTES..=(first + pixel_bytes - 1) / LINE_BYTES {
            open = match open {
                Some((same, held)) if same == line => Some((line, held | 1 << pixel)),
                before => {
                    before.into_iter().for_each(|(line, held)| each(line, held));
                    Some((line, 1 << pixel))
                }
            };
        }
    }
    open.into_iter().for_each(|(line, held)| each(line, held));
}

/// The same where each line holds `count` whole pixels, a power of two.
fn tile_lines_of_pixels(first_line: u64, count: u32, pixels: u64, mut each: impl FnMut(u64, u64)) {
    let (of_line, mut remaining) = (u64::MAX >> (64 - count), pixels);
    while remaining != 0 {
        let line = remaining.trailing_zeros() >> count.ilog2();
        let held = remaining & of_line << (line << count.ilog2());
        each(first_line + u64::from(line), held);
        remaining &= !held;
    }
}

/// Values by cell.
pub(super) type ByCell<T> = HashMap<[i32; 2], T, BuildHasherDefault<CellHasher>>;

/// Hasher of the two coordinates of a cell. The map is never iterated, so the order has no effect.
#[derive(Default)]
pub(super) struct CellHasher(u64);

impl Hasher for CellHasher {
    fn finish(&self) -> u64 {
        mix(self.0)
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = self.0.rotate_left(8) ^ u64::from(byte);
        }
    }

    fn write_i32(&mut self, part: i32) {
        self.0 = self.0.rotate_left(32) ^ u64::from(part as u32);
    }

    fn write_usize(&mut self, _length: usize) {}
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    /// Lines of a tile pixel by pixel.
    fn one_by_one([first_byte, pixel_bytes]: [u64; 2], pixels: u64) -> Vec<(u64, u64)> {
        let mut lines: Vec<(u64, u64)> = Vec::new();
        for pixel in (0..64).filter(|pixel| pixels >> pixel & 1 == 1) {
            let first = first_byte + pixel * pixel_bytes;
            for line in first / LINE_BYTES..=(first + pixel_bytes - 1) / LINE_BYTES {
                match lines.last_mut().filter(|(known, _)| *known == line) {
                    Some((_, held)) => *held |= 1 << pixel,
                    None => lines.push((line, 1 << pixel)),
                }
            }
        }
        lines
    }

    #[test]
    fn lines_of_a_tile_hold_its_pixels() {
        for (pixel_bytes, first_byte) in
            [4, 8, 12, 32, 64, 96, 128].iter().flat_map(|&bytes| [0, 64 * 7, 36].map(|first| (bytes, first)))
        {
            for pixels in [u64::MAX, 1, 1 << 63, 0xF0F0_0000_1234_8001, mix(pixel_bytes), mix(first_byte)] {
                let mut lines = Vec::new();
                tile_lines([first_byte, pixel_bytes], pixels, |line, held| lines.push((line, held)));
                assert_eq!(
                    lines,
                    one_by_one([first_byte, pixel_bytes], pixels),
                    "{pixel_bytes} {first_byte} {pixels:x}"
                );
            }
        }
    }

    #[test]
    fn slots_are_sorted_by_triangle_and_then_by_number() {
        let mut sorted = SlotsByTriangle::default();
        for triangles in [1, 2, 3, 40, 300_u32] {
            // Some have equal low bits.
            let triangle = |slot: u64| ((mix(slot) % u64::from(triangles)) as u32).wrapping_mul(128) ^ 5;
            let of: Vec<u32> = (0..512).map(triangle).chain([DepthTile::NO_TRIANGLE; 3]).collect();
            let mut expected: Vec<u16> = (0..of.len() as u16).collect();
            expected.sort_by_key(|&slot| of[usize::from(slot)]);
            sorted.sort(&of);
            let groups: Vec<(u32, &[u16])> = sorted.groups().collect();
            assert!(groups.is_sorted_by(|a, b| a.0 < b.0));
            assert!(
                groups.iter().all(|(known, group)| group.iter().all(|&slot| of[usize::from(slot)] == *known))
            );
            assert_eq!(groups.iter().flat_map(|(_, group)| *group).copied().collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn a_known_colour_is_not_shaded_again() {
        let (mut known, shaded) = (KnownColours::default(), RefCell::new(Vec::new()));
        let colour = |quad: [i32; 2], lane: usize| Vec3::new(quad[0] as f32, quad[1] as f32, lane as f32);
        let shade = |access: &QuadAccess| {
            shaded.borrow_mut().push((access.quad, access.lanes));
            [0, 1, 2, 3].map(|lane| colour(access.quad, lane).extend(1.0))
        };
        for (triangle, quad, lanes) in [
            (1, [3, 4], 0b0001),
            (1, [3, 4], 0b0101),
            (1, [3, 4], 0b0100),
            (1, [-3, 4], 0b1000),
            (2, [3, 4], 1),
        ] {
            let colours = known.of(triangle, &QuadAccess { quad, sample: 0, lookups: 1, lanes }, shade);
            for lane in (0..4).filter(|lane| lanes >> lane & 1 == 1) {
                assert_eq!(colours[lane], colour(quad, lane));
            }
        }
        assert_eq!(*shaded.borrow(), [([3, 4], 1), ([3, 4], 4), ([-3, 4], 8), ([3, 4], 1)]);
    }
}
