//! VI-13 and VI-14: shader runs of stereo and of seven views, over what the paper leaves open.

use pipeline::{CacheSpec, Replacement};
use workloads::multiview::Layout;

use super::Task;
use super::settings::{Policy, Size, Views};
use crate::chart::views::{Bench, Lanes};
use crate::reproduce::band::{Band, Cases};
use crate::reproduce::figure::{level, line, over_doublings};
use crate::reproduce::row::{Row, With, numbers};
use crate::reproduce::settings::Form;
use crate::reproduce::{Done, Figure};
use crate::study::StudyError;
use output::plot::Series;
use run::RunError;

/// VI-13.
pub(super) fn stereo(task: &Task<'_>) -> Result<Done, RunError> {
    done(&task.with(|settings| &settings.vi_13), ["VI_fig17_stereo", "VI_fig17_stereo_band"])
}

/// VI-14.
pub(super) fn seven(task: &Task<'_>) -> Result<Done, RunError> {
    done(&task.with(|settings| &settings.vi_14), ["VI_fig17_seven", "VI_fig17_seven_band"])
}

/// One value of everything that is left open.
#[derive(Clone, PartialEq)]
struct Point {
    samples: u32,
    eyes: f64,
    size_px: Size,
    lens_over_eyes: f64,
    shutter: f64,
    scene: (String, u32),
    quads: u32,
    ways: u32,
    policy: Policy,
}

impl Point {
    fn base(row: &Views, form: Form) -> Self {
        Self {
            samples: *row.samples.get(form),
            eyes: *row.eyes.get(form),
            size_px: *row.size_px.get(form),
            lens_over_eyes: *row.lens_over_eyes.get(form),
            shutter: *row.shutter.get(form),
            scene: row.scene.get(form).clone(),
            quads: *row.quads.get(form),
            ways: *row.ways.get(form),
            policy: *row.policy.get(form),
        }
    }

    /// Lanes of all views and of one, for `views` that are two lenses apart or `overlap` steps of a line.
    fn lanes(&self, [views, overlap]: [u32; 2]) -> Result<Lanes, StudyError> {
        let aperture = self.lens_over_eyes * self.eyes;
        let layout = match overlap {
            0 => Layout { views, ..Layout::stereo(self.eyes, aperture) },
            _ => Layout { overlap, ..Layout::line(views, self.eyes + 2.0 * aperture, aperture) },
        };
        let replacement = match self.policy {
            Policy::Lru => Replacement::Lru,
            Policy::Fifo => Replacement::Fifo,
        };
        let cache = CacheSpec { replacement, ..CacheSpec::lru(self.quads, self.ways) };
        let size = [self.size_px.0, self.size_px.1];
        let bench = Bench::with_shutter((self.scene.0.as_str(), self.scene.1), size, Some(self.shutter))?;
        bench.lanes(layout, cache, self.samples)
    }
}

/// What was tried so far.
struct Tried<'a> {
    row: &'a Views,
    form: Form,
    cases: Cases,
    draws: u64,
    samples_hit: u64,
    passes: u64,
}

impl Tried<'_> {
    /// Shader lanes of all views over those of one, less one, in %.
    fn increase(&mut self, point: &Point) -> Result<f64, RunError> {
        let shape = [*self.row.views.get(self.form), *self.row.overlap.get(self.form)];
        let lanes = point.lanes(shape).map_err(RunError::setting)?;
        self.draws += lanes.draws;
        self.samples_hit += lanes.samples_hit;
        // That of all views, and the one view alone.
        self.passes += 2;
        Ok(100.0 * (lanes.all as f64 / lanes.one as f64 - 1.0))
    }

    fn holds(&self, increase: f64) -> bool {
        let (expected, off) =
            (self.row.increase_percent.get(self.form), self.row.within_points.get(self.form));
        (increase - expected).abs() <= *off
    }

    /// All points along one setting, each with what its value is called.
    fn along(&mut self, setting: &str, points: Vec<(String, Point)>) -> Result<Vec<f64>, RunError> {
        // A setting with a single value is not varied.
        if points.len() < 2 {
            return Ok(Vec::new());
        }
        let base = Point::base(self.row, self.form);
        let (mut at, mut standing) = (Vec::new(), None);
        for (value, point) in points {
            if point == base {
                standing = Some(value.clone());
            }
            let increase = self.increase(&point)?;
            at.push((value, increase, self.holds(increase)));
        }
        let found = at.iter().map(|(_, increase, _)| *increase).collect();
        let cases = self.cases.along(setting, at);
        standing.into_iter().for_each(|value| cases.standing_at(value));
        Ok(found)
    }
}

