//! Comparison of two results: runs, tables of frames, images, or folders of images.
//!
//! Two PNG files are compared in sRGB values from 0 to 1. EXR files, and an EXR with a PNG, are compared in
//! linear light, without clamping. Structural similarity always compares the displayed values.

mod runs;

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::Path;

use ::image::{DynamicImage, ImageReader, Limits};
use blazediff_ssim::{Plane, Rgba8, SsimOptions, ssim};
use output::image::{LinearImage, encode_png};
use pipeline::texture::{linear_to_srgb8, srgb8_to_linear};
use serde::Serialize;

pub use runs::{ComparedSetting, RunComparison, TableComparison, ValueChange, shown};

/// Error of a comparison.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// A file is missing or cannot be read.
    #[error("{path}: cannot read it: {source}; check the path")]
    Read {
        /// The file.
        path: String,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The contents of a file are not of its format.
    #[error("{path}: {message}")]
    Broken {
        /// The file.
        path: String,
        /// The fault and the remedy.
        message: String,
    },
    /// The two cannot be compared, or an option does not apply.
    #[error("{0}")]
    Usage(String),
    /// The difference image cannot be made or written.
    #[error("{path}: cannot write it: {message}")]
    Write {
        /// The file.
        path: String,
        /// The cause.
        message: String,
    },
}

impl CompareError {
    /// Whether the request is at fault, or a file that it names (exit code 2), rather than the writing of the
    /// result (exit code 1).
    pub fn is_usage(&self) -> bool {
        !matches!(self, Self::Write { .. })
    }

    fn broken(path: &Path, message: impl Into<String>) -> Self {
        Self::Broken { path: path.display().to_string(), message: message.into() }
    }

    fn unreadable(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.display().to_string();
        |source| Self::Read { path, source }
    }
}

/// Result of a comparison.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Comparison {
    /// Two runs.
    Runs(RunComparison),
    /// Two tables of frames.
    Frames(TableComparison),
    /// Two images.
    Images(ImageComparison),
    /// Images of the same name in two folders.
    Folders(FolderComparison),
}

/// Kind of result at a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Run,
    Frames,
    Image,
    Folder,
}

impl Kind {
    fn of(path: &Path) -> Result<Self, CompareError> {
        let metadata = std::fs::metadata(path).map_err(CompareError::unreadable(path))?;
        if metadata.is_dir() {
            return Ok(if path.join(runs::SUMMARY).is_file() { Self::Run } else { Self::Folder });
        }
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        match ending.to_ascii_lowercase().as_str() {
            "json" => Ok(Self::Run),
            "csv" => Ok(Self::Frames),
            "png" | "exr" | "jpg" | "jpeg" => Ok(Self::Image),
            _ => Err(CompareError::Usage(format!(
                "{}: it is neither a run (a folder with summary.json), a frames.csv nor an image (.png, .exr): give one of these",
                path.display()
            ))),
        }
    }

    fn description(self) -> &'static str {
        match self {
            Self::Run => "a run",
            Self::Frames => "a table of frames",
            Self::Image => "an image",
            Self::Folder => "a folder of images",
        }
    }
}

/// Compares the results at `a` and `b`. A difference image is written to `out`.
///
/// # Errors
/// [`CompareError`]. A difference is not an error.
pub fn compare(a: &Path, b: &Path, out: Option<&Path>) -> Result<Comparison, CompareError> {
    let kinds = [Kind::of(a)?, Kind::of(b)?];
    if kinds[0] != kinds[1] {
        let [one, other] = kinds.map(Kind::description);
        return Err(CompareError::Usage(format!(
            "{} is {one} and {} {other}: give two of a kind",
            a.display(),
            b.display()
        )));
    }
    if out.is_some() && kinds[0] != Kind::Image {
        let message = format!(
            "--out is for the difference of two images, and these are not: leave it out ({})",
            kinds[0].description()
        );
        return Err(CompareError::Usage(message));
    }
    match kinds[0] {
        Kind::Run => runs::compare(a, b).map(Comparison::Runs),
        Kind::Frames => runs::compare_tables(a, b).map(Comparison::Frames),
        Kind::Image => compare_images(a, b, out).map(Comparison::Images),
        Kind::Folder => compare_folders(a, b).map(Comparison::Folders),
    }
}

/// Largest side of an image, in pixels.
const MAX_SIDE_PX: u32 = 32_768;

/// Largest memory of a decoder, in bytes.
const MAX_DECODED_BYTES: u64 = 4 << 30;

