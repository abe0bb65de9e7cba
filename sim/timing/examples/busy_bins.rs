//! Busy time and events of two units, in bins of a nanosecond: `cargo run -p timing --example busy_bins`.

use activity::{Event, Unit};
use timing::Recorder;

fn main() {
    let mut recorder = Recorder::new(1000, 16);
    // The rasterizer works for one and a half bins, one of two texture samplers for two.
    recorder.busy(Unit::Traversal, 500, 2000, 1, 1);
    recorder.busy(Unit::Texture, 1000, 3000, 1, 2);
    recorder.event(Event::TextureFetches, 12, 2500);
    let timeline = recorder.finish();
    for (index, bin) in timeline.bins.iter().enumerate() {
        let [traversal, texture] = [Unit::Traversal, Unit::Texture].map(|unit| bin.busy_ps[unit as usize]);
        let fetches = bin.counts[Event::TextureFetches];
        println!("bin {index}: traversal {traversal} ps, texture {texture} ps, {fetches} fetches");
    }
    println!("frame: {:.1} ns", 1e9 * timeline.duration_s());
    println!("fetches: {}", timeline.total()[Event::TextureFetches]);
}
