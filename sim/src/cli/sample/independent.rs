//! `quintile sample white` and `quintile sample volume`: independent points.

use std::path::PathBuf;

use activity::spec::suggestion;
use clap::Args;
use serde::Serialize;
use workloads::points::volume::{Bounds, Inside, Sampled, Solid, Torus};
use workloads::points::white::{Density, ImageDensity, Named, Numbers, WhiteSpec, columns_for, white_noise};
use workloads::visibility::load_surface;

use super::{Common, Failure, Points, usage};

/// Arguments of `sample volume`.
#[derive(Debug, Args)]
pub struct VolumeArgs {
    /// Dimensions: 3
    #[arg(long, value_name = "D", default_value_t = 3, allow_negative_numbers = true, value_parser = clap::value_parser!(u8).range(3..=3))]
    pub dim: u8,
    /// A closed surface, .ply, .obj, .off or .stl; without it a torus about the middle of the unit cube
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<PathBuf>,
    /// Major radius of the torus, from its axis to the middle of its tube
    #[arg(
        long,
        value_name = "R",
        default_value_t = 0.3,
        allow_negative_numbers = true,
        conflicts_with = "mesh"
    )]
    pub ring: f64,
    /// Radius of the tube of the torus
    #[arg(
        long,
        value_name = "R",
        default_value_t = 0.15,
        allow_negative_numbers = true,
        conflicts_with = "mesh"
    )]
    pub tube: f64,
    /// Number of points [default: 10000 without a density]
    #[arg(long, value_name = "N", allow_negative_numbers = true, conflicts_with = "density", value_parser = clap::value_parser!(u32).range(1..))]
    pub count: Option<u32>,
    /// Mean number of points per unit of volume
    #[arg(long, value_name = "RHO", allow_negative_numbers = true)]
    pub density: Option<f64>,
    /// Tiles along an axis; the volume is bounded in each
    #[arg(long, value_name = "N", default_value_t = 64, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=2048))]
    pub tiles: u32,
    #[command(flatten)]
    pub common: Common,
}

impl VolumeArgs {
    /// Number of points without a density.
    fn points(&self) -> u32 {
        self.count.unwrap_or(10_000)
    }
}

/// VolumeFacts about the points.
#[derive(Serialize)]
struct VolumeFacts {
    seed: u64,
    /// Exact volume, from a closed form or the divergence theorem.
    volume: f64,
    /// Volume by counting: share of accepted candidates times the volume of the bounds.
    volume_by_count: f64,
    bounds_volume: f64,
    candidates: u64,
}

pub(super) fn volume(args: &VolumeArgs) -> Result<(), Failure> {
    args.common.check(args.mesh.as_deref())?;
    let pool = args.common.threads.pool()?;
    pool.install(|| match &args.mesh {
        Some(path) => {
            let mesh = load_surface(path)?;
            let solid = Solid::new(&mesh.open, &mesh.triangles, args.tiles)
                .map_err(|error| usage(format!("{}: {error}", path.display())))?;
            sample_volume(args, &solid, solid.bounds(), solid.volume().abs())
        }
        None => {
            let torus = Torus { ring: args.ring, tube: args.tube };
            if !(args.tube > 0.0 && args.tube < args.ring && args.ring + args.tube <= 0.5) {
                return Err(usage(format!(
                    "--ring {:?}, --tube {:?}: the tube has to be above 0 and below the ring, and both together at most 0.5",
                    args.ring, args.tube
                )));
            }
            let bounds = torus.bounds(args.tiles);
            thick_enough(args, torus.volume() / bounds.volume())?;
            sample_volume(args, &torus, &bounds, torus.volume())
        }
    })
}

/// Largest number of candidates: some minutes of work.
const MAX_CANDIDATES: f64 = 1e10;

/// Checks that a torus fills enough of its bounds for [`MAX_CANDIDATES`].
fn thick_enough(args: &VolumeArgs, share: f64) -> Result<(), Failure> {
    let count = args.points();
    let candidates = f64::from(count) / share;
    if candidates <= MAX_CANDIDATES {
        return Ok(());
    }
    Err(usage(format!(
        "--tube {:?}: {count} points in it take about {candidates:.0e} candidates, more than {MAX_CANDIDATES:.0e}; \
         make the tube wider or choose fewer points",
        args.tube
    )))
}

