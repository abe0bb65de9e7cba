//! `quintile chart frames`: how well frame starts are found, by method, over rate, noise, resolution and host time.
//!
//! Scenes are those of [`traces::synth`], whose frames are known. Each is recorded, frames are marked as by
//! hand (0.1 ms off at most), and the outcome is compared with the ground truth: F1 of starts within 0.5 ms,
//! and the energy error of frames whose two ends were found.

mod held_out;

use std::time::Instant;

use output::OutputError;
use output::plot::{ChartPanel, Paint, PlotMark, Scale, Series};
use output::terminal::Progress;
use serde::Serialize;
use traces::Trace;
use traces::energy::{FrameEnergy, PowerIntegral, TOLERANCE_S, score, true_frames};
use traces::frames::{FinderMethod, FinderOptions, Marks, default_window, find_with};
use traces::synth::{RecorderSpec, SCENARIOS, Scenario, SynthScene};

use self::held_out::{HeldOutRow, HeldOutSummary};
use crate::study::table::{Sheet, TableBuilder, fixed, optional, plain, share};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError};

pub use self::held_out::AlarmCount;

/// A method fails where its F1 is below this.
pub const FAILS_BELOW: f64 = 0.9;

/// Effort of the measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct FramesEffort {
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
    /// Seeds of the [held-out devices](traces::synth::HELD_OUT_DEVICES).
    #[serde(rename = "witness_seeds")]
    pub held_out_seeds: &'static [u64],
}

/// Search for frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FramesMethod {
    /// Sum of squares to one mark (Paper III).
    Squares,
    /// z-normalized distance to one mark.
    Normalized,
    /// Sum of squares to the nearest of five marks.
    Templates,
    /// Tracking from one mark, templates learnt.
    Tracking,
    /// One mark, without a requested method: the finder chooses one of the others.
    Auto,
}

impl FramesMethod {
    /// All of them, in the order of their colours.
    pub const ALL: [Self; 5] = [Self::Squares, Self::Normalized, Self::Templates, Self::Tracking, Self::Auto];

    /// Name of the method.
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

/// The property that is changed; the others stay at 50 kHz, 30 dB and 14 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FramesAxis {
    /// Sampling rate, Hz.
    Rate,
    /// Signal-to-noise ratio, dB.
    Noise,
    /// Bits of both converters.
    Bits,
}

impl FramesAxis {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Rate, Self::Noise, Self::Bits];

    /// Name of the axis.
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

    fn recordings(self, effort: &FramesEffort) -> Vec<(f64, RecorderSpec)> {
        let usual = RecorderSpec::default();
        match self {
            Self::Rate => {
                effort.rates_hz.iter().map(|&rate_hz| (rate_hz, RecorderSpec { rate_hz, ..usual })).collect()
            }
            Self::Noise => {
                effort.snrs_db.iter().map(|&snr_db| (snr_db, RecorderSpec { snr_db, ..usual })).collect()
            }
            Self::Bits => {
                effort.bits.iter().map(|&bits| (f64::from(bits), RecorderSpec { bits, ..usual })).collect()
            }
        }
    }
}

