//! `quintile sample poisson`.

use activity::Warning;
use clap::Args;
use serde::Serialize;
use workloads::points::doubt;
use workloads::points::poisson::{Domain, PoissonDisk, PoissonSpec, Spacing, ball, poisson_disk, radius_for};

use super::file::Points;
use super::{Common, Failure, usage};

/// Arguments of `sample poisson`.
#[derive(Debug, Args)]
pub struct PoissonArgs {
    /// Dimensions, 1 to 4
    #[arg(long, value_name = "D", default_value_t = 2, allow_negative_numbers = true, value_parser = clap::value_parser!(u8).range(1..=4))]
    pub dim: u8,
    /// Least distance, up to 0.5
    #[arg(
        long,
        value_name = "R",
        allow_negative_numbers = true,
        required_unless_present = "count",
        conflicts_with = "count"
    )]
    pub r: Option<f64>,
    /// About how many points: chooses r by how many fit on average
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..))]
    pub count: Option<u32>,
    /// A box with borders instead of a torus, whose opposite sides meet
    #[arg(long = "box")]
    pub boxed: bool,
    #[command(flatten)]
    pub common: Common,
}

/// What is to be said of the points.
#[derive(Serialize)]
struct Facts {
    r: f64,
    periodic: bool,
    seed: u64,
    /// Share of the domain that balls of diameter r cover.
    packing_density: f64,
    darts: u64,
    voids: u64,
    levels: u32,
    /// Voids narrower than the spacing of numbers that are left.
    thin_voids: u64,
    /// Regimes in which points are known to be bad.
    warnings: Vec<Warning>,
}

pub(super) fn run(args: &PoissonArgs) -> Result<(), Failure> {
    args.common.check()?;
    match args.dim {
        1 => sample::<1>(args),
        2 => sample::<2>(args),
        3 => sample::<3>(args),
        _ => sample::<4>(args),
    }
}

fn sample<const D: usize>(args: &PoissonArgs) -> Result<(), Failure> {
    let for_count = || radius_for(f64::from(args.count.unwrap_or(1)), D).min(0.5);
    let spec = PoissonSpec {
        radius: args.r.unwrap_or_else(for_count),
        domain: if args.boxed { Domain::Box } else { Domain::Torus },
        seed: args.common.seed,
        spacing: if args.common.single { Spacing::Single } else { Spacing::Double },
    };
    let pool = crate::cli::threads(args.common.threads)?;
    let found: PoissonDisk<D> = pool.install(|| poisson_disk(&spec)).map_err(usage)?;
    let facts = Facts {
        r: spec.radius,
        periodic: !args.boxed,
        seed: spec.seed,
        packing_density: found.points.len() as f64 * ball(D) * spec.radius.powi(D as i32),
        darts: found.darts,
        voids: found.voids,
        levels: found.levels,
        thin_voids: found.thin_voids,
        warnings: doubt(found.points.len(), found.thin_voids).into_iter().collect(),
    };
    let thin = match found.thin_voids {
        0 => "no other fits".to_owned(),
        thin => format!("no other number fits; {thin} voids thinner than the spacing of numbers are left"),
    };
    let warnings: String = facts.warnings.iter().map(|warning| format!("\nwarning: {warning}")).collect();
    let line = format!("r {}, packing density {:.4}, {thin}{warnings}", spec.radius, facts.packing_density);
    args.common.deliver(&Points::new(&found.points), facts, &line)
}
