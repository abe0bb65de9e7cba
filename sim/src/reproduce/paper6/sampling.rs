//! Rows VI-8 to VI-10: sampling (section 5).

use std::ops::RangeInclusive;

use pipeline::sampling::{HashedSamples, LensShape};
use workloads::points::poisson::{Domain, PoissonDisk, PoissonSpec, Spacing, ball, poisson_disk, saturation};
use workloads::points::quality::{ChiSquare, chi_square, closer_than, free_share, largest_hole, upper_tail};
use workloads::points::volume::{Covered, Torus, standard_mode};
use workloads::points::white::{
    Density, Named, Numbers, WhiteSpec, columns_for, counts, shares, white_noise,
};

use super::super::figure::{dots, line};
use super::super::row::{Kind, Row, Verdict, numbers};
use super::super::{Done, Effort, Figure};
use crate::gpu::GpuSpec;
use crate::output::progress::Progress;
use crate::run::RunError;

pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    let bar = progress.bar("sampling", 3);
    let quick = effort == Effort::QUICK;
    let mut done = Vec::new();
    for row in [torus, darts, densities] {
        done.push(row(quick)?);
        bar.inc();
    }
    Ok(done)
}

fn failed(error: impl std::fmt::Display) -> RunError {
    RunError::Setting(format!("sampling: {error}"))
}

/// Pixels across and samples in each: 1,048,576 samples.
const SIDE: u32 = 512;
const SAMPLES: u32 = 4;

