//! Points of every method, how fast they came and how good they are.

use cpu_time::ThreadTime;
use serde::Serialize;
use workloads::points::poisson::{Domain, PoissonError, PoissonSpec, Spacing, ball, poisson_disk};
use workloads::points::quality::{Spectrum, closer_than, free_share, largest_hole, least_distance};
use workloads::points::rivals::{bridson, plain_darts};

use super::Effort;
use output::progress::Bar;

/// One method.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// In how many dimensions.
    pub dimensions: usize,
    /// Its name.
    pub method: &'static str,
    /// How long it may go on: misses in a row, or candidates around a point; 0 where it ends by itself.
    pub effort: u64,
    /// Least distance asked for.
    pub radius: f64,
    /// How many points there are.
    pub points: usize,
    /// Of one thread's CPU time.
    pub points_per_s: f64,
    /// Share of the domain covered by balls of diameter r.
    pub packing_density: f64,
    /// Pairs closer than r.
    pub closer_pairs: u64,
    /// Least distance over r.
    pub least_over_r: f64,
    /// Radius of the largest hole over r.
    pub hole_over_r: f64,
    /// Share of the domain where another point would fit.
    pub free_share: f64,
    /// Mean power below half the rate of points.
    pub low_power: f64,
    /// Frequency, in units of that rate, and power of the peak.
    pub peak: (f64, f64),
    /// Power over frequency.
    #[serde(skip)]
    pub spectrum: Vec<(f64, f64)>,
}

/// The name of the method of [`workloads::points::poisson`].
pub(super) const VOIDS: &str = "voids";
const BRIDSON: &str = "bridson";
const PLAIN: &str = "plain";

/// Methods with their efforts.
const METHODS: [(&str, u64); 6] =
    [(VOIDS, 0), (BRIDSON, 10), (BRIDSON, 30), (PLAIN, 100), (PLAIN, 1000), (PLAIN, 10_000)];

fn points<const D: usize>(
    (method, effort): (&str, u64),
    spec: &PoissonSpec,
) -> Result<Vec<[f64; D]>, PoissonError> {
    match method {
        BRIDSON => bridson(spec, effort as u32),
        PLAIN => plain_darts(spec, effort),
        _ => poisson_disk(spec).map(|found| found.points),
    }
}

/// Every method at one least distance on the torus.
pub(super) fn rows<const D: usize>(
    effort: &Effort,
    radius: f64,
    bar: &Bar,
) -> Result<Vec<Row>, PoissonError> {
    let spec = |seed| PoissonSpec { radius, domain: Domain::Torus, seed, spacing: Spacing::Double };
    let row = |method: (&'static str, u64)| {
        // The first is for the caches.
        points::<D>(method, &spec(0))?;
        let (mut sets, mut rates) = (Vec::new(), Vec::new());
        for seed in 1..=effort.seeds {
            let started = ThreadTime::now();
            let set = one_thread(|| points::<D>(method, &spec(seed)))?;
            rates.push(set.len() as f64 / started.elapsed().as_secs_f64());
            sets.push(set);
        }
        bar.inc();
        rates.sort_by(f64::total_cmp);
        Ok(judged(method, radius, &sets, rates[rates.len() / 2], effort))
    };
    METHODS.into_iter().map(row).collect()
}

/// Does something on this thread alone.
fn one_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
    match pool {
        Ok(pool) => pool.install(work),
        Err(_) => work(),
    }
}

fn judged<const D: usize>(
    (method, effort): (&'static str, u64),
    radius: f64,
    sets: &[Vec<[f64; D]>],
    points_per_s: f64,
    asked: &Effort,
) -> Row {
    let (set, torus) = (&sets[0], Domain::Torus);
    let rate = (set.len() as f64).powf(1.0 / D as f64);
    let most = (3.0 * rate).min(if D == 2 { 160.0 } else { 40.0 }) as usize;
    let spectra: Vec<Spectrum> = sets.iter().map(|set| Spectrum::new(set, most)).collect();
    let spectrum = Spectrum::mean(&spectra);
    Row {
        dimensions: D,
        method,
        effort,
        radius,
        points: set.len(),
        points_per_s,
        packing_density: set.len() as f64 * ball(D) * radius.powi(D as i32),
        closer_pairs: closer_than(set, radius, torus),
        least_over_r: least_distance(set, torus) / radius,
        hole_over_r: largest_hole(set, torus).radius / radius,
        free_share: free_share(set, radius, torus, asked.darts),
        low_power: spectrum.low(),
        peak: spectrum.peak(),
        spectrum: spectrum.curve(),
    }
}
