//! Writing a recording, sample by sample.

use super::chunks::{Chunks, List};
use super::definitions::{self, Heads, Named};
use super::format::{END, LONGEST_BYTES};
use super::signal::Signal;
use super::utc::{self, Times};
use crate::io::{Sink, Source, Stretch, WriteError, atomic, header};
use crate::metadata::Metadata;
use std::io::{self, Seek, Write};
use std::path::Path;

/// The signals, as Joulescope's recorders call them, numbered from 1.
const SIGNALS: [Named; 2] = [("current", "A"), ("voltage", "V")];
/// How far a rate may be off the whole number that stands in the file, as a share of it.
const OFF: f64 = 1e-3;

/// A JLS file being written: voltage and current of one trace, in pieces of any size, which leave no trace in the bytes.
///
/// Memory does not grow with the samples: about 4 MiB, and 25 KiB a signal for each level of summaries (five at 1e9).
///
/// ```
/// use traces::io::{atomic, jls};
///
/// # let folder = std::env::temp_dir().join(format!("jls-doc-{}", std::process::id()));
/// # std::fs::create_dir_all(&folder)?;
/// atomic::write_file(&folder.join("a.jls"), |out| {
///     let mut file = jls::Writer::new(out, 50e3, 0.0, &traces::Metadata::default())?;
///     for _ in 0..100 {
///         file.push(&[3.8; 1000], &[0.25; 1000])?;
///     }
///     file.finish()
/// })?;
/// # std::fs::remove_dir_all(&folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Writer<W> {
    chunks: Chunks<W>,
    signals: [Signal; SIGNALS.len()],
    times: [Times; SIGNALS.len()],
    heads: [Heads; SIGNALS.len()],
    rate_hz: f64,
    start_s: f64,
    samples: u64,
}

fn failed(error: io::Error) -> WriteError {
    WriteError::Encode(error.to_string())
}

/// The rate as it stands in the file.
fn whole_rate_hz(rate_hz: f64) -> Result<u32, WriteError> {
    let whole_hz = libm::round(rate_hz);
    if (1.0..=f64::from(u32::MAX)).contains(&whole_hz) && (rate_hz - whole_hz).abs() <= OFF * rate_hz {
        return Ok(whole_hz as u32);
    }
    Err(WriteError::JlsRate { rate_hz })
}

impl<W: Write + Seek> Writer<W> {
    /// Begins a recording in an empty file. Sample 0 is at `start_s`, in s since 1970-01-01 UTC for readers that show
    /// the time of day.
    ///
    /// # Errors
    /// [`WriteError`] if the rate (Hz) is not whole to 1 in 1000, the start is beyond about 8.5e9 s from 2018, a mark is
    /// not finite, the description is longer than 64 MiB, or `out` cannot be written.
    pub fn new(out: W, rate_hz: f64, start_s: f64, metadata: &Metadata) -> Result<Self, WriteError> {
        let whole_hz = whole_rate_hz(rate_hz)?;
        let description = header::wrapped(&header::describe(rate_hz, start_s, None, metadata)?)?;
        if description.len() >= LONGEST_BYTES as usize {
            return Err(WriteError::Encode("the description is longer than 64 MiB: leave out marks".into()));
        }
        let mut chunks = Chunks::new(out);
        let heads = definitions::write(&mut chunks, &metadata.device, SIGNALS, whole_hz, &description);
        let mut writer = Self {
            heads: heads.map_err(failed)?,
            chunks,
            signals: [Signal::new(1), Signal::new(2)],
            times: Default::default(),
            rate_hz,
            start_s,
            samples: 0,
        };
        writer.stamp()?;
        Ok(writer)
    }

