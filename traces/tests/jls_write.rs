//! JLS as we write it: read back, held against sums of its samples, cut and damaged. `benches/jls_beside_pyjls.py` reads
//! it with pyjls.
#![allow(clippy::unwrap_used)]

#[path = "common/jls.rs"]
mod jls_files;

use jls_files::{crc32c, sealed};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::io::Cursor;
use traces::io::{ReadError, ReadOptions, atomic, jls, read};
use traces::{Mark, MarkKind, Metadata, Trace};

fn metadata() -> Metadata {
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

fn channels(samples: usize) -> (Vec<f32>, Vec<f32>) {
    let mixed = |index: usize| (index as u32).wrapping_mul(2_654_435_761);
    let voltage = |index| 3.8 + (mixed(index) >> 20) as f32 * 1e-5;
    let current = |index| (mixed(index) >> 8 & 0xfff) as f32 * 1e-4 - 0.1;
    (0..samples).map(|index| (voltage(index), current(index))).unzip()
}

fn trace(samples: usize) -> Trace {
    let (voltage_v, current_a) = channels(samples);
    Trace::new(voltage_v, current_a, 50e3, 1.25, metadata()).unwrap()
}

fn written(trace: &Trace) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    jls::write(trace, &mut bytes).unwrap();
    bytes.into_inner()
}

/// Without losses, in pieces of these sizes by turns.
fn in_pieces(trace: &Trace, sizes: &[usize]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = jls::Writer::new(&mut bytes, trace.rate_hz(), trace.start_s(), &trace.metadata).unwrap();
    let (mut from, mut turn) = (0, sizes.iter().cycle());
    while from < trace.samples() {
        let end = trace.samples().min(from + turn.next().unwrap());
        writer.push(&trace.voltage_v()[from..end], &trace.current_a()[from..end]).unwrap();
        from = end;
    }
    assert_eq!(writer.samples(), from as u64);
    writer.finish().unwrap();
    bytes.into_inner()
}

fn read_bytes(bytes: &[u8], repair: bool) -> Result<Trace, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jls");
    std::fs::write(&path, bytes).unwrap();
    read(&path, &ReadOptions { repair, ..ReadOptions::default() }).map(|loaded| loaded.trace)
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[track_caller]
fn same(left: &Trace, right: &Trace) {
    assert!(bits(left.voltage_v()) == bits(right.voltage_v()));
    assert!(bits(left.current_a()) == bits(right.current_a()));
    let key = |trace: &Trace| (trace.rate_hz().to_bits(), trace.start_s().to_bits());
    assert_eq!(key(left), key(right));
    assert_eq!(left.metadata, right.metadata);
}

