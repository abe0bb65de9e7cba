//! Flags that several commands share: worker threads, style of pictures, messages, changes to a scene.

use std::ffi::OsString;
use std::ops::Range;

use clap::{Args, ColorChoice, ValueEnum};
use output::plot::{COLUMN_MM, PlotStyle, undrawable};
use output::terminal::{self, Terminal, Verbosity};
use rayon::{ThreadPool, ThreadPoolBuilder};
use workloads::Overrides;

use super::Failure;
use crate::cli::parse::{depth, frames, lens, per_pixel, rate, shutter, size};

/// Worker threads.
#[derive(Clone, Copy, Debug, Args)]
pub struct ThreadArgs {
    /// Worker threads [default: all cores]; only times depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

impl ThreadArgs {
    /// Pool of worker threads; one per core without a number.
    pub(in crate::cli) fn pool(self) -> Result<ThreadPool, Failure> {
        let pool = ThreadPoolBuilder::new().num_threads(usize::from(self.threads.unwrap_or(0))).build();
        pool.map_err(|error| Failure { message: format!("starting worker threads: {error}"), code: 1 })
    }
}

/// Style of pictures. By default each picture has its own width, and text for a screen.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Pictures")]
pub struct PlotStyleArgs {
    /// Width of pictures in millimetres, 30 to 400, or `column` for 85 mm; text is then 8 points high
    #[arg(long, value_name = "MM|column", allow_negative_numbers = true, value_parser = width)]
    pub width: Option<f64>,
    /// Title of pictures in place of their own; an empty one omits title and subtitle, for papers with
    /// captions
    #[arg(long, value_name = "TEXT", value_parser = title)]
    pub title: Option<String>,
    /// Font size of pictures in points, 4 to 32
    #[arg(long, value_name = "PT", allow_negative_numbers = true, value_parser = font_size)]
    pub font_size: Option<f64>,
}

impl PlotStyleArgs {
    /// The flags as a style.
    pub fn plot_style(&self) -> PlotStyle {
        PlotStyle { width_mm: self.width, font_pt: self.font_size, title: self.title.clone() }
    }
}

fn width(text: &str) -> Result<f64, String> {
    if text == "column" {
        return Ok(COLUMN_MM);
    }
    within(text.strip_suffix("mm").unwrap_or(text), 30.0..=400.0).ok_or_else(|| {
        format!("`{text}` is not a width; give 30 to 400 millimetres, or `column` for {COLUMN_MM}")
    })
}

fn title(text: &str) -> Result<String, String> {
    match undrawable(text) {
        None => Ok(text.to_owned()),
        Some(letter) => Err(format!(
            "the font of pictures has no `{}`: it has Latin letters and symbols of plots; write it in these, or give an empty title and \
             a caption",
            shown(letter)
        )),
    }
}

/// A letter, or its code if it would not be seen.
fn shown(letter: char) -> String {
    if letter.is_alphanumeric() { letter.to_string() } else { letter.escape_default().to_string() }
}

fn font_size(text: &str) -> Result<f64, String> {
    within(text.strip_suffix("pt").unwrap_or(text), 4.0..=32.0)
        .ok_or_else(|| format!("`{text}` is not a font size; give 4 to 32 points"))
}

fn within(text: &str, range: std::ops::RangeInclusive<f64>) -> Option<f64> {
    text.trim().parse().ok().filter(|value| range.contains(value))
}

/// Options of every command.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Messages")]
pub struct MessageArgs {
    /// Print results and errors only: no warnings, notes or progress bars
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Print details of warnings and of the work
    #[arg(short, long, global = true)]
    pub verbose: bool,
    /// Colours of messages; `auto` shows them on a terminal unless NO_COLOR is set
    #[arg(long, global = true, value_name = "WHEN", default_value_t = ColorChoice::Auto)]
    pub color: ColorChoice,
}

impl MessageArgs {
    /// The terminal that these options describe.
    pub fn terminal(&self) -> Terminal {
        let verbosity = match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (false, true) => Verbosity::Verbose,
            (false, false) => Verbosity::Normal,
        };
        let color = match self.color {
            ColorChoice::Auto => terminal::ColorChoice::Auto,
            ColorChoice::Always => terminal::ColorChoice::Always,
            ColorChoice::Never => terminal::ColorChoice::Never,
        };
        Terminal::new(verbosity, color)
    }
}

