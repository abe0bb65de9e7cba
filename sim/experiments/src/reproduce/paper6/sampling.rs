//! Rows VI-9 and VI-10: points by darts, and points that follow a density.

use std::ops::RangeInclusive;

use output::plot::{Paint, PlotMark, Series};
use pipeline::{Gpu, PipelineSpec};
use rayon::prelude::*;
use run::{GpuSpec, RunError};
use workloads::points::job::{Rasterized, rasterized};
use workloads::points::poisson::{
    Cube, Domain, PoissonDisk, PoissonSpec, Spacing, ball, poisson_disk, saturation,
};
use workloads::points::quality::{ChiSquare, chi_square, closer_than, free_share, largest_hole, upper_tail};
use workloads::points::white::{
    Density, NamedDensity, Numbers, WhiteSpec, columns_for, counts, shares, white_noise,
};
use workloads::points::{NoiseSpec, draw_noise};

use super::super::report::{dots, line};
use super::super::row::{self, Cases, ClaimRow, Verdict, numbers};
use super::super::{Done, Figure};
use super::Task;
use super::figures::balls_and_uncovered;
use super::settings::Darts;
use crate::reproduce::settings::Form;
use crate::study::Ran;

fn failed(error: impl std::fmt::Display) -> RunError {
    RunError::invalid("sampling", error)
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

/// Darts of which the first rounds are rasterized, and the points of the CPU sampler.
struct Thrown<const D: usize> {
    darts: Rasterized<D>,
    ran: Ran,
    cpu_points: usize,
}

impl<const D: usize> Thrown<D> {
    fn new(row: &Darts, radius: f64, form: Form) -> Result<Self, RunError> {
        let seed = *row.seed.get(form);
        let spec = PoissonSpec { radius, domain: Domain::Torus, seed, spacing: Spacing::Double };
        let hardware = GpuSpec::load("reference")?.pipeline;
        let (darts, work) = rasterized::<D>(&spec, *row.rounds.get(form), &hardware)?;
        let ran = Ran { fragments: darts.fragments, ..Ran::of(&work) };
        Ok(Self { darts, ran, cpu_points: poisson_disk::<D>(&spec).map_err(failed)?.points.len() })
    }

    fn text(&self, checked: &Checked) -> String {
        format!(
            "{D}D, {} of the points from {} candidates in rasterized uncovered regions in {} passes: {}; the CPU sampler alone has {} points",
            self.darts.drawn,
            self.darts.kept,
            self.darts.passes,
            checked.text(),
            self.cpu_points
        )
    }
}

/// VI-9: dart throwing in two and three dimensions.
pub(super) fn darts(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_9);
    let (row, form) = (with.settings, with.form);
    let flat = Thrown::<2>::new(row, *row.radius_2d.get(form), form)?;
    let deep = Thrown::<3>::new(row, *row.radius_3d.get(form), form)?;
    let places = *row.places.get(form);
    let in_plane = Checked::of(&flat.darts.found, *row.radius_2d.get(form), places);
    let in_space = Checked::of(&deep.darts.found, *row.radius_3d.get(form), places);
    let is_drawn = flat.darts.drawn > 0 && deep.darts.drawn > 0;
    let holds = in_plane.is_maximal() && in_space.is_maximal() && is_drawn;
    let ours = format!("{}; {}", flat.text(&in_plane), deep.text(&in_space));
    let note = format!(
        "{} of {places} random places in the plane and {} in space are free; saturated random addition has densities {} and {}",
        libm::round(in_plane.free * places as f64),
        libm::round(in_space.free * places as f64),
        saturation(2),
        saturation(3)
    );
    let facts = numbers([
        ("points_2d", in_plane.points as f64),
        ("points_2d_from_passes", flat.darts.drawn as f64),
        ("points_2d_of_cpu", flat.cpu_points as f64),
        ("points_3d", in_space.points as f64),
        ("points_3d_from_passes", deep.darts.drawn as f64),
        ("points_3d_of_cpu", deep.cpu_points as f64),
        ("closer_pairs", (in_plane.closer + in_space.closer) as f64),
        ("hole_over_r_2d", in_plane.hole),
        ("hole_over_r_3d", in_space.hole),
        ("free_share", in_plane.free + in_space.free),
        ("packing_density_2d", in_plane.density),
        ("packing_density_3d", in_space.density),
        ("thin_regions", (in_plane.thin_regions + in_space.thin_regions) as f64),
    ]);
    let mut ran = row::ran(&[flat.ran, deep.ran].into_iter().sum());
    let made = [flat.darts.candidates + deep.darts.candidates, flat.darts.kept + deep.darts.kept];
    ran.extend(numbers([("candidates", made[0] as f64), ("candidates_in_regions", made[1] as f64)]));
    let radius = *row.radius_2d.get(form);
    let is_shown = |[x, y]: &[f64; 2]| *x < 40.0 * radius && *y < 20.0 * radius;
    let shown =
        flat.darts.found.points.iter().filter(|point| is_shown(point) && !flat.darts.is_in_uncovered(point));
    let uncovered = flat.darts.uncovered.iter().filter(|region| is_shown(&region.low)).map(outline).collect();
    let figure = Figure::plane(
        "VI_fig11",
        [
            "Points that keep their distance, and uncovered regions (Paper VI, Figure 11)",
            &format!(
                "before the last of {} passes, in a corner of the unit square, r = {radius}",
                flat.darts.passes
            ),
        ],
        ["x", "y"],
        vec![
            Series::new("uncovered regions that the last pass draws", PlotMark::Faint(uncovered))
                .painted(Paint::Grey),
            dots("points", shown.map(|[x, y]| (*x, *y)).collect()),
        ],
    );
    let made = with.row(&row.about, (ours, Verdict::of(holds), note));
    let in_cube = balls_and_uncovered(&deep.darts, *row.radius_3d.get(form))?;
    Ok(Done { row: ClaimRow { numbers: facts, ran, ..made }, figures: vec![figure, in_cube] })
}