    /// How many samples there are so far, skipped ones included.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Adds samples, V and A. What is not finite is written as it is; summaries leave it out.
    ///
    /// # Errors
    /// [`WriteError::Encode`] if there are not as many voltages as currents, or the writer fails.
    pub fn push(&mut self, voltage_v: &[f32], current_a: &[f32]) -> Result<(), WriteError> {
        if voltage_v.len() != current_a.len() {
            let [voltages, currents] = [voltage_v.len(), current_a.len()];
            return Err(WriteError::Encode(format!("{voltages} voltages but {currents} currents")));
        }
        let mut from = 0;
        while from < voltage_v.len() {
            let end = voltage_v.len().min(from + self.signals[0].room());
            let samples = [current_a, voltage_v].map(|channel| channel[from..end].iter().copied());
            self.extend(samples, end - from)?;
            from = end;
        }
        Ok(())
    }

    /// Leaves out samples that were lost: NaN stands for them, as in what pyjls writes.
    ///
    /// # Errors
    /// [`WriteError::Encode`] if the writer fails.
    pub fn skip(&mut self, mut samples: u64) -> Result<(), WriteError> {
        while samples > 0 {
            let count = samples.min(self.signals[0].room() as u64) as usize;
            self.extend([(); SIGNALS.len()].map(|()| core::iter::repeat_n(f32::NAN, count)), count)?;
            samples -= count as u64;
        }
        Ok(())
    }

    fn extend(
        &mut self,
        channels: [impl IntoIterator<Item = f32>; SIGNALS.len()],
        count: usize,
    ) -> Result<(), WriteError> {
        for (signal, samples) in self.signals.iter_mut().zip(channels) {
            signal.extend(&mut self.chunks, samples).map_err(failed)?;
        }
        self.samples += count as u64;
        Ok(())
    }

    /// Says when the last sample so far was taken, or the first one if there is none yet.
    fn stamp(&mut self) -> Result<(), WriteError> {
        let sample = self.samples.saturating_sub(1);
        let after_s = sample as f64 / self.rate_hz;
        let time_s = self.start_s + after_s;
        let time = utc::time(self.start_s, after_s).ok_or(WriteError::JlsTime { time_s })?;
        for (times, number) in self.times.iter_mut().zip(1..) {
            times.push(&mut self.chunks, number, (sample as i64, time)).map_err(failed)?;
        }
        Ok(())
    }

    /// Writes what is left. Without it, the file is one that was not closed.
    ///
    /// # Errors
    /// [`WriteError`] if the writer fails, or the last sample is later than JLS can say.
    pub fn finish(mut self) -> Result<(), WriteError> {
        if self.samples > 1 {
            self.stamp()?;
        }
        self.close().map_err(failed)
    }

    fn close(mut self) -> io::Result<()> {
        let chunks = &mut self.chunks;
        let tracks = self.signals.into_iter().zip(self.times).zip(self.heads);
        for (((signal, times), heads), number) in tracks.zip(1..) {
            let firsts = signal.finish(chunks)?;
            chunks.replace(heads.samples, &definitions::head(&firsts))?;
            let firsts = times.finish(chunks, number)?;
            chunks.replace(heads.utc, &definitions::head(&firsts))?;
        }
        chunks.append(&mut List::default(), END, 0, |_| ())?;
        self.chunks.finish()
    }
}

impl<W: Write + Seek + Send> Sink for Writer<W> {
    fn take(&mut self, stretch: &Stretch<'_>) -> Result<(), WriteError> {
        if stretch.lost {
            self.skip(stretch.len() as u64)
        } else {
            self.push(stretch.voltage_v, stretch.current_a)
        }
    }
}

/// Writes a trace, lost samples as NaN. The same trace gives the same bytes, whatever pieces it comes in.
///
/// # Errors
/// As [`Writer`], or [`WriteError::Read`] where the samples cannot be read.
pub fn write<W: Write + Seek + Send>(trace: &dyn Source, out: W) -> Result<(), WriteError> {
    let heading = trace.heading();
    let mut writer = Writer::new(out, heading.rate_hz, heading.start_s, &heading.metadata)?;
    trace.pour(&mut writer)?;
    writer.finish()
}

/// Writes a file, whole or not at all.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save(trace: &dyn Source, path: &Path) -> Result<(), WriteError> {
    atomic::write_trace(path, |out| write(trace, out))
}