/// Comparison of two images of equal size.
#[derive(Clone, Debug, Serialize)]
pub struct ImageComparison {
    /// The files.
    pub files: [String; 2],
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Whether values are linear light (EXR) rather than sRGB from 0 to 1 (PNG).
    pub linear: bool,
    /// Mean squared error over pixels and channels.
    pub mse: f64,
    /// Peak signal-to-noise ratio for a peak of 1, in dB; `None` for equal images.
    pub psnr_db: Option<f64>,
    /// Structural similarity of luma (Wang et al. 2004), 1 for equal images; `None` for images smaller than
    /// its window.
    pub ssim: Option<f64>,
    /// Mean absolute difference.
    pub mean_difference: f64,
    /// Largest absolute difference of a channel.
    pub largest_difference: f64,
    /// Pixels that differ.
    pub pixels_that_differ: u64,
    /// Pixels skipped because a channel is not finite.
    pub pixels_not_finite: u64,
    /// Brightness factor of the difference image, if written as PNG.
    pub scale: Option<f64>,
}

/// Comparison of the images of two folders.
#[derive(Clone, Debug, Serialize)]
pub struct FolderComparison {
    /// The folders.
    pub files: [String; 2],
    /// Images in both folders, by name.
    pub images: Vec<NamedComparison>,
    /// Images only in A.
    pub only_in_a: Vec<String>,
    /// Images only in B.
    pub only_in_b: Vec<String>,
    /// Mean of the images' mean squared errors.
    pub mse: Option<f64>,
    /// Number of equal pairs.
    pub equal: usize,
}

/// Comparison of two images of equal name.
#[derive(Clone, Debug, Serialize)]
pub struct NamedComparison {
    /// The name.
    pub name: String,
    /// The comparison.
    #[serde(flatten)]
    pub comparison: ImageComparison,
}

/// A decoded image.
struct Picture {
    width: u32,
    height: u32,
    /// Linear light.
    linear: Vec<[f32; 3]>,
    /// Displayed sRGB values.
    shown: Vec<[u8; 3]>,
    is_linear: bool,
}

impl Picture {
    fn read(path: &Path) -> Result<Self, CompareError> {
        let file = File::open(path).map_err(CompareError::unreadable(path))?;
        let broken = |error: String| {
            let message =
                format!("cannot be decoded as an image: {error}; give a PNG or an EXR file that is whole");
            CompareError::broken(path, message)
        };
        let mut reader = ImageReader::new(BufReader::new(file))
            .with_guessed_format()
            .map_err(CompareError::unreadable(path))?;
        let mut limits = Limits::default();
        limits.max_image_width = Some(MAX_SIDE_PX);
        limits.max_image_height = Some(MAX_SIDE_PX);
        limits.max_alloc = Some(MAX_DECODED_BYTES);
        reader.limits(limits);
        let image = reader.decode().map_err(|error| broken(error.to_string()))?;
        let is_linear = matches!(image, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
        let (width, height) = (image.width(), image.height());
        let (linear, shown) = if is_linear {
            let linear: Vec<[f32; 3]> = image.into_rgb32f().pixels().map(|pixel| pixel.0).collect();
            let shown = linear.iter().map(|pixel| pixel.map(linear_to_srgb8)).collect();
            (linear, shown)
        } else {
            let shown: Vec<[u8; 3]> = image.into_rgb8().pixels().map(|pixel| pixel.0).collect();
            let linear = shown.iter().map(|pixel| pixel.map(srgb8_to_linear)).collect();
            (linear, shown)
        };
        Ok(Self { width, height, linear, shown, is_linear })
    }

    fn luma(&self) -> Option<Plane> {
        let rgba: Vec<u8> = self.shown.iter().flat_map(|[r, g, b]| [*r, *g, *b, 255]).collect();
        Plane::from_rgba8(Rgba8::new(&rgba, self.width as usize, self.height as usize)).ok()
    }
}

/// Compares two images and writes their difference to `out`.
fn compare_images(a: &Path, b: &Path, out: Option<&Path>) -> Result<ImageComparison, CompareError> {
    let pictures = [Picture::read(a)?, Picture::read(b)?];
    let mut comparison = between([a, b], &pictures)?;
    if let Some(out) = out {
        comparison.scale = write_difference(out, &pictures, comparison.linear)?;
    }
    Ok(comparison)
}

fn between(files: [&Path; 2], pictures: &[Picture; 2]) -> Result<ImageComparison, CompareError> {
    let [a, b] = pictures;
    if (a.width, a.height) != (b.width, b.height) {
        return Err(CompareError::Usage(format!(
            "{} has {}x{} pixels and {} {}x{}: give images of one size",
            files[0].display(),
            a.width,
            a.height,
            files[1].display(),
            b.width,
            b.height
        )));
    }
    let linear = a.is_linear || b.is_linear;
    let (mut squares, mut sum, mut largest) = (0.0, 0.0, 0.0_f64);
    let (mut differ, mut not_finite) = (0, 0);
    for difference in differences(pictures, linear) {
        let Some(difference) = difference else {
            not_finite += 1;
            continue;
        };
        differ += u64::from(difference != [0.0; 3]);
        for part in difference {
            squares += part * part;
            sum += part.abs();
            largest = largest.max(part.abs());
        }
    }
    let pixels = u64::from(a.width) * u64::from(a.height);
    let count = 3.0 * (pixels - not_finite).max(1) as f64;
    let mse = squares / count;
    Ok(ImageComparison {
        files: files.map(|path| path.display().to_string()),
        width: a.width,
        height: a.height,
        linear,
        mse,
        psnr_db: (mse > 0.0).then(|| -10.0 * libm::log10(mse)),
        ssim: similarity(pictures),
        mean_difference: sum / count,
        largest_difference: largest,
        pixels_that_differ: differ,
        pixels_not_finite: not_finite,
        scale: None,
    })
}

/// B minus A of each pixel; `None` if not finite.
fn differences(pictures: &[Picture; 2], linear: bool) -> impl Iterator<Item = Option<[f64; 3]>> + '_ {
    let [a, b] = pictures;
    (0..a.shown.len()).map(move |pixel| {
        let part = |channel: usize| {
            if linear {
                f64::from(b.linear[pixel][channel]) - f64::from(a.linear[pixel][channel])
            } else {
                (f64::from(b.shown[pixel][channel]) - f64::from(a.shown[pixel][channel])) / 255.0
            }
        };
        let difference = [part(0), part(1), part(2)];
        difference.iter().all(|part| part.is_finite()).then_some(difference)
    })
}