/// One method on one scene recorded in one way, over all seeds.
#[derive(Clone, Debug, Serialize)]
pub struct FramesRow {
    /// The property that is changed.
    pub axis: FramesAxis,
    /// Value on the axis.
    pub value: f64,
    /// The scene.
    pub scene: &'static str,
    /// The method.
    pub way: FramesMethod,
    /// Quality of the starts found.
    #[serde(flatten)]
    pub outcome: FinderScore,
    /// Whether F1 is below [`FAILS_BELOW`].
    pub fails: bool,
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct FramesChart {
    /// Effort of the measurement.
    pub effort: FramesEffort,
    /// By axis, value, scene and method.
    pub rows: Vec<FramesRow>,
    /// By kind of device, seed and method.
    #[serde(rename = "witnesses")]
    pub held_out: Vec<HeldOutRow>,
}

impl Study for FramesChart {
    const NAME: &'static str = "frames";
    const ABOUT: &'static str =
        "Frame starts found and energy error, by method, over sampling rate, noise, bits and host time";
    const PICTURES: &'static [&'static str] = &["frames_rate", "frames_noise", "frames_bits", "frames_time"];
    const FILES: &'static [&'static str] =
        &["frame_finding.csv", "frame_witnesses.csv", "frame_finding.json"];
    const SHOWS_TIME: bool = true;

    type Effort = FramesEffort;
    const FULL: FramesEffort = FramesEffort {
        frames: 200,
        rates_hz: &[1e3, 2e3, 5e3, 10e3, 20e3, 50e3, 200e3, 1e6],
        snrs_db: &[40.0, 30.0, 20.0, 10.0, 5.0, 0.0],
        bits: &[4, 6, 8, 10, 12, 14, 16],
        seeds: &[1, 2],
        held_out_seeds: &[104, 105, 106],
    };
    const QUICK: FramesEffort = FramesEffort {
        frames: 60,
        rates_hz: &[2e3, 10e3, 50e3],
        snrs_db: &[40.0, 10.0, 0.0],
        bits: &[6, 10, 14],
        seeds: &[1],
        held_out_seeds: &[1],
    };

    fn measure(effort: FramesEffort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let subjects = SCENARIOS.iter().map(|scenario| Subject::new(scenario, &effort));
        let subjects: Vec<Subject> = subjects.collect::<Result<_, _>>()?;
        let settings = FramesAxis::ALL.into_iter().flat_map(|axis| {
            axis.recordings(&effort).into_iter().map(move |(value, recording)| (axis, value, recording))
        });
        let settings: Vec<(FramesAxis, f64, RecorderSpec)> = settings.collect();
        let bar = progress.bar("recordings", (settings.len() * subjects.len()) as u64);
        let mut rows = Vec::new();
        // One after another: host times are part of what is measured.
        for (axis, value, recording) in settings {
            for subject in &subjects {
                for (way, outcomes) in subject.analyse(&recording)? {
                    let outcome = joined(&outcomes);
                    let fails = outcome.f1 < FAILS_BELOW;
                    rows.push(FramesRow { axis, value, scene: subject.name, way, outcome, fails });
                }
                bar.inc();
            }
        }
        let held_out = held_out::measure(effort.frames, effort.held_out_seeds)?;
        Ok(Self { effort, rows, held_out })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let subject = format!(
            "means over {} scenes of {} frames, {} of each; 50 kHz, 30 dB and 14 bits where not said otherwise",
            SCENARIOS.len(),
            self.effort.frames,
            self.effort.seeds.len()
        );
        for axis in FramesAxis::ALL {
            let (title, x, unit) = match axis {
                FramesAxis::Rate => ("Frames found over sampling rate", "sampling rate, kHz", 1e3),
                FramesAxis::Noise => ("Frames found over signal to noise", "signal to noise, dB", 1.0),
                FramesAxis::Bits => ("Frames found over resolution", "bits", 1.0),
            };
            let values: Vec<String> =
                self.values(axis).into_iter().map(|value| format!("{}", value / unit)).collect();
            let panels = [self.found(axis), self.energy(axis)].map(|panel| panel.along(x, &values));
            to.chart(&format!("frames_{}", axis.name()), [title, &subject], panels.into())?;
        }
        let panels = vec![self.host_time(), self.found_over_time()];
        to.chart("frames_time", ["Host time of finding frames", &subject], panels)
    }

    fn tables(&self) -> Vec<Sheet> {
        let rows = TableBuilder::of(&self.rows)
            .data("axis", |row| row.axis.name())
            .data("value", |row| row.value)
            .data("scene", |row| row.scene)
            .data("method", |row| row.way.name())
            .data("f1", |row| row.outcome.f1)
            .data("fails", |row| row.fails)
            .data("energy_error", |row| row.outcome.energy_error)
            .data("wrong", |row| row.outcome.flags.wrong)
            .data("wrong_flagged", |row| row.outcome.flags.wrong_with)
            .data("right", |row| row.outcome.flags.right)
            .data("right_flagged", |row| row.outcome.flags.right_with)
            .data("host_s_per_1e6", |row| row.outcome.host_s_per_1e6)
            .csv("frame_finding.csv");
        let devices = TableBuilder::of(&self.held_out)
            .data("witness", |row| row.device)
            .data("seed", |row| row.seed)
            .data("method", |row| row.method)
            .data("f1", |row| row.f1.first().copied())
            .data("f1_worst_mark", |row| row.f1.iter().copied().reduce(f64::min))
            .data("calibration_error", |row| row.calibration.error())
            .data("wrong", |row| row.flags.wrong)
            .data("wrong_flagged", |row| row.flags.wrong_with)
            .data("right", |row| row.flags.right)
            .data("right_flagged", |row| row.flags.right_with)
            .data("failed", |row| row.warnings.wrong)
            .data("failed_warned", |row| row.warnings.wrong_with)
            .data("good", |row| row.warnings.right)
            .data("good_warned", |row| row.warnings.right_with)
            .csv("frame_witnesses.csv");
        vec![self.by_scene(), self.by_value(), self.by_device(), rows.sheet(), devices.sheet()]
    }

    /// Every method at each ratio of signal to noise, over all scenes.
    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let at = |snr_db: f64, way: FramesMethod| {
            let mean = |of: fn(&FinderScore) -> Option<f64>| self.mean(FramesAxis::Noise, snr_db, way, of);
            let cost = mean(|o| Some(o.host_s_per_1e6));
            let f1 =
                mean(|o| Some(o.f1)).map(|f1| Metric::new("starts wrong or missed (1 - F1)", "", 1.0 - f1));
            let energy = mean(|o| o.energy_error);
            let energy =
                energy.map(|share| Metric::new("median error of a frame's energy", "%", 100.0 * share));
            let point = |error: Metric| {
                let cost = Metric::new("host time of a million samples", "s", cost?);
                let subject = format!("frames of a trace ({})", FramesAxis::Noise.shown(snr_db));
                Some(TradeoffPoint::new(subject, [way.name(), ""], [error.beside(0.0), cost]))
            };
            [f1, energy].into_iter().flatten().filter_map(point).collect::<Vec<_>>()
        };
        let values = self.values(FramesAxis::Noise).into_iter();
        values.flat_map(|snr_db| FramesMethod::ALL.map(|way| at(snr_db, way))).flatten().collect()
    }
}

