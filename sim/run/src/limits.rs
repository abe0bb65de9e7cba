//! How large a run may be, checked before any of it is made.

use super::RunError;
use power_model::Pacing;

/// Bytes of memory that the samples of one image may take.
const SAMPLE_BYTES_LIMIT: u64 = 8 << 30;
/// Bytes of one stored sample: its depth, its triangle, and what is logged and resolved of it.
pub(super) const BYTES_PER_SAMPLE: u64 = 16;
/// Samples of the trace: about 2.5 GB as CSV, which is written beside the 0.4 GB of Parquet.
const TRACE_LIMIT: f64 = 5e7;
/// Frames of one run.
const FRAMES_LIMIT: u32 = 100_000;

/// Refuses `pixels` of `samples`, each of so many bytes, where they would not fit into memory; `what` begins the message.
///
/// # Errors
/// [`RunError::Setting`] with what would be needed.
pub fn fits_memory(what: &str, pixels: u64, samples: u32, bytes_per_sample: u64) -> Result<(), RunError> {
    let bytes = pixels * u64::from(samples) * bytes_per_sample;
    let (needed, limit) = (bytes >> 30, SAMPLE_BYTES_LIMIT >> 30);
    let message = || {
        format!(
            "{what}: {pixels} pixels of {samples} samples take {needed} GiB, more than {limit} GiB; ask for fewer"
        )
    };
    if bytes > SAMPLE_BYTES_LIMIT { Err(RunError::Setting(message())) } else { Ok(()) }
}

/// What decides the size of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    pub pixels: u64,
    pub samples: u32,
    pub frames: u32,
    pub pacing: Pacing,
    pub trace_rate_hz: f64,
    pub idle_s: f64,
}

impl Size {
    /// Refuses what would not fit.
    pub fn check(&self) -> Result<(), RunError> {
        let refuse = |message| Err(RunError::Setting(message));
        fits_memory("size and samples", self.pixels, self.samples, BYTES_PER_SAMPLE)?;
        if self.frames > FRAMES_LIMIT {
            return refuse(format!(
                "frames: {} in one run; at most {FRAMES_LIMIT}, ask for fewer",
                self.frames
            ));
        }
        trace_fits(self.recorded_s(), self.trace_rate_hz)
    }

    /// How long the recording is; of frames that follow each other freely, without them.
    fn recorded_s(&self) -> f64 {
        let frames_s = match self.pacing {
            Pacing::Vsync { rate } => f64::from(self.frames) / rate.value(),
            Pacing::FreeRunning => 0.0,
        };
        frames_s + self.idle_s
    }

    /// Samples of the trace.
    pub fn trace_samples(&self) -> f64 {
        self.recorded_s() * self.trace_rate_hz
    }
}

/// Refuses a recording of `length_s` where its files would fill the disk.
pub(super) fn trace_fits(length_s: f64, rate_hz: f64) -> Result<(), RunError> {
    let samples = length_s * rate_hz;
    if samples <= TRACE_LIMIT {
        return Ok(());
    }
    Err(RunError::Setting(format!(
        "the trace: {length_s:.0} s at {rate_hz} samples a second are {samples:.1e} samples, more than {TRACE_LIMIT:.0e}; ask \
         for fewer frames, a lower --trace-rate, a higher --rate, or less lead_in_s and tail_s in the platform file"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size() -> Size {
        let pacing = Pacing::vsync(60.0).unwrap();
        Size { pixels: 921_600, samples: 8, frames: 36, pacing, trace_rate_hz: 50e3, idle_s: 0.5 }
    }

    fn message(size: Size) -> String {
        size.check().unwrap_err().to_string()
    }

    #[test]
    fn ordinary_runs_fit() {
        assert!(size().check().is_ok());
        assert!(Size { pixels: 3840 * 2160, samples: 64, frames: 3000, ..size() }.check().is_ok());
    }

    #[test]
    fn what_does_not_fit_says_what_to_change() {
        assert!(message(Size { pixels: 1 << 28, samples: 256, ..size() }).contains("ask for fewer"));
        assert!(message(Size { frames: 10_000_000, ..size() }).contains("at most 100000"));
        assert!(message(Size { trace_rate_hz: 1e7, frames: 6000, ..size() }).contains("--trace-rate"));
        let idle = Size { trace_rate_hz: 1e7, idle_s: 120.0, pacing: Pacing::FreeRunning, ..size() };
        assert!(
            message(idle).contains("120 s at 10000000 samples a second are 1.2e9 samples, more than 5e7")
        );
    }
}
