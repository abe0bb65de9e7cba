//! Files of pictures: their formats, and writing them.

use std::path::Path;

use clap::ValueEnum;
use output::plot::Picture;

use super::wrong;
use crate::cli::Failure;

/// Formats of plots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names of the formats")]
pub enum PlotFormat {
    Svg,
    Png,
    Pdf,
}

impl PlotFormat {
    /// The ending of files of this format, and whether they are text.
    pub(super) fn ending(self) -> (&'static str, bool) {
        match self {
            Self::Svg => ("svg", true),
            Self::Png => ("png", false),
            Self::Pdf => ("pdf", false),
        }
    }

    /// The format of a file, by its name.
    pub(super) fn of(path: &Path) -> Result<Self, Failure> {
        match path.extension().and_then(|end| end.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            Some("pdf") => Ok(Self::Pdf),
            _ => Err(wrong(format!("{}: a plot has to end in .svg, .png or .pdf", path.display()))),
        }
    }
}

pub(super) fn write(picture: &Picture, path: &Path, format: PlotFormat) -> Result<(), Failure> {
    let bytes = match format {
        PlotFormat::Svg => picture.svg().map(String::into_bytes),
        PlotFormat::Png => picture.png(),
        PlotFormat::Pdf => Ok(picture.pdf()),
    }
    .map_err(|error| Failure { message: format!("{}: {error}", path.display()), code: 1 })?;
    Ok(traces::io::atomic::write_file(path, |out| std::io::Write::write_all(out, &bytes))?)
}