impl FramesChart {
    /// The values along an axis, in order.
    fn values(&self, axis: FramesAxis) -> Vec<f64> {
        let mut values: Vec<f64> =
            self.rows.iter().filter(|row| row.axis == axis).map(|row| row.value).collect();
        values.dedup();
        values
    }

    /// The rows of one method at one value, a row for each scene.
    fn at(&self, axis: FramesAxis, value: f64, way: FramesMethod) -> impl Iterator<Item = &FramesRow> {
        self.rows.iter().filter(move |row| row.axis == axis && row.value == value && row.way == way)
    }

    /// The mean over scenes of what each has; `None` where none has it.
    fn mean(
        &self,
        axis: FramesAxis,
        value: f64,
        way: FramesMethod,
        of: fn(&FinderScore) -> Option<f64>,
    ) -> Option<f64> {
        let values: Vec<f64> = self.at(axis, value, way).filter_map(|row| of(&row.outcome)).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    }

    /// A curve over the places of the values, without those at which nothing is known.
    fn along(&self, axis: FramesAxis, way: FramesMethod, of: fn(&FinderScore) -> Option<f64>) -> Series {
        let means = self.values(axis).into_iter().map(|value| self.mean(axis, value, way, of)).enumerate();
        Series::curve(way.name(), means.filter_map(|(place, mean)| Some((place as f64, mean?))))
    }

    /// F1, with the line below which a method fails.
    fn found(&self, axis: FramesAxis) -> ChartPanel {
        let last = self.values(axis).len().saturating_sub(1) as f64;
        let limit = Series::new("fails below", PlotMark::Line(vec![(0.0, FAILS_BELOW), (last, FAILS_BELOW)]));
        let curves = FramesMethod::ALL.into_iter().map(|way| self.along(axis, way, |o| Some(o.f1)));
        let series = curves.chain([limit.painted(Paint::Ink)]).collect();
        ChartPanel::new("", ["", "F1 of starts within 0.5 ms"], series).on(Scale::Even, Scale::FromZero)
    }

