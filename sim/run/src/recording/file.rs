//! Recordings in files: a line of JSON that describes the run and its frames, then the packets of each frame,
//! all in gzip.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use activity::{Event, PacketStream};
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use output::terminal::Progress;
use pipeline::{FrameReport, Gpu};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use traces::io::atomic;
use workloads::SceneSettings;
use workloads::job::{Drawn, Draws, JobError};

use super::{DrawnFrames, RecordedFrame, TimedFrames};
use crate::frame::DrawnFrame;
use crate::{Change, Distinct, InputFile, Plan, RunError, RunOptions};

/// All frames of a run as drawn.
pub struct RecordedRun {
    about: About,
    recording: DrawnFrames,
    /// The file that it was read from.
    path: PathBuf,
}

/// What a file says of the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct About {
    /// Version of the format.
    recording: u32,
    /// The program that drew the frames.
    program: String,
    /// Names of all events, in the order of the counts in packets.
    events: Vec<String>,
    /// Name of the scene or workload.
    scene: String,
    width: u32,
    height: u32,
    samples: u32,
    frame_rate_hz: f64,
    /// First frame and the frame after the last.
    frames: [u32; 2],
    seed: u64,
    /// Name of the GPU that drew the frames.
    gpu: String,
    /// Its pipeline, as in its file.
    pipeline: Value,
    /// Place of each frame among those that differ.
    groups: Vec<usize>,
    /// Frames that differ, in order.
    distinct: Vec<FrameHead>,
}

/// A drawn frame, without its packets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FrameHead {
    number: u32,
    moving: bool,
    lens: bool,
    report: FrameReport,
    packets: u64,
    bytes: u64,
}

/// Version of the format.
const FORMAT: u32 = 1;

/// What a recording of any version begins with.
const START: &[u8; 13] = b"{\"recording\":";

/// Longest description of a run in bytes: of 100,000 frames with all their draws.
const MAX_ABOUT_BYTES: u64 = 4 << 30;

fn events() -> Vec<String> {
    Event::ALL.iter().map(|event| event.name().to_owned()).collect()
}

impl RecordedRun {
    /// Draws all frames of a plan that differ.
    ///
    /// # Errors
    /// If a frame cannot be drawn.
    pub fn draw(plan: &Plan, progress: &Progress) -> Result<Self, RunError> {
        let distinct = Distinct::new(&*plan.job)?;
        let recording = DrawnFrames::draw(plan, distinct.numbers(), usize::MAX, progress)?;
        let recording = recording.unwrap_or(DrawnFrames { frames: Vec::new() });
        let settings = plan.job.settings();
        let about = About {
            recording: FORMAT,
            program: env!("CARGO_PKG_VERSION").to_owned(),
            events: events(),
            scene: plan.name.clone(),
            width: settings.width,
            height: settings.height,
            samples: settings.samples,
            frame_rate_hz: settings.frame_rate_hz,
            frames: [settings.frames.start, settings.frames.end],
            seed: plan.options.seed,
            gpu: plan.gpu.name.clone(),
            pipeline: pipeline_of(plan),
            groups: distinct.groups().to_vec(),
            distinct: recording.frames.iter().map(FrameHead::of).collect(),
        };
        Ok(Self { about, recording, path: PathBuf::new() })
    }

    /// Number of its frames.
    pub fn frame_count(&self) -> usize {
        self.about.groups.len()
    }

    /// Number of packets of the frames that differ.
    pub fn packets(&self) -> u64 {
        self.recording.frames.iter().map(|frame| frame.packets.packets()).sum()
    }

    /// Writes it to `path`.
    ///
    /// # Errors
    /// If it cannot be written; an earlier file then stays.
    pub fn write(&self, path: &Path) -> Result<(), RunError> {
        let fill = |out: &mut std::io::BufWriter<File>| {
            let mut zip = GzEncoder::new(out, Compression::fast());
            serde_json::to_writer(&mut zip, &self.about)?;
            zip.write_all(b"\n")?;
            self.recording.frames.iter().try_for_each(|frame| zip.write_all(frame.packets.bytes()))?;
            zip.finish().map(drop)
        };
        Ok(atomic::write_file(path, fill)?)
    }

