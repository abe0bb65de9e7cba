//! Time of draws: sums at every level, and closed forms.

use activity::{Event, LineAccess, Packet, PacketKind};
use proptest::prelude::*;
use timing::{DrawSpan, Timed};

use crate::common::{Packets, bound_level, clocks, levels, packet_level, plain, stepped};
use crate::conservation::{machine, passes, through_levels};

/// Picoseconds of a cycle.
const CYCLE_PS: u64 = 1000;

fn of_draw(draw: u32, batch: u32, kind: PacketKind, counts: &[(Event, u32)]) -> (Packet, Vec<LineAccess>) {
    let mut packet = Packet { draw, batch, ..Packet::new(kind, 0) };
    counts.iter().for_each(|&(event, count)| packet.counts[event] = count);
    (packet, Vec::new())
}

/// A tile that takes `cycles` in the sample test.
fn tile(draw: u32, batch: u32, cycles: u32) -> (Packet, Vec<LineAccess>) {
    of_draw(draw, batch, PacketKind::Tile, &[(Event::SamplesTested, cycles)])
}

/// Vertices that take `cycles` in the command unit.
fn vertices(draw: u32, batch: u32, cycles: u32) -> (Packet, Vec<LineAccess>) {
    let counts = [(Event::Indices, cycles), (Event::TrianglesIn, 1)];
    of_draw(draw, batch, PacketKind::Vertices, &counts)
}

/// Latency of traversal and of z-cull, and of the way out.
const FILL: u64 = 3;

/// Cycles of each draw of the only pass, at the levels that know when packets leave.
fn draws(packets: &Packets) -> [Vec<u64>; 2] {
    let both = [stepped(&plain(), packets), packet_level(&plain(), clocks(), packets)];
    both.map(|timed| timed.passes[0].draws_ps.iter().map(|time| time / CYCLE_PS).collect())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Two draws, one after the other or in turn: each gets the cycles of its tiles, the first also those to
    /// fill the path.
    #[test]
    fn draws_get_the_time_of_their_tiles(
        counts in prop::array::uniform2(1u32..30), cycles in prop::array::uniform2(1u32..50), in_turn in any::<bool>(),
    ) {
        let of = |draw: usize| (0..counts[draw]).map(move |n| (n, tile(draw as u32, 0, cycles[draw])));
        let mut numbered: Vec<_> = of(0).chain(of(1)).collect();
        if in_turn {
            numbered.sort_by_key(|(n, _)| *n);
        }
        let packets: Packets = numbered.into_iter().map(|(_, packet)| packet).collect();
        let work = [0, 1].map(|draw| u64::from(counts[draw] * cycles[draw]));
        prop_assert_eq!(draws(&packets), [vec![FILL + work[0], work[1]], vec![FILL + work[0], work[1]]]);
        // `bound` shares the time of the pass by the work in the busiest unit.
        let bound = bound_level(&plain(), clocks(), &packets);
        let whole = bound.timeline.duration_ps * work[0] / (work[0] + work[1]);
        prop_assert_eq!(bound.passes[0].draws_ps[0], whole);
    }

    /// The front end of the second draw takes time only where it is not hidden by tiles of the first.
    #[test]
    fn hidden_vertices_take_no_time(front in 1u32..200, long in 1u32..400, short in 1u32..50) {
        let packets = vec![vertices(0, 0, 1), vertices(1, 1, front), tile(0, 0, long), tile(1, 1, short)];
        // Command, vertices and set-up: three latencies and a cycle.
        let set_up = [1, 1 + u64::from(front)].map(|cycles| cycles + 4);
        let first = set_up[0] + FILL + u64::from(long);
        // The second tile follows the first, or fills an empty path.
        let second = (first + u64::from(short)).max(set_up[1] + FILL + u64::from(short));
        let expected = vec![first, second - first];
        prop_assert_eq!(draws(&packets), [expected.clone(), expected]);
    }

    /// At every level the draws of a pass and the others are its time, and the spans say the same.
    #[test]
    fn draws_add_up_to_passes(packets in passes(), machine in machine(), seed in any::<u32>()) {
        let of = |(packet, at): (Packet, u32)| match seed.rotate_left(at) % 4 {
            3 => packet,
            draw => Packet { draw, ..packet },
        };
        let packets = through_levels(packets, &machine);
        let packets: Packets =
            packets.into_iter().zip(0..).map(|((packet, lines), at)| (of((packet, at)), lines)).collect();
        for (level, timed) in levels(&machine, &packets).into_iter().enumerate() {
            let times = pass_times(&timed);
            let draws: Vec<u64> = timed.passes.iter().map(|pass| pass.draws_ps.iter().sum()).collect();
            prop_assert!(draws.iter().zip(&times).all(|(draws, pass)| draws <= pass), "{:?} {:?}", draws, times);
            if level == 2 {
                continue;
            }
            let ends = timed.spans.last().map(|span| span.end_ps);
            prop_assert_eq!(ends.unwrap_or(0), times.iter().sum::<u64>(), "{} {:?} {}", level, timed.passes, timed.cycles);
            for (number, pass) in timed.passes.iter().enumerate() {
                let of_pass = |span: &DrawSpan| span.pass as usize == number;
                prop_assert_eq!(spent(&timed.spans, of_pass), times[number]);
                for (draw, time) in pass.draws_ps.iter().enumerate() {
                    prop_assert_eq!(spent(&timed.spans, |span| of_pass(span) && span.draw as usize == draw), *time);
                }
            }
        }
    }
}

/// Time of each pass from the end of the one before.
fn pass_times(timed: &Timed) -> Vec<u64> {
    let mut before = 0;
    timed.passes.iter().map(|pass| pass.end_ps - std::mem::replace(&mut before, pass.end_ps)).collect()
}

/// Time of the spans that are requested.
fn spent(spans: &[DrawSpan], is_requested: impl Fn(&DrawSpan) -> bool) -> u64 {
    let mut before = 0;
    let each = spans.iter().map(|span| (span, span.end_ps - std::mem::replace(&mut before, span.end_ps)));
    each.filter(|(span, _)| is_requested(span)).map(|(_, time)| time).sum()
}