    fn energy(&self, axis: FramesAxis) -> ChartPanel {
        let percent: fn(&FinderScore) -> Option<f64> = |o| o.energy_error.map(|error| 100.0 * error);
        let curves = FramesMethod::ALL.into_iter().map(|way| self.along(axis, way, percent)).collect();
        ChartPanel::new("", ["", "median energy error (%)"], curves)
    }

    fn host_time(&self) -> ChartPanel {
        let of =
            |way: FramesMethod| self.timed(way).into_iter().map(|(rate_hz, host_s, _)| (rate_hz, host_s));
        let axes = ["sampling rate, Hz", "host seconds for a million samples"];
        let curves = FramesMethod::ALL.map(|way| Series::curve(way.name(), of(way)));
        ChartPanel::new("time over sampling rate", axes, curves.into())
    }

    fn found_over_time(&self) -> ChartPanel {
        let curve = |way: FramesMethod| {
            let mut points: Vec<(f64, f64)> =
                self.timed(way).into_iter().map(|(_, host_s, f1)| (host_s, f1)).collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            Series::curve(way.name(), points)
        };
        let axes = ["host seconds for a million samples", "F1"];
        ChartPanel::new("F1 over time, a dot for each rate", axes, FramesMethod::ALL.map(curve).into())
    }

    /// Rate, host seconds for a million samples, and F1.
    fn timed(&self, way: FramesMethod) -> Vec<(f64, f64, f64)> {
        let point = |rate_hz: f64| {
            let mean = |of| self.mean(FramesAxis::Rate, rate_hz, way, of);
            Some((rate_hz, mean(|o| Some(o.host_s_per_1e6))?, mean(|o| Some(o.f1))?))
        };
        self.values(FramesAxis::Rate).into_iter().filter_map(point).collect()
    }

    /// Mean F1 by axis, value and method; a star where it fails, and on how many of the scenes it does.
    fn by_value(&self) -> Sheet {
        let each = FramesAxis::ALL
            .into_iter()
            .flat_map(|axis| self.values(axis).into_iter().map(move |at| (axis, at)));
        let mut table = TableBuilder::of(each).shown("axis", |(axis, _)| axis.name(), plain).shown(
            "value",
            |(axis, value)| axis.shown(*value),
            plain,
        );
        for way in FramesMethod::ALL {
            table = table.shown(way.name(), |(axis, value)| self.cell(*axis, *value, way), plain);
        }
        let energy = |axis, value| self.mean(axis, value, FramesMethod::Auto, |o| o.energy_error);
        let flags = |(axis, value): &(FramesAxis, f64)| {
            AlarmCount::sum(self.at(*axis, *value, FramesMethod::Auto).map(|row| &row.outcome.flags))
        };
        table
            .detail("energy error, auto", |(axis, value)| energy(*axis, *value), optional(share(3)))
            .detail("wrong frames flagged", move |at| flags(at).of_wrong(), plain)
            .detail("right ones flagged", move |at| flags(at).of_right(), plain)
            .after(format!("*: mean F1 below {FAILS_BELOW}; in brackets how many scenes are below\n"))
            .sheet()
    }

    /// Every method on every kind of device.
    fn by_device(&self) -> Sheet {
        let below = |of: &HeldOutSummary| format!("{} of {}", of.below_simple, of.devices);
        TableBuilder::of(held_out::summaries(&self.held_out))
            .detail("device", |of| of.device, plain)
            .detail("method", |of| of.method, plain)
            .detail("F1, first mark", |of| of.first, fixed(3))
            .detail("F1, worst of five marks", |of| of.worst, fixed(3))
            .detail("below the better simple method", below, plain)
            .detail("calibration error", |of| of.calibration.error(), optional(fixed(3)))
            .detail("wrong frames flagged", |of| of.flags.of_wrong(), plain)
            .detail("right ones flagged", |of| of.flags.of_right(), plain)
            .detail("failed searches that warn", |of| of.warnings.of_wrong(), plain)
            .detail("good ones that warn", |of| of.warnings.of_right(), plain)
            .sheet()
    }

    /// F1 with the number of scenes that fail; marked where the mean does.
    fn cell(&self, axis: FramesAxis, value: f64, way: FramesMethod) -> String {
        let f1 = self.mean(axis, value, way, |o| Some(o.f1)).unwrap_or(0.0);
        let failed = self.at(axis, value, way).filter(|row| row.fails).count();
        let mark = if f1 < FAILS_BELOW { "*" } else { "" };
        let failures = if failed == 0 { String::new() } else { format!(" ({failed})") };
        format!("{f1:.3}{mark}{failures}")
    }