/// Value of `--color` among `args`, for errors of the parser itself.
pub(in crate::cli) fn color_of(args: &[OsString]) -> ColorChoice {
    let words = args.iter().map(|arg| arg.to_str().unwrap_or_default()).take_while(|arg| *arg != "--");
    let words: Vec<&str> = words.collect();
    let after = words.windows(2).filter(|two| two[0] == "--color").map(|two| two[1]);
    let joined = words.iter().filter_map(|word| word.strip_prefix("--color="));
    after.chain(joined).find_map(|word| ColorChoice::from_str(word, false).ok()).unwrap_or_default()
}

/// Changes to a scene's settings and its camera.
#[derive(Debug, Args)]
pub struct SceneArgs {
    /// Frames to render, the end not included
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub frames: Option<Range<u32>>,
    /// Samples per pixel, 1 to 256
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = per_pixel)]
    pub samples: Option<u32>,
    /// Sample table: a built-in one (see `quintile list`), a description in a .ron file, or samples in a .smp
    /// file
    #[arg(long, value_name = "TABLE")]
    pub table: Option<String>,
    /// Size of the image in pixels
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<(u32, u32)>,
    /// Frame rate of scene and display, in Hz
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = rate)]
    pub rate: Option<f64>,
    /// Radius of the lens in scene units, 0 for a pinhole
    #[arg(long, value_name = "R", allow_hyphen_values = true, value_parser = lens)]
    pub lens: Option<f32>,
    /// Depth in scene units that is in focus
    #[arg(long, value_name = "F", allow_hyphen_values = true, value_parser = depth)]
    pub focus: Option<f32>,
    /// Open time of the shutter as a share of the frame period, 0 to 1
    #[arg(long, value_name = "S", allow_hyphen_values = true, value_parser = shutter)]
    pub shutter: Option<f64>,
    /// Animation of a glTF scene, by name or number
    #[arg(long, value_name = "CLIP")]
    pub clip: Option<String>,
    /// The camera: one of the scene's own by name or number, `inside` or `outside` for automatic placement, a
    /// .ron file, or a description in the RON of scene files such as 'position: (1, 2, 3), target: (0, 0, 0),
    /// fov_deg: 40'. `quintile info` prints the one in use
    #[arg(long, value_name = "CAMERA", allow_hyphen_values = true)]
    pub camera: Option<String>,
}

impl SceneArgs {
    /// The changes as overrides of the scene's settings.
    pub fn overrides(&self) -> Overrides {
        Overrides {
            size: self.size,
            samples: self.samples,
            frame_rate_hz: self.rate,
            shutter: self.shutter,
            frames: self.frames.clone(),
            lens_radius: self.lens,
            focus: self.focus,
            clip: self.clip.clone(),
            camera: self.camera.clone(),
            table: self.table.clone(),
        }
    }
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn widths_and_sizes_are_checked() {
        assert_eq!([width("column"), width("120"), width("85 mm")], [Ok(85.0), Ok(120.0), Ok(85.0)]);
        assert_eq!([font_size("7.5"), font_size("9pt")], [Ok(7.5), Ok(9.0)]);
        for wrong in ["", "0", "-85", "1e9", "NaN", "wide", "85cm"] {
            assert!(width(wrong).unwrap_err().contains("30 to 400"), "{wrong}");
            assert!(font_size(wrong).unwrap_err().contains("4 to 32"), "{wrong}");
        }
    }

    #[test]
    fn titles_that_the_font_cannot_show_are_refused() {
        assert_eq!([title(""), title("Łódź – 3 Ω")], [Ok(String::new()), Ok("Łódź – 3 Ω".to_owned())]);
        assert!(title("дом").unwrap_err().contains("has no `д`"));
    }

    #[test]
    fn color_is_found_before_parsing() {
        let color = |args: &[&str]| color_of(&args.iter().map(OsString::from).collect::<Vec<_>>());
        assert_eq!(color(&["quintile", "run", "--color", "never"]), ColorChoice::Never);
        assert_eq!(color(&["quintile", "--color=always", "run"]), ColorChoice::Always);
        for args in [&["quintile", "--color"] as &[_], &["--color", "blue"], &["--", "--color=never"]] {
            assert_eq!(color(args), ColorChoice::Auto, "{args:?}");
        }
    }
}
