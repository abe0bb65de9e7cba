//! Maximal Poisson-disk points: dart throwing over voids (thesis, Paper VI, section 5, "Accelerated Dart Throwing").
//!
//! Space is cut into cells so small that each holds one point at most. Cells that are not yet known to be covered are the *voids*.
//! Darts are thrown at voids, each as likely as its volume, and stay where they are free; then voids are halved along
//! each axis and those that a disk covers are dropped, until none is left (the flat list of cells of one size: Ebeida, Mitchell,
//! Patney, Davidson, Owens 2012, "A Simple Algorithm for Maximal Poisson-Disk Sampling in High Dimensions"; before it as a tree:
//! Gamito, Maddock 2009). Voids of a level are of one size and hold all that is free, so **every dart that stays is uniform over
//! what is free**: the points are those of plain dart throwing carried on for ever (random sequential adsorption).
//!
//! Distances are looked at in single precision from cell to cell and, where that cannot tell, exactly, for the numbers that are
//! handed out. Voids narrower than a few of these numbers are tried number by number; what is left of them has no number in it,
//! and is counted ([`PoissonDisk::thin_voids`]).
//!
//! The paper rasterizes the voids to make candidates; that is [`super::job`]. Here a candidate is made by choosing a cell.

mod cells;
mod exact;
mod grid;
mod near;
mod rain;
mod throw;
mod voids;

pub use exact::closer;
pub use throw::{poisson_disk, poisson_disk_drawn, poisson_disk_telling};
pub use voids::Cube;

/// What lies beyond the unit square or cube.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Domain {
    /// The other side: no border.
    #[default]
    Torus,
    /// Nothing.
    Box,
}

/// The numbers that coordinates may be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Spacing {
    /// Multiples of 2^-52: what `f64` tells apart everywhere in the unit interval.
    #[default]
    Double,
    /// Multiples of 2^-24: the same for `f32`.
    Single,
    /// Multiples of 2^-n, n at most 52: coarser numbers, to see what they do.
    Bits(u32),
}

impl Spacing {
    /// Numbers to a unit of length.
    pub fn per_unit(self) -> f64 {
        match self {
            Self::Double => (1_u64 << exact::FINEST_BITS) as f64,
            Self::Single => (1_u64 << 24) as f64,
            Self::Bits(bits) => (1_u64 << bits.min(exact::FINEST_BITS)) as f64,
        }
    }
}

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoissonSpec {
    /// No two points are closer than this, and no place is farther from all of them. At most 0.5, or at least [`span`].
    pub radius: f64,
    /// What lies beyond the border.
    pub domain: Domain,
    /// Other points by another seed.
    pub seed: u64,
    /// The numbers that coordinates may be.
    pub spacing: Spacing,
}

/// Why there are no points.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PoissonError {
    /// The radius cannot be.
    #[error("r is {}; it has to be {least:.1e} to 0.5, or from {one:.3} on for a single point", short(*.radius))]
    Radius {
        /// What it is.
        radius: f64,
        /// The least that coordinates can tell.
        least: f64,
        /// From here on there is one point.
        one: f64,
    },
    /// Too many points for memory and patience.
    #[error(
        "that would be about {points:.1e} points; choose a larger r, at least {least:.1e}, or fewer points, at most {most:.1e}"
    )]
    TooMany {
        /// How many there would be.
        points: f64,
        /// An r that would do.
        least: f64,
        /// How many points there may be about.
        most: f64,
    },
}

/// A number without a row of zeros.
fn short(number: f64) -> String {
    let plain = number == 0.0 || !number.is_finite() || (1e-4..1e6).contains(&number.abs());
    if plain { number.to_string() } else { format!("{number:e}") }
}

/// Points that no other can be added to.
#[derive(Clone, Debug, PartialEq)]
pub struct PoissonDisk<const D: usize> {
    /// Points in the unit cube, in the order in which they came.
    pub points: Vec<[f64; D]>,
    /// Darts thrown.
    pub darts: u64,
    /// Voids over all levels.
    pub voids: u64,
    /// How often voids were halved.
    pub levels: u32,
    /// Voids left without a number in them that would be free: narrower than the spacing of numbers.
    pub thin_voids: u64,
}

/// The share of space that disks of diameter r cover when no more fit (random sequential adsorption): in one dimension Renyi's
/// constant (1958), in two and three as in `docs/guide/sampling.md`, in four from Torquato, Uche, Stillinger (2006).
pub fn saturation(dimensions: usize) -> f64 {
    match dimensions {
        1 => 0.7476,
        2 => 0.547,
        3 => 0.384,
        _ => 0.260,
    }
}

/// Volume of a ball of diameter 1.
pub fn ball(dimensions: usize) -> f64 {
    use std::f64::consts::PI;
    match dimensions {
        1 => 1.0,
        2 => PI / 4.0,
        3 => PI / 6.0,
        _ => PI * PI / 32.0,
    }
}

/// The radius at which about `count` points fill the unit cube.
pub fn radius_for(count: f64, dimensions: usize) -> f64 {
    (saturation(dimensions) / (ball(dimensions) * count)).powf(1.0 / dimensions as f64)
}

/// The distance from which on one point fills the unit cube: none is farther from it.
pub fn span(dimensions: usize, domain: Domain) -> f64 {
    let root = (dimensions as f64).sqrt();
    if domain == Domain::Torus { 0.5 * root } else { root }
}

/// Cells that memory is taken for at most, and points that are made at most: some minutes.
const MOST_CELLS: f64 = (1_u64 << 28) as f64;
const MOST_POINTS: f64 = (1_u64 << 25) as f64;

/// Refuses what would be too much.
///
/// # Errors
/// [`PoissonError::TooMany`].
pub(super) fn check_room(radius: f64, dimensions: usize, cells: f64) -> Result<(), PoissonError> {
    let volume = radius.powi(dimensions as i32);
    let points = saturation(dimensions) / (ball(dimensions) * volume);
    let over = (cells / MOST_CELLS).max(points / MOST_POINTS);
    if over <= 1.0 {
        return Ok(());
    }
    // Padding takes more cells the fewer there are, and what is printed has to do.
    let most = 0.8 * points / over;
    Err(PoissonError::TooMany { points, least: 1.05 * radius_for(most, dimensions), most })
}

#[cfg(test)]
mod tests;
