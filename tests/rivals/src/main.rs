//! Maximal Poisson-disk points per second of one thread's CPU time, beside the `poisson` crate and, where it
//! is there, scipy.
//!
//! `cargo run --release --manifest-path tests/rivals/Cargo.toml`. With `QUINTILE_SCIPY=PYTHON` (a Python that
//! has scipy) its engine runs in the same minutes. Medians of five runs; packing density and largest hole say
//! how good the points are. With `space` after `--` only points in space and ever more of them, a line as
//! soon as it is known: of six runs at the distances below the crate saw no end.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run may as well panic")]

use std::process::Command;

use cpu_time::ProcessTime;
use nalgebra::{Vector2, Vector3};
use poisson::{Builder, Type, algorithm::Ebeida};
use rand::{SeedableRng, rngs::SmallRng};
use workloads::points::poisson::{Domain, PoissonSpec, Spacing, ball, poisson_disk};
use workloads::points::quality::largest_hole;

const RUNS: u64 = 5;
/// Distances in space at which the crate makes hundreds of points in a second or two.
const WIDE: [f64; 5] = [0.4, 0.3, 0.2, 0.15, 0.12];

/// The median of points per second, and the points of the last run.
fn measured<const D: usize>(mut make: impl FnMut(u64) -> Vec<[f64; D]>) -> (f64, Vec<[f64; D]>) {
    let (mut rates, mut last) = (Vec::new(), Vec::new());
    for seed in 1..=RUNS {
        let started = ProcessTime::now();
        last = make(seed);
        rates.push(last.len() as f64 / started.elapsed().as_secs_f64());
    }
    rates.sort_by(f64::total_cmp);
    (rates[rates.len() / 2], last)
}

fn print<const D: usize>(
    name: &str,
    radius: f64,
    (rate, points): (f64, Vec<[f64; D]>),
    domain: Domain,
    ours: f64,
) {
    let density = points.len() as f64 * ball(D) * radius.powi(D as i32);
    let hole = largest_hole(&points, domain).radius / radius;
    println!(
        "{D}D r {radius:<6} {domain:?} {name:<8} {:>8} points {rate:>9.0}/s  density {density:.4}  hole {hole:.5} r  ours is {:.1} x",
        points.len(),
        ours / rate
    );
}

fn ours<const D: usize>(radius: f64, domain: Domain) -> f64 {
    let make = |seed| {
        poisson_disk::<D>(&PoissonSpec { radius, domain, seed, spacing: Spacing::Double }).unwrap().points
    };
    let found = measured(make);
    let rate = found.0;
    print("uncovered", radius, found, domain, rate);
    rate
}

fn kind(domain: Domain) -> Type {
    // The crate's own spelling.
    if domain == Domain::Torus { Type::Perioditic } else { Type::Normal }
}

fn flat(radius: f64, domain: Domain) {
    let own = ours::<2>(radius, domain);
    let make = |seed| {
        let builder = Builder::<f64, Vector2<f64>>::with_radius(0.5 * radius, kind(domain));
        let made = builder.build(SmallRng::seed_from_u64(seed), Ebeida).generate();
        made.into_iter().map(|p| [p.x, p.y]).collect()
    };
    print("crate", radius, measured(make), domain, own);
    scipy(2, radius, own);
}

fn deep(radius: f64, domain: Domain) {
    let own = ours::<3>(radius, domain);
    let make = |seed| {
        let builder = Builder::<f64, Vector3<f64>>::with_radius(0.5 * radius, kind(domain));
        let made = builder.build(SmallRng::seed_from_u64(seed), Ebeida).generate();
        made.into_iter().map(|p| [p.x, p.y, p.z]).collect()
    };
    print("crate", radius, measured(make), domain, own);
    scipy(3, radius, own);
}

/// Bridson's method as scipy has it; its points are no maximal ones.
fn scipy(dimensions: u32, radius: f64, ours: f64) {
    let Ok(python) = std::env::var("QUINTILE_SCIPY") else { return };
    let script = format!(
        "import time,numpy\nfrom scipy.stats import qmc\nr=[]\nfor s in range(3):\n a=time.process_time()\n \
         n=len(qmc.PoissonDisk(d={dimensions},radius={radius},ncandidates=30,rng=numpy.random.default_rng(s)).fill_space())\n \
         r.append(n/(time.process_time()-a))\nprint(sorted(r)[1])"
    );
    let said = Command::new(python).args(["-c", &script]).output().unwrap();
    let rate: f64 = String::from_utf8_lossy(&said.stdout).trim().parse().unwrap();
    println!("{dimensions}D r {radius:<6} Box   scipy    {rate:>25.0}/s  ours is {:.1} x", ours / rate);
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    if std::env::args().any(|word| word == "space") {
        return pool.install(|| WIDE.into_iter().for_each(|radius| deep(radius, Domain::Torus)));
    }
    pool.install(|| {
        for domain in [Domain::Torus, Domain::Box] {
            flat(0.01, domain);
            flat(0.0025, domain);
            deep(0.06, domain);
            deep(0.03, domain);
        }
        ours::<2>(0.000_8, Domain::Torus);
    });
}
