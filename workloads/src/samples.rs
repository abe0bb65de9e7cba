//! Sample tables of a rendering, by name or file, and the files of their samples.

use std::io::{self, Write};
use std::path::Path;

use activity::spec::suggestion;
use pipeline::sampling::{Sample, SampleSource};
use pipeline::{SampleSpec, SampleTable, Viewport};
use warnings::{Code, Warning};

use crate::error::{LoadError, Source};
use crate::import::reader::Bytes;

/// A requested sample table.
#[derive(Clone, Debug)]
pub enum SampleChoice {
    /// A table made from a description.
    Described(SampleSpec),
    /// A table from a file.
    Fixed(FixedSamples),
}

impl SampleChoice {
    /// Loads a table: a named one (see [`SampleSpec::names`]), a description in a `.ron` file, or samples in
    /// any other file.
    ///
    /// # Errors
    /// [`LoadError`] for an unknown name, or an unreadable or invalid file.
    pub fn load(name_or_path: &str) -> Result<Self, LoadError> {
        if let Some(spec) = SampleSpec::named(name_or_path) {
            return Ok(Self::Described(spec));
        }
        let path = Path::new(name_or_path);
        match path.extension() {
            Some(end) if end.eq_ignore_ascii_case("ron") => Ok(Self::Described(activity::spec::load(path)?)),
            Some(_) => FixedSamples::load(path).map(Self::Fixed),
            None => Err(unknown(name_or_path)),
        }
    }

    /// Samples per pixel, if the table fixes them.
    pub fn per_pixel(&self) -> Option<u32> {
        match self {
            Self::Described(_) => None,
            Self::Fixed(table) => Some(table.per_pixel()),
        }
    }

    /// The table with `per_pixel` samples per pixel.
    ///
    /// # Errors
    /// [`LoadError::Setting`] if the table has another number, or cannot be made with this one.
    pub fn source(&self, per_pixel: u32, seed: u64) -> Result<Box<dyn SampleSource>, LoadError> {
        let wrong = |message| Err(LoadError::Setting { setting: "sample table", message });
        match self {
            Self::Fixed(table) if table.per_pixel() != per_pixel => {
                let has = table.per_pixel();
                wrong(format!(
                    "it has {has} samples per pixel, not {per_pixel}: ask for {has} or leave the number out"
                ))
            }
            Self::Fixed(table) => Ok(Box::new(table.clone())),
            Self::Described(spec) => match SampleTable::new(spec, per_pixel, seed) {
                Ok(table) => Ok(Box::new(table)),
                Err(error) => wrong(error.to_string()),
            },
        }
    }
}

/// Warns if a frame shows nothing of its scene, although passes over the whole screen fill the image.
pub(crate) fn empty_warning(sees_any: bool) -> Option<Warning> {
    (!sees_any).then(|| Warning::new(Code::EmptyFrame, "nothing of the scene is in view: check the camera"))
}

/// Warns if the samples of a pixel do not spread over a dimension that is drawn: time, or the lens. One
/// sample has no spread and is left out.
pub(crate) fn blur_warning(samples: &dyn SampleSource, moving: bool, lens: bool) -> Option<Warning> {
    let mut pixel = vec![Sample::default(); samples.per_pixel() as usize];
    samples.pixel_into(0, 0, &mut pixel);
    let one = |of: fn(&Sample) -> [f32; 2]| pixel.len() > 1 && pixel.iter().all(|at| of(at) == of(&pixel[0]));
    let what = match (moving && one(|at| [at.t, 0.0]), lens && one(|at| [at.u, at.v])) {
        (true, true) => "one time and one lens position",
        (true, false) => "one time",
        (false, true) => "one lens position",
        (false, false) => return None,
    };
    let message = format!(
        "all samples of a pixel have {what}: the image has no such blur, and its dimensions are paid for; --table owen spreads them"
    );
    Some(Warning::new(Code::SamplesWithoutBlur, message))
}

fn unknown(name: &str) -> LoadError {
    let names: Vec<&str> = SampleSpec::names().map(|(name, _)| name).collect();
    let (list, near) = (names.join(", "), suggestion(name, &names));
    let near = if near.starts_with("did you mean") { format!(" {near}") } else { String::new() };
    let message = format!(
        "none is called `{name}`;{near} built in: {list}; or a description in a .ron file, or a .smp file"
    );
    LoadError::Setting { setting: "sample table", message }
}

