//! Rows VI-8 to VI-10: sampling.

use std::ops::RangeInclusive;

use activity::Event;
use pipeline::sampling::{HashedSamples, LensShape};
use workloads::points::job::{self, rasterized};
use workloads::points::poisson::{Domain, PoissonDisk, PoissonSpec, Spacing, ball, poisson_disk, saturation};
use workloads::points::quality::{ChiSquare, chi_square, closer_than, free_share, largest_hole, upper_tail};
use workloads::points::volume::{Covered, Torus, standard_mode};
use workloads::points::white::{
    Density, Named, Numbers, WhiteSpec, columns_for, counts, shares, white_noise,
};

use super::super::band::Cases;
use super::super::figure::{dots, line};
use super::super::row::{Row, numbers};
use super::super::verdict::Verdict;
use super::super::{Done, Figure};
use super::Task;
use super::settings::Darts;
use crate::reproduce::settings::{About, Form};
use run::GpuSpec;
use run::RunError;

fn failed(error: impl std::fmt::Display) -> RunError {
    RunError::Setting(format!("sampling: {error}"))
}

/// What a torus is found to hold, with how many standard errors count and integral are off.
struct Filled {
    found: Covered,
    inside: f64,
    expected: f64,
    integral: f64,
    off: [f64; 2],
}

fn fill(torus: &Torus, seed: u64, [side, samples]: [u32; 2]) -> Result<Filled, RunError> {
    let gpu = GpuSpec::load("reference")?;
    let samples =
        HashedSamples::new(seed, side, samples, LensShape::Square).ok_or_else(|| failed("samples"))?;
    let found = standard_mode(torus, side, &samples, &gpu.pipeline).map_err(failed)?;
    let (n, all, share) = (found.points.len() as f64, found.samples as f64, torus.volume());
    let from_axis = |[x, y, _]: &[f64; 3]| (x - 0.5).powi(2) + (y - 0.5).powi(2);
    let values: Vec<f64> = found.points.iter().map(from_axis).collect();
    let integral = values.iter().sum::<f64>() / all;
    let squares = values.iter().map(|value| value * value).sum::<f64>() / all;
    let off = [
        (n - all * share) / (all * share * (1.0 - share)).sqrt(),
        (integral - torus.moment()) / ((squares - integral * integral) / all).sqrt(),
    ];
    Ok(Filled { found, inside: n, expected: all * share, integral, off })
}

/// What the file says of the tolerance. It is not so, but files of settings are not changed once a number was computed with them.
const SAID_OF_TOLERANCE: &str =
    "The samples of a pixel are stratified, so that 3 standard errors of independent ones are generous.";

/// The limits of the file, with what the deviations show in the place of that sentence.
fn limits(said: &str, off: &[[f64; 2]]) -> String {
    let squares = || off.iter().flatten().map(|off| off * off);
    let rms = (squares().sum::<f64>() / squares().count() as f64).sqrt();
    let most = squares().fold(0.0, f64::max).sqrt();
    let found = format!(
        "The standard errors are those of independent samples; those of a pixel are stratified. The {} deviations of count and integral \
         found here have a root mean square of {rms:.2} standard errors, {most:.2} at most; of independent samples it is 1.",
        squares().count()
    );
    let kept = said.replace(SAID_OF_TOLERANCE, "");
    format!("{} {found}", kept.trim_end())
}

/// VI-8: as many samples in a torus as its volume says, and the integral over it.
pub(super) fn torus(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_8);
    let (row, form) = (with.settings, with.form);
    let torus = Torus { ring: *row.ring.get(form), tube: *row.tube.get(form) };
    let size = [*row.side_px.get(form), *row.samples.get(form)];
    let (most, least) = (*row.standard_errors.get(form), *row.least_samples.get(form));
    let filled = row.seed.all(form).iter().map(|&seed| fill(&torus, seed, size));
    let filled: Vec<Filled> = filled.collect::<Result<_, _>>()?;
    let farther = |one: &Filled| one.off.iter().fold(0.0, |most: f64, off| most.max(off.abs()));
    let mut tried = Cases::new("standard errors off, count or integral, whichever is farther", "seed alone");
    let judged = |(seed, one): (&u64, &Filled)| {
        (*seed, farther(one), farther(one) <= most && one.found.samples as f64 >= least)
    };
    tried.along("seed", row.seed.all(form).iter().zip(&filled).map(judged));
    let band = tried.band(row.seed.values()).ok_or_else(|| failed("no seed"))?;
    let first = &filled[0];
    let ours = format!(
        "{:.0} of {} samples, {:.0} expected ({:+.2} standard errors); the integral of the squared distance from the axis is {:.6}, exactly \
         {:.6} ({:+.2})",
        first.inside,
        first.found.samples,
        first.expected,
        first.off[0],
        first.integral,
        torus.moment(),
        first.off[1]
    );
    let facts = numbers([
        ("inside", first.inside),
        ("expected", first.expected),
        ("deviation_of_count", first.off[0]),
        ("integral", first.integral),
        ("deviation_of_integral", first.off[1]),
    ]);
    let ran = numbers([
        ("samples", filled.iter().map(|one| one.found.samples as f64).sum()),
        ("samples_covered_by_triangles", filled.iter().map(|one| one.found.covered as f64).sum()),
        ("samples_inside", filled.iter().map(|one| one.inside).sum()),
    ]);
    let figure = slice(&first.found);
    let off: Vec<[f64; 2]> = filled.iter().map(|one| one.off).collect();
    let about = About { limits: limits(&row.about.limits, &off), ..row.about.clone() };
    Ok(Done { row: Row { numbers: facts, ran, ..with.banded(&about, ours, band) }, figures: vec![figure] })
}

