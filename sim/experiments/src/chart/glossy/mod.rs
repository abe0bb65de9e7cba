//! `quintile chart glossy`: glossy reflection and refraction on a planar receiver.
//!
//! Error is the root of the mean squared difference of the map to brute force by rays, over all texels and channels in linear light.
//! Beside one pass stands accumulation, whose samples all texels share.

mod measure;
mod tables;

use serde::Serialize;
use workloads::glossy::Effect;

use super::ChartError;
use output::OutDir;
use output::plot::Look;
use output::progress::Progress;

pub use measure::{Bench, Blur, Row, Wide};
pub use tables::claim;

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Effort {
    /// Rows of texels of the map.
    pub texels: u32,
    /// Samples per texel go from 1 to this, doubling.
    pub most_samples: u32,
    /// Sample tables of 256 samples per texel that make up the reference.
    pub reference_tables: u32,
}

impl Effort {
    /// The chart of the book: a reference of 4096 samples.
    pub const FULL: Self = Self { texels: 32, most_samples: 256, reference_tables: 16 };
    /// A look in seconds.
    pub const QUICK: Self = Self { texels: 16, most_samples: 64, reference_tables: 2 };
}

/// Radius of the lens where it does not vary, scene units.
pub const ROUGHNESS: f64 = 0.25;
/// Both effects, each with its name.
pub const EFFECTS: [(&str, Effect); 2] =
    [("reflection", Effect::Reflection), ("refraction", Effect::Refraction(1.33))];

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct GlossyChart {
    /// How much was measured.
    pub effort: Effort,
    /// By effect and samples.
    pub rows: Vec<Row>,
    /// Contact hardening: blur by height.
    pub blurs: Vec<Blur>,
    /// Where it does not work: a lens as wide as the receiver, and wider.
    pub wides: Vec<Wide>,
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
) -> Result<GlossyChart, ChartError> {
    let chart = measure(effort, progress)?;
    tables::write(&chart, dir, look)?;
    Ok(chart)
}

/// Measures without writing.
///
/// # Errors
/// [`ChartError`] when the scene cannot be drawn.
pub fn measure(effort: Effort, progress: &Progress) -> Result<GlossyChart, ChartError> {
    let counts: Vec<u32> = (0..=effort.most_samples.ilog2()).map(|power| 1 << power).collect();
    let bar = progress.bar("glossy", (EFFECTS.len() * counts.len() + 2) as u64);
    let mut rows = Vec::new();
    for effect in EFFECTS {
        let bench = Bench::new(effect, effort)?;
        let reference = bench.reference(ROUGHNESS)?;
        for &samples in &counts {
            rows.push(bench.row(samples, &reference)?);
            bar.inc();
        }
    }
    let bench = Bench::new(EFFECTS[0], effort)?;
    let blurs = bench.blurs()?;
    bar.inc();
    let wides = bench.wides()?;
    bar.inc();
    Ok(GlossyChart { effort, rows, blurs, wides })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: Effort = Effort { texels: 10, most_samples: 16, reference_tables: 1 };

    #[test]
    fn more_samples_err_less_contact_hardens_and_wide_lenses_fail() {
        let chart = measure(LEAST, &Progress::new(true)).unwrap();
        for rows in chart.rows.chunks_exact(5) {
            assert!(rows[4].rmse < 0.6 * rows[0].rmse, "{rows:?}");
            assert!(rows[4].vertices < rows[4].accumulated_vertices);
        }
        assert!(chart.blurs.windows(2).all(|pair| pair[0].width < pair[1].width), "{:?}", chart.blurs);
        let (narrow, wide) = (&chart.wides[0], chart.wides.last().unwrap());
        assert!(wide.rmse_of_lobe > 2.0 * narrow.rmse_of_lobe, "{narrow:?} {wide:?}");
    }

    #[test]
    fn the_files_are_all_there() {
        let folder = tempfile::tempdir().unwrap();
        OutDir::with(folder.path(), claim(), |dir| {
            chart(Effort { texels: 4, most_samples: 2, ..LEAST }, dir, &Look::default(), &Progress::new(true))
        })
        .unwrap()
        .unwrap();
        for file in
            ["glossy.csv", "glossy.json", "glossy_error.svg", "glossy_blur.png", "glossy_failures.svg"]
        {
            assert!(folder.path().join(file).exists(), "{file}");
        }
    }
}
