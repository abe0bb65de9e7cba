//! Pieces and skips, which the public readers do not show.
#![allow(clippy::unwrap_used)]

use super::super::Rows;
use super::*;
use std::path::PathBuf;

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign/pyjls.jls")
}

fn from(skip: &[u64], limit: usize) -> Vec<f32> {
    let mut rows = Rows::open(&file(), &ReadOptions::default()).unwrap();
    skip.iter().for_each(|&rows_left_out| rows.skip(rows_left_out).unwrap());
    let (mut voltage_v, mut current_a, mut chunk) = (Vec::new(), Vec::new(), Chunk::default());
    while rows.next(limit, &mut chunk).unwrap() > 0 {
        rows.channels(&mut chunk, &mut voltage_v, &mut current_a);
    }
    assert_eq!(voltage_v.len(), current_a.len());
    voltage_v.extend(current_a);
    voltage_v
}

#[test]
fn rows_in_pieces_after_any_skip_are_those_of_the_whole() {
    let whole = from(&[], 10_000);
    assert_eq!(whole.len(), 2 * 3003);
    for limit in [1, 159, 160, 161, 1000] {
        assert_eq!(from(&[], limit), whole);
    }
    for skip in [1, 159, 160, 161, 320, 1000, 2879, 2880, 2881, 3002, 3003] {
        let left = [&whole[skip..3003], &whole[3003 + skip..]].concat();
        assert_eq!(from(&[skip as u64], 700), left, "{skip}");
        assert_eq!(from(&[1, skip as u64 - 1], 700), left, "{skip}");
    }
    assert!(from(&[5000], 10).is_empty());
}

#[test]
fn a_skip_between_pieces_goes_on_from_there() {
    let whole = from(&[], 10_000);
    let (source, _, _) = &mut JlsRows::open(&file(), &ReadOptions::default()).unwrap();
    let mut chunk = Chunk { values: vec![Vec::new(); 2], ..Chunk::default() };
    assert_eq!(source.next(100, &mut chunk).unwrap(), 100);
    source.skip(1500).unwrap();
    chunk.values.iter_mut().for_each(Vec::clear);
    assert_eq!(source.next(100, &mut chunk).unwrap(), 100);
    assert_eq!(chunk.values, [&whole[1600..1700], &whole[3003 + 1600..3003 + 1700]]);
}
