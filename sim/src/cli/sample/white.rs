//! `quintile sample white`.

use std::path::PathBuf;

use activity::spec::suggestion;
use clap::Args;
use serde::Serialize;
use workloads::points::white::{Density, ImageDensity, Named, Numbers, WhiteSpec, columns_for, white_noise};

use super::Points;
use super::{Common, Failure, usage};

/// Arguments of `sample white`.
#[derive(Debug, Args)]
pub struct WhiteArgs {
    /// Dimensions, 1 to 4
    #[arg(long, value_name = "D", default_value_t = 2, allow_negative_numbers = true, value_parser = clap::value_parser!(u8).range(1..=4))]
    pub dim: u8,
    /// Number of points
    #[arg(long, value_name = "N", default_value_t = 10_000, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..))]
    pub count: u32,
    /// The density: constant, ramp, gauss or waves
    #[arg(long, value_name = "NAME", default_value = "gauss", value_parser = density, conflicts_with = "image")]
    pub density: Named,
    /// A PNG or JPEG image as a density in two dimensions: bright is dense
    #[arg(long, value_name = "FILE")]
    pub image: Option<PathBuf>,
    /// Cells along an axis; the density is bounded in each. 1 is plain rejection
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub columns: Option<u32>,
    /// Take candidates from a low-discrepancy sequence: they follow the density better than independent ones
    #[arg(long)]
    pub low_discrepancy: bool,
    #[command(flatten)]
    pub common: Common,
}

fn density(name: &str) -> Result<Named, String> {
    let known = Named::ALL.map(|(name, _)| name);
    Named::by_name(name).ok_or_else(|| format!("unknown density `{name}`; {}", suggestion(name, &known)))
}

/// Facts about the points.
#[derive(Serialize)]
struct Facts {
    seed: u64,
    candidates: u64,
    columns: u32,
    low_discrepancy: bool,
}

pub(super) fn run(args: &WhiteArgs) -> Result<(), Failure> {
    args.common.check(args.image.as_deref())?;
    if let Some(path) = &args.image {
        if args.dim != 2 {
            return Err(usage("--image: a picture is a density of two dimensions; leave --dim out or say 2"));
        }
        let image = ImageDensity::load(path).map_err(|e| Failure { message: e.to_string(), code: 1 })?;
        return sample::<2>(args, &image);
    }
    match args.dim {
        1 => sample::<1>(args, &args.density),
        2 => sample::<2>(args, &args.density),
        3 => sample::<3>(args, &args.density),
        _ => sample::<4>(args, &args.density),
    }
}

fn sample<const D: usize>(args: &WhiteArgs, density: &dyn Density<D>) -> Result<(), Failure> {
    let numbers = if args.low_discrepancy { Numbers::LowDiscrepancy } else { Numbers::Independent };
    let columns = args.columns.unwrap_or_else(|| columns_for(D));
    let seed = args.common.seed;
    let spec = WhiteSpec { count: args.count as usize, seed, across: columns, numbers };
    let pool = args.common.threads.pool()?;
    let found = pool.install(|| white_noise(density, &spec)).map_err(usage)?;
    let line = format!("{} candidates", found.candidates);
    let facts = Facts { seed, candidates: found.candidates, columns, low_discrepancy: args.low_discrepancy };
    args.common.deliver(&Points::new(&found.points), facts, &line)
}
