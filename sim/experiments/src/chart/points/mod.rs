//! `quintile chart points`: quality of Poisson disk points over points per second, spectra, and failure modes.
//!
//! Times are CPU times of one thread.

use cpu_time::ThreadTime;
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::terminal::{Bar, Progress};
use serde::Serialize;
use workloads::points::MAX_THIN_PER_POINT;
use workloads::points::poisson::{Domain, PoissonError, PoissonSpec, Spacing, ball, poisson_disk};
use workloads::points::quality::{
    Spectrum, chi_square, closer_than, free_share, largest_hole, least_distance,
};
use workloads::points::white::{
    Density, NamedDensity, Numbers, WhiteError, WhiteSpec, counts, shares, white_noise,
};
use workloads::points::{bridson, plain_darts};

use crate::study::table::{Sheet, TableBuilder, count, fixed, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError};
use workloads::points::job::{MAX_CANDIDATES_PER_POINT, MIN_DRAWN_SHARE};

mod drawn;
pub use drawn::{DrawnRow, Weak};

/// Effort of the measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PointsEffort {
    /// Least distance in the plane and in space.
    pub radius: [f64; 2],
    /// Places tried to find what is still free.
    pub darts: u64,
    /// Points of other seeds that a spectrum is the mean of.
    pub seeds: u64,
    /// Numbers in a unit of length get finer up to 2 to this power, from the fewest that the least distance
    /// of that sweep may have.
    pub finest_bits: u32,
    /// Points that follow a density.
    pub white: usize,
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct PointsChart {
    /// Effort of the measurement.
    pub effort: PointsEffort,
    /// Dimension by dimension, method by method.
    pub rows: Vec<PointsRow>,
    /// Uncovered regions thinner than an ulp.
    pub coarse: Vec<CoarsePoints>,
    /// Candidates for a point that follows a density.
    pub columns: Vec<Columns>,
    /// Rasterization beside the CPU sampler.
    pub drawn: Vec<DrawnRow>,
    /// Share of darts from passes, over rounds.
    pub rounds: Vec<Weak>,
    /// Candidates for a point of noise, over points.
    pub rejected: Vec<Weak>,
}

