//! `quintile chart shadows`: soft shadows from a five-dimensional shadow map against accumulation buffering.
//!
//! Error is the root of the mean squared difference to an image in which every sample asks the light by rays, over all pixels and
//! channels in linear light. Cost is that of making the map, in one pass and in as many passes as places on the light.

mod measure;
mod tables;

use serde::Serialize;

use super::ChartError;
use output::OutDir;
use output::plot::Look;
use output::progress::Progress;

pub use measure::{Bias, Cost, Row};
pub use tables::claim;

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Effort {
    /// Pixels of the image, across and down.
    pub size: [u32; 2],
    /// Texels of the map across and down.
    pub map_px: u32,
    /// Places `(u, v, t)` go from 1 to this, doubling.
    pub most_points: u32,
    /// Sample tables of 256 samples per pixel that make up the reference.
    pub reference_tables: u32,
    /// Depth bias, scene units.
    pub bias: f64,
}

impl Effort {
    /// The chart of the book.
    pub const FULL: Self =
        Self { size: [96, 54], map_px: 256, most_points: 256, reference_tables: 4, bias: 0.06 };
    /// A look in seconds.
    pub const QUICK: Self =
        Self { size: [48, 27], map_px: 128, most_points: 64, reference_tables: 1, bias: 0.1 };
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct ShadowsChart {
    /// How much was measured.
    pub effort: Effort,
    /// Samples per pixel of the reference.
    pub reference_samples_per_pixel: u32,
    /// By places on the light, from few to many.
    pub rows: Vec<Row>,
    /// Where it does not work: too small and too large a bias, by its size.
    pub biases: Vec<Bias>,
}

impl ShadowsChart {
    /// Whether the map of one pass was that of accumulation to the bit, everywhere.
    pub fn is_equal(&self) -> bool {
        self.rows.iter().all(|row| row.equal)
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
) -> Result<ShadowsChart, ChartError> {
    let chart = measure(effort, progress)?;
    tables::write(&chart, dir, look)?;
    Ok(chart)
}

/// Measures without writing.
///
/// # Errors
/// [`ChartError`] when the scene cannot be drawn.
pub fn measure(effort: Effort, progress: &Progress) -> Result<ShadowsChart, ChartError> {
    let counts: Vec<u32> = (0..=effort.most_points.ilog2()).map(|power| 1 << power).collect();
    let bar = progress.bar("shadows", counts.len() as u64 + 2);
    let stage = measure::Stage::new(&effort)?;
    stage.with(|world| {
        let reference = world.reference()?;
        bar.inc();
        let row = |&points: &u32| {
            let row = world.row(points, &reference);
            bar.inc();
            row
        };
        let rows = counts.iter().map(row).collect::<Result<_, _>>()?;
        let biases = world.biases()?;
        bar.inc();
        let reference_samples_per_pixel = 256 * effort.reference_tables;
        Ok(ShadowsChart { effort, reference_samples_per_pixel, rows, biases })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: Effort =
        Effort { size: [32, 18], map_px: 64, most_points: 16, reference_tables: 1, bias: 0.2 };

    #[test]
    fn more_places_err_less_one_pass_costs_less_and_is_equal() {
        let chart = measure(LEAST, &Progress::new(true)).unwrap();
        assert!(chart.is_equal());
        let (first, last) = (&chart.rows[0], chart.rows.last().unwrap());
        assert!(last.rmse < 0.6 * first.rmse, "{} {}", first.rmse, last.rmse);
        assert!(last.one_pass.vertices * 16 == last.accumulation.vertices);
        assert!(last.one_pass.dram_bytes <= last.accumulation.dram_bytes);
        let (least, most) = (&chart.biases[0], chart.biases.last().unwrap());
        assert!(least.acne > 0.05 && most.acne < 0.01, "{} {}", least.acne, most.acne);
        assert!(most.leak > 0.2 && least.leak < most.leak, "{} {}", least.leak, most.leak);
    }

    #[test]
    fn the_files_are_all_there() {
        let folder = tempfile::tempdir().unwrap();
        let effort = Effort { size: [16, 9], most_points: 2, ..LEAST };
        OutDir::with(folder.path(), claim(), |dir| {
            chart(effort, dir, &Look::default(), &Progress::new(true))
        })
        .unwrap()
        .unwrap();
        for file in
            ["shadows.csv", "shadows.json", "shadows_error.svg", "shadows_cost.png", "shadows_failures.svg"]
        {
            assert!(folder.path().join(file).exists(), "{file}");
        }
    }
}
