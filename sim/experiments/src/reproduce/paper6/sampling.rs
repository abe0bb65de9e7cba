//! Rows VI-9 and VI-10: points by darts, and points that follow a density.

use pipeline::FrameReport;
use std::ops::RangeInclusive;

use activity::Event;
use workloads::points::job::{self, rasterized};
use workloads::points::poisson::{Domain, PoissonDisk, PoissonSpec, Spacing, ball, poisson_disk, saturation};
use workloads::points::quality::{ChiSquare, chi_square, closer_than, free_share, largest_hole, upper_tail};
use workloads::points::white::{
    Density, Named, Numbers, WhiteSpec, columns_for, counts, shares, white_noise,
};

use super::super::band::Cases;
use super::super::figure::{dots, line};
use super::super::row::{Row, numbers};
use super::super::verdict::Verdict;
use super::super::{Done, Figure};
use super::Task;
use super::image_figures::balls;
use super::settings::Darts;
use crate::reproduce::settings::Form;
use run::GpuSpec;
use run::RunError;

fn failed(error: impl std::fmt::Display) -> RunError {
    RunError::Setting(format!("sampling: {error}"))
}

/// Maximal points and what is wrong with them: pairs that are closer than r, and whether a hole is larger.
struct Checked {
    points: usize,
    closer: u64,
    /// Largest hole over r.
    hole: f64,
    free: f64,
    density: f64,
    thin_regions: u64,
}

impl Checked {
    fn of<const D: usize>(found: &PoissonDisk<D>, radius: f64, places: u64) -> Self {
        let (points, torus) = (&found.points, Domain::Torus);
        Self {
            points: points.len(),
            closer: closer_than(points, radius, torus),
            hole: largest_hole(points, torus).radius / radius,
            free: free_share(points, radius, torus, places),
            density: points.len() as f64 * ball(D) * radius.powi(D as i32),
            thin_regions: found.thin_regions,
        }
    }

    fn is_maximal(&self) -> bool {
        self.points > 0 && self.closer == 0 && self.hole <= 1.0 + 1e-12 && self.free == 0.0
    }

    fn text(&self) -> String {
        format!(
            "{} points, {} pairs closer than r, largest hole {:.9} r, packing density {:.4}",
            self.points, self.closer, self.hole, self.density
        )
    }
}

/// Darts in two dimensions, the first rounds of them rasterized, and in three.
fn thrown(row: &Darts, form: Form) -> Result<(job::Rasterized, FrameReport, PoissonDisk<3>), RunError> {
    let options =
        job::Options { radius: *row.radius_2d.get(form), rounds: *row.rounds.get(form), periodic: true };
    let size = [*row.side_px.get(form), *row.samples.get(form)];
    let (flat, work) =
        rasterized(options, size[0], size[1], *row.seed.get(form), &GpuSpec::load("reference")?.pipeline)?;
    let radius = *row.radius_3d.get(form);
    let spec =
        PoissonSpec { radius, domain: Domain::Torus, seed: *row.seed.get(form), spacing: Spacing::Double };
    Ok((flat, work, poisson_disk::<3>(&spec).map_err(failed)?))
}

