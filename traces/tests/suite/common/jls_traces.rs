//! Traces to be written as JLS.

use std::collections::BTreeMap;
use std::io::Cursor;
use traces::io::jls;
use traces::{Mark, MarkKind, Metadata, Trace};

/// A description with all there can be in one.
pub fn metadata() -> Metadata {
    Metadata {
        device: "daq \"A\" 1.5, 14 bit\u{0}".to_owned(),
        scene: "Fuchs, d\u{e4}mmrig".to_owned(),
        seed: u64::MAX,
        pixels: Some(921_600),
        marks: vec![Mark { time_s: 0.1 + 0.2, kind: MarkKind::FrameStart, label: "first\u{0}".to_owned() }],
        other: BTreeMap::from([("operator".to_owned(), serde_json::json!({"name": "E.", "run": 3}))]),
        ..Metadata::default()
    }
}

/// Voltages and currents that `benches/jls_beside_pyjls.py --golden` makes, too.
pub fn channels(samples: usize) -> (Vec<f32>, Vec<f32>) {
    let mixed = |index: usize| (index as u32).wrapping_mul(2_654_435_761);
    let voltage = |index| 3.8 + (mixed(index) >> 20) as f32 * 1e-5;
    let current = |index| (mixed(index) >> 8 & 0xfff) as f32 * 1e-4 - 0.1;
    (0..samples).map(|index| (voltage(index), current(index))).unzip()
}

/// So many samples at 50 kHz from 1.25 s on.
pub fn trace(samples: usize) -> Trace {
    let (voltage_v, current_a) = channels(samples);
    Trace::new(voltage_v, current_a, 50e3, 1.25, metadata()).unwrap()
}

/// The file of a trace.
pub fn written(trace: &Trace) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    jls::write(trace, &mut bytes).unwrap();
    bytes.into_inner()
}
