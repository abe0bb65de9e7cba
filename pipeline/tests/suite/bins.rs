//! Bins in memory: records and lists counted by hand, and nothing else changes.

use crate::common::*;
use activity::{Counts, Event, LineAccess, LineKind, Unit};
use glam::Vec3;
use pipeline::*;

/// A frame with its images, counts and requests of set-up and the tile loop.
struct Binned {
    images: Vec<Vec<Vec3>>,
    counts: Counts,
    lines: Vec<LineAccess>,
}

fn draw(soup: &[Draw<'_>], spec: &PipelineSpec, camera: &Camera, viewport: Viewport) -> Binned {
    let table = SampleTable::low_discrepancy(4, 3, LensShape::Disk).unwrap();
    let settings = Settings { spec, viewport, samples: &table, background: Vec3::ZERO };
    let mut lines = Vec::new();
    let is_of_bins = |line: &&LineAccess| matches!(line.client, Unit::Setup | Unit::Traversal);
    let rendered = RasterPass::new(camera, soup, &settings)
        .render(|_, requests| lines.extend(requests.iter().filter(is_of_bins)))
        .unwrap();
    Binned { images: rendered.images, counts: rendered.counts, lines }
}

/// Two still triangles, each in all four bins of 32x32 pixels.
fn two_triangles(bins: Option<CacheSpec>) -> Binned {
    let viewport = Viewport::new(64, 64).unwrap();
    let corners = rectangle([-40.0, 40.0], [-40.0, 40.0], 2.0);
    let geometry = Geometry::new(&corners, &corners, &QUAD).unwrap();
    let draws = [Draw::new(geometry, &Flat(Vec3::ONE), Cull::None)];
    let mut spec = spec(Features::NONE);
    spec.memory.bins = bins;
    draw(&draws, &spec, &pixel_camera(viewport, 0.25), viewport)
}

fn counted(binned: &Binned) -> [u64; 4] {
    [Event::BinEntries, Event::BinLinesWritten, Event::BinLinesRead, Event::BinMisses]
        .map(|event| binned.counts[event])
}

/// Requests by set-up and by the tile loop: lines written and lines read.
fn requested(binned: &Binned) -> [[usize; 2]; 2] {
    [Unit::Setup, Unit::Traversal].map(|unit| {
        let of = |read: bool| move |line: &&LineAccess| line.client == unit && line.is_read() == read;
        [false, true].map(|read| binned.lines.iter().filter(of(read)).count())
    })
}

#[test]
fn records_and_lists_of_two_triangles_counted_by_hand() {
    // Records of three positions and a number, 40 bytes: the second one lies in two lines. Four lists of two
    // entries. The tile loop reads a line of a list and three of records in each bin.
    let roomy = two_triangles(Some(CacheSpec::lru(64, 4)));
    assert_eq!(counted(&roomy), [8, 3 + 8, 4 * 4, 0]);
    assert_eq!(requested(&roomy), [[0, 0], [0, 0]]);
    // With room for one line all but one line of every bin is fetched, and each line that is written makes
    // room for the next.
    let narrow = two_triangles(Some(CacheSpec::lru(1, 1)));
    assert_eq!(counted(&narrow), [8, 3 + 8, 4 * 4, 4 * 3]);
    assert_eq!(requested(&narrow), [[10, 0], [1, 12]]);
    // All of them are in the L2, and none is written to memory: their triangles are drawn.
    let bytes = [Event::DramReadBytes, Event::DramWriteBytes];
    let without = two_triangles(None);
    assert_eq!(counted(&without), [0; 4]);
    for binned in [roomy, narrow] {
        assert_eq!(bytes.map(|event| binned.counts[event]), bytes.map(|event| without.counts[event]));
        assert!(binned.lines.iter().all(|line| line.kind != LineKind::Fetch));
    }
}

#[test]
fn bins_change_no_image_and_no_other_count() {
    let others = |counts: &Counts| {
        let shared = [Unit::L2, Unit::Dram];
        let own = [Event::BinEntries, Event::BinLinesWritten, Event::BinLinesRead, Event::BinMisses];
        let counted = |event: &Event| !shared.contains(&event.unit()) && !own.contains(event);
        Event::ALL.into_iter().filter(counted).map(|event| counts[event]).collect::<Vec<u64>>()
    };
    for (seed, lens) in [(1, false), (2, true), (3, true)] {
        let soup = Soup::new(if lens { SoupKind::Moving } else { SoupKind::Still }, 300, seed);
        let draws = [soup.draw(&Flat(Vec3::ONE), Cull::None)];
        let viewport = Viewport::new(96, 80).unwrap();
        let frame = |bins, batch_triangles| {
            let mut spec = PipelineSpec { batch_triangles, ..spec(Features::ALL) };
            (spec.memory.bins, spec.memory.l2) = (bins, CacheSpec::lru(64, 8));
            draw(&draws, &spec, &camera(lens), viewport)
        };
        for batch_triangles in [1, 7, 100, 1000] {
            let without = frame(None, batch_triangles);
            let binned = frame(Some(CacheSpec::lru(32, 4)), batch_triangles);
            assert_eq!(binned.images, without.images);
            assert_eq!(others(&binned.counts), others(&without.counts));
            // The tile loop reads every entry once.
            assert_eq!(binned.counts[Event::BinEntries], binned.counts[Event::CoarseTilesVisited]);
            let more = |event| binned.counts[event] - without.counts[event];
            assert!(more(Event::L2Reads) == binned.counts[Event::BinMisses]);
            assert!(batch_triangles < 100 || more(Event::DramWriteBytes) > 0);
        }
    }
}

#[test]
fn batches_that_fit_in_the_buffer_stay_on_the_chip() {
    let soup = Soup::new(SoupKind::Moving, 300, 4);
    let draws = [soup.draw(&Flat(Vec3::ONE), Cull::None)];
    let viewport = Viewport::new(96, 80).unwrap();
    let requests = |batch_triangles| {
        let mut spec = PipelineSpec { batch_triangles, ..spec(Features::ALL) };
        spec.memory.bins = Some(CacheSpec::lru(256, 256));
        requested(&draw(&draws, &spec, &camera(true), viewport))
    };
    // Two batches are in memory at once: two lines for a record, and one for each of nine bins.
    assert_eq!(requests(10), [[0, 0], [0, 0]]);
    assert!(requests(300)[0][0] > 0 && requests(300)[1][1] > 0);
}