/// A sample table for a block of pixels of any size, repeated over the image.
#[derive(Clone, Debug)]
pub struct FixedSamples {
    width: u32,
    height: u32,
    per_pixel: u32,
    samples: Vec<Sample>,
}

const SAMPLE_BYTES: u64 = 5 * 4;

impl FixedSamples {
    /// Reads the table at `path`.
    ///
    /// # Errors
    /// [`LoadError`] if the file cannot be read, is truncated, or has samples out of range.
    pub fn load(path: &Path) -> Result<Self, LoadError> {
        let data = Source { path }.read()?;
        Self::parse(path, &data)
    }

    /// Width and height in pixels; larger images repeat the table.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Parses `data`; `path` is for messages.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(path: &Path, data: &[u8]) -> Result<Self, LoadError> {
        let mut bytes = Bytes::new(path, data, b"M5DSMP1\0")?;
        let (width, height, per_pixel, _) = (bytes.u32()?, bytes.u32()?, bytes.u32()?, bytes.u32()?);
        if width == 0 || height == 0 || !(1..=256).contains(&per_pixel) {
            return Err(bytes.wrong(format!(
                "{width}x{height} pixels of {per_pixel} samples; sides start at 1, and a pixel takes 1 to 256"
            )));
        }
        // The product may exceed u64; no file is that large.
        let count = (u64::from(width) * u64::from(height)).saturating_mul(u64::from(per_pixel));
        bytes.expect_records(count, SAMPLE_BYTES)?;
        let mut samples = Vec::new();
        for index in 0..count {
            let sample = Sample {
                x: bytes.f32()?,
                y: bytes.f32()?,
                u: bytes.f32()?,
                v: bytes.f32()?,
                t: bytes.f32()?,
            };
            if !sample.is_in_range() {
                return Err(bytes.wrong(format!(
                    "sample {index} lies outside [0, 1) in x, y or t, or outside [-1, 1] on the lens"
                )));
            }
            samples.push(sample);
        }
        Ok(Self { width, height, per_pixel, samples })
    }
}

impl SampleSource for FixedSamples {
    fn per_pixel(&self) -> u32 {
        self.per_pixel
    }

    fn pixel_into(&self, px: u32, py: u32, into: &mut [Sample]) {
        let place = (py % self.height) as usize * self.width as usize + (px % self.width) as usize;
        let first = place * self.per_pixel as usize;
        into.copy_from_slice(&self.samples[first..first + self.per_pixel as usize]);
    }
}