/// VI-9: dart throwing in two and three dimensions.
pub(super) fn darts(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_9);
    let (row, form) = (with.settings, with.form);
    let (flat, work, deep) = thrown(row, form)?;
    let places = *row.places.get(form);
    let in_plane = Checked::of(&flat.found, *row.radius_2d.get(form), places);
    let in_space = Checked::of(&deep, *row.radius_3d.get(form), places);
    let holds = in_plane.is_maximal() && in_space.is_maximal() && flat.drawn > 0;
    let ours = format!(
        "2D, {} of the points from {} samples that hit rasterized uncovered regions in {} passes: {}; 3D, thrown on the CPU: {}",
        flat.drawn,
        flat.candidates,
        flat.passes,
        in_plane.text(),
        in_space.text()
    );
    let note = format!(
        "{} of {places} random places in the plane and {} in space are free; saturated random addition has densities {} and {}",
        libm::round(in_plane.free * places as f64),
        libm::round(in_space.free * places as f64),
        saturation(2),
        saturation(3)
    );
    let facts = numbers([
        ("points_2d", in_plane.points as f64),
        ("points_2d_from_samples", flat.drawn as f64),
        ("points_3d", in_space.points as f64),
        ("closer_pairs", (in_plane.closer + in_space.closer) as f64),
        ("hole_over_r_2d", in_plane.hole),
        ("hole_over_r_3d", in_space.hole),
        ("free_share", in_plane.free + in_space.free),
        ("packing_density_2d", in_plane.density),
        ("packing_density_3d", in_space.density),
        ("thin_regions", (in_plane.thin_regions + in_space.thin_regions) as f64),
    ]);
    let ran = numbers([
        ("passes", f64::from(flat.passes)),
        ("triangles", work.triangles() as f64),
        ("samples_tested", work.counts()[Event::SamplesTested] as f64),
        ("samples_hit", flat.candidates as f64),
    ]);
    let radius = *row.radius_2d.get(form);
    let shown = flat.found.points.iter().filter(|[x, y]| *x < 40.0 * radius && *y < 20.0 * radius);
    let figure = Figure::plane(
        "VI_fig11",
        [
            "Maximal points that keep their distance (Paper VI, Figure 11)",
            &format!("a corner of the unit square, r = {radius}"),
        ],
        ["x", "y"],
        vec![dots("points", shown.map(|[x, y]| (*x, *y)).collect())],
    );
    let made = with.row(&row.about, (ours, Verdict::of(holds), note));
    let in_cube = balls(&deep.points, *row.radius_3d.get(form))?;
    Ok(Done { row: Row { numbers: facts, ran, ..made }, figures: vec![figure, in_cube] })
}

/// A p within these is that of white noise.
type Fits = RangeInclusive<f64>;

/// Chi-square of sets of points by different seeds.
struct Tested(Vec<ChiSquare>);

impl Tested {
    /// Sets of so many points each, seeds from 1 on.
    fn new<const D: usize>([sets, points, cells]: [u64; 3], numbers: Numbers) -> Result<Self, RunError> {
        let density: &dyn Density<D> = &Named::Gauss;
        let expected = shares(density, cells, 8);
        let one = |seed| {
            let spec = WhiteSpec { count: points as usize, seed, across: columns_for(D), numbers };
            let points = white_noise(density, &spec).map_err(failed)?.points;
            Ok::<ChiSquare, RunError>(chi_square(&counts(&points, cells), &expected))
        };
        (1..=sets).map(one).collect::<Result<_, _>>().map(Self)
    }

    /// p of the first sets together.
    fn p(&self, sets: u64) -> f64 {
        let first = self.0.iter().take(sets as usize);
        let (statistic, freedom) =
            first.fold((0.0, 0), |(sum, freedom), set| (sum + set.statistic, freedom + set.freedom));
        upper_tail(statistic, freedom)
    }

    /// Sets whose own p is outside.
    fn outside(&self, fits: &Fits) -> usize {
        self.0.iter().filter(|set| !fits.contains(&set.p)).count()
    }
}

/// Independent candidates, or those of a low-discrepancy sequence, in 1D to 4D.
fn in_four(
    sets: u64,
    points: u64,
    cells: (u64, u64, u64, u64),
    numbers: Numbers,
) -> Result<[Tested; 4], RunError> {
    Ok([
        Tested::new::<1>([sets, points, cells.0], numbers)?,
        Tested::new::<2>([sets, points, cells.1], numbers)?,
        Tested::new::<3>([sets, points, cells.2], numbers)?,
        Tested::new::<4>([sets, points, cells.3], numbers)?,
    ])
}

