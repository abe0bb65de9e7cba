//! Row VI-8: samples in a torus that is drawn as moving triangles, and how far they scatter about what is
//! expected of them.

use pipeline::Lane;
use pipeline::sampling::{HashedSamples, LensShape};
use run::{GpuSpec, RunError};
use workloads::points::quality::upper_tail;
use workloads::points::volume::{Blurred, CoveredSamples, SamplePoint, Torus, every_sample, standard_mode};

use super::super::report::dots;
use super::super::row::{self, Cases, ClaimRow, NamedValue, numbers};
use super::super::{Done, Figure};
use super::Task;
use crate::study::Ran;

fn failed(error: impl std::fmt::Display) -> RunError {
    RunError::invalid("torus", error)
}

/// Samples found in a torus, and how many standard errors count and integral are off.
struct Filled {
    found: CoveredSamples,
    inside: f64,
    expected: f64,
    integral: f64,
    off: [f64; 2],
    ran: Ran,
    /// Samples that differ from those found by testing every one on the CPU.
    differing: usize,
}

fn from_axis([x, y, ..]: &SamplePoint) -> f64 {
    (x - 0.5).powi(2) + (y - 0.5).powi(2)
}

/// How many points are in one list alone, or in another place. Both are in the order of pixels.
fn differing(a: &[SamplePoint], b: &[SamplePoint]) -> usize {
    a.len().abs_diff(b.len()) + a.iter().zip(b).filter(|(a, b)| a != b).count()
}

/// A blurred disk in four or five dimensions.
struct Disk {
    dimensions: u32,
    count_off: f64,
    integral: f64,
    moment: f64,
    differing: usize,
    ran: Ran,
}

impl Disk {
    fn new(dimensions: u32, seed: u64, [side, samples]: [u32; 2]) -> Result<Self, RunError> {
        let disk = if dimensions == 4 { Blurred::FOUR } else { Blurred::FIVE };
        let gpu = GpuSpec::load("reference")?;
        let samples =
            HashedSamples::new(seed, side, samples, LensShape::Square).ok_or_else(|| failed("samples"))?;
        let (found, work) = standard_mode(&disk, side, &samples, &gpu.pipeline).map_err(failed)?;
        let (lane, all) = (Lane::default(), found.samples as f64);
        let sum: f64 = found.points.iter().map(|point| disk.from_axis(&lane, point)).sum();
        Ok(Self {
            dimensions,
            count_off: count_off(found.points.len() as f64, all, disk.volume()),
            integral: sum / all,
            moment: disk.moment(),
            differing: differing(&found.points, &every_sample(&disk, side, &samples)),
            ran: Ran::of(&work),
        })
    }

    fn text(&self) -> String {
        format!(
            "In {}D, a disk out of focus{}, the count is {:+.2} standard errors off and the integral {:.6}, exactly {:.6}",
            self.dimensions,
            if self.dimensions == 5 { " and in motion" } else { "" },
            self.count_off,
            self.integral,
            self.moment
        )
    }
}

/// How many standard errors a count is off, each of `all` independent samples being counted with the
/// probability `share`.
fn count_off(n: f64, all: f64, share: f64) -> f64 {
    (n - all * share) / (all * share * (1.0 - share)).sqrt()
}

impl Filled {
    fn new(torus: &Torus, seed: u64, [side, samples]: [u32; 2]) -> Result<Self, RunError> {
        let gpu = GpuSpec::load("reference")?;
        let samples =
            HashedSamples::new(seed, side, samples, LensShape::Square).ok_or_else(|| failed("samples"))?;
        let (found, work) = standard_mode(torus, side, &samples, &gpu.pipeline).map_err(failed)?;
        let differing = differing(&found.points, &every_sample(torus, side, &samples));
        let (n, all, share) = (found.points.len() as f64, found.samples as f64, torus.volume());
        let values: Vec<f64> = found.points.iter().map(from_axis).collect();
        let integral = values.iter().sum::<f64>() / all;
        let squares = values.iter().map(|value| value * value).sum::<f64>() / all;
        let integral_off = (integral - torus.moment()) / ((squares - integral * integral) / all).sqrt();
        let off = [count_off(n, all, share), integral_off];
        Ok(Self { found, inside: n, expected: all * share, integral, off, ran: Ran::of(&work), differing })
    }