/// Lengths about those at which a chunk, an index or a summary is full.
fn lengths() -> impl Strategy<Value = usize> {
    let about = |count: usize| (count - 1..=count + 1).boxed();
    prop_oneof![
        1_usize..300,
        about(128),
        about(8192),
        about(8192 + 128),
        about(81_920),
        about(81_920 + 8192),
        about(100_000),
        1_usize..200_000,
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn what_is_read_is_what_was_written_in_pieces_of_any_size(
        samples in lengths(),
        sizes in prop::collection::vec(1_usize..30_000, 1..4),
        rate_hz in prop_oneof![Just(1.0), Just(50e3), Just(44_100.0), Just(1e7), Just(1e8), 49_999.5..50_000.5, 1000.0..1e6_f64],
        start_s in prop_oneof![Just(0.0), -10.0..1e4_f64, 1.5e9..1.8e9_f64],
        seed in any::<u32>(),
    ) {
        // Every pattern of bits that is finite.
        let value = |index: usize, salt: u32| {
            let mixed = (index as u32 ^ salt).wrapping_mul(2_654_435_761).rotate_left(11).wrapping_mul(0x85eb_ca6b);
            Some(f32::from_bits(mixed)).filter(|value| value.is_finite()).unwrap_or(-0.0)
        };
        let channel = |salt: u32| (0..samples).map(|index| value(index, salt)).collect();
        let trace = Trace::new(channel(seed), channel(!seed), rate_hz, start_s, metadata()).unwrap();
        let bytes = written(&trace);
        prop_assert!(in_pieces(&trace, &sizes) == bytes);
        same(&read_bytes(&bytes, false).unwrap(), &trace);
    }
}

#[test]
fn a_file_that_pyjls_reads_stays_as_it_is() {
    // Written on 22 November 2026 and read by pyjls 0.17 (`benches/jls_beside_pyjls.py --golden`): samples to the bit,
    // every summary, UTC and user data.
    let golden = Trace::new(channels(30_000).0, channels(30_000).1, 50e3, 1.25, Metadata::default()).unwrap();
    let bytes = written(&golden.without([1000..1100, 29_000..30_000]));
    if let Some(to) = std::env::var_os("JLS_GOLDEN") {
        std::fs::write(to, &bytes).unwrap();
    }
    assert_eq!((bytes.len(), u32::from_le_bytes(crc32c(&bytes))), (252_168, 2_379_377_962));
}

#[test]
fn a_recording_without_samples_is_told_to_be_empty() {
    let mut bytes = Cursor::new(Vec::new());
    jls::Writer::new(&mut bytes, 1e3, 0.0, &Metadata::default()).unwrap().finish().unwrap();
    let message = read_bytes(&bytes.into_inner(), false).unwrap_err().to_string();
    assert!(message.contains("no samples"), "{message}");
}

#[test]
fn lost_samples_are_missing_and_filled_on_request() {
    for lost in [vec![5000..5001], vec![1..130, 8000..17_000, 19_990..20_000]] {
        let trace = trace(20_000).without(lost.clone());
        let message = read_bytes(&written(&trace), false).unwrap_err().to_string();
        let row = lost[0].start + 1;
        assert!(message.contains(&format!("row {row}: voltage_V is NaN")), "{message}");
        let mended = read_bytes(&written(&trace), true).unwrap();
        assert_eq!((mended.samples(), mended.start_s()), (20_000, 1.25));
        // Between stretches nothing is changed, and in them it is the line that the trace in memory has.
        for (index, pair) in mended.current_a().iter().zip(trace.current_a()).enumerate() {
            let near = lost.iter().any(|lost| lost.contains(&index));
            assert!(pair.0 == pair.1 || near && (pair.0 - pair.1).abs() < 1e-5, "{index}: {pair:?}");
        }
    }
}

#[test]
fn what_jls_cannot_say_is_refused() {
    let refused = |rate_hz: f64, start_s: f64, metadata: &Metadata| {
        let begun = jls::Writer::new(Cursor::new(Vec::new()), rate_hz, start_s, metadata);
        begun.map(|_| ()).unwrap_err().to_string()
    };
    let none = Metadata::default();
    for rate_hz in [0.4, 0.9, 1.5, 100.4, 0.0, -5.0, f64::NAN, f64::INFINITY, 5e9] {
        assert!(refused(rate_hz, 0.0, &none).contains(&format!("{rate_hz} Hz is none")));
    }
    assert!(refused(1e3, -9e9, &none).contains("-9000000000 s from 1970"));
    let mut marked = none.clone();
    marked.marks.push(Mark { time_s: f64::NAN, kind: MarkKind::Other, label: String::new() });
    assert!(refused(1e3, 0.0, &marked).contains("mark 0 is at NaN s"));
    let mut writer = jls::Writer::new(Cursor::new(Vec::new()), 1e3, 0.0, &none).unwrap();
    assert!(writer.push(&[1.0], &[]).unwrap_err().to_string().contains("1 voltages but 0 currents"));
}

#[test]
fn a_writer_that_fails_anywhere_is_an_error_and_leaves_no_file() {
    let whole = written(&trace(400_000)).len();
    for room in [0, 100, 3000, 3_200_000, whole - 1] {
        let mut space = vec![0; room];
        assert!(jls::write(&trace(400_000), Cursor::new(&mut space[..])).is_err(), "{room}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jls");
    let error = atomic::write_file(&path, |out| {
        let mut writer = jls::Writer::new(out, 1e3, 0.0, &Metadata::default())?;
        writer.push(&[1.0; 9000], &[1.0; 8000])
    });
    assert!(error.unwrap_err().to_string().contains("a.jls: cannot write the trace: 9000 voltages"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let (trace, mut errors) = (trace(9000), 0);
    let whole = written(&trace);
    for length in (8..whole.len()).step_by(64).chain([whole.len() - 1]) {
        for repair in [false, true] {
            let message = read_bytes(&whole[..length], repair).unwrap_err().to_string();
            assert!(message.contains(&format!("byte {length}: ")), "{message}");
        }
        // Where the header agrees with what is left, only what is not read may be missing.
        match read_bytes(&sealed(&whole[..length]), false) {
            Ok(left) => same(&left, &trace),
            Err(_) => errors += 1,
        }
    }
    assert!(errors > whole.len() / 70, "{errors}");
}

#[test]
fn a_changed_byte_is_an_error_or_changes_nothing() {
    let (trace, mut errors) = (trace(9000), 0);
    let whole = written(&trace);
    for position in (8..whole.len()).step_by(37) {
        let mut bytes = whole.clone();
        bytes[position] ^= [0x01, 0x80, 0xff][position % 3];
        match read_bytes(&bytes, false) {
            Ok(changed) => same(&changed, &trace),
            Err(_) => errors += 1,
        }
    }
    // All but summaries and UTC, which are a twentieth.
    assert!(errors > whole.len() / 37 * 9 / 10, "{errors} of {}", whole.len() / 37);
}

/// The file with one text in place of another, checksums made right.
fn edited(bytes: &[u8], text: &str, by: &str) -> Vec<u8> {
    assert_eq!(text.len(), by.len());
    let at = bytes.windows(text.len()).position(|window| window == text.as_bytes()).unwrap();
    let mut bytes = bytes.to_vec();
    bytes[at..at + text.len()].copy_from_slice(by.as_bytes());
    sealed(&bytes)
}

#[test]
fn notes_of_other_programs_are_passed_over_and_wrong_descriptions_told() {
    let bytes = written(&trace(500));
    let plain = read_bytes(&edited(&bytes, "{\"trace\":", "{\"tracf\":"), false).unwrap();
    // What is left is what any recorder writes.
    assert_eq!((plain.rate_hz(), plain.start_s(), plain.samples()), (50e3, 0.0, 500));
    assert_eq!(plain.metadata.device, "daq \"A\" 1_5, 14 bit_");
    let broken = read_bytes(&edited(&bytes, "{\"trace\":", "{ trace\":"), false).unwrap();
    assert_eq!(broken.start_s(), 0.0);
    let message = read_bytes(&edited(&bytes, "\"rate_hz\":50000.0", "\"rate_hz\":-5000.0"), false)
        .unwrap_err()
        .to_string();
    assert!(message.contains("a.jls: the JSON description: rate_hz is -5000, not above 0"), "{message}");
    // Of another rate than the signals: somebody else's samples.
    let other = read_bytes(&edited(&bytes, "\"rate_hz\":50000.0", "\"rate_hz\":25000.0"), false).unwrap();
    assert_eq!((other.rate_hz(), other.start_s(), &other.metadata.scene), (50e3, 0.0, &metadata().scene));
}

/// A chunk: where, next, previous, tag, signal and level, payload.
struct Chunk<'a> {
    at: u64,
    next: u64,
    previous: u64,
    tag: u8,
    signal: u16,
    level: u16,
    payload: &'a [u8],
}

fn long(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

/// All chunks of a file in order; what each says of the one before is held against that.
fn chunks(bytes: &[u8]) -> Vec<Chunk<'_>> {
    let (mut list, mut at, mut before) = (Vec::new(), 32, 0);
    while at < bytes.len() {
        let header = &bytes[at..at + 32];
        let length = word(header, 20);
        assert_eq!(word(header, 24), before);
        let payload = &bytes[at + 32..at + 32 + length as usize];
        let mark = word(header, 16) >> 16;
        let (signal, level) = ((mark & 0xfff) as u16, (mark >> 12) as u16);
        let [next, previous] = [0, 8].map(|at| long(header, at));
        list.push(Chunk { at: at as u64, next, previous, tag: header[16], signal, level, payload });
        at += 32 + if length == 0 { 0 } else { (length as usize + 4).next_multiple_of(8) };
        before = length;
    }
    list
}

/// Sources make up a list, definitions and heads another, user data another, and so do chunks of one kind, signal and
/// level.
fn list_of(chunk: &Chunk) -> (u8, u16, u16) {
    match chunk.tag {
        0x01 | 0x40 => (chunk.tag, 0, 0),
        tag if tag == 0x02 || tag & 7 < 2 => (0x02, 0, 0),
        tag => (tag, chunk.signal, chunk.level),
    }
}

#[test]
fn lists_lead_both_ways_and_the_whole_is_sealed() {
    for samples in [1, 9000, 200_000] {
        let bytes = written(&trace(samples));
        assert!(sealed(&bytes) == bytes);
        let mut lists = BTreeMap::<_, Vec<Chunk>>::new();
        for chunk in chunks(&bytes).into_iter().filter(|chunk| chunk.tag != 0xff) {
            lists.entry(list_of(&chunk)).or_default().push(chunk);
        }
        for list in lists.values() {
            let at = |index: usize| list.get(index).map_or(0, |chunk| chunk.at);
            for (index, chunk) in list.iter().enumerate() {
                assert_eq!((chunk.next, chunk.previous), (at(index + 1), at(index.wrapping_sub(1))));
            }
        }
    }
}

/// Mean, deviation, lowest and highest by definition; NaN left out.
fn moments(samples: &[f32]) -> [f64; 4] {
    let kept: Vec<f64> = samples.iter().map(|&v| f64::from(v)).filter(|v| v.is_finite()).collect();
    let count = kept.len() as f64;
    let mean = kept.iter().sum::<f64>() / count;
    let variance = kept.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count;
    let pick = |by: fn(f64, f64) -> f64| kept.iter().copied().reduce(by).unwrap_or(f64::NAN);
    [mean, variance.sqrt(), pick(f64::min), pick(f64::max)]
}

/// Every entry of one level against its samples; the chunks there are.
fn check_level<'a>(
    chunks: &'a [Chunk<'a>],
    (signal, level): (u16, u16),
    samples: &[f32],
) -> Vec<&'a Chunk<'a>> {
    let step = 128 * 20_usize.pow(u32::from(level) - 1);
    let (mut entries, mut indices) = (samples.chunks_exact(step), Vec::new());
    for (index, pair) in chunks.windows(2).enumerate() {
        if (pair[0].tag, pair[0].signal, pair[0].level) != (0x23, signal, level) {
            continue;
        }
        indices.push(&chunks[index]);
        let summary = &pair[1];
        assert_eq!((summary.tag, summary.signal, summary.level), (0x24, signal, level));
        assert_eq!(summary.payload[..8], pair[0].payload[..8]);
        assert_eq!(summary.payload.len(), 16 + 16 * word(summary.payload, 8) as usize);
        for entry in summary.payload[16..].as_chunks::<16>().0 {
            let truth = moments(entries.next().unwrap());
            for (part, truth) in truth.into_iter().enumerate() {
                let said = f64::from(f32::from_bits(word(entry, 4 * part)));
                let near = (said - truth).abs() <= 6.1e-8 * truth.abs() + 1e-12;
                assert!(near || said.is_nan() && truth.is_nan(), "level {level}: {said} {truth}");
            }
        }
    }
    assert!(entries.next().is_none(), "level {level}");
    indices
}

/// The chunks an index of a level leads to, and where each of its entries must begin.
fn check_index(bytes: &[u8], index: &Chunk, below: &[&Chunk]) -> usize {
    let chunk_samples = 8192 * if index.level > 1 { 10 * 20_u64.pow(u32::from(index.level) - 2) } else { 1 };
    let count = word(index.payload, 8) as usize;
    for entry in 0..count {
        let at = long(index.payload, 16 + 8 * entry);
        assert_eq!(at, below[entry].at);
        let first = long(index.payload, 0) + entry as u64 * chunk_samples;
        assert_eq!(long(bytes, at as usize + 32), first);
    }
    count
}

fn check_summaries(samples: usize, lost: Vec<core::ops::Range<usize>>, levels: u16) {
    let trace = trace(samples).without(lost);
    let bytes = written(&trace);
    let chunks = chunks(&bytes);
    for (signal, channel) in [(1, trace.current_a()), (2, trace.voltage_v())] {
        let mut channel = channel.to_vec();
        trace.lost().iter().for_each(|lost| channel[lost.clone()].fill(f32::NAN));
        let of = |tag: u8| chunks.iter().filter(move |chunk| (chunk.tag, chunk.signal) == (tag, signal));
        let head = of(0x21).next().unwrap().payload;
        let mut below: Vec<&Chunk> = of(0x22).collect();
        for level in 1..=levels {
            assert_eq!(long(head, 8 * usize::from(level) - 8), below[0].at);
            let indices = check_level(&chunks, (signal, level), &channel);
            let mut rest = &below[..];
            for index in &indices {
                rest = &rest[check_index(&bytes, index, rest)..];
            }
            assert!(rest.is_empty(), "level {level}: chunks that no index leads to");
            below = indices;
        }
        assert_eq!((below.len(), of(0x23).filter(|chunk| chunk.level > levels).count()), (1, 0));
        assert!(head[8 * usize::from(levels) + 8..].iter().all(|byte| *byte == 0));
    }
}

#[test]
fn summaries_of_every_level_are_those_of_their_samples_and_indices_lead_to_them() {
    check_summaries(1, vec![], 0);
    check_summaries(127, vec![], 0);
    check_summaries(128, vec![], 1);
    check_summaries(8192 + 1, vec![], 2);
    check_summaries(81_920, vec![], 3);
    // The last chunk has no entry of any level, but an index.
    check_summaries(81_920 + 50, vec![], 3);
    check_summaries(1_638_400 + 50, vec![], 4);
    check_summaries(1_200_000, vec![7..8, 1000..2000, 100_000..300_000, 1_199_000..1_200_000], 4);
}

#[test]
fn utc_entries_say_when_the_first_and_last_sample_were_taken() {
    let (voltage_v, current_a) = channels(5001);
    let trace = Trace::new(voltage_v, current_a, 999.5, 1_514_764_802.5, metadata()).unwrap();
    let bytes = written(&trace);
    for signal in [1, 2] {
        let chunks = chunks(&bytes);
        let of = |tag: u8| chunks.iter().filter(move |chunk| (chunk.tag, chunk.signal) == (tag, signal));
        let pairs: Vec<_> = of(0x3a).map(|chunk| (long(chunk.payload, 0), long(chunk.payload, 16))).collect();
        let second = (1_u64 << 30) as f64;
        let last = (2.5 * second + 5000.0 / 999.5 * second).round() as u64;
        assert_eq!(pairs, [(0, 5 << 29), (5000, last)]);
        let summary = of(0x3c).next().unwrap().payload;
        let told: Vec<_> = [16, 32].map(|at| (long(summary, at), long(summary, at + 8))).to_vec();
        assert_eq!(told, pairs);
        let places: Vec<_> = of(0x3a).map(|chunk| chunk.at).collect();
        let index = of(0x3b).next().unwrap();
        assert_eq!([24, 40].map(|at| long(index.payload, at)).to_vec(), places);
        let head = of(0x39).next().unwrap().payload;
        assert_eq!([long(head, 0), long(head, 8)], [places[0], index.at]);
    }
}
