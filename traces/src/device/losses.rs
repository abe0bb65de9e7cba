//! Packets that are lost between recorder and host, and the gaps they leave between samples.

use super::Device;
use crate::io::{TraceChunk, TraceWriter, WriteError};
use crate::random::Random;
use crate::trace::on_line;
use core::ops::Range;

/// Stream of the random numbers of losses, apart from those of the noise.
const RANDOM_STREAM: u64 = 1;

impl Device {
    /// The segments of `samples` that do not arrive, neighbouring packets in one. Each packet but the first
    /// is lost or not by itself.
    pub(super) fn lost(&self, samples: usize) -> Vec<Range<usize>> {
        let random = Random::new(self.spec.seed, RANDOM_STREAM);
        let length = self.spec.packet_samples as usize;
        let packets = 1..samples.div_ceil(length);
        let mut lost: Vec<Range<usize>> = Vec::new();
        for packet in packets.filter(|&packet| random.uniform(packet as u64) < self.spec.packet_loss) {
            let range = packet * length..samples.min((packet + 1) * length);
            match lost.last_mut().filter(|last| last.end == range.start) {
                Some(last) => last.end = range.end,
                None => lost.push(range),
            }
        }
        lost
    }
}

/// Samples of a gap that are made at once.
const PIECE_SAMPLES: usize = 1 << 16;

/// Writes samples as if none were lost, with the lost ones on the line between their neighbours, as
/// [`Trace::without`](crate::Trace::without) does.
pub(super) struct Gaps<'a> {
    lost: &'a [Range<usize>],
    /// The next gap, or that of the current samples.
    at: usize,
    /// Voltage and current before it.
    before: [f32; 2],
    into: &'a mut dyn TraceWriter,
}

impl<'a> Gaps<'a> {
    pub fn new(lost: &'a [Range<usize>], into: &'a mut dyn TraceWriter) -> Self {
        Self { lost, at: 0, before: [0.0; 2], into }
    }

    pub fn write(&mut self, made: &TraceChunk<'_>) -> Result<(), WriteError> {
        let (mut from, len) = (0, made.len());
        while from < len {
            let (now, place) =
                (made.first as usize + from, |sample: usize| len.min(sample - made.first as usize));
            match self.lost.get(self.at) {
                Some(gap) if gap.end <= now => {
                    self.bridge(gap.clone(), [made.voltage_v[from], made.current_a[from]])?;
                    self.at += 1;
                }
                Some(gap) if gap.start <= now => from = place(gap.end),
                next => {
                    let to = next.map_or(len, |gap| place(gap.start));
                    self.into.write(&made.part(from, to))?;
                    self.before = [made.voltage_v[to - 1], made.current_a[to - 1]];
                    from = to;
                }
            }
        }
        Ok(())
    }

    /// After the last sample: a gap that nothing follows.
    pub fn finish(&mut self) -> Result<(), WriteError> {
        while let Some(gap) = self.lost.get(self.at) {
            self.bridge(gap.clone(), self.before)?;
            self.at += 1;
        }
        Ok(())
    }

    fn bridge(&mut self, gap: Range<usize>, after: [f32; 2]) -> Result<(), WriteError> {
        for from in gap.clone().step_by(PIECE_SAMPLES) {
            let places = from - gap.start..gap.len().min(from - gap.start + PIECE_SAMPLES);
            let line = |channel: usize| -> Vec<f32> {
                places
                    .clone()
                    .map(|at| on_line(self.before[channel], after[channel], at, gap.len()))
                    .collect()
            };
            let (voltage_v, current_a) = (line(0), line(1));
            let (voltage_v, current_a) = (&voltage_v[..], &current_a[..]);
            self.into.write(&TraceChunk { first: from as u64, voltage_v, current_a, lost: true })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::curve::Curve;
    use crate::device::{Device, DeviceSpec};
    use crate::io;
    use crate::io::{ReadError, ReadOptions, RepairKind, csv, parquet};

    fn device(packet_loss: f64, seed: u64) -> Device {
        Device::new(DeviceSpec { packet_samples: 100, packet_loss, seed, ..DeviceSpec::default() }).unwrap()
    }

    #[test]
    fn as_many_are_lost_as_asked_whole_and_never_the_first() {
        for seed in 1..20 {
            let lost = device(0.1, seed).lost(100_050);
            let samples: usize = lost.iter().map(ExactSizeIterator::len).sum();
            // 1000 packets, each lost with 0.1: within five standard deviations of 100.
            assert!((samples as f64 - 10_000.0).abs() < 5.0 * 949.0, "{samples}");
            assert!(lost.iter().all(|range| range.start >= 100 && range.start % 100 == 0));
            assert!(lost.windows(2).all(|two| two[0].end < two[1].start));
        }
        assert!(device(0.0, 1).lost(100_000).is_empty());
        assert_ne!(device(0.1, 1).lost(100_000), device(0.1, 2).lost(100_000));
    }

    #[test]
    fn a_file_has_the_gaps_and_a_reader_reports_their_places() {
        let curve = Curve::new((0..=40).map(|i| f64::from(i) * 0.01).collect(), vec![12.0; 40]).unwrap();
        let trace = device(0.2, 3).sample(&curve, 0.0, 0.4).unwrap().trace;
        let first = trace.lost()[0].clone();
        let dir = std::env::temp_dir().join(format!("quintile-packets-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let (table, text) = (dir.join("t.parquet"), dir.join("t.csv"));
        parquet::save(&trace, &table).unwrap();
        csv::save_as(&trace, &text, b',', false).unwrap();
        for path in [table, text] {
            let refused = io::read(&path, &ReadOptions::default()).unwrap_err();
            let at_gap = |row: u64| row == first.start as u64 + 1;
            assert!(matches!(refused, ReadError::Uneven { row, .. } if at_gap(row)), "{refused}");
            let repaired = io::read(&path, &ReadOptions { repair: true, ..ReadOptions::default() }).unwrap();
            let gaps = repaired.repairs.iter().filter(|repair| repair.code == RepairKind::FilledGap);
            let gaps: Vec<u64> = gaps.map(|repair| repair.count).collect();
            let lost: Vec<u64> = trace
                .lost()
                .iter()
                .filter(|lost| lost.end < trace.samples())
                .map(|lost| lost.len() as u64)
                .collect();
            assert_eq!(gaps, lost);
        }
        std::fs::remove_dir_all(dir).unwrap();
    }
}
