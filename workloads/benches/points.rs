//! Points per second of CPU time: maximal Poisson-disk points beside their rivals.
#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run may as well panic")]
use cpu_time::ProcessTime;
use rand::SeedableRng;
use workloads::points::poisson::*;
fn one<const D: usize>(count: f64) {
    let radius = radius_for(count, D);
    for seed in 1..4 {
        let spec = PoissonSpec { radius, domain: Domain::Torus, seed, spacing: Spacing::Double };
        let start = ProcessTime::now();
        let found = poisson_disk::<D>(&spec).unwrap();
        let s = start.elapsed().as_secs_f64();
        let n = found.points.len() as f64;
        println!(
            "{D}D n={n} {s:.3}s {:.0}/s density {:.4} darts/pt {:.2} voids/pt {:.2} levels {} thin {}",
            n / s,
            n * ball(D) * radius.powi(D as i32),
            found.darts as f64 / n,
            found.voids as f64 / n,
            found.levels,
            found.thin_voids
        );
    }
}
fn crate_poisson(count: f64) {
    let radius = radius_for(count, 2);
    for periodic in [poisson::Type::Normal, poisson::Type::Perioditic] {
        let rng = rand::rngs::SmallRng::seed_from_u64(1);
        let start = ProcessTime::now();
        let found = poisson::Builder::<f64, nalgebra::Vector2<f64>>::with_radius(radius / 2.0, periodic)
            .build(rng, poisson::algorithm::Ebeida)
            .generate();
        let s = start.elapsed().as_secs_f64();
        println!("poisson crate {periodic:?} n={} {:.0}/s", found.len(), found.len() as f64 / s);
    }
}
fn main() {
    if std::env::args().any(|a| a == "--rival") {
        crate_poisson(1e4);
        crate_poisson(1e5);
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        for _ in 0..5 {
            one::<2>(1e5);
        }
        if std::env::args().any(|a| a == "--short") {
            return;
        }
        one::<2>(1e6);
        one::<3>(1e5);
    });
    if std::env::args().any(|a| a == "--rival") {
        crate_poisson(1e4);
        crate_poisson(1e5);
    }
}