    /// F1 of every scene at the usual rate; a star where a method fails.
    fn by_scene(&self) -> Sheet {
        let usual =
            self.values(FramesAxis::Rate).into_iter().rfind(|&rate_hz| rate_hz <= 50e3).unwrap_or(0.0);
        let at = |way: FramesMethod| self.at(FramesAxis::Rate, usual, way).collect::<Vec<_>>();
        let f1 = |row: &FramesRow| format!("{:.3}{}", row.outcome.f1, if row.fails { "*" } else { "" });
        let mut table = TableBuilder::of(at(FramesMethod::Auto).into_iter().enumerate()).detail(
            "scene",
            |(_, row)| row.scene,
            plain,
        );
        for way in FramesMethod::ALL {
            let rows = at(way);
            table = table.detail(way.name(), |(place, _)| f1(rows[*place]), plain);
        }
        let table =
            table.detail("energy error, auto", |(_, row)| row.outcome.energy_error, optional(share(3)));
        table.sheet()
    }
}

/// Places of the marks, as shares of the frames; where one is requested, it is the first.
const MARKED: [f64; 5] = [0.4, 0.1, 0.25, 0.6, 0.85];
/// Errors of the marks, s.
const HAND_S: [f64; 5] = [0.05e-3, -0.1e-3, 0.1e-3, 0.0, -0.05e-3];

/// Quality of the starts found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FinderScore {
    /// Harmonic mean of precision and recall of starts; of several analyses the mean.
    pub f1: f64,
    /// Median energy error of frames whose two ends were found, as a share; `None` where there is none.
    pub energy_error: Option<f64>,
    /// Flags of the frames.
    pub flags: AlarmCount,
    /// Host time, s for a million samples.
    pub host_s_per_1e6: f64,
}

/// A scenario with every seed.
struct Subject {
    pub name: &'static str,
    scenes: Vec<(u64, SynthScene)>,
}

impl Subject {
    pub fn new(scenario: &Scenario, effort: &FramesEffort) -> Result<Self, StudyError> {
        let scene = |&seed: &u64| Ok((seed, scenario.scene(effort.frames, seed)?));
        let scenes = effort.seeds.iter().map(scene).collect::<Result<_, StudyError>>()?;
        Ok(Self { name: scenario.name, scenes })
    }

    /// By each method, the outcome with each seed.
    pub fn analyse(
        &self,
        recording: &RecorderSpec,
    ) -> Result<Vec<(FramesMethod, Vec<FinderScore>)>, StudyError> {
        let mut of = FramesMethod::ALL.map(|way| (way, Vec::new()));
        for (seed, scene) in &self.scenes {
            let trace = scene.record(&RecorderSpec { seed: *seed, ..*recording })?;
            for (way, outcomes) in &mut of {
                outcomes.push(analyse(&trace, scene, *way)?);
            }
        }
        Ok(of.into())
    }
}

/// Marks some frames, finds the others and holds them against the truth.
fn analyse(trace: &Trace, scene: &SynthScene, way: FramesMethod) -> Result<FinderScore, StudyError> {
    let (count, method) = match way {
        FramesMethod::Squares => (1, FinderMethod::SumOfSquares),
        FramesMethod::Normalized => (1, FinderMethod::Normalized),
        FramesMethod::Templates => (MARKED.len(), FinderMethod::SumOfSquares),
        FramesMethod::Tracking => (1, FinderMethod::Tracking),
        FramesMethod::Auto => (1, FinderMethod::Auto),
    };
    let frame = |share: f64| &scene.truth[(share * scene.truth.len() as f64) as usize];
    let marks_s = MARKED.iter().zip(HAND_S).map(|(&share, hand_s)| frame(share).start_s + hand_s);
    let marks = Marks {
        starts_s: marks_s.take(count).collect(),
        window: default_window(0.0, trace.rate_hz()),
        end_s: trace.end_s(),
    };
    let clock = Instant::now();
    let found = find_with(trace, &marks, &FinderOptions { method, ..FinderOptions::default() })?;
    let host_s = clock.elapsed().as_secs_f64();
    let frames = PowerIntegral::new(trace).frames(&found);
    let score = score(&frames, &scene.truth, TOLERANCE_S);
    Ok(FinderScore {
        f1: score.f1(),
        energy_error: score.median_energy_error(),
        host_s_per_1e6: host_s * 1e6 / trace.samples() as f64,
        flags: flags(&frames, scene),
    })
}