impl Study for PointsChart {
    const NAME: &'static str = "points";
    const ABOUT: &'static str =
        "Points of all kinds: quality over points a second, spectra, and where it fails";
    const PICTURES: &'static [&'static str] =
        &["points_quality", "points_spectra", "points_failures", "points_drawn"];
    const FILES: &'static [&'static str] = &["points.csv", "points_drawn.csv", "points.json"];

    type Effort = PointsEffort;
    const FULL: PointsEffort =
        PointsEffort { radius: [0.01, 0.06], darts: 1_000_000, seeds: 4, finest_bits: 26, white: 200_000 };
    const QUICK: PointsEffort =
        PointsEffort { radius: [0.025, 0.1], darts: 100_000, seeds: 2, finest_bits: 22, white: 20_000 };

    fn measure(effort: PointsEffort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let bar = progress.bar("points", 16);
        let [plane, space] = effort.radius;
        let mut rows = measured::<2>(&effort, plane, &bar).map_err(StudyError::pipeline)?;
        rows.extend(measured::<3>(&effort, space, &bar).map_err(StudyError::pipeline)?);
        let coarse = coarse(&effort).map_err(StudyError::pipeline)?;
        bar.inc();
        let columns = columns(&effort).map_err(StudyError::pipeline)?;
        bar.inc();
        let drawn = drawn::rows(&effort)?;
        bar.inc();
        let (rounds, rejected) = (drawn::rounds(&effort)?, drawn::rejected(&effort)?);
        bar.inc();
        Ok(Self { effort, rows, coarse, columns, drawn, rounds, rejected })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let [plane, space] = self.effort.radius;
        let subject = format!("torus, r {plane} in the plane and {space} in space; CPU time of one thread");
        to.chart("points_quality", ["Largest hole and free share over speed", &subject], self.quality())?;
        to.chart("points_spectra", ["Power over frequency, all directions", &subject], self.spectra())?;
        let subject = "points of the plane that keep their distance, on ever coarser grids of numbers (marked: points-thin-regions), and candidates for points that follow a density";
        to.chart("points_failures", ["Where points fail", subject], self.failures())?;
        let subject = "a frame of the workload sampling on the reference GPU; the CPU sampler on one thread; marked: a run warns";
        to.chart("points_drawn", ["Points by rasterization and on the CPU", subject], self.by_rasterization())
    }

    fn tables(&self) -> Vec<Sheet> {
        let free = |free_share: f64| format!("{free_share:.1e}");
        let rows = TableBuilder::of(&self.rows)
            .column("dimensions", "D", |row| row.dimensions, plain)
            .data("method", |row| row.method)
            .data("effort", |row| row.effort)
            .shown("method", |row| row.name(), plain)
            .column("points", "points", |row| row.points, count)
            .column("points_per_s", "points/s", |row| row.points_per_s, |per_s| count(per_s.round() as u64))
            .column("packing_density", "density", |row| row.packing_density, fixed(4))
            .data("closer_pairs", |row| row.closer_pairs)
            .detail("closer", |row| row.closer_pairs, plain)
            .data("least_over_r", |row| row.least_over_r)
            .column("hole_over_r", "hole / r", |row| row.hole_over_r, fixed(5))
            .column("free_share", "free share", |row| row.free_share, free)
            .data("low_power", |row| row.low_power)
            .detail("low", |row| row.low_power, fixed(3))
            .data("peak_frequency", |row| row.peak.0)
            .column("peak_power", "peak", |row| row.peak.1, fixed(2))
            .detail("at", |row| row.peak.0, fixed(2))
            .csv("points.csv");
        let coarse = TableBuilder::of(&self.coarse)
            .shown("r in spacings of numbers", |c| c.radius_ulp, fixed(0))
            .shown("points", |c| c.points, count)
            .shown("thin regions", |c| c.thin_regions, count)
            .shown("hole beyond r", |c| c.beyond, |beyond| format!("{beyond:.1e} r"));
        let columns = TableBuilder::of(&self.columns)
            .detail("D", |c| c.dimensions, plain)
            .detail("columns", |c| c.across, plain)
            .detail("candidates a point", |c| c.candidates_each, fixed(3))
            .detail("p", |c| c.p, fixed(3))
            .detail("p, low discrepancy", |c| c.p_low_discrepancy, fixed(4));
        let drawn = TableBuilder::of(&self.drawn)
            .column("kind", "points", |row| row.kind, plain)
            .column("dimensions", "D", |row| row.dimensions, plain)
            .column("points", "number", |row| row.points, count)
            .column("triangles", "triangles", |row| row.triangles, count)
            .column("shader_ops", "shader operations", |row| row.shader_ops, count)
            .column("frame_s", "frame (s)", |row| row.frame_s, |s| format!("{s:.2e}"))
            .column("frame_j", "frame (J)", |row| row.frame_j, |j| format!("{j:.2e}"))
            .column("cpu_s", "CPU (s)", |row| row.cpu_s, |s| format!("{s:.2e}"))
            .column("error", "error", |row| row.error, fixed(4))
            .column("cpu_error", "error, CPU", |row| row.cpu_error, fixed(4))
            .csv("points_drawn.csv");
        vec![rows.sheet(), coarse.sheet(), columns.sheet(), drawn.sheet()]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let both = |row: &PointsRow| {
            let cost = Metric::new("CPU time of a million points", "s", 1e6 / row.points_per_s);
            let errors = [
                Metric::new("largest hole beyond r", "r", (row.hole_over_r - 1.0).max(0.0)),
                Metric::new("share where a point would fit", "", row.free_share),
            ];
            let level = if row.effort == 0 { String::new() } else { format!("effort {}", row.effort) };
            let subject = format!("points that keep their distance ({}D)", row.dimensions);
            errors.map(|error| {
                TradeoffPoint::new(subject.clone(), [row.method, &level], [error.beside(0.0), cost])
            })
        };
        self.rows.iter().flat_map(both).collect()
    }
}

impl PointsRow {
    /// Method and effort.
    fn name(&self) -> String {
        if self.effort == 0 { self.method.to_owned() } else { format!("{} {}", self.method, self.effort) }
    }
}

