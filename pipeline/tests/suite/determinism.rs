//! Determinism: image, counts and packets are the same to the byte for any number of threads.

use crate::common::*;
use activity::{Packet, PacketKind};
use glam::{Vec2, Vec3, Vec4};
use pipeline::random::mix;
use pipeline::*;

/// A digest of every field of every packet, in order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Stream {
    packets: u64,
    digest: u64,
}

impl Stream {
    fn add(&mut self, packet: &Packet) {
        let kind = match packet.kind {
            PacketKind::Draw => 1,
            PacketKind::Vertices => 2,
            PacketKind::Tile => 3,
            PacketKind::Resolve => 4,
            PacketKind::Compute => 6,
            PacketKind::Barrier(_) => 5,
        };
        let place = [packet.batch, packet.draw, packet.tile, packet.triangle].map(u64::from);
        let head = [kind, u64::from(packet.pass)].into_iter().chain(place);
        let counts = packet.counts.iter().map(|(_, count)| u64::from(count));
        for word in head.chain(counts) {
            self.digest = mix(self.digest.rotate_left(7) ^ word).wrapping_add(word);
        }
        self.packets += 1;
    }
}

struct Textured(Texture);

impl Shader for Textured {
    fn texture(&self) -> Option<&Texture> {
        Some(&self.0)
    }

    fn shade(&self, _lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4 {
        (texel.truncate() * at.normal.abs()).extend(1.0)
    }
}

fn texture() -> Texture {
    let texel = |i: u32| [(i * 37 % 256) as u8, (i * 91 % 256) as u8, (i / 3 % 256) as u8, 255];
    Texture::from_srgb8(64, 32, (0..64 * 32).map(texel).collect(), [Wrap::Repeat, Wrap::Mirror]).unwrap()
}

/// Results of a frame of all dimensions.
type Frame = (Vec<[u32; 3]>, activity::Counts, Stream, Vec<(u32, u32)>);

fn frame(threads: usize, lens: bool, features: Features, batch_triangles: u32) -> Frame {
    let (near, far) = (Soup::new(SoupKind::Moving, 300, 5), Soup::new(SoupKind::Crossing, 200, 6));
    let uvs: Vec<_> = near.open.iter().map(|p| Vec2::new(p.x, p.y) * 0.3).collect();
    let textured = Textured(texture());
    let mut first = near.draw(&textured, Cull::None);
    first.geometry = first.geometry.with_uvs(&uvs).unwrap();
    let draws = [first, far.draw(&Plain, Cull::Back)];
    let table = SampleTable::low_discrepancy(4, 3, LensShape::Disk).unwrap();
    let spec = PipelineSpec { batch_triangles, ..spec(features) };
    let viewport = Viewport::new(150, 101).unwrap();
    let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::new(0.1, 0.2, 0.3) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let mut stream = Stream::default();
        let rendered =
            RasterPass::new(&camera(lens), &draws, &settings).render(|packet, _| stream.add(packet)).unwrap();
        let image = rendered.images[0].iter().map(|pixel| pixel.to_array().map(f32::to_bits)).collect();
        (
            image,
            rendered.counts,
            stream,
            RasterPass::new(&camera(lens), &draws, &settings).visibility().unwrap(),
        )
    })
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    for lens in [false, true] {
        for features in [Features::ALL, Features::NONE, Features { auto: true, ..Features::ALL }] {
            let one = frame(1, lens, features, 64);
            assert!(one.2.packets > 500, "{:?}", one.2);
            for threads in [2, 3, 16] {
                let many = frame(threads, lens, features, 64);
                assert!(one.0 == many.0, "the image differs on {threads} threads");
                assert_eq!(one.1, many.1, "the counts differ on {threads} threads");
                assert_eq!(one.2, many.2, "the packets differ on {threads} threads");
                assert!(one.3 == many.3, "what samples see differs on {threads} threads");
            }
        }
    }
}

#[test]
fn the_same_threads_give_the_same_bytes_again() {
    let [first, again] = [(); 2].map(|()| frame(3, true, Features::ALL, 17));
    assert!(first == again);
}

/// Batches and tiles divide the work but do not change the image.
#[test]
fn the_size_of_batches_changes_no_sample() {
    let whole = frame(2, true, Features::ALL, 4096);
    for batch_triangles in [1, 33, 499] {
        let cut = frame(2, true, Features::ALL, batch_triangles);
        assert!(whole.0 == cut.0 && whole.3 == cut.3, "batches of {batch_triangles}");
    }
}

#[test]
fn the_size_of_tiles_changes_no_pixel() {
    let (soup, viewport) = (Soup::new(SoupKind::Moving, 200, 8), Viewport::new(77, 45).unwrap());
    let table = SampleTable::low_discrepancy(4, 3, LensShape::Disk).unwrap();
    let seen = |tile_px, coarse_tile_px| {
        let spec = PipelineSpec { tile_px, coarse_tile_px, ..spec(Features::ALL) };
        let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
        let draws = [soup.draw(&Plain, Cull::None)];
        RasterPass::new(&camera(true), &draws, &settings).visibility().unwrap()
    };
    let eight = seen(8, 32);
    for (tile_px, coarse_tile_px) in [(8, 8), (4, 16), (2, 2), (1, 64), (1, 1), (8, 256)] {
        assert!(eight == seen(tile_px, coarse_tile_px), "tiles of {tile_px} and {coarse_tile_px}");
    }
}