/// How many frames are wrong and right, and how many of each carry a flag. The last one ends at the end mark
/// and is left out.
fn flags(frames: &[FrameEnergy], scene: &SynthScene) -> AlarmCount {
    let found_s: Vec<f64> = frames.iter().map(|frame| frame.start_s).collect();
    let truth_s: Vec<f64> = scene.truth.iter().map(|frame| frame.start_s).collect();
    let mut flags = AlarmCount::default();
    for (right, frame) in true_frames(&found_s, &truth_s, TOLERANCE_S).into_iter().zip(frames) {
        flags.add(right, frame.flags.has_low_confidence());
    }
    flags
}

/// Several as one: means of rates and errors, sums of counts.
fn joined(outcomes: &[FinderScore]) -> FinderScore {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let all = |of: fn(&FinderScore) -> f64| mean(&outcomes.iter().map(of).collect::<Vec<_>>());
    let errors: Vec<f64> = outcomes.iter().filter_map(|outcome| outcome.energy_error).collect();
    FinderScore {
        f1: all(|o| o.f1),
        energy_error: (!errors.is_empty()).then(|| mean(&errors)),
        flags: AlarmCount::sum(outcomes.iter().map(|outcome| &outcome.flags)),
        host_s_per_1e6: all(|o| o.host_s_per_1e6),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    const SMALL: FramesEffort = FramesEffort {
        frames: 40,
        rates_hz: &[1e3, 20e3],
        snrs_db: &[30.0],
        bits: &[],
        seeds: &[1],
        held_out_seeds: &[],
    };

    fn small() -> (tempfile::TempDir, FramesChart) {
        let (dir, chart, _) = written::<FramesChart>(SMALL);
        (dir, chart)
    }

    #[test]
    fn tracking_finds_the_frames_of_every_scene_and_few_samples_leave_hardly_any() {
        let (dir, chart) = small();
        assert_eq!(chart.rows.len(), 3 * SCENARIOS.len() * FramesMethod::ALL.len());
        let f1 =
            |rate_hz| chart.mean(FramesAxis::Rate, rate_hz, FramesMethod::Tracking, |o| Some(o.f1)).unwrap();
        assert!(f1(20e3) > 0.95 && f1(1e3) < f1(20e3), "{} {}", f1(1e3), f1(20e3));
        for row in &chart.rows {
            assert_eq!(row.fails, row.outcome.f1 < FAILS_BELOW);
            let AlarmCount { wrong, wrong_with, .. } = row.outcome.flags;
            assert!(wrong_with <= wrong && row.outcome.f1 <= 1.0);
        }
        let text = std::fs::read_to_string(dir.path().join("frame_finding.csv")).unwrap();
        assert_eq!(text.lines().count(), 1 + chart.rows.len());
    }

    #[test]
    fn all_but_host_time_is_the_same_every_time() {
        let without_time = |chart: FramesChart| {
            let mut rows = chart.rows;
            rows.iter_mut().for_each(|row| row.outcome.host_s_per_1e6 = 0.0);
            rows.into_iter().map(|row| row.outcome).collect::<Vec<_>>()
        };
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(without_time(small().1), without_time(one.install(|| small().1)));
    }

    #[test]
    fn outcomes_are_joined_by_means_and_sums() {
        let flags = |wrong, right| AlarmCount { wrong, right, ..AlarmCount::default() };
        let a = FinderScore { f1: 0.5, flags: flags(2, 3), ..FinderScore::default() };
        let b =
            FinderScore { f1: 1.0, energy_error: Some(0.1), flags: flags(1, 4), ..FinderScore::default() };
        let both = joined(&[a, b]);
        assert_eq!((both.f1, both.energy_error, both.flags), (0.75, Some(0.1), flags(3, 7)));
        assert_eq!(joined(&[a]).energy_error, None);
    }
}
