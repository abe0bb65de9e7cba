//! `quintile sample poisson`, and independent points: `quintile sample white` and `quintile sample volume`.

use std::path::PathBuf;

use activity::spec::suggestion;
use clap::{ArgGroup, Args};
use output::terminal::{Progress, Terminal};
use serde::Serialize;
use warnings::Warning;
use workloads::points::poisson::{
    Domain, PoissonDisk, PoissonSpec, Spacing, ball, poisson_disk_with_progress, radius_for, saturation, span,
};
use workloads::points::thin_regions_warning;
use workloads::points::volume::{Inside, Sampled, Solid, SolidBounds, Torus};
use workloads::points::white::{
    Density, ImageDensity, NamedDensity, Numbers, WhiteSpec, columns_for, white_noise,
};
use workloads::visibility::load_surface;

use super::{CommonArgs, Failure, Points, usage};

/// Arguments of `sample poisson`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("how many").args(["r", "count"]).required(true))]
pub struct PoissonArgs {
    /// Dimensions, 1 to 4
    #[arg(long, value_name = "D", default_value_t = 2, allow_negative_numbers = true, value_parser = clap::value_parser!(u8).range(1..=4))]
    pub dim: u8,
    /// Minimum distance, up to 0.5
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    pub r: Option<f64>,
    /// Approximate number of points: sets r from the mean number that fits; 1 is exact, others give at least
    /// the points of r = 0.5
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..))]
    pub count: Option<u32>,
    /// A box with borders instead of a periodic domain
    #[arg(long = "box")]
    pub boxed: bool,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl PoissonArgs {
    fn domain(&self) -> Domain {
        if self.boxed { Domain::Box } else { Domain::Torus }
    }
}

/// Facts about the points.
#[derive(Serialize)]
struct Facts {
    r: f64,
    periodic: bool,
    seed: u64,
    /// Packing density: share of the domain covered by balls of diameter r.
    packing_density: f64,
    darts: u64,
    uncovered_regions: u64,
    levels: u32,
    /// Uncovered regions left, narrower than the gap between representable numbers.
    thin_regions: u64,
    /// Warnings about the points.
    warnings: Vec<Warning>,
}

pub(super) fn poisson(args: &PoissonArgs, terminal: &Terminal) -> Result<(), Failure> {
    args.common.check(None)?;
    match args.dim {
        1 => sample::<1>(args, terminal),
        2 => sample::<2>(args, terminal),
        3 => sample::<3>(args, terminal),
        _ => sample::<4>(args, terminal),
    }
}

/// Distance r that gives about `count` points, at most 0.5.
fn radius(count: u32, dimensions: usize, domain: Domain) -> f64 {
    if count == 1 {
        span(dimensions, domain)
    } else {
        radius_for(f64::from(count), dimensions, domain).min(0.5)
    }
}

/// Points per second by number of dimensions, on two cores; an order of magnitude.
const POINTS_PER_S: [f64; 4] = [2.5e6, 6e5, 1.1e5, 1.1e4];
/// Smallest expected time in seconds for a note.
const MIN_NOTE_S: f64 = 20.0;

/// Note about the expected time, for many points.
fn long(points: f64, dimensions: usize) -> Option<String> {
    let seconds = points / POINTS_PER_S[dimensions - 1];
    let time = if seconds < 120.0 { format!("{seconds:.0} s") } else { format!("{:.0} min", seconds / 60.0) };
    let note = format!("about {points:.1e} points in {dimensions} dimensions take of the order of {time}");
    (MIN_NOTE_S..f64::INFINITY).contains(&seconds).then_some(note)
}

/// Generates the points, with a progress bar, and a note if they take long.
fn make<const D: usize>(
    spec: &PoissonSpec,
    args: &PoissonArgs,
    terminal: &Terminal,
) -> Result<PoissonDisk<D>, Failure> {
    let pool = args.common.threads.pool()?;
    let volume = ball(D) * spec.radius.powi(D as i32);
    let progress = Progress::on(terminal, false);
    let points = saturation(D) / volume;
    if let Some(note) = long(points, D) {
        progress.note(&note);
    }
    let bar = progress.bar("points, about", points as u64);
    pool.install(|| poisson_disk_with_progress(spec, &mut |points| bar.set(points as u64))).map_err(usage)
}

/// Note if r cannot be large enough for the requested number of points.
fn shortfall(args: &PoissonArgs, made: usize) -> String {
    match args.count {
        Some(count @ 2..) if radius_for(f64::from(count), args.dim.into(), args.domain()) > 0.5 => {
            format!(" ({count} requested; r is at most 0.5, which gave {made})")
        }
        _ => String::new(),
    }
}