    /// The farther of count and integral.
    fn farther(&self) -> f64 {
        self.off.iter().fold(0.0, |most: f64, off| most.max(off.abs()))
    }

    /// Deviations in the octants of the torus, its halves along x, y and t: of the count, and of the mean of
    /// the integrand among those counted. By symmetry each octant expects the same. Count and mean of
    /// independent samples are uncorrelated; count and integral are not.
    fn by_octant(&self, torus: &Torus) -> Vec<f64> {
        let mean = torus.moment() / torus.volume();
        let mut octants = [(0.0, 0.0, 0.0); 8];
        for point in &self.found.points {
            let [x, y, t, ..] = point.map(|at| usize::from(at >= 0.5));
            let (n, sum, squares) = &mut octants[4 * x + 2 * y + t];
            let off = from_axis(point) - mean;
            *n += 1.0;
            *sum += off;
            *squares += off * off;
        }
        let (all, share) = (self.found.samples as f64, torus.volume() / 8.0);
        let both = |(n, sum, squares): (f64, f64, f64)| [count_off(n, all, share), sum / squares.sqrt()];
        octants.into_iter().flat_map(both).collect()
    }
}

/// Uncorrelated deviations in standard errors of independent samples.
struct Scatter(Vec<f64>);

impl Scatter {
    fn squares(&self) -> f64 {
        self.0.iter().map(|off| off * off).sum()
    }

    /// Root mean square; near 1 for independent samples.
    fn rms(&self) -> f64 {
        (self.squares() / self.0.len() as f64).sqrt()
    }

    /// Probability that independent samples scatter as much or more.
    fn p(&self) -> f64 {
        upper_tail(self.squares(), self.0.len() as u64)
    }

    /// How many deviations are beyond so many standard errors.
    fn beyond(&self, errors: f64) -> usize {
        self.0.iter().filter(|off| off.abs() > errors).count()
    }

    /// How many of independent samples would be.
    fn by_chance(&self, errors: f64) -> f64 {
        self.0.len() as f64 * rarity(errors)
    }

    /// Whether it is no larger than that of independent samples, as rarely wrong as one deviation within `most`.
    fn is_of_independent(&self, most: f64) -> bool {
        self.p() >= rarity(most)
    }

    /// Conclusion for a tolerance of `most` standard errors.
    fn text(&self, most: f64) -> String {
        let meaning = if !self.is_of_independent(most) {
            "more than independent samples scatter".to_owned()
        } else if 1.0 - self.p() < rarity(most) {
            format!(
                "less than independent samples scatter, {most} of whose standard errors are {:.1} of these",
                most / self.rms()
            )
        } else {
            format!(
                "consistent with independent samples, so {most} standard errors are not a generous tolerance"
            )
        };
        let counts = [1.0, 2.0, 3.0].map(|errors| self.beyond(errors).to_string()).join(", ");
        let chance = [1.0, 2.0, 3.0].map(|errors| format!("{:.1}", self.by_chance(errors))).join(", ");
        format!(
            "The {} deviations of count and mean in the octants have a root mean square of {:.2} standard errors, where it is 1 for independent \
             samples (p = {:.3} for as much or more): {meaning}. Beyond 1, 2 and 3 standard errors are {counts}, by chance {chance}",
            self.0.len(),
            self.rms(),
            self.p()
        )
    }