    /// Whether the file at `path` is a recording, of any version of the program.
    pub fn is_at(path: &Path) -> bool {
        let mut start = [0; START.len()];
        let read =
            File::open(path).and_then(|file| GzDecoder::new(BufReader::new(file)).read_exact(&mut start));
        read.is_ok() && start == *START
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// [`RunError::Input`] if it cannot be read, [`RunError::Damaged`] if it is no recording of this version
    /// of the program.
    pub fn read(path: &Path) -> Result<Self, RunError> {
        let name = path.display().to_string();
        let damaged = |message: String| RunError::Damaged { path: name.clone(), message };
        let file = File::open(path).map_err(|source| RunError::Input { path: name.clone(), source })?;
        let mut unzipped = BufReader::new(GzDecoder::new(BufReader::new(file)));
        let unreadable =
            |error| damaged(format!("it is no recording, or cut off: {error}; record the frames again"));
        let mut line = Vec::new();
        unzipped.by_ref().take(MAX_ABOUT_BYTES).read_until(b'\n', &mut line).map_err(unreadable)?;
        let about = About::parse(&line).map_err(damaged)?;
        let mut frames = Vec::new();
        for head in &about.distinct {
            let mut bytes = Vec::new();
            unzipped.by_ref().take(head.bytes).read_to_end(&mut bytes).map_err(unreadable)?;
            if bytes.len() as u64 != head.bytes {
                return Err(damaged(format!("it ends in frame {}; record the frames again", head.number)));
            }
            frames.push(head.clone().with_packets(bytes));
        }
        if unzipped.read(&mut [0]).map_err(unreadable)? > 0 {
            return Err(damaged("it goes on after its last frame; record the frames again".to_owned()));
        }
        Ok(Self { about, recording: DrawnFrames { frames }, path: path.to_owned() })
    }

    /// The run on the GPU, platform and energy table of `options`, at their timing level. Scene and view are
    /// those of the recording.
    ///
    /// # Errors
    /// If an input is missing or invalid, or the GPU has another pipeline than the one that drew the frames.
    pub fn plan(&self, options: RunOptions) -> Result<Plan, RunError> {
        let of_scene = |change: &&Change| InputFile::of(&change.path) == Some(InputFile::Scene);
        if let Some(change) = options.changes.iter().find(of_scene) {
            let file = self.path.display();
            let why = format!("the frames of {file} are drawn: record them anew");
            return Err(RunError::invalid(format_args!("--set {change}"), why));
        }
        let About { width, height, samples, frame_rate_hz, frames: [start, end], seed, .. } = self.about;
        let settings = SceneSettings {
            width,
            height,
            samples,
            frame_rate_hz,
            frames: start..end,
            ..SceneSettings::default()
        };
        let options = RunOptions { seed, ..options };
        let plan = Plan::of_job(options, &self.about.scene, Arc::new(RecordedJob { settings }))?;
        match first_difference("pipeline", &self.about.pipeline, &pipeline_of(&plan)) {
            None => Ok(plan),
            Some((path, [drawn, requested])) => {
                let why = format!(
                    "GPU `{}` has {path} {requested}, and the frames were drawn on `{}` with {drawn}: record them on this GPU",
                    plan.gpu.name, self.about.gpu
                );
                Err(RunError::invalid(self.path.display(), why))
            }
        }
    }

    /// All frames of the run on each of the plans as from [`frames_of`](crate::frames_of), in order.
    ///
    /// # Errors
    /// If a frame cannot be timed.
    pub fn timed(&self, plans: &[&Plan]) -> Result<Vec<TimedFrames<'_>>, RunError> {
        self.recording.timed(plans)
    }

    /// Place of each frame of the run among those that are timed.
    pub fn groups(&self) -> &[usize] {
        &self.about.groups
    }
}

impl About {
    fn parse(line: &[u8]) -> Result<Self, String> {
        let about: Self = serde_json::from_slice(line).map_err(|error| {
            format!("it is no recording of version {FORMAT}: {error}; record the frames again")
        })?;
        let differ = about.groups.len() != (about.frames[0]..about.frames[1]).len()
            || about.groups.iter().any(|group| *group >= about.distinct.len());
        if about.recording != FORMAT || about.events != events() || differ {
            let (theirs, ours) = (&about.program, env!("CARGO_PKG_VERSION"));
            return Err(format!(
                "it was written by version {theirs}, and this is {ours}: record the frames again"
            ));
        }
        Ok(about)
    }
}

impl FrameHead {
    fn of(recorded: &RecordedFrame) -> Self {
        let RecordedFrame { frame, packets } = recorded;
        Self {
            number: frame.number,
            moving: frame.moving,
            lens: frame.lens,
            report: frame.report.clone(),
            packets: packets.packets(),
            bytes: packets.bytes().len() as u64,
        }
    }

