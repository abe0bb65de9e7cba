//! Plots of runs and charts. Each is described once as a [`Picture`], and rendered as SVG, PNG and PDF. A [`Look`] sets the width
//! and the font size.
//!
//! Plots of a run:
//!
//! - [`PowerRun`]: power over the whole run, with every spike.
//! - [`FramePowerPlot`]: power of one frame over time, stacked by part.
//! - [`FrameEnergyPlot`]: energy of each frame, measured and true.
//! - [`UnitPlot`]: how busy each unit was over one frame, or what it waited for.
//! - [`HeatMapPlot`]: a value over the image.
//!
//! Other plots:
//!
//! - [`Chart`]: panels of [`Series`] over axes of any [`Scale`].
//! - [`Images`]: images in colour beside each other.
//! - [`Matrix`]: costs of methods by test case.
//!
//! A unit has the same colour in all plots ([`part_colour`]). Without anything to draw (no samples, no frames, no finite value) the
//! plot says so; this is no error. Only `render` and `text` use the crate `plotters`.

mod axis;
mod chart;
mod chart_panel;
mod frame_plots;
mod heat_map;
mod palette;
mod panel;
mod picture;
mod render;
mod run_plots;
mod series;

pub use axis::{AxisSpec, Scale};
pub use chart::Chart;
pub use chart_panel::ChartPanel;
pub use frame_plots::{FramePowerPlot, PowerPart, StallLane, UnitLane, UnitPlot};
pub use heat_map::{CaptionedImage, HeatMapPlot, HeatTile, Images, Matrix, MatrixPanel, Shading};
pub use palette::{Colour, part_colour};
pub use picture::{COLUMN_MM, Look, Picture, undrawable};
pub use render::PlotError;
pub use run_plots::{FrameEnergyPlot, FrameEnergyPoint, PowerRun};
pub use series::{Mark, Paint, Series, Spread};

#[cfg(test)]
mod tests;