    fn facts(&self) -> Vec<NamedValue> {
        numbers([
            ("deviations", self.0.len() as f64),
            ("scatter_in_standard_errors", self.rms()),
            ("p_of_scatter", self.p()),
            ("beyond_1_standard_error", self.beyond(1.0) as f64),
            ("beyond_2_standard_errors", self.beyond(2.0) as f64),
            ("beyond_3_standard_errors", self.beyond(3.0) as f64),
            ("by_chance_beyond_1", self.by_chance(1.0)),
            ("by_chance_beyond_2", self.by_chance(2.0)),
            ("by_chance_beyond_3", self.by_chance(3.0)),
        ])
    }
}

/// Share of normal deviations that are beyond so many standard errors.
fn rarity(errors: f64) -> f64 {
    upper_tail(errors * errors, 1)
}

/// VI-8: as many samples in a torus as its volume says, and the integral over it.
pub(super) fn row(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_8);
    let (row, form) = (with.settings, with.form);
    let torus = Torus { ring: *row.ring.get(form), tube: *row.tube.get(form) };
    let size = [*row.side_px.get(form), *row.samples.get(form)];
    let (most, least) = (*row.standard_errors.get(form), *row.least_samples.get(form));
    let filled = row.seed.all(form).iter().map(|&seed| Filled::new(&torus, seed, size));
    let filled: Vec<Filled> = filled.collect::<Result<_, _>>()?;
    let scatter = Scatter(filled.iter().flat_map(|one| one.by_octant(&torus)).collect());
    let mut tried = Cases::new(
        "standard errors off (of a seed the farther of count and integral, of octants the root mean square)",
        "seed alone, and the octants of all seeds together",
    );
    let judged = |(seed, one): (&u64, &Filled)| {
        (*seed, one.farther(), one.farther() <= most && one.found.samples as f64 >= least)
    };
    tried.along("seed", row.seed.all(form).iter().zip(&filled).map(judged));
    tried.along("scatter", [("octants", scatter.rms(), scatter.is_of_independent(most))]);
    let band = tried.band(row.seed.values() + 1)?;
    let first = &filled[0];
    let made = with.banded(&row.about, ours(first, &torus), band);
    let disks = [Disk::new(4, row.seed.all(form)[0], size)?, Disk::new(5, row.seed.all(form)[0], size)?];
    let differing =
        disks.iter().map(|disk| disk.differing).chain(filled.iter().map(|one| one.differing)).sum::<usize>();
    let note = format!(
        "{}. {}. {}. {}. {differing} samples differ from those found by testing all samples on the CPU",
        made.note,
        scatter.text(most),
        disks[0].text(),
        disks[1].text()
    );
    let mut numbers: Vec<NamedValue> = facts(first).into_iter().chain(scatter.facts()).collect();
    numbers.extend(self::numbers([
        ("deviation_of_count_4d", disks[0].count_off),
        ("deviation_of_count_5d", disks[1].count_off),
        ("differing_from_cpu", differing as f64),
    ]));
    let ran = ran(&filled, &disks);
    Ok(Done { row: ClaimRow { numbers, note, ran, ..made }, figures: vec![slice(&first.found)] })
}

fn ours(first: &Filled, torus: &Torus) -> String {
    format!(
        "{:.0} of {} samples, {:.0} expected ({:+.2} standard errors); the integral of the squared distance from the axis is {:.6}, exactly \
         {:.6} ({:+.2})",
        first.inside,
        first.found.samples,
        first.expected,
        first.off[0],
        first.integral,
        torus.moment(),
        first.off[1]
    )
}

fn facts(first: &Filled) -> Vec<NamedValue> {
    numbers([
        ("inside", first.inside),
        ("expected", first.expected),
        ("deviation_of_count", first.off[0]),
        ("integral", first.integral),
        ("deviation_of_integral", first.off[1]),
    ])
}

