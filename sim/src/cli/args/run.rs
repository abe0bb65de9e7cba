//! Arguments of `run`.

use std::ops::Range;
use std::path::PathBuf;

use activity::{Event, spec::suggestion};
use clap::{Args, ValueEnum};
use pipeline::frame::HeatMap;

use crate::cli::parse::{duration, frames, percent, setting, size};
use crate::timing::Method;

/// Arguments of `run`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile run Fox.glb --clip Run --frames 0..60 --lens 2 --samples 16 --out fox\n  \
    quintile run Fox.glb --frames 0..300 --accuracy 2% --verify --out fox\n  \
    quintile run ccd --set resolution=64 --set bins=8 --out ccd\n\n\
    A workload's options with their defaults are in its chapter of the book; `--set` names them when one is misspelled. It takes no\n\
    --accuracy, --budget, --timing sampled or --heat, which need a scene, and refuses flags of scenes that would change nothing.\n\n\
    Results are in DIR: images/, report.html, summary.json, frames.csv, trace.parquet, trace.csv, plots/ and\n\
    timeline.perfetto-trace (open it at ui.perfetto.dev). summary.json is written last: where it is, all is there."
)]
pub struct RunArgs {
    /// A built-in scene or a workload (see `quintile list`), or a .ron, .gltf, .glb, .ply or .obj file
    #[arg(default_value = "default", value_name = "SCENE|WORKLOAD|FILE")]
    pub scene: String,
    /// Options of a workload in a .ron file
    #[arg(long, value_name = "FILE.ron")]
    pub options: Option<PathBuf>,
    /// An option of a workload; may be given several times, and comes after --options
    #[arg(long, value_name = "NAME=VALUE", value_parser = setting)]
    pub set: Vec<(String, String)>,
    /// Folder for the results; made where it is missing
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Frames to render, the end not included
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub frames: Option<Range<u32>>,
    /// Samples in a pixel, 1 to 256
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub samples: Option<u32>,
    /// Where and when each pixel looks: a built-in sample table (see `quintile list`), a description of one in a .ron
    /// file, or the samples themselves in a .smp file
    #[arg(long, value_name = "TABLE")]
    pub table: Option<String>,
    /// Size of the image in pixels
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<(u32, u32)>,
    /// Frames in a second of the scene's time, and ticks of the display
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Radius of the lens in scene units, 0 for a pinhole
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    pub lens: Option<f32>,
    /// Depth in scene units at which the lens is sharp
    #[arg(long, value_name = "F", allow_negative_numbers = true)]
    pub focus: Option<f32>,
    /// How long the shutter is open, as a fraction of the frame period
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub shutter: Option<f64>,
    /// Animation of a glTF scene, by name or number
    #[arg(long, value_name = "CLIP")]
    pub clip: Option<String>,
    /// A built-in GPU or a .ron file
    #[arg(long, value_name = "FILE", default_value = "reference")]
    pub gpu: String,
    /// A built-in platform or a .ron file
    #[arg(long, value_name = "FILE", default_value = "reference")]
    pub platform: String,
    /// A built-in energy table or a .ron file
    #[arg(long, value_name = "FILE", default_value = "28nm")]
    pub energy: String,
    /// Which values of the energy table to use
    #[arg(long, value_enum, default_value_t)]
    pub bound: BoundArg,
    /// How time is modelled; `quintile chart timing` says how well
    #[arg(long, value_enum, default_value_t)]
    pub timing: Method,
    /// Let a probe choose level, frames and dimensions so that the error of cycles and energy is at most this, for example 2%;
    /// for scenes, not for workloads
    #[arg(long, value_name = "P%", value_parser = percent, conflicts_with = "timing", allow_hyphen_values = true)]
    pub accuracy: Option<f64>,
    /// Let a probe choose the most exact that takes no longer than this, for example 30s, 500ms or 2min; for scenes, not for
    /// workloads
    #[arg(long, value_name = "T", value_parser = duration, conflicts_with = "timing", allow_hyphen_values = true)]
    pub budget: Option<f64>,
    /// Simulate every frame at the reference as well, and say how wrong the run was
    #[arg(long)]
    pub verify: bool,
    /// When the next frame starts
    #[arg(long, value_enum, default_value_t)]
    pub pacing: PacingArg,
    /// Samples per second of the recorder
    #[arg(long, value_name = "HZ", default_value_t = 50e3, allow_negative_numbers = true)]
    pub trace_rate: f64,
    /// Samples of the recorder that travel together, and are lost together
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..))]
    pub packet_samples: u32,
    /// Share of these packets that are lost, 0 to below 1: gaps in trace.parquet
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, allow_negative_numbers = true)]
    pub packet_loss: f64,
    /// Seed of samples, noise and losses
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = crate::cli::parse::seed)]
    pub seed: u64,
    /// Write every frame as EXR, too (linear light)
    #[arg(long)]
    pub exr: bool,
    /// Write where in each frame a counter counted, as a picture, an EXR and a CSV in heat/; may be given several times
    #[arg(long, value_name = "COUNTER", value_parser = counter)]
    pub heat: Vec<Event>,
    /// Worker threads; all cores without it. The results do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print summary.json to standard output and nothing else
    #[arg(long)]
    pub json: bool,
}

/// Which values of the energy table to use.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum BoundArg {
    /// The lowest that sources support
    Low,
    /// The most likely
    #[default]
    Nominal,
    /// The highest that sources support
    High,
}

/// When the next frame starts.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum PacingArg {
    /// On the next tick of the display
    #[default]
    Vsync,
    /// As soon as the one before is done
    Free,
}

fn counter(text: &str) -> Result<Event, String> {
    let placed = || Event::ALL.into_iter().filter(|&event| HeatMap::is_of(event));
    match Event::from_name(text) {
        Some(event) if HeatMap::is_of(event) => Ok(event),
        Some(_) => {
            Err(format!("`{text}` is counted before it is known where in the image; samples_tested is not"))
        }
        None => {
            let known: Vec<&str> = placed().map(Event::name).collect();
            Err(format!("no counter is called `{text}`; {}", suggestion(text, &known)))
        }
    }
}
