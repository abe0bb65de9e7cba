//! The plots of a run and of charts. Each is described once as a [`Picture`] and rendered into SVG, PNG and PDF from there, as wide
//! and with letters as large as a [`Look`] asks for.
//!
//! Of a run:
//!
//! - [`PowerRun`]: power over the whole run, with every spike.
//! - [`FramePower`]: one frame's power over time, stacked by part.
//! - [`FrameEnergy`]: energy of each frame, measured against true.
//! - [`UnitBusy`]: how busy each unit was over one frame.
//! - [`StallLanes`]: what each unit waited for over one frame.
//! - [`HeatMapPlot`]: where in the image something happens.
//!
//! Of anything else:
//!
//! - [`Chart`]: panels of [`Series`] over axes of any [`Scale`].
//! - [`Matrix`]: costs of methods by what they were tried on.
//!
//! A unit has one colour in all of them ([`part_colour`]). Nothing to draw (no samples, no frames, nothing finite) is a plot that says
//! so, never an error. All use of the `plotters` crate is in `render`.

mod axis;
mod chart;
mod columns;
mod frame_plots;
mod heat_map;
mod lanes;
mod legend;
mod matrix;
mod palette;
mod panel;
mod picture;
mod power_run;
mod render;
mod series;
mod text;

pub use axis::{AxisSpec, Scale};
pub use chart::{Chart, ChartPanel};
pub use frame_plots::{FrameEnergy, FrameEnergyPoint};
pub use frame_plots::{FramePower, PowerPart};
pub use heat_map::{HeatMapPlot, HeatTile, Shading};
pub use lanes::{StallLane, StallLanes};
pub use lanes::{UnitBusy, UnitLane};
pub use matrix::{Matrix, MatrixPanel};
pub use palette::{Colour, part_colour};
pub use picture::Picture;
pub use picture::{COLUMN_MM, Look};
pub use power_run::PowerRun;
pub use render::PlotError;
pub use series::{Mark, Paint, Series, Spread};

#[cfg(test)]
mod tests;
