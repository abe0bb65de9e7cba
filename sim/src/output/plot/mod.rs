//! The plots of a run. Each is described once as a [`Picture`] and rendered into SVG and PNG from there.
//!
//! - [`PowerRun`]: power over the whole run, with every spike.
//! - [`FramePower`]: one frame's power over time, stacked by part.
//! - [`FrameEnergy`]: energy of each frame, measured against true.
//! - [`UnitBusy`]: how busy each unit was over one frame.
//! - [`Curves`]: curves over one parameter, on the [`Scale`] that suits them.
//! - [`Lines`]: bands, lines, dots and bars over plain axes.
//! - [`HeatMapPlot`]: where in the image something happens.
//!
//! And those of comparisons of methods:
//!
//! - [`Matrix`]: costs of methods by what they were tried on.
//! - [`Sweep`]: several measures along one parameter.
//! - [`Tradeoff`]: gain over cost with its front.
//!
//! Nothing to draw (no samples, no frames, nothing finite) is a plot that says so, never an error. All use of the
//! `plotters` crate is in `render`.

mod axis;
mod columns;
mod curves;
mod frame_energy;
mod frame_power;
mod heat_map;
mod lines;
mod matrix;
mod palette;
mod panel;
mod picture;
mod power_run;
mod render;
mod scale;
mod stalls;
mod sweep;
mod tradeoff;
mod unit_busy;

pub use curves::{Curve, CurvePanel, Curves};
pub use frame_energy::{FrameEnergy, FrameEnergyPoint};
pub use frame_power::{FramePower, PowerPart};
pub use heat_map::{HeatMapPlot, HeatTile};
pub use lines::{Lines, Mark, Series};
pub use matrix::{Matrix, MatrixPanel};
pub use palette::{Colour, part_colour};
pub use picture::Picture;
pub use power_run::PowerRun;
pub use render::PlotError;
pub use scale::Scale;
pub use stalls::{StallLane, StallLanes};
pub use sweep::{Sweep, SweepCurve, SweepPanel};
pub use tradeoff::{Tradeoff, TradeoffPanel, TradeoffPoint};
pub use unit_busy::{UnitBusy, UnitLane};

#[cfg(test)]
mod tests;