fn sample<const D: usize>(args: &PoissonArgs, terminal: &Terminal) -> Result<(), Failure> {
    let domain = args.domain();
    let spec = PoissonSpec {
        radius: args.r.unwrap_or_else(|| radius(args.count.unwrap_or(1), D, domain)),
        domain,
        seed: args.common.seed,
        spacing: if args.common.single { Spacing::Single } else { Spacing::Double },
    };
    let found: PoissonDisk<D> = make(&spec, args, terminal)?;
    let facts = Facts {
        r: spec.radius,
        periodic: !args.boxed,
        seed: spec.seed,
        packing_density: found.points.len() as f64 * ball(D) * spec.radius.powi(D as i32),
        darts: found.darts,
        uncovered_regions: found.uncovered,
        levels: found.levels,
        thin_regions: found.thin_regions,
        warnings: thin_regions_warning(found.points.len(), found.thin_regions).into_iter().collect(),
    };
    let thin = match found.thin_regions {
        0 => "no other fits".to_owned(),
        thin => format!(
            "no other representable point fits; {thin} uncovered regions below the gap between numbers are left"
        ),
    };
    let short = shortfall(args, found.points.len());
    if !args.common.json {
        facts.warnings.iter().for_each(|warning| terminal.warn(warning));
    }
    let line = format!("r {}, packing density {:.4}, {thin}{short}", spec.radius, facts.packing_density);
    args.common.deliver(&Points::new(&found.points), facts, &line)
}

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
    pub common: CommonArgs,
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

fn sample_volume(
    args: &VolumeArgs,
    solid: &dyn Inside,
    bounds: &SolidBounds,
    volume: f64,
) -> Result<(), Failure> {
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
    pub density: NamedDensity,
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
    pub common: CommonArgs,
}

fn density(name: &str) -> Result<NamedDensity, String> {
    let known = NamedDensity::ALL.map(|(name, _)| name);
    NamedDensity::by_name(name)
        .ok_or_else(|| format!("unknown density `{name}`; {}", suggestion(name, &known)))
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

    use super::*;
    use crate::cli::sample::Kind;
    use crate::cli::{Cli, Command};

    fn parsed(rest: &[&str]) -> Result<PoissonArgs, String> {
        let typed = ["quintile", "sample", "poisson"].iter().chain(rest);
        match Cli::try_parse_from(typed).map_err(|error| error.to_string())?.command {
            Command::Sample(args) => match args.kind {
                Kind::Poisson(args) => Ok(args),
                _ => Err("another kind".to_owned()),
            },
            _ => Err("another command".to_owned()),
        }
    }

    #[test]
    fn either_r_or_count_is_required() {
        let message = parsed(&[]).unwrap_err();
        assert!(message.contains("--r <R>") && message.contains("--count <N>"), "{message}");
        assert!(parsed(&["--r", "0.1", "--count", "4"]).is_err());
        assert!(parsed(&["--r", "0.1"]).is_ok() && parsed(&["--count", "4"]).is_ok());
    }

    #[test]
    fn invalid_values_are_refused_with_their_limits() {
        let message = parsed(&["--r", "0.1", "--seed", "-1"]).err().unwrap_or_default();
        assert!(message.contains("-1") && message.contains("from 0 to 18446744073709551615"), "{message}");
        for (r, said) in
            [("0.6", "r is 0.6; "), ("1e-300", "r is 1e-300; "), ("0", "r is 0; "), ("nan", "r is NaN; ")]
        {
            let args = parsed(&["--r", r]).unwrap();
            let message =
                sample::<2>(&args, &Terminal::default()).map_err(|failure| failure.message).unwrap_err();
            let limits = "it has to be 1.4e-14 to 0.5, or from 0.707 on for a single point";
            assert!(message.contains(said) && message.ends_with(limits), "{message}");
        }
    }

    #[test]
    fn a_long_time_gives_a_note() {
        assert_eq!((long(1e5, 2), long(1e5, 4), long(f64::INFINITY, 4)), (None, None, None));
        let [short, much] = [long(1e6, 4), long(1e7, 4)].map(Option::unwrap_or_default);
        assert!(
            short == "about 1.0e6 points in 4 dimensions take of the order of 91 s" && much.ends_with(" min")
        );
    }

    #[test]
    fn one_point_is_exact_and_too_few_give_a_note() {
        let said = |count: &str| {
            let args = parsed(&["--count", count]).unwrap();
            let spec = PoissonSpec {
                radius: radius(args.count.unwrap(), 2, Domain::Torus),
                domain: Domain::Torus,
                seed: 1,
                spacing: Spacing::Double,
            };
            let made = make::<2>(&spec, &args, &Terminal::default())
                .map_err(|failure| failure.message)
                .unwrap()
                .points
                .len();
            (made, shortfall(&args, made))
        };
        assert_eq!(said("1"), (1, String::new()));
        let (made, line) = said("2");
        assert!(made > 1 && line.contains(&format!("2 requested; r is at most 0.5, which gave {made}")));
        let (made, line) = said("1000");
        assert!((900..1100).contains(&made) && line.is_empty());
    }

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