/// The outline of an uncovered region in the plane.
fn outline(region: &Cube<2>) -> Vec<(f64, f64)> {
    let ([x, y], side) = (region.low, region.side);
    [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side), (0.0, 0.0)]
        .map(|(right, up)| (x + right, y + up))
        .to_vec()
}

/// A p within these is that of white noise.
type Fits = RangeInclusive<f64>;

/// Chi-square of sets of points by different seeds, and the work of the passes that made them.
struct Tested {
    sets: Vec<ChiSquare>,
    ran: Ran,
    points: u64,
    candidates: u64,
}

impl Tested {
    /// Sets of so many points each on average, from columns that are drawn; seeds from 1 on.
    fn drawn<const D: usize>(
        [sets, points, cells]: [u64; 3],
        hardware: &PipelineSpec,
    ) -> Result<Self, RunError> {
        let expected = shares::<D>(&NamedDensity::Gauss, cells, 8);
        let one = |seed| {
            let spec = NoiseSpec { count: points as f64, seed, across: columns_for(D) };
            let mut gpu = Gpu::without_packets(hardware).map_err(failed)?;
            let found = draw_noise::<D>(&NamedDensity::Gauss, &spec, &mut gpu).map_err(failed)?;
            Ok::<Self, RunError>(Self {
                sets: vec![chi_square(&counts(&found.points, cells), &expected)],
                ran: Ran { fragments: found.fragments, ..Ran::of(&gpu.finish()) },
                points: found.points.len() as u64,
                candidates: found.candidates,
            })
        };
        let sets: Vec<Self> = (1..=sets).into_par_iter().map(one).collect::<Result<_, _>>()?;
        Ok(Self {
            ran: sets.iter().map(|set| set.ran).sum(),
            points: sets.iter().map(|set| set.points).sum(),
            candidates: sets.iter().map(|set| set.candidates).sum(),
            sets: sets.into_iter().flat_map(|set| set.sets).collect(),
        })
    }

