//! `quintile chart occlusion`: what is found hidden, and what that costs, over boxes of lens and time, tiles and samples.

mod measure;
mod tables;

use serde::Serialize;

use super::ChartError;
use output::OutDir;
use output::plot::Look;
use output::progress::Progress;

pub(crate) use measure::Drawn;
pub use tables::claim;

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Effort {
    /// Pixels of the image.
    pub size: [u32; 2],
    /// Boxes that are asked for, in each yard.
    pub boxes: u32,
    /// Yards of each kind.
    pub yards: u64,
    /// Samples in a pixel that sampled queries look at.
    pub samples: &'static [u32],
    /// Sides of tiles in pixels.
    pub tiles: &'static [u32],
    /// Slats that a wall is made of where methods fail.
    pub slats: &'static [u32],
}

impl Effort {
    /// The chart of the book.
    pub const FULL: Self = Self {
        size: [192, 108],
        boxes: 96,
        yards: 3,
        samples: &[16, 32, 64],
        tiles: &[4, 8, 16, 32],
        slats: &[1, 2, 4, 8, 16, 32, 64],
    };
    /// A look in seconds.
    pub const QUICK: Self = Self {
        size: [128, 72],
        boxes: 48,
        yards: 1,
        samples: &[16, 64],
        tiles: &[4, 8, 16],
        slats: &[1, 4, 16],
    };
}

/// What blurs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Walls and what is behind them move.
    Motion,
    /// All is out of focus.
    Defocus,
    /// Both.
    Both,
}

impl Kind {
    /// Every kind.
    pub const ALL: [Self; 3] = [Self::Motion, Self::Defocus, Self::Both];

    /// Its name in tables and pictures.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Motion => "motion",
            Self::Defocus => "defocus",
            Self::Both => "both",
        }
    }
}

/// A way to ask, on one kind of yard. Costs are means over all objects.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// What blurs.
    pub kind: Kind,
    /// Slats of a wall.
    pub slats: u32,
    /// Samples in a pixel.
    pub samples: u32,
    /// Side of a tile in pixels, none for a sampled query.
    pub tile_px: Option<u32>,
    /// Boxes of lens and time along u, v and t, none for a sampled query.
    pub boxes: Option<[u32; 3]>,
    /// Objects.
    pub objects: u64,
    /// Of these hidden from every sample.
    pub hidden: u64,
    /// Of these found.
    pub found: u64,
    /// Objects called hidden that a sample sees: there must be none.
    pub wrong: u64,
    /// Share of tiles that most samples but not all find covered.
    pub half_covered: f64,
    /// Tests of tiles, samples and depths.
    pub tests: f64,
    /// Bytes of stored depth read.
    pub bytes: f64,
    /// Multiply-adds.
    pub madds: f64,
}

impl Row {
    /// The share of what is hidden that is found.
    pub fn rate(&self) -> f64 {
        if self.hidden == 0 { 0.0 } else { self.found as f64 / self.hidden as f64 }
    }
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct OcclusionChart {
    /// How much was measured.
    pub effort: Effort,
    /// By intervals, over boxes and tiles.
    pub intervals: Vec<Row>,
    /// Both ways over samples.
    pub samples: Vec<Row>,
    /// Walls of more and more slats.
    pub failing: Vec<Row>,
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
) -> Result<OcclusionChart, ChartError> {
    let chart = measure(effort, progress)?;
    tables::write(&chart, dir, look)?;
    Ok(chart)
}

/// Measures without writing.
///
/// # Errors
/// [`ChartError`] when a yard cannot be drawn.
pub fn measure(effort: Effort, progress: &Progress) -> Result<OcclusionChart, ChartError> {
    measure::measure(effort, progress)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_are_all_there_and_nothing_seen_is_called_hidden() {
        let folder = tempfile::tempdir().unwrap();
        let least =
            Effort { size: [64, 36], boxes: 24, yards: 1, samples: &[4, 8], tiles: &[8], slats: &[1, 8] };
        let chart = OutDir::with(folder.path(), claim(), |dir| {
            chart(least, dir, &Look::default(), &Progress::new(true))
        })
        .unwrap()
        .unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let json: serde_json::Value = serde_json::from_str(&read("occlusion.json")).unwrap();
        let rows = chart.intervals.len() + chart.samples.len() + chart.failing.len();
        assert_eq!(json["intervals"].as_array().unwrap().len(), chart.intervals.len());
        assert_eq!(read("occlusion.csv").lines().count(), 1 + rows);
        assert!(read("occlusion.svg").contains("motion") && folder.path().join("occlusion.png").exists());
        assert!(chart.fault().is_none(), "{:?}", chart.fault());
        assert!(chart.intervals.iter().any(|row| row.found > 0) && chart.text().contains("1x1x16"));
        let sampled = chart.samples.iter().find(|row| row.boxes.is_none()).unwrap();
        let interval = chart.samples.iter().find(|row| row.boxes.is_some()).unwrap();
        assert!(sampled.bytes > interval.bytes && sampled.rate() == 1.0);
    }
}