/// VI-8: as many samples in a torus as its volume says, and the integral over it.
fn torus(_quick: bool) -> Result<Done, RunError> {
    let (torus, gpu) = (Torus::default(), GpuSpec::load("reference")?);
    let samples = HashedSamples::new(1, SIDE, SAMPLES, LensShape::Square).ok_or_else(|| failed("samples"))?;
    let found = standard_mode(&torus, SIDE, &samples, &gpu.pipeline).map_err(failed)?;
    let (n, all, share) = (found.points.len() as f64, found.samples as f64, torus.volume());
    let from_axis = |[x, y, _]: &[f64; 3]| (x - 0.5).powi(2) + (y - 0.5).powi(2);
    let values: Vec<f64> = found.points.iter().map(from_axis).collect();
    let integral = values.iter().sum::<f64>() / all;
    let squares = values.iter().map(|value| value * value).sum::<f64>() / all;
    let deviations = [
        (n - all * share) / (all * share * (1.0 - share)).sqrt(),
        (integral - torus.moment()) / ((squares - integral * integral) / all).sqrt(),
    ];
    let row = Row {
        id: "VI-8",
        kind: Kind::Number,
        claim: "E[N] = density x volume for a torus bounded by moving triangles",
        paper: "E[N] = rho V(S), and the integral by summing over the samples (Figure 9)",
        ours: format!(
            "{n:.0} of {all:.0} samples, {:.0} expected ({:+.2} standard errors); the integral of the squared distance from the axis is \
             {integral:.6}, exactly {:.6} ({:+.2})",
            all * share,
            deviations[0],
            torus.moment(),
            deviations[1]
        ),
        verdict: Verdict::of(deviations.iter().all(|d| d.abs() <= 3.0) && all >= 1e6),
        note: "holds within 3 standard errors of independent samples over at least 1e6 of them".to_owned(),
        numbers: numbers([
            ("samples", all),
            ("inside", n),
            ("covered_by_triangles", found.covered as f64),
            ("expected", all * share),
            ("deviation_of_count", deviations[0]),
            ("integral", integral),
            ("deviation_of_integral", deviations[1]),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    Ok(Done { row, figures: vec![slice(&found)] })
}

/// Figure 9: the samples near a plane through the axis.
fn slice(found: &Covered) -> Figure {
    let near = found.points.iter().filter(|[_, y, _]| (y - 0.5).abs() < 0.01);
    Figure::lines(
        "VI_fig9",
        "Samples in a torus drawn as moving triangles (Paper VI, Figure 9)",
        "those within 0.01 of a plane through its axis",
        [("x", ""), ("t", "")],
        vec![dots("samples", near.map(|[x, _, t]| (*x, *t)).collect())],
    )
}

/// Maximal points and what is wrong with them: pairs that are closer than r, and whether a hole is larger.
struct Checked<const D: usize> {
    found: PoissonDisk<D>,
    closer: u64,
    /// Largest hole over r.
    hole: f64,
    free: f64,
    density: f64,
}

fn checked<const D: usize>(radius: f64, tries: u64) -> Result<Checked<D>, RunError> {
    let spec = PoissonSpec { radius, domain: Domain::Torus, seed: 1, spacing: Spacing::Double };
    let found = poisson_disk::<D>(&spec).map_err(failed)?;
    let (points, torus) = (&found.points, Domain::Torus);
    Ok(Checked {
        closer: closer_than(points, radius, torus),
        hole: largest_hole(points, torus).radius / radius,
        free: free_share(points, radius, torus, tries),
        density: points.len() as f64 * ball(D) * radius.powi(D as i32),
        found,
    })
}

/// VI-9: dart throwing in two and three dimensions.
fn darts(quick: bool) -> Result<Done, RunError> {
    let (plane, space, tries) = if quick { (0.02, 0.1, 100_000) } else { (0.005, 0.04, 1_000_000) };
    let (flat, deep) = (checked::<2>(plane, tries)?, checked::<3>(space, tries)?);
    let good = |closer: u64, hole: f64, free: f64| closer == 0 && hole <= 1.0 + 1e-12 && free == 0.0;
    let holds = good(flat.closer, flat.hole, flat.free) && good(deep.closer, deep.hole, deep.free);
    let said = |points: usize, closer: u64, hole: f64, density: f64| {
        format!(
            "{points} points, {closer} pairs closer than r, largest hole {hole:.9} r, packing density {density:.4}"
        )
    };
    let row = Row {
        id: "VI-9",
        kind: Kind::Equality,
        claim: "dart throwing is maximal and keeps the minimum distance in 2D and 3D",
        paper: "when the active list is empty, no more points can be inserted (Figure 11)",
        ours: format!(
            "2D: {}; 3D: {}",
            said(flat.found.points.len(), flat.closer, flat.hole, flat.density),
            said(deep.found.points.len(), deep.closer, deep.hole, deep.density)
        ),
        verdict: Verdict::of(holds),
        note: format!(
            "holds with 0 pairs closer than r (compared exactly), no hole larger than r and none of {tries} random places free; saturated \
             random addition has densities {} and {}",
            saturation(2),
            saturation(3)
        ),
        numbers: numbers([
            ("points_2d", flat.found.points.len() as f64),
            ("points_3d", deep.found.points.len() as f64),
            ("closer_pairs", (flat.closer + deep.closer) as f64),
            ("hole_over_r_2d", flat.hole),
            ("hole_over_r_3d", deep.hole),
            ("free_share", flat.free + deep.free),
            ("packing_density_2d", flat.density),
            ("packing_density_3d", deep.density),
            ("thin_voids", (flat.found.thin_voids + deep.found.thin_voids) as f64),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    let shown = flat.found.points.iter().filter(|[x, y]| *x < 40.0 * plane && *y < 20.0 * plane);
    let figure = Figure::lines(
        "VI_fig11",
        "Maximal points that keep their distance (Paper VI, Figure 11)",
        &format!("a corner of the unit square, r = {plane}"),
        [("x", ""), ("y", "")],
        vec![dots("points", shown.map(|[x, y]| (*x, *y)).collect())],
    );
    Ok(Done { row, figures: vec![figure] })
}

/// Sets of points by different seeds, tested together: a single test is outside of 0.01 to 0.99 by chance once in fifty.
const SETS: u64 = 16;

/// Chi-square of points that follow a density.
struct Fit {
    /// Of all sets together.
    p: f64,
    /// Sets whose own is outside of [`FITS`].
    outside: usize,
}

/// A p within these is that of white noise (claims.md).
const FITS: RangeInclusive<f64> = 0.01..=0.99;

/// The test of points that follow a density: independent candidates, and those of a low-discrepancy sequence.
fn fits<const D: usize>(count: usize, cells: u64) -> Result<[Fit; 2], RunError> {
    let density: &dyn Density<D> = &Named::Gauss;
    let expected = shares(density, cells, 8);
    let fit = |numbers| {
        let one = |seed| {
            let spec = WhiteSpec { count, seed, across: columns_for(D), numbers };
            let points = white_noise(density, &spec).map_err(failed)?.points;
            Ok(chi_square(&counts(&points, cells), &expected))
        };
        let sets = (1..=SETS).map(one).collect::<Result<Vec<ChiSquare>, RunError>>()?;
        let (statistic, freedom) =
            sets.iter().fold((0.0, 0), |(sum, freedom), set| (sum + set.statistic, freedom + set.freedom));
        let outside = sets.iter().filter(|set| !FITS.contains(&set.p)).count();
        Ok::<Fit, RunError>(Fit { p: upper_tail(statistic, freedom), outside })
    };
    Ok([fit(Numbers::Independent)?, fit(Numbers::LowDiscrepancy)?])
}

/// VI-10: white noise follows a density in one to four dimensions.
fn densities(quick: bool) -> Result<Done, RunError> {
    let count = if quick { 50_000 } else { 500_000 };
    let all = [fits::<1>(count, 64)?, fits::<2>(count, 24)?, fits::<3>(count, 8)?, fits::<4>(count, 4)?];
    let (own, even) = (all.each_ref().map(|[own, _]| own.p), all.each_ref().map(|[_, even]| even.p));
    let outside = |which: usize| all.iter().map(|fits| fits[which].outside).sum::<usize>();
    let four = |p: [f64; 4]| p.map(|p| format!("{p:.3}")).join(", ");
    let tests = 4 * SETS;
    let row = Row {
        id: "VI-10",
        kind: Kind::Number,
        claim: "adaptive white noise follows the density in 1D to 4D",
        paper: "the region under the density is sampled and projected (Figure 12)",
        ours: format!(
            "chi-square of {SETS} sets of {count} points of a bell, 1D to 4D: p = {}; {} of the {tests} sets alone are outside of 0.01 to 0.99",
            four(own),
            outside(0)
        ),
        verdict: Verdict::of(own.iter().all(|p| FITS.contains(p))),
        note: format!(
            "holds with every p of all sets together within 0.01 and 0.99; by chance {:.1} of {tests} are outside alone. Candidates of a \
             low-discrepancy sequence, as the sample tables of the rasterizer are, give p = {}, and {} outside: near 1 the points fit better \
             than white noise would",
            0.02 * tests as f64,
            four(even),
            outside(1)
        ),
        numbers: numbers([
            ("p_1d", own[0]),
            ("p_2d", own[1]),
            ("p_3d", own[2]),
            ("p_4d", own[3]),
            ("sets_outside", outside(0) as f64),
            ("p_1d_low_discrepancy", even[0]),
            ("p_2d_low_discrepancy", even[1]),
            ("p_3d_low_discrepancy", even[2]),
            ("p_4d_low_discrepancy", even[3]),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    Ok(Done { row, figures: vec![histogram(count)?] })
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
