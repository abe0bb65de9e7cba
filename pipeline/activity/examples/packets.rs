//! Adds up packets and prints the counts of each unit.

use activity::{Counts, Event, Packet, PacketKind, Unit};

fn main() {
    let mut total = Counts::default();
    for tile in 0..4 {
        let mut packet = Packet { tile, ..Packet::new(PacketKind::Tile, 0) };
        packet.counts[Event::SamplesTested] = 64;
        packet.counts[Event::SamplesHit] = 10 * tile;
        for (event, count) in packet.counts.iter() {
            total[event] += u64::from(count);
        }
    }
    for (event, count) in total.iter().filter(|(_, count)| *count > 0) {
        println!("{event:?}: {count}");
    }
    println!("sample test efficiency: {:?}", total.sample_test_efficiency());
    println!("units: {}", Unit::COUNT);
}
