//! Layout of JLS as we write it: lists, indices, summaries against their samples by definition, times.

use crate::common::jls::{crc32c, sealed};
use crate::common::jls_traces::{channels, metadata, trace, written};
use std::collections::BTreeMap;
use traces::Trace;

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

/// All chunks of a file in order; what each says of the one before is compared with that.
fn chunks(bytes: &[u8]) -> Vec<Chunk<'_>> {
    let (mut list, mut at, mut before) = (Vec::new(), 32, 0);
    while at < bytes.len() {
        let header = &bytes[at..at + 32];
        assert_eq!(crc32c(&header[..28]), header[28..]);
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
    for (entry, chunk) in below[..count].iter().enumerate() {
        let at = long(index.payload, 16 + 8 * entry);
        assert_eq!(at, chunk.at);
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
        let reported: Vec<_> = [16, 32].map(|at| (long(summary, at), long(summary, at + 8))).to_vec();
        assert_eq!(reported, pairs);
        let places: Vec<_> = of(0x3a).map(|chunk| chunk.at).collect();
        let index = of(0x3b).next().unwrap();
        assert_eq!([24, 40].map(|at| long(index.payload, at)).to_vec(), places);
        let head = of(0x39).next().unwrap().payload;
        assert_eq!([long(head, 0), long(head, 8)], [places[0], index.at]);
    }
}