fn long_name(method: &str) -> &str {
    match method {
        "bridson" => "Bridson, more and more candidates",
        "plain" => "plain darts, more and more misses",
        _ => "uncovered",
    }
}

impl PointsChart {
    /// Rows of a dimension, a method's beside each other.
    fn by_method(&self, dimensions: usize) -> impl Iterator<Item = &[PointsRow]> {
        let same = |a: &PointsRow, b: &PointsRow| (a.dimensions, a.method) == (b.dimensions, b.method);
        self.rows.chunk_by(same).filter(move |rows| rows[0].dimensions == dimensions)
    }

    fn quality(&self) -> Vec<ChartPanel> {
        let panel = |dimensions, up: &str, of: fn(&PointsRow) -> f64| {
            let curve = |rows: &[PointsRow]| {
                Series::curve(long_name(rows[0].method), rows.iter().map(|row| (row.points_per_s, of(row))))
            };
            let title = format!("{up}, {dimensions}D");
            ChartPanel::new(&title, ["points a second", up], self.by_method(dimensions).map(curve).collect())
        };
        vec![
            panel(2, "largest hole over r", |row| row.hole_over_r).on(Scale::Decades, Scale::Even),
            panel(3, "largest hole over r", |row| row.hole_over_r).on(Scale::Decades, Scale::Even),
            panel(2, "share where a point would fit", |row| row.free_share),
            panel(3, "share where a point would fit", |row| row.free_share),
        ]
    }

    fn spectra(&self) -> Vec<ChartPanel> {
        let panel = |dimensions| {
            let last = self.by_method(dimensions).filter_map(<[PointsRow]>::last);
            let curve = |row: &PointsRow| Series {
                note: format!("peak {:.2}", row.peak.1),
                ..Series::curve(row.method, row.spectrum.iter().copied())
            };
            let title = format!("{dimensions}D");
            ChartPanel::new(&title, ["frequency over rate of points", "power"], last.map(curve).collect())
        };
        vec![panel(2), panel(3)]
    }

    /// Cost a point of rasterization and of the CPU sampler, and where rasterization fails.
    fn by_rasterization(&self) -> Vec<ChartPanel> {
        let curve = |kind: &'static str, name: String, of: fn(&DrawnRow) -> f64| {
            let rows = self.drawn.iter().filter(move |row| row.kind == kind);
            Series::curve(name, rows.map(|row| (f64::from(row.dimensions), of(row))))
        };
        let pair = |kind: &'static str| {
            let of_frame = |row: &DrawnRow| row.frame_s / row.points.max(1) as f64;
            let of_cpu = |row: &DrawnRow| row.cpu_s / row.points.max(1) as f64;
            [curve(kind, format!("{kind}, drawn"), of_frame), curve(kind, format!("{kind}, CPU"), of_cpu)]
        };
        let cost = ["darts", "noise", "volume"].into_iter().flat_map(pair).collect();
        let over =
            |weak: &[Weak], name: &str| Series::curve(name, weak.iter().map(|weak| (weak.at, weak.value)));
        let few = self.rounds.iter().rfind(|weak| weak.value < MIN_DRAWN_SHARE);
        let loose = self.rejected.iter().rfind(|weak| weak.value > MAX_CANDIDATES_PER_POINT);
        vec![
            ChartPanel::new("cost of a point", ["dimensions", "time a point (s)"], cost)
                .on(Scale::Even, Scale::Decades),
            ChartPanel::new(
                "too few rounds of darts, 2D",
                ["rounds", "share of points from passes"],
                vec![over(&self.rounds, "darts, 2D")],
            )
            .failing(few.map(|weak| 0.0..weak.at), "a run warns"),
            ChartPanel::new(
                "too few points of noise, 4D",
                ["points on average", "candidates for a point"],
                vec![over(&self.rejected, "noise, 4D")],
            )
            .on(Scale::Decades, Scale::Decades)
            .failing(loose.map(|weak| 0.0..weak.at), "a run warns"),
        ]
    }

    /// Numbers too coarse for the disks, and columns too few for the density.
    fn failures(&self) -> Vec<ChartPanel> {
        let coarse = |title: &str, up: &str, of: fn(&CoarsePoints) -> f64| {
            let curve =
                Series::curve("uncovered regions, 2D", self.coarse.iter().map(|c| (c.radius_ulp, of(c))));
            let warned = |c: &&CoarsePoints| c.thin_regions as f64 > MAX_THIN_PER_POINT * c.points as f64;
            let last = self.coarse.iter().rfind(warned);
            ChartPanel::new(title, ["r in spacings of numbers", up], vec![curve])
                .on(Scale::Doublings, Scale::Decades)
                .failing(last.map(|c| 0.0..c.radius_ulp), "a run warns")
        };
        let of = |dimensions: usize| {
            let rows = self.columns.iter().filter(move |c| c.dimensions == dimensions);
            Series::curve(format!("{dimensions}D"), rows.map(|c| (f64::from(c.across), c.candidates_each)))
        };
        let columns = (1..=4).map(of).collect();
        vec![
            coarse("uncovered regions thinner than an ulp", "regions without a number, a point", |c| {
                c.thin_regions as f64 / c.points as f64
            }),
            coarse("what that costs: holes", "largest hole beyond r, share of r", |c| c.beyond),
            ChartPanel::new(
                "too few columns under a bell",
                ["columns along an axis", "candidates for a point"],
                columns,
            )
            .on(Scale::Doublings, Scale::Decades),
        ]
    }
}

