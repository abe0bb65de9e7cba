//! `quintile chart frames`: how well frame starts are found, by method, over rate, noise, resolution and host time.
//!
//! Scenes are those of [`traces::synth`], whose frames are known. Each is recorded, frames are marked as by hand (0.1 ms off at most),
//! and the outcome is held against the truth: F1 of starts within 0.5 ms, and the energy error of frames whose two ends were found.

mod measure;
mod tables;
#[cfg(test)]
mod tests;

use serde::Serialize;
use traces::synth::{Recording, SCENARIOS};

use super::ChartError;
use output::OutDir;
use output::plot::Look;
use output::progress::Progress;

pub use measure::Outcome;
use measure::{Subject, joined};
pub use tables::claim;

/// A method fails where its F1 is below this.
pub const FAILS_BELOW: f64 = 0.9;

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Effort {
    /// Frames of each scene.
    pub frames: usize,
    /// Rates, Hz.
    pub rates_hz: &'static [f64],
    /// Signal-to-noise ratios, dB.
    pub snrs_db: &'static [f64],
    /// Resolutions, bits.
    pub bits: &'static [u32],
    /// Seeds of scenes and noise.
    pub seeds: &'static [u64],
}

impl Effort {
    /// The chart of the book.
    pub const FULL: Self = Self {
        frames: 200,
        rates_hz: &[1e3, 2e3, 5e3, 10e3, 20e3, 50e3, 200e3, 1e6],
        snrs_db: &[40.0, 30.0, 20.0, 10.0, 5.0, 0.0],
        bits: &[4, 6, 8, 10, 12, 14, 16],
        seeds: &[1, 2],
    };
    /// A look.
    pub const QUICK: Self = Self {
        frames: 60,
        rates_hz: &[2e3, 10e3, 50e3],
        snrs_db: &[40.0, 10.0, 0.0],
        bits: &[6, 10, 14],
        seeds: &[1],
    };
}

/// How frames are looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// Sum of squares to one mark (Paper III).
    Squares,
    /// z-normalized distance to one mark.
    Normalized,
    /// Sum of squares to the nearest of five marks.
    Templates,
    /// Tracking from one mark, templates learnt.
    Tracking,
    /// One mark and no method asked for: that of the others which fits what is found.
    Auto,
}

impl Way {
    /// All of them, in the order of their colours.
    pub const ALL: [Self; 5] = [Self::Squares, Self::Normalized, Self::Templates, Self::Tracking, Self::Auto];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Squares => "squares",
            Self::Normalized => "normalized",
            Self::Templates => "five templates",
            Self::Tracking => "tracking",
            Self::Auto => "auto",
        }
    }
}

/// What is changed; the others stay at 50 kHz, 30 dB and 14 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// Sampling rate, Hz.
    Rate,
    /// Signal-to-noise ratio, dB.
    Noise,
    /// Bits of both converters.
    Bits,
}

impl Axis {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Rate, Self::Noise, Self::Bits];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rate => "rate",
            Self::Noise => "noise",
            Self::Bits => "bits",
        }
    }

    /// A value with its unit.
    pub fn shown(self, value: f64) -> String {
        match self {
            Self::Rate => format!("{} kHz", value / 1e3),
            Self::Noise => format!("{value} dB"),
            Self::Bits => format!("{value}"),
        }
    }

    fn recordings(self, effort: &Effort) -> Vec<(f64, Recording)> {
        let usual = Recording::default();
        match self {
            Self::Rate => {
                effort.rates_hz.iter().map(|&rate_hz| (rate_hz, Recording { rate_hz, ..usual })).collect()
            }
            Self::Noise => {
                effort.snrs_db.iter().map(|&snr_db| (snr_db, Recording { snr_db, ..usual })).collect()
            }
            Self::Bits => {
                effort.bits.iter().map(|&bits| (f64::from(bits), Recording { bits, ..usual })).collect()
            }
        }
    }
}

/// One method on one scene recorded in one way, over all seeds.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What is changed.
    pub axis: Axis,
    /// To what.
    pub value: f64,
    /// The scene.
    pub scene: &'static str,
    /// The method.
    pub way: Way,
    /// What came out.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Whether F1 is below [`FAILS_BELOW`].
    pub fails: bool,
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct FramesChart {
    /// How much was measured.
    pub effort: Effort,
    /// By axis, value, scene and method.
    pub rows: Vec<Row>,
}

impl FramesChart {
    /// The values along an axis, in order.
    pub(super) fn values(&self, axis: Axis) -> Vec<f64> {
        let mut values: Vec<f64> =
            self.rows.iter().filter(|row| row.axis == axis).map(|row| row.value).collect();
        values.dedup();
        values
    }

    /// The rows of one method at one value, a row for each scene.
    fn at(&self, axis: Axis, value: f64, way: Way) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(move |row| row.axis == axis && row.value == value && row.way == way)
    }

    /// The mean over scenes of what each has; `None` where none has it.
    pub(super) fn mean(
        &self,
        axis: Axis,
        value: f64,
        way: Way,
        of: fn(&Outcome) -> Option<f64>,
    ) -> Option<f64> {
        let values: Vec<f64> = self.at(axis, value, way).filter_map(|row| of(&row.outcome)).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    }
}

/// Measures the chart and writes it into `dir`.
///
/// # Errors
/// [`ChartError`], above all when `dir` cannot be written to.
pub fn chart(
    effort: Effort,
    dir: &OutDir,
    look: &Look,
    progress: &Progress,
) -> Result<FramesChart, ChartError> {
    let subjects: Vec<Subject> =
        SCENARIOS.iter().map(|scenario| Subject::new(scenario, &effort)).collect::<Result<_, _>>()?;
    let settings = Axis::ALL.into_iter().flat_map(|axis| {
        axis.recordings(&effort).into_iter().map(move |(value, recording)| (axis, value, recording))
    });
    let settings: Vec<(Axis, f64, Recording)> = settings.collect();
    let bar = progress.bar("recordings", (settings.len() * subjects.len()) as u64);
    let mut rows = Vec::new();
    // One after another: host times are part of what is measured.
    for (axis, value, recording) in settings {
        for subject in &subjects {
            for (way, outcomes) in subject.analyse(&recording)? {
                let outcome = joined(&outcomes);
                let fails = outcome.f1 < FAILS_BELOW;
                rows.push(Row { axis, value, scene: subject.name, way, outcome, fails });
            }
            bar.inc();
        }
    }
    let chart = FramesChart { effort, rows };
    tables::write(&chart, dir, look)?;
    Ok(chart)
}