/// Every value of a setting, the others as in `base`.
fn each<T: Clone>(
    values: &[T],
    name: impl Fn(&T) -> String,
    set: impl Fn(&mut Point, T),
    base: &Point,
) -> Vec<(String, Point)> {
    let one = |value: &T| {
        let mut point = base.clone();
        set(&mut point, value.clone());
        (name(value), point)
    };
    values.iter().map(one).collect()
}

/// Increases in % over the distance of the eyes, for images of one size.
type Curves = Vec<(Size, Vec<(f64, f64)>)>;

fn done(with: &With<'_, Views>, figures: [&'static str; 2]) -> Result<Done, RunError> {
    let (row, form) = (with.settings, with.form);
    let base = Point::base(row, form);
    let cases = Cases::new("increase of shader invocations in %");
    let mut tried = Tried { row, form, cases, draws: 0, samples_hit: 0, passes: 0 };
    let curves = over_eyes(&mut tried, &base)?;
    over_the_rest(&mut tried, &base)?;
    let ours = tried.increase(&base)?;
    let entries = entries(row, form, &base)?;
    let Tried { cases, draws, samples_hit, passes, .. } = tried;
    let band = cases.band().ok_or_else(|| RunError::setting("no setting of the views is varied"))?;
    let at = |quads: u32| {
        entries.iter().find(|(count, ..)| *count == quads).map(|(_, all, one)| 100.0 * (all / one - 1.0))
    };
    let text = said(&base, ours, &band);
    let facts = numbers([
        ("increase_percent", ours),
        ("increase_least_percent", band.min),
        ("increase_most_percent", band.max),
        ("increase_at_64_entries_percent", at(64).unwrap_or(f64::NAN)),
        ("increase_at_16384_entries_percent", at(16_384).unwrap_or(f64::NAN)),
    ]);
    let ran =
        numbers([("passes", passes as f64), ("draws", draws as f64), ("samples_hit", samples_hit as f64)]);
    let figures = vec![over_entries(figures[0], row, &entries), banded(figures[1], row, form, &curves)];
    Ok(Done { row: Row { numbers: facts, ran, ..with.banded(&row.about, text, band) }, figures })
}

fn said(base: &Point, ours: f64, band: &Band) -> String {
    format!(
        "{ours:+.1} % with eyes {} apart, {}x{} pixels a view; {:+.1} to {:+.1} % over all that is left open",
        base.eyes, base.size_px.0, base.size_px.1, band.min, band.max
    )
}

/// Every distance of the eyes with every size of the image.
fn over_eyes(tried: &mut Tried<'_>, base: &Point) -> Result<Curves, RunError> {
    let mut eyes = tried.row.eyes.all(tried.form).to_vec();
    eyes.sort_by(f64::total_cmp);
    let mut curves = Vec::new();
    for &size_px in tried.row.size_px.all(tried.form) {
        let base = Point { size_px, ..base.clone() };
        let points = each(&eyes, f64::to_string, |point, eyes| point.eyes = eyes, &base);
        let found = tried.along(&format!("eyes ({}x{} pixels)", size_px.0, size_px.1), points)?;
        curves.push((size_px, eyes.iter().copied().zip(found).collect()));
    }
    Ok(curves)
}