/// Writes the samples of every pixel as a table for [`FixedSamples`].
///
/// # Errors
/// Errors of `out`.
pub fn write_samples(viewport: Viewport, source: &dyn SampleSource, out: &mut dyn Write) -> io::Result<()> {
    out.write_all(b"M5DSMP1\0")?;
    for word in [viewport.width(), viewport.height(), source.per_pixel(), 0] {
        out.write_all(&word.to_le_bytes())?;
    }
    let mut samples = vec![Sample::default(); source.per_pixel() as usize];
    for pixel in 0..viewport.pixels() as u32 {
        source.pixel_into(pixel % viewport.width(), pixel / viewport.width(), &mut samples);
        for number in samples.iter().flat_map(|s| [s.x, s.y, s.u, s.v, s.t]) {
            out.write_all(&number.to_le_bytes())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn described(text: &str) -> Result<SampleSpec, String> {
        activity::spec::parse(text, "table.ron").map_err(|error| error.to_string())
    }

    #[test]
    fn known_names_load_and_others_are_listed() {
        assert!(SampleSpec::names().all(|(name, _)| SampleChoice::load(name).is_ok()));
        let text = SampleChoice::load("jitered").unwrap_err().to_string();
        assert!(text.contains("did you mean `jittered`?") && text.contains("owen, sobol"), "{text}");
        let error = SampleChoice::load("/nowhere/a.smp").unwrap_err();
        assert!(!error.is_usage() && error.to_string().contains("/nowhere/a.smp"), "{error}");
    }

    #[test]
    fn descriptions_may_be_partial() {
        assert_eq!(described("()").unwrap(), SampleSpec::default());
        let text = "(pattern: Interleaved(points: 16), lens: Polygon(blades: 7, rotation_deg: 12), regions: Grid(2, 1))";
        let spec = described(text).unwrap();
        assert_eq!(SampleTable::new(&spec, 4, 1).unwrap().regions().len(), 2);
        let given = described("(pattern: Given(points: [(0, 0.5, 0.25), (-1, 1, 0)]))").unwrap();
        let found: Vec<f32> =
            SampleTable::new(&given, 2, 1).unwrap().pixel(0, 0).iter().map(|s: &Sample| s.t).collect();
        assert!(found.contains(&0.25) && found.contains(&0.0), "{found:?}");
        assert!(
            described("(regions: Rectangles([(u: (-1, 0), v: (-1, 1)), (u: (0, 1), v: (-1, 1))]))").is_ok()
        );
    }

    #[test]
    fn mistakes_say_where_they_are() {
        for (text, place, what) in [
            ("(pattren: Owen)", "table.ron:1:", "did you mean `pattern`?"),
            ("(\n pattern: Owne)", "table.ron:2:", "did you mean `Owen`?"),
            ("(\n lens: Polygon(blades: 2))", "table.ron:2:", "2 blades; it takes 3 to 64"),
            ("(\n\n pattern: Interleaved(points: 0))", "table.ron:3:", "0 points; it takes 1 to 65536"),
            ("(pattern: Given(points: [(0, 0, 1)]))", "table.ron:1:", "point 0 lies outside"),
            ("(pattern: Given(points: []))", "table.ron:1:", "0 points"),
            ("(regions: Across(0))", "table.ron:1:", "0 regions; it takes 1 to 256"),
            (
                "(regions: Rectangles([(u: (-1, 0.5), v: (-1, 1)), (u: (0, 1), v: (0, 1))]))",
                "table.ron:1:",
                "regions 0 and 1 overlap",
            ),
            ("(regions: Rectangles([(u: (0.5, 0.5), v: (-1, 1))]))", "table.ron:1:", "region 0 has to lie"),
        ] {
            let message = described(text).unwrap_err();
            assert!(message.starts_with(place) && message.contains(what), "{text}: {message}");
        }
    }

    #[test]
    fn tables_survive_a_round_trip() {
        let table = SampleTable::low_discrepancy(3, 5, pipeline::LensShape::Disk).unwrap();
        let (viewport, mut file) = (Viewport::new(70, 3).unwrap(), Vec::new());
        write_samples(viewport, &table, &mut file).unwrap();
        assert_eq!(file.len(), 24 + 70 * 3 * 3 * 20);
        let read = FixedSamples::parse(Path::new("a.smp"), &file).unwrap();
        let mut found = [Sample::default(); 3];
        for (px, py) in [(0, 0), (69, 2), (64, 1)] {
            read.pixel_into(px, py, &mut found);
            assert_eq!(found, table.pixel(px, py));
        }
    }

    fn file(x: f32) -> Vec<u8> {
        let mut data = b"M5DSMP1\0".to_vec();
        [2_u32, 1, 1, 0].iter().for_each(|word| data.extend(word.to_le_bytes()));
        for number in [0.25, 0.5, -1.0, 1.0, 0.0, x, 0.5, 0.0, 0.0, 0.75] {
            data.extend(number.to_le_bytes());
        }
        data
    }

    #[test]
    fn sample_counts_beyond_64_bits_are_refused() {
        // 2^31 by 2^31 pixels of 16 samples are 2^66, which wraps to 0 in 64 bits.
        let mut data = file(0.125);
        for (word, value) in [1_u32 << 31, 1 << 31, 16].into_iter().enumerate() {
            data[8 + 4 * word..][..4].copy_from_slice(&value.to_le_bytes());
        }
        data.truncate(24);
        let error = FixedSamples::parse(Path::new("a.smp"), &data).unwrap_err();
        assert!(error.to_string().contains("0 bytes follow"), "{error}");
    }

    #[test]
    fn a_table_is_tiled_over_the_image() {
        let table = FixedSamples::parse(Path::new("a.smp"), &file(0.125)).unwrap();
        let mut found = [Sample::default()];
        table.pixel_into(7, 9, &mut found);
        assert_eq!(found[0], Sample { x: 0.125, y: 0.5, u: 0.0, v: 0.0, t: 0.75 });
    }

    #[test]
    fn a_sample_out_of_range_is_named() {
        let error = FixedSamples::parse(Path::new("a.smp"), &file(1.0)).unwrap_err().to_string();
        assert!(error.contains("a.smp") && error.contains("sample 1"), "{error}");
    }
}