fn sample_volume(args: &VolumeArgs, solid: &dyn Inside, bounds: &Bounds, volume: f64) -> Result<(), Failure> {
    let seed = args.common.seed;
    let count = args.points() as usize;
    let Sampled { points, candidates } = match args.density {
        Some(density) if !(density > 0.0 && density * bounds.volume() < MAX_CANDIDATES) => {
            return Err(usage(format!(
                "--density {density:?}: it has to be above 0 and below {:.1e}: {MAX_CANDIDATES:.0e} candidates in the bounds",
                MAX_CANDIDATES / bounds.volume()
            )));
        }
        Some(density) => bounds.sample_density(solid, density, seed),
        None => bounds.sample(solid, count, seed),
    };
    if args.density.is_none() && points.len() < count {
        let message = format!("only {} points found in {candidates}: the volume is too thin", points.len());
        return Err(Failure { message, code: 1 });
    }
    let volume_by_count = points.len() as f64 / candidates.max(1) as f64 * bounds.volume();
    let facts = VolumeFacts { seed, volume, volume_by_count, bounds_volume: bounds.volume(), candidates };
    let line = format!("volume {volume:.6}, by count {volume_by_count:.6}; {candidates} candidates");
    args.common.deliver(&Points::new(&points), facts, &line)
}

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

/// WhiteFacts about the points.
#[derive(Serialize)]
struct WhiteFacts {
    seed: u64,
    candidates: u64,
    columns: u32,
    low_discrepancy: bool,
}

pub(super) fn white(args: &WhiteArgs) -> Result<(), Failure> {
    args.common.check(args.image.as_deref())?;
    if let Some(path) = &args.image {
        if args.dim != 2 {
            return Err(usage("--image: a picture is a density of two dimensions; leave --dim out or say 2"));
        }
        let image = ImageDensity::load(path).map_err(usage)?;
        return sample_white::<2>(args, &image);
    }
    match args.dim {
        1 => sample_white::<1>(args, &args.density),
        2 => sample_white::<2>(args, &args.density),
        3 => sample_white::<3>(args, &args.density),
        _ => sample_white::<4>(args, &args.density),
    }
}

fn sample_white<const D: usize>(args: &WhiteArgs, density: &dyn Density<D>) -> Result<(), Failure> {
    let numbers = if args.low_discrepancy { Numbers::LowDiscrepancy } else { Numbers::Independent };
    let columns = args.columns.unwrap_or_else(|| columns_for(D));
    let seed = args.common.seed;
    let spec = WhiteSpec { count: args.count as usize, seed, across: columns, numbers };
    let pool = args.common.threads.pool()?;
    let found = pool.install(|| white_noise(density, &spec)).map_err(usage)?;
    let line = format!("{} candidates", found.candidates);
    let facts =
        WhiteFacts { seed, candidates: found.candidates, columns, low_discrepancy: args.low_discrepancy };
    args.common.deliver(&Points::new(&found.points), facts, &line)
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use output::terminal::Terminal;

    use crate::cli::{Cli, Command};

    #[test]
    fn a_mesh_has_no_ring_and_no_tube() {
        for flag in ["--ring", "--tube"] {
            let typed = ["quintile", "sample", "volume", "--mesh", "a.ply", flag, "0.2"];
            let error = Cli::try_parse_from(typed).map(|_| ()).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(flag), "{error}");
        }
        assert!(Cli::try_parse_from(["quintile", "sample", "volume", "--mesh", "a.ply"]).is_ok());
    }

    fn refusal(typed: &[&str]) -> String {
        let typed = ["quintile", "sample", "volume"].iter().chain(typed);
        let Ok(Cli { command: Command::Sample(args), .. }) = Cli::try_parse_from(typed) else {
            return String::new();
        };
        super::super::run(&args, &Terminal::default()).err().map_or_else(String::new, |failure| {
            assert_eq!(failure.code, 2);
            failure.message
        })
    }

    #[test]
    fn invalid_numbers_are_refused_in_one_line() {
        for (typed, says) in [
            (["--tube", "1e-300"], "--tube 1e-300: 10000 points in it take about"),
            (["--tube", "1e-9"], "make the tube wider or choose fewer points"),
            (["--tube", "nan"], "--tube NaN: the tube has to be above 0"),
            (["--ring", "1e300"], "--ring 1e300, --tube 0.15: the tube has to be"),
            (["--ring", "inf"], "both together at most 0.5"),
            (["--density", "1e30"], "--density 1e30: it has to be above 0 and below"),
            (["--density", "inf"], "--density inf: "),
        ] {
            let message = refusal(&typed);
            assert!(message.contains(says) && message.len() < 160, "{typed:?}: {message}");
        }
    }
}