/// One method.
#[derive(Clone, Debug, Serialize)]
pub struct PointsRow {
    /// In how many dimensions.
    pub dimensions: usize,
    /// Name of the method.
    pub method: &'static str,
    /// How long it may go on: misses in a row, or candidates around a point; 0 where it ends by itself.
    pub effort: u64,
    /// Least distance requested.
    pub radius: f64,
    /// Number of points.
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
const UNCOVERED: &str = "uncovered";
const BRIDSON: &str = "bridson";
const PLAIN_DARTS: &str = "plain";

/// Methods with their efforts.
const METHODS: [(&str, u64); 6] = [
    (UNCOVERED, 0),
    (BRIDSON, 10),
    (BRIDSON, 30),
    (PLAIN_DARTS, 100),
    (PLAIN_DARTS, 1000),
    (PLAIN_DARTS, 10_000),
];

fn points<const D: usize>(
    (method, effort): (&str, u64),
    spec: &PoissonSpec,
) -> Result<Vec<[f64; D]>, PoissonError> {
    match method {
        BRIDSON => bridson(spec, effort as u32),
        PLAIN_DARTS => plain_darts(spec, effort),
        _ => poisson_disk(spec).map(|found| found.points),
    }
}

/// Every method at one least distance on the torus.
fn measured<const D: usize>(
    effort: &PointsEffort,
    radius: f64,
    bar: &Bar,
) -> Result<Vec<PointsRow>, PoissonError> {
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
    amounts: &PointsEffort,
) -> PointsRow {
    let (set, torus) = (&sets[0], Domain::Torus);
    let rate = (set.len() as f64).powf(1.0 / D as f64);
    let most = (3.0 * rate).min(if D == 2 { 160.0 } else { 40.0 }) as usize;
    let spectra: Vec<Spectrum> = sets.iter().map(|set| Spectrum::new(set, most)).collect();
    let spectrum = Spectrum::mean(&spectra);
    PointsRow {
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
        free_share: free_share(set, radius, torus, amounts.darts),
        low_power: spectrum.low(),
        peak: spectrum.peak(),
        spectrum: spectrum.curve(),
    }
}

/// Poisson-disk points of the plane on coarse numbers.
#[derive(Clone, Debug, Serialize)]
pub struct CoarsePoints {
    /// Coordinates are multiples of 2 to the power of minus this.
    pub bits: u32,
    /// The least distance in spacings of numbers.
    pub radius_ulp: f64,
    /// Number of points.
    pub points: usize,
    /// Uncovered regions left, without a number in them.
    pub thin_regions: u64,
    /// How far the largest hole is beyond r, as a share of r.
    pub beyond: f64,
}

/// The least distance of the points on coarse numbers: what fails depends on how many numbers wide it is alone.
const COARSE_RADIUS: f64 = 1.0 / 64.0;
/// The coarsest numbers with which that can be requested.
const COARSEST_BITS: u32 = 12;

/// Finer and finer numbers, from disks on that are as few numbers wide as may be.
fn coarse(effort: &PointsEffort) -> Result<Vec<CoarsePoints>, PoissonError> {
    let each = (COARSEST_BITS..=effort.finest_bits).step_by(2).map(|bits| {
        let spacing = Spacing::Bits(bits);
        let spec = PoissonSpec { radius: COARSE_RADIUS, domain: Domain::Torus, seed: 1, spacing };
        let found = poisson_disk::<2>(&spec)?;
        let hole = largest_hole(&found.points, Domain::Torus);
        Ok(CoarsePoints {
            bits,
            radius_ulp: COARSE_RADIUS * spacing.per_unit(),
            points: found.points.len(),
            thin_regions: found.thin_regions,
            beyond: (hole.radius / COARSE_RADIUS - 1.0).max(0.0),
        })
    });
    each.collect()
}

/// Points that follow the bell.
#[derive(Clone, Debug, Serialize)]
pub struct Columns {
    /// In how many dimensions.
    pub dimensions: usize,
    /// Columns along an axis.
    pub across: u32,
    /// Candidates for a point.
    pub candidates_each: f64,
    /// Of chi-square, independent candidates.
    pub p: f64,
    /// The same of a low-discrepancy sequence, which fits too well.
    pub p_low_discrepancy: f64,
}

/// More and more columns in one to four dimensions.
fn columns(effort: &PointsEffort) -> Result<Vec<Columns>, WhiteError> {
    let mut all = of::<1>(effort, &[1, 4, 16, 64, 256, 1024], 64)?;
    all.extend(of::<2>(effort, &[1, 4, 16, 64, 256], 24)?);
    all.extend(of::<3>(effort, &[1, 4, 8, 16, 32], 8)?);
    all.extend(of::<4>(effort, &[1, 2, 4, 8, 12], 4)?);
    Ok(all)
}

fn of<const D: usize>(effort: &PointsEffort, across: &[u32], cells: u64) -> Result<Vec<Columns>, WhiteError> {
    let bell: &dyn Density<D> = &NamedDensity::Gauss;
    let expected = shares(bell, cells, 8);
    let measure = |&across: &u32| {
        let spec = WhiteSpec { count: effort.white, seed: 1, across, numbers: Numbers::Independent };
        let found = white_noise(bell, &spec)?;
        let even = white_noise(bell, &WhiteSpec { numbers: Numbers::LowDiscrepancy, ..spec })?;
        let p = |points: &[[f64; D]]| chi_square(&counts(points, cells), &expected).p;
        Ok(Columns {
            dimensions: D,
            across,
            candidates_each: found.candidates as f64 / effort.white as f64,
            p: p(&found.points),
            p_low_discrepancy: p(&even.points),
        })
    };
    across.iter().map(measure).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    #[test]
    fn a_quick_chart_is_written_and_the_maximal_method_alone_is_maximal() {
        let effort =
            PointsEffort { radius: [0.06, 0.2], darts: 5000, seeds: 1, finest_bits: 16, white: 2000 };
        let (_folder, chart, _) = written::<PointsChart>(effort);
        for row in &chart.rows {
            let maximal = row.hole_over_r <= 1.0 + 1e-9;
            assert_eq!(maximal, row.method == UNCOVERED, "{row:?}");
            assert!(row.closer_pairs == 0 && row.points_per_s > 0.0, "{row:?}");
        }
        for row in &chart.drawn {
            let is_right = match row.kind {
                "darts" => row.error <= 1e-9 && row.cpu_error <= 1e-9,
                // Drawn samples are those of the CPU.
                "volume" => row.error == row.cpu_error,
                _ => (1e-4..0.9999).contains(&row.error),
            };
            assert!(is_right && row.frame_s > 0.0 && row.frame_j > 0.0 && row.points > 0, "{row:?}");
        }
        assert!(chart.rounds.is_sorted_by(|a, b| a.value <= b.value), "{:?}", chart.rounds);
    }
}
