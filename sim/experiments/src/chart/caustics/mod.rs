//! `quintile chart caustics`: shader executions and images of caustics, by how beams are bounded, and where beams fail.

mod crossed;
mod failures;
mod measure;
mod tables;
pub(crate) mod view;

use serde::Serialize;
use workloads::caustics::Method;

use super::ChartError;
use output::OutDir;
use output::plot::Look;
use output::progress::Progress;

pub use crossed::Crossed;
pub use measure::{Ocean, ocean};
pub use tables::claim;

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Effort {
    /// Squares along a side of the ocean of the paper's figure; 255 are 130,050 volumes.
    pub ocean_cells: u32,
    /// Pixels of its image.
    pub ocean_px: [u32; 2],
    /// Squares along a side of the ocean whose waves get steeper, and pixels of its image.
    pub sweep_cells: u32,
    /// Pixels of its image.
    pub sweep_px: [u32; 2],
    /// Slopes of its waves.
    pub slopes: &'static [f64],
    /// Squares along a side of an ocean that gets coarser.
    pub coarse_cells: &'static [u32],
    /// Squares along a side of oceans whose triangles are pleated along the light.
    pub pleated_cells: &'static [u32],
    /// Their pleats.
    pub pleats: &'static [f64],
    /// Photons across and down that surfaces are held against.
    pub rays: u32,
    /// Pixels along a side of the floor they light.
    pub floor_px: u32,
    /// Times are medians of so many.
    pub repeats: usize,
}

impl Effort {
    /// The chart of the book.
    pub const FULL: Self = Self {
        ocean_cells: 255,
        ocean_px: [512, 288],
        sweep_cells: 24,
        sweep_px: [128, 72],
        slopes: &[0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0],
        coarse_cells: &[8, 16, 32, 64, 128],
        pleated_cells: &[24, 48, 96],
        pleats: &[0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
        rays: 2400,
        floor_px: 512,
        repeats: 3,
    };
    /// A look in seconds.
    pub const QUICK: Self = Self {
        ocean_cells: 48,
        ocean_px: [192, 108],
        sweep_cells: 10,
        sweep_px: [64, 36],
        slopes: &[0.02, 0.1, 0.4, 1.0],
        coarse_cells: &[8, 16, 32, 64],
        pleated_cells: &[32],
        pleats: &[0.0, 0.05, 0.2, 0.5],
        rays: 1000,
        floor_px: 192,
        repeats: 1,
    };
}

/// One method on one surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Root mean square of the slope of the surface.
    pub slope: f64,
    /// For how much of their length sides of beams cross.
    pub crossing: f64,
    /// How beams are bounded.
    pub method: Method,
    /// Shader executions.
    pub executions: u64,
    /// The share of them that finds light.
    pub useful: f64,
    /// Largest difference of a pixel from the image of the moving triangles.
    pub difference: f64,
    /// CPU time of one thread, for coverage and shading.
    pub cpu_s: f64,
}

/// A surface made of fewer and fewer triangles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Coarse {
    /// Squares along a side.
    pub cells: u32,
    /// Root mean square of the slope of the surface.
    pub slope: f64,
    /// For how much of their length sides of beams cross.
    pub crossing: f64,
    /// Mean difference from photons refracted at the waves themselves, as a part of its mean.
    pub error: f64,
    /// That of other photons of that kind.
    pub noise: f64,
    /// Whether the run warns.
    pub warned: bool,
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct CausticsChart {
    /// How much was measured.
    pub effort: Effort,
    /// The ocean of the paper's figure.
    pub ocean: Ocean,
    /// Squares along a side of the coarser oceans from which on a run does not warn that they are too few.
    pub resolved_cells: f64,
    /// By slope and method.
    pub rows: Vec<Row>,
    /// By slope and number of triangles.
    pub coarse: Vec<Coarse>,
    /// By number of triangles and pleat.
    pub crossed: Vec<Crossed>,
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
) -> Result<CausticsChart, ChartError> {
    let chart = measure::measure(effort, progress)?;
    tables::write(&chart, dir, look)?;
    Ok(chart)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_are_all_there_and_agree() {
        let folder = tempfile::tempdir().unwrap();
        let least = Effort {
            ocean_cells: 6,
            ocean_px: [48, 27],
            sweep_cells: 4,
            sweep_px: [32, 18],
            slopes: &[0.05, 0.3],
            coarse_cells: &[2, 8],
            pleated_cells: &[24],
            pleats: &[0.0, 0.4],
            rays: 300,
            floor_px: 48,
            repeats: 1,
        };
        let chart = OutDir::with(folder.path(), claim(), |dir| {
            chart(least, dir, &Look::default(), &Progress::new(true))
        })
        .unwrap()
        .unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let json: serde_json::Value = serde_json::from_str(&read("caustics.json")).unwrap();
        assert_eq!(json["rows"].as_array().unwrap().len(), 2 * 4);
        let coarse = json["coarse"].as_array().unwrap().len();
        assert!(coarse >= 2 * 2, "every slope with every number of triangles");
        assert_eq!(read("caustics.csv").lines().count(), 1 + 2 * 4 + coarse + 2 * 4);
        let [straight, crossed] = [&chart.crossed[0], &chart.crossed[1]];
        assert!(crossed.crossing > straight.crossing + 0.02);
        assert!(chart.crossed.iter().all(|row| row.difference == 0.0 && row.floor_error > row.noise));
        assert!(
            read("caustics.svg").contains("moving") && folder.path().join("caustics_map_prism.png").exists()
        );
        assert!(chart.rows.iter().all(|row| row.difference == 0.0), "the same image by every method");
        assert!(chart.text().contains("convex hull"));
        for slope in 0..2 {
            let of = |method: usize| chart.rows[4 * slope + method].executions;
            assert!(of(0) <= of(1) && of(0) <= of(2) && of(2) <= of(3));
        }
    }
}