/// Every other setting alone.
fn over_the_rest(tried: &mut Tried<'_>, base: &Point) -> Result<(), RunError> {
    let (row, form) = (tried.row, tried.form);
    let number = f64::to_string;
    let count = u32::to_string;
    let points =
        each(row.lens_over_eyes.all(form), number, |point, value| point.lens_over_eyes = value, base);
    tried.along("lens_over_eyes", points)?;
    let points = each(row.shutter.all(form), number, |point, value| point.shutter = value, base);
    tried.along("shutter", points)?;
    let name = |(scene, frame): &(String, u32)| format!("{scene} {frame}");
    let points = each(row.scene.all(form), name, |point, value| point.scene = value, base);
    tried.along("scene", points)?;
    let points = each(row.samples.all(form), count, |point, value| point.samples = value, base);
    tried.along("samples", points)?;
    let points = each(row.quads.all(form), count, |point, value| point.quads = value, base);
    tried.along("quads", points)?;
    let points = each(row.ways.all(form), count, |point, value| point.ways = value, base);
    tried.along("ways", points)?;
    let name = |policy: &Policy| format!("{policy:?}").to_lowercase();
    let points = each(row.policy.all(form), name, |point, value| point.policy = value, base);
    tried.along("policy", points).map(|_| ())
}

/// Lanes of all views and of one over the entries of the cache, for the figure.
fn entries(row: &Views, form: Form, base: &Point) -> Result<Vec<(u32, f64, f64)>, RunError> {
    let shape = [*row.views.get(form), *row.overlap.get(form)];
    let pixels = f64::from(base.size_px.0) * f64::from(base.size_px.1);
    let at = |&quads: &u32| {
        let lanes = Point { quads, ..base.clone() }.lanes(shape).map_err(RunError::setting)?;
        Ok((quads, lanes.all as f64 / pixels, lanes.one as f64 / pixels))
    };
    row.curve_entries.get(form).iter().map(at).collect()
}

fn over_entries(name: &'static str, row: &Views, entries: &[(u32, f64, f64)]) -> Figure {
    let over = |of: fn(&(u32, f64, f64)) -> f64| {
        entries.iter().map(|at| (f64::from(at.0), of(at))).collect::<Vec<_>>()
    };
    over_doublings(
        name,
        [
            "Pixel shader lanes for each pixel over the shading cache (Paper VI, section 8)",
            row.about.claim.as_str(),
        ],
        ["entries of the shading cache", "lanes a pixel"],
        vec![
            Series::curve("all views in one pass", over(|at| at.1)),
            Series::curve("one view alone", over(|at| at.2)),
        ],
    )
}

/// The band over the distance of the eyes, a curve for each size of the image, with what the paper reports and the limits of the row.
fn banded(name: &'static str, row: &Views, form: Form, curves: &Curves) -> Figure {
    let named = |((across, down), points): &(Size, Vec<(f64, f64)>)| {
        line(&format!("{across}x{down} pixels"), points.clone())
    };
    let mut series: Vec<_> = curves.iter().filter(|(_, points)| !points.is_empty()).map(named).collect();
    let ends = |pick: fn(f64, f64) -> f64| row.eyes.all(form).iter().copied().reduce(pick).unwrap_or(0.0);
    let (from, to) = (ends(f64::min), ends(f64::max));
    let (expected, off) = (*row.increase_percent.get(form), *row.within_points.get(form));
    series.push(level("reported by the paper", from, to, expected));
    series.push(level("least that holds", from, to, expected - off));
    series.push(level("most that holds", from, to, expected + off));
    Figure::lines(
        name,
        "Increase of shader invocations over the distance of the eyes (Paper VI, section 8)",
        "the paper gives neither the distance nor the size of its images",
        [("distance of the eyes in scene units", ""), ("increase in %", "")],
        series,
    )
}