fn similarity([a, b]: &[Picture; 2]) -> Option<f64> {
    ssim(&a.luma()?, &b.luma()?, &SsimOptions::default()).ok().map(|outcome| outcome.score)
}

/// Writes the difference image; returns its brightness factor.
fn write_difference(out: &Path, pictures: &[Picture; 2], linear: bool) -> Result<Option<f64>, CompareError> {
    let failed = |message: String| CompareError::Write { path: out.display().to_string(), message };
    let [width, height] = [pictures[0].width, pictures[0].height];
    let difference: Vec<[f64; 3]> =
        differences(pictures, linear).map(|difference| difference.unwrap_or_default()).collect();
    let (bytes, scale) = match out.extension().and_then(|ending| ending.to_str()) {
        Some("exr") => {
            let signed: Vec<[f32; 3]> = differences(pictures, true)
                .map(|difference| difference.unwrap_or_default().map(|part| part as f32))
                .collect();
            let image = LinearImage::new(width, height, &signed).and_then(|image| image.exr());
            (image.map_err(|error| failed(error.to_string()))?, None)
        }
        Some("png") => {
            let largest = difference.iter().flatten().fold(0.0_f64, |largest, part| largest.max(part.abs()));
            let scale = if largest > 0.0 { 1.0 / largest } else { 1.0 };
            let shown: Vec<u8> =
                difference.iter().flatten().map(|part| (255.0 * scale * part.abs()).round() as u8).collect();
            (encode_png(width, height, &shown).map_err(|error| failed(error.to_string()))?, Some(scale))
        }
        _ => {
            let message = format!("--out: {}: give a name that ends in .png or .exr", out.display());
            return Err(CompareError::Usage(message));
        }
    };
    let written = traces::io::atomic::write_file(out, |file: &mut BufWriter<File>| {
        file.write_all(&bytes)?;
        file.flush()
    });
    written.map_err(|error| failed(error.to_string()))?;
    Ok(scale)
}

/// Compares the images of two folders by their names.
fn compare_folders(a: &Path, b: &Path) -> Result<FolderComparison, CompareError> {
    let [in_a, in_b] = [names(a)?, names(b)?];
    for (folder, names) in [(a, &in_a), (b, &in_b)] {
        if names.is_empty() {
            let message = "there is neither a summary.json nor a .png or .exr image in it: give the folder of a run, or one of images";
            return Err(CompareError::broken(folder, message));
        }
    }
    let mut images = Vec::new();
    for name in in_a.intersection(&in_b) {
        let comparison = compare_images(&a.join(name), &b.join(name), None)?;
        images.push(NamedComparison { name: name.clone(), comparison });
    }
    let mean = images.iter().map(|image| image.comparison.mse).sum::<f64>() / images.len().max(1) as f64;
    Ok(FolderComparison {
        files: [a, b].map(|path| path.display().to_string()),
        mse: (!images.is_empty()).then_some(mean),
        equal: images.iter().filter(|image| image.comparison.pixels_that_differ == 0).count(),
        only_in_a: in_a.difference(&in_b).cloned().collect(),
        only_in_b: in_b.difference(&in_a).cloned().collect(),
        images,
    })
}

fn names(folder: &Path) -> Result<BTreeSet<String>, CompareError> {
    let entries = std::fs::read_dir(folder).map_err(CompareError::unreadable(folder))?;
    let mut names = BTreeSet::new();
    for entry in entries {
        let entry = entry.map_err(CompareError::unreadable(folder))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if (name.ends_with(".png") || name.ends_with(".exr")) && entry.path().is_file() {
            names.insert(name);
        }
    }
    Ok(names)
}