fn ran(filled: &[Filled], disks: &[Disk]) -> Vec<NamedValue> {
    let mut ran = row::ran(&filled.iter().map(|one| one.ran).chain(disks.iter().map(|disk| disk.ran)).sum());
    ran.extend(numbers([
        ("samples", filled.iter().map(|one| one.found.samples as f64).sum()),
        ("samples_covered_by_triangles", filled.iter().map(|one| one.found.covered as f64).sum()),
        ("samples_inside", filled.iter().map(|one| one.inside).sum()),
    ]));
    ran
}

/// Figure 9: the samples near a plane through the axis.
fn slice(found: &CoveredSamples) -> Figure {
    let near = found.points.iter().filter(|[_, y, ..]| (y - 0.5).abs() < 0.01);
    Figure::plane(
        "VI_fig9",
        [
            "Samples in a torus drawn as moving triangles (Paper VI, Figure 9)",
            "those within 0.01 of a plane through its axis",
        ],
        ["x", "t"],
        vec![dots("samples", near.map(|[x, _, t, ..]| (*x, *t)).collect())],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::paper6::settings::Settings;
    use crate::reproduce::settings::load;

    /// The file states both parts of the condition, and no tolerance that samples do not have.
    #[test]
    fn the_file_states_both_conditions() {
        let (settings, _) = load::<Settings>(None).unwrap();
        let file = &settings.vi_8.about;
        assert!(file.holds_when.contains("standard errors") && file.holds_when.contains("scatter no more"));
        assert!(!file.limits.contains("generous"));
    }

    #[test]
    fn a_scatter_is_judged_against_independent_samples() {
        // As many within each tenth of the normal distribution, so that the mean square is near 1.
        let normal: Vec<f64> = [0.126, 0.385, 0.674, 1.036, 1.645]
            .iter()
            .flat_map(|z| [*z, -z])
            .cycle()
            .take(60)
            .chain([2.5, -2.5, 2.5, -2.5])
            .collect();
        let times = |factor: f64| Scatter(normal.iter().map(|off| off * factor).collect());
        let same = times(1.0);
        assert!((same.rms() - 1.0).abs() < 0.2 && same.is_of_independent(3.0), "{}", same.text(3.0));
        assert_eq!([1.0, 2.0, 3.0].map(|errors| same.beyond(errors)), [28, 4, 0]);
        assert!((same.by_chance(1.0) - 20.31).abs() < 0.01 && (same.by_chance(3.0) - 0.173).abs() < 0.001);
        assert!(same.text(3.0).contains(
            "consistent with independent samples, so 3 standard errors are not a generous tolerance"
        ));
        assert!(
            times(0.5).text(3.0).contains("of whose standard errors are 5.4 of these")
                && times(0.5).is_of_independent(3.0)
        );
        assert!(!times(1.5).is_of_independent(3.0), "{}", times(1.5).text(3.0));
        assert!(times(1.5).text(3.0).contains("more than independent samples scatter"));
    }

    /// Samples that repeat in blocks of four are right on average and scatter twice as far.
    #[test]
    fn samples_that_are_not_independent_fail() {
        let torus = Torus::default();
        let seeds = 1..=4;
        let honest: Vec<Filled> = seeds.map(|seed| Filled::new(&torus, seed, [128, 4]).unwrap()).collect();
        let repeated = |one: &Filled| {
            let kept = one.found.points.iter().step_by(4);
            let points: Vec<SamplePoint> = kept.flat_map(|point| [*point; 4]).collect();
            Filled { found: CoveredSamples { points, ..one.found.clone() }, ..*one }
        };
        let scatter =
            |filled: &[Filled]| Scatter(filled.iter().flat_map(|one| one.by_octant(&torus)).collect());
        let blocks: Vec<Filled> = honest.iter().map(repeated).collect();
        let (honest, blocks) = (scatter(&honest), scatter(&blocks));
        assert!(honest.is_of_independent(3.0), "{}", honest.text(3.0));
        assert!(!blocks.is_of_independent(3.0), "{}", blocks.text(3.0));
    }
}