/// VI-10: white noise follows a density in one to four dimensions.
pub(super) fn densities(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_10);
    let (row, form) = (with.settings, with.form);
    let (points, cells) = (*row.points.get(form), *row.cells.get(form));
    let fits = row.fits.get(form).0..=row.fits.get(form).1;
    let (base, all) = (*row.sets.get(form), row.sets.all(form));
    let most = all.iter().copied().max().unwrap_or(base);
    let own = in_four(most, points as u64, cells, Numbers::Independent)?;
    let even = in_four(most, points as u64, cells, Numbers::LowDiscrepancy)?;
    let p = |of: &[Tested; 4], sets: u64| of.each_ref().map(|tested| tested.p(sets));
    let four = |p: [f64; 4]| p.map(|p| format!("{p:.4}")).join(", ");
    // The p that is nearest to either end of the range, by its distance from one half.
    let farthest = |p: [f64; 4]| p.into_iter().max_by(|a, b| (a - 0.5).abs().total_cmp(&(b - 0.5).abs()));
    let mut tried = Cases::new("p farthest from one half", "sets alone");
    let judged = |&sets: &u64| {
        let p = p(&own, sets);
        (sets, farthest(p).unwrap_or(f64::NAN), p.iter().all(|p| fits.contains(p)))
    };
    tried.along("sets", all.iter().map(judged));
    let band = tried.band(row.sets.values()).ok_or_else(|| failed("no set"))?;
    let tests = 4 * most;
    let ours = format!(
        "chi-square of {points} points of a bell a set, 1D to 4D: p = {} for {base} sets together, {} for one; {} of the {tests} sets alone are \
         outside, {:.1} by chance",
        four(p(&own, base)),
        four(p(&own, 1)),
        own.iter().map(|tested| tested.outside(&fits)).sum::<usize>(),
        (1.0 - (fits.end() - fits.start())) * tests as f64
    );
    let made = with.banded(&row.about, ours, band);
    let note = format!(
        "{}. Candidates of a low-discrepancy sequence, as the sample tables of the rasterizer are, give p = {}: near 1 they fit better than white \
         noise would, near 0 worse",
        made.note,
        four(p(&even, base))
    );
    let [pooled, single] = [p(&own, base), p(&own, 1)];
    let facts = numbers([
        ("p_1d", pooled[0]),
        ("p_2d", pooled[1]),
        ("p_3d", pooled[2]),
        ("p_4d", pooled[3]),
        ("p_1d_one_set", single[0]),
        ("p_2d_one_set", single[1]),
        ("p_3d_one_set", single[2]),
        ("p_4d_one_set", single[3]),
    ]);
    let ran = numbers([("sets", tests as f64), ("points", (tests * points as u64) as f64)]);
    Ok(Done { row: Row { numbers: facts, ran, note, ..made }, figures: vec![histogram(points)?] })
}

/// Figure 12: points on a line against the density.
fn histogram(count: usize) -> Result<Figure, RunError> {
    const BINS: u64 = 100;
    let density: &dyn Density<1> = &Named::Gauss;
    let spec = WhiteSpec { count, seed: 1, across: 64, numbers: Numbers::Independent };
    let points = white_noise(density, &spec).map_err(failed)?.points;
    let shares = shares(density, BINS, 16);
    let whole: f64 = shares.iter().sum();
    let place = |bin: usize| (bin as f64 + 0.5) / BINS as f64;
    let expected = shares.iter().enumerate().map(|(bin, share)| (place(bin), share / whole * count as f64));
    let found = counts(&points, BINS).into_iter().enumerate().map(|(bin, n)| (place(bin), n as f64));
    Ok(Figure::lines(
        "VI_fig12",
        "Points that follow a density (Paper VI, Figure 12)",
        &format!("{count} points in {BINS} bins"),
        [("x", ""), ("points", "")],
        vec![line("density", expected.collect()), dots("points", found.collect())],
    ))
}
