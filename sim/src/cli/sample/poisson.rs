//! `quintile sample poisson`.

use clap::{ArgGroup, Args};
use output::terminal::{Progress, Terminal};
use serde::Serialize;
use warnings::Warning;
use workloads::points::poisson::{Domain, PoissonDisk, PoissonSpec, Spacing, ball, poisson_disk_with_progress, radius_for, saturation, span};
use workloads::points::thin_regions_warning;

use super::{Common, Failure, Points, usage};

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
    pub common: Common,
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

pub(super) fn run(args: &PoissonArgs, terminal: &Terminal) -> Result<(), Failure> {
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

#[cfg(test)]
mod tests {
    use clap::Parser;

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
}