    /// The same on the CPU, of so many points each.
    fn on_cpu<const D: usize>([sets, points, cells]: [u64; 3], numbers: Numbers) -> Result<Self, RunError> {
        let density: &dyn Density<D> = &NamedDensity::Gauss;
        let expected = shares(density, cells, 8);
        let one = |seed| {
            let spec = WhiteSpec { count: points as usize, seed, across: columns_for(D), numbers };
            let points = white_noise(density, &spec).map_err(failed)?.points;
            Ok::<ChiSquare, RunError>(chi_square(&counts(&points, cells), &expected))
        };
        let tests = (1..=sets).into_par_iter().map(one).collect::<Result<_, _>>()?;
        Ok(Self { sets: tests, ran: Ran::default(), points: sets * points, candidates: 0 })
    }

    /// p of the first sets together.
    fn p(&self, sets: u64) -> f64 {
        let first = self.sets.iter().take(sets as usize);
        let (statistic, freedom) =
            first.fold((0.0, 0), |(sum, freedom), set| (sum + set.statistic, freedom + set.freedom));
        upper_tail(statistic, freedom)
    }

    /// Sets whose own p is outside.
    fn outside(&self, fits: &Fits) -> usize {
        self.sets.iter().filter(|set| !fits.contains(&set.p)).count()
    }
}

/// Sets on the CPU in 1D to 4D: independent candidates, or those of a low-discrepancy sequence.
fn in_four(
    [sets, points]: [u64; 2],
    cells: (u64, u64, u64, u64),
    numbers: Numbers,
) -> Result<[Tested; 4], RunError> {
    Ok([
        Tested::on_cpu::<1>([sets, points, cells.0], numbers)?,
        Tested::on_cpu::<2>([sets, points, cells.1], numbers)?,
        Tested::on_cpu::<3>([sets, points, cells.2], numbers)?,
        Tested::on_cpu::<4>([sets, points, cells.3], numbers)?,
    ])
}

/// Sets that are drawn, in 1D to 4D.
fn drawn_in_four([sets, points]: [u64; 2], cells: (u64, u64, u64, u64)) -> Result<[Tested; 4], RunError> {
    let hardware = GpuSpec::load("reference")?.pipeline;
    Ok([
        Tested::drawn::<1>([sets, points, cells.0], &hardware)?,
        Tested::drawn::<2>([sets, points, cells.1], &hardware)?,
        Tested::drawn::<3>([sets, points, cells.2], &hardware)?,
        Tested::drawn::<4>([sets, points, cells.3], &hardware)?,
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
    let own = drawn_in_four([most, points as u64], cells)?;
    let cpu = in_four([most, points as u64], cells, Numbers::Independent)?;
    let even = in_four([most, points as u64], cells, Numbers::LowDiscrepancy)?;
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
    let band = tried.band(row.sets.values())?;
    let tests = 4 * most;
    let ours = format!(
        "chi-square of some {points} points of a bell a set, from drawn columns, 1D to 4D: p = {} for {base} sets together, {} for one; {} of the {tests} sets alone are \
         outside, {:.1} by chance",
        four(p(&own, base)),
        four(p(&own, 1)),
        own.iter().map(|tested| tested.outside(&fits)).sum::<usize>(),
        (1.0 - (fits.end() - fits.start())) * tests as f64
    );
    let made = with.banded(&row.about, ours, band);
    let note = format!(
        "{}. On the CPU independent candidates give p = {}. Those of a low-discrepancy sequence, as the sample tables of the rasterizer are, give \
         p = {}: near 1 they fit better than white noise would, near 0 worse",
        made.note,
        four(p(&cpu, base)),
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
    let sum = |of: fn(&Tested) -> u64| own.iter().map(of).sum::<u64>() as f64;
    let mut ran = row::ran(&own.iter().map(|tested| tested.ran).sum());
    ran.extend(numbers([
        ("sets", tests as f64),
        ("points", sum(|tested| tested.points)),
        ("candidates", sum(|tested| tested.candidates)),
    ]));
    Ok(Done { row: ClaimRow { numbers: facts, ran, note, ..made }, figures: vec![histogram(points)?] })
}

/// Figure 12: points on a line against the density.
fn histogram(count: usize) -> Result<Figure, RunError> {
    const BINS: u64 = 100;
    let density: &dyn Density<1> = &NamedDensity::Gauss;
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