    fn with_packets(self, bytes: Vec<u8>) -> RecordedFrame {
        let Self { number, moving, lens, report, packets, .. } = self;
        let (facts, warnings, regime) = Default::default();
        let frame = DrawnFrame { number, report, moving, lens, facts, warnings, regime };
        RecordedFrame { frame, packets: PacketStream::new(bytes, packets) }
    }
}

fn pipeline_of(plan: &Plan) -> Value {
    serde_json::to_value(plan.gpu.pipeline).unwrap_or_default()
}

/// The first value at which two trees differ, by its path, with both values.
fn first_difference(path: &str, a: &Value, b: &Value) -> Option<(String, [String; 2])> {
    match (a, b) {
        (Value::Object(a), Value::Object(b)) if a.keys().eq(b.keys()) => {
            a.iter().find_map(|(key, value)| first_difference(&format!("{path}.{key}"), value, &b[key]))
        }
        _ => (a != b).then(|| (format!("`{path}`"), [a, b].map(Value::to_string))),
    }
}

/// The job of a recording: its frames were drawn before.
struct RecordedJob {
    settings: SceneSettings,
}

impl RecordedJob {
    fn refusal() -> JobError {
        JobError::Setting("the frames of a recording are drawn: they can only be timed".to_owned())
    }
}

impl Draws for RecordedJob {
    type Input = ();

    fn settings(&self) -> &SceneSettings {
        &self.settings
    }

    fn input(&self, _: u32) -> Result<(), JobError> {
        Err(Self::refusal())
    }

    fn draw(&self, (): &(), _: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        Err(Self::refusal())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GpuSpec, frames_of};
    use workloads::Overrides;

    fn recorded() -> (Plan, RecordedRun) {
        let overrides = Overrides { frames: Some(0..3), samples: Some(2), ..Overrides::default() };
        let options = RunOptions { scene: "tiny".into(), overrides, ..RunOptions::default() };
        let plan = Plan::resolve(options).unwrap();
        let run = RecordedRun::draw(&plan, &Progress::new(true)).unwrap();
        (plan, run)
    }

    #[test]
    fn a_file_gives_the_frames_of_a_run() {
        let (plan, run) = recorded();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tiny.rec");
        run.write(&path).unwrap();
        let read = RecordedRun::read(&path).unwrap();
        assert_eq!(read.about, run.about);
        let again = read.plan(RunOptions::default()).unwrap();
        let timed = read.timed(&[&again]).unwrap()[0].powered(&again.model).unwrap();
        let direct = frames_of(&plan, &[0, 1, 2], &Progress::new(true)).unwrap();
        for (frame, &group) in direct.iter().zip(read.groups()) {
            let timed = &timed[group];
            assert_eq!((frame.cycles, &frame.power), (timed.cycles, &timed.power));
            assert_eq!(frame.observed().unwrap().report, timed.observed().unwrap().report);
        }
        assert_eq!((again.name.as_str(), again.pixels()), (plan.name.as_str(), plan.pixels()));
    }

    #[test]
    fn another_pipeline_is_refused_by_its_first_difference() {
        let (_, run) = recorded();
        let message = |gpu: &str| {
            let options = RunOptions { gpu: gpu.into(), ..RunOptions::default() };
            run.plan(options).map(|plan| plan.gpu.name).map_err(|error| error.to_string())
        };
        assert_eq!(message("reference"), Ok("reference".to_owned()));
        let text = message("mobile").unwrap_err();
        assert!(
            text.contains("GPU `mobile` has `pipeline.") && text.contains("record them on this GPU"),
            "{text}"
        );
        assert!(GpuSpec::names().all(|name| (name == "reference") == message(name).is_ok()));
    }

    #[test]
    fn files_that_are_cut_or_no_recordings_say_so() {
        let (_, run) = recorded();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tiny.rec");
        run.write(&path).unwrap();
        let whole = std::fs::read(&path).unwrap();
        assert!(RecordedRun::is_at(&path) && !RecordedRun::is_at(folder.path()));
        for length in [0, 1, 10, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&path, &whole[..length]).unwrap();
            let text = RecordedRun::read(&path).map(drop).unwrap_err().to_string();
            assert!(text.contains("tiny.rec: ") && text.contains("record the frames again"), "{text}");
        }
        std::fs::write(&path, "(name: \"tiny\")").unwrap();
        assert!(RecordedRun::read(&path).is_err() && !RecordedRun::is_at(&path));
        assert!(matches!(RecordedRun::read(&folder.path().join("no.rec")), Err(RunError::Input { .. })));
    }
}