/// Figure 9: the samples near a plane through the axis.
fn slice(found: &Covered) -> Figure {
    let near = found.points.iter().filter(|[_, y, _]| (y - 0.5).abs() < 0.01);
    Figure::plane(
        "VI_fig9",
        [
            "Samples in a torus drawn as moving triangles (Paper VI, Figure 9)",
            "those within 0.01 of a plane through its axis",
        ],
        ["x", "t"],
        vec![dots("samples", near.map(|[x, _, t]| (*x, *t)).collect())],
    )
}

/// Maximal points and what is wrong with them: pairs that are closer than r, and whether a hole is larger.
struct Checked {
    points: usize,
    closer: u64,
    /// Largest hole over r.
    hole: f64,
    free: f64,
    density: f64,
    thin_voids: u64,
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
            thin_voids: found.thin_regions,
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
fn thrown(row: &Darts, form: Form) -> Result<(job::Rasterized, PoissonDisk<3>), RunError> {
    let options =
        job::Options { radius: *row.radius_2d.get(form), rounds: *row.rounds.get(form), periodic: true };
    let size = [*row.side_px.get(form), *row.samples.get(form)];
    let flat =
        rasterized(options, size[0], size[1], *row.seed.get(form), &GpuSpec::load("reference")?.pipeline)?;
    let radius = *row.radius_3d.get(form);
    let spec =
        PoissonSpec { radius, domain: Domain::Torus, seed: *row.seed.get(form), spacing: Spacing::Double };
    Ok((flat, poisson_disk::<3>(&spec).map_err(failed)?))
}

/// VI-9: dart throwing in two and three dimensions.
pub(super) fn darts(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_9);
    let (row, form) = (with.settings, with.form);
    let (flat, deep) = thrown(row, form)?;
    let places = *row.places.get(form);
    let in_plane = Checked::of(&flat.found, *row.radius_2d.get(form), places);
    let in_space = Checked::of(&deep, *row.radius_3d.get(form), places);
    let holds = in_plane.is_maximal() && in_space.is_maximal() && flat.drawn > 0;
    let ours = format!(
        "2D, {} of the points from {} samples that hit rasterized voids in {} passes: {}; 3D, thrown on the CPU: {}",
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
        ("thin_voids", (in_plane.thin_voids + in_space.thin_voids) as f64),
    ]);
    let ran = numbers([
        ("passes", f64::from(flat.passes)),
        ("triangles", flat.triangles as f64),
        ("samples_tested", flat.counts[Event::SamplesTested] as f64),
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
    Ok(Done { row: Row { numbers: facts, ran, ..made }, figures: vec![figure] })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::paper6::settings::Settings;
    use crate::reproduce::settings::load;

    /// The committed file calls the tolerance generous; what is printed are the deviations.
    #[test]
    fn the_tolerance_is_not_called_generous() {
        let (settings, _) = load::<Settings>(None).unwrap();
        let file = &settings.vi_8.about.limits;
        assert!(file.contains(SAID_OF_TOLERANCE));
        let text = limits(file, &[[0.6, -0.8], [1.0, -2.0]]);
        assert!(!text.contains("generous") && text.starts_with("Standard mode, in x, y and t"), "{text}");
        assert!(text.contains("The 4 deviations") && text.contains("root mean square of 1.22"), "{text}");
        assert!(text.contains("2.00 at most"), "{text}");
    }
}
