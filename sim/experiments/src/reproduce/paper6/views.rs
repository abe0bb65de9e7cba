//! VI-13 and VI-14: shader runs of stereo and of seven views, over what the paper leaves open.

use output::plot::Series;
use pipeline::{CacheSpec, Replacement};
use run::RunError;
use workloads::multiview::Layout;

use super::Task;
use super::figures::{self, Line};
use super::settings::{Policy, Size, Views};
use crate::chart::multiview::{MultiviewBench, ViewLanes};
use crate::reproduce::report::{level, line, over_doublings};
use crate::reproduce::row::{Cases, ClaimRow, With, numbers, one_at_a_time, ran};
use crate::reproduce::settings::Form;
use crate::reproduce::{Done, Figure};
use crate::study::{Ran, StudyError};

/// VI-13.
pub(super) fn stereo(task: &Task<'_>) -> Result<Done, RunError> {
    done(
        &task.with(|settings| &settings.vi_13),
        ["VI_fig17_stereo", "VI_fig17_stereo_band", "VI_fig17_stereo_images"],
    )
}

/// VI-14.
pub(super) fn seven(task: &Task<'_>) -> Result<Done, RunError> {
    done(
        &task.with(|settings| &settings.vi_14),
        ["VI_fig17_seven", "VI_fig17_seven_band", "VI_fig17_seven_images"],
    )
}

/// Number of views, and steps of the line that a view covers.
fn shape(row: &Views, form: Form) -> [u32; 2] {
    [*row.views.get(form), *row.overlap.get(form)]
}

/// One value of everything that is left open.
#[derive(Clone, Debug, PartialEq)]
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

    /// All of it in words.
    fn name(&self) -> String {
        let Self { samples, eyes, size_px, lens_over_eyes, shutter, scene, quads, ways, policy } = self;
        format!(
            "eyes {eyes}, {}x{} pixels, lens_over_eyes {lens_over_eyes}, shutter {shutter}, scene {} {}, samples {samples}, quads {quads}, ways \
             {ways}, {}",
            size_px.0,
            size_px.1,
            scene.0,
            scene.1,
            policy.name()
        )
    }

    /// `views` that are two lenses apart or `overlap` steps of a line.
    fn layout(&self, [views, overlap]: [u32; 2]) -> Layout {
        let aperture = self.lens_over_eyes * self.eyes;
        match overlap {
            0 => Layout { views, ..Layout::stereo(self.eyes, aperture) },
            _ => Layout { overlap, ..Layout::line(views, self.eyes + 2.0 * aperture, aperture) },
        }
    }

    /// Images of all views of the frame.
    fn images(&self, name: &'static str, shape: [u32; 2]) -> Result<Figure, RunError> {
        let Layout { views, spacing, aperture, overlap } = self.layout(shape);
        let (scene, frame) = (self.scene.0.as_str(), self.scene.1);
        let (samples, shutter) = (self.samples, self.shutter);
        figures::views(name, &Line { scene, frame, views, spacing, aperture, overlap, samples, shutter })
    }

    /// Lanes of all views and of one.
    fn lanes(&self, shape: [u32; 2]) -> Result<ViewLanes, StudyError> {
        let layout = self.layout(shape);
        let replacement = match self.policy {
            Policy::Lru => Replacement::Lru,
            Policy::Fifo => Replacement::Fifo,
        };
        let cache = CacheSpec { replacement, ..CacheSpec::lru(self.quads, self.ways) };
        let size = [self.size_px.0, self.size_px.1];
        let bench =
            MultiviewBench::with_shutter((self.scene.0.as_str(), self.scene.1), size, Some(self.shutter))?;
        bench.lanes(layout, cache, self.samples)
    }
}

/// Points that were tried so far.
struct Tried<'a> {
    row: &'a Views,
    form: Form,
    cases: Cases,
    /// Every point of the sweeps, with its increase in %.
    found: Vec<(Point, f64)>,
    ran: Ran,
}

impl Tried<'_> {
    /// Shader lanes of all views over those of one, less one, in %.
    fn increase(&mut self, point: &Point) -> Result<f64, RunError> {
        let lanes = point.lanes(shape(self.row, self.form))?;
        self.ran += lanes.ran;
        Ok(100.0 * (lanes.all as f64 / lanes.one as f64 - 1.0))
    }

    fn holds(&self, increase: f64) -> bool {
        meets(self.row, self.form, increase)
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
            self.found.push((point, increase));
        }
        let found = at.iter().map(|(_, increase, _)| *increase).collect();
        let cases = self.cases.along(setting, at);
        standing.into_iter().for_each(|value| cases.with_base(value));
        Ok(found)
    }
}

/// Settings that are varied together: copies one such setting, or the two, from a point to another.
type Group = fn(&mut Point, &Point);

const GROUPS: [Group; 8] = [
    |to, from| (to.eyes, to.size_px) = (from.eyes, from.size_px),
    |to, from| to.lens_over_eyes = from.lens_over_eyes,
    |to, from| to.shutter = from.shutter,
    |to, from| to.scene = from.scene.clone(),
    |to, from| to.samples = from.samples,
    |to, from| to.quads = from.quads,
    |to, from| to.ways = from.ways,
    |to, from| to.policy = from.policy,
];

/// The point at which every setting has the value that `better` takes for the best by itself, the others as
/// in `base`.
fn corner(base: &Point, found: &[(Point, f64)], better: fn(f64, f64) -> bool) -> Point {
    let mut corner = base.clone();
    for copy in GROUPS {
        let only = |point: &Point| {
            let mut same = base.clone();
            copy(&mut same, point);
            same == *point
        };
        let own = found.iter().filter(|(point, _)| only(point));
        let best = own.reduce(|best, one| if better(one.1, best.1) { one } else { best });
        best.into_iter().for_each(|(point, _)| copy(&mut corner, point));
    }
    corner
}

/// Whether the first of two numbers lies further towards an end of a range.
type Further = fn(f64, f64) -> bool;

/// All settings together at the values that raise, and that lower, the number by themselves; those not met in
/// a sweep.
fn over_corners(tried: &mut Tried<'_>, base: &Point) -> Result<[f64; 2], RunError> {
    let ends: [(&str, Further); 2] = [
        ("every setting as it lowers the number", |a, b| a < b),
        ("every setting as it raises it", |a, b| a > b),
    ];
    let mut increases = [f64::NAN; 2];
    for ((setting, better), increase) in ends.into_iter().zip(&mut increases) {
        let point = corner(base, &tried.found, better);
        let met = tried.found.iter().find(|(other, _)| *other == point).map(|(_, met)| *met);
        *increase = met.map_or_else(|| tried.increase(&point), Ok)?;
        if met.is_none() {
            let case = (point.name(), *increase, tried.holds(*increase));
            tried.cases.along(setting, [case]);
        }
    }
    Ok(increases)
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

/// Entries of the cache, and lanes a pixel of all views and of one.
type Entries = (u32, f64, f64);

/// Increases in % over the distance of the eyes, for images of one size.
type Curves = Vec<(Size, Vec<(f64, f64)>)>;

fn done(with: &With<'_, Views>, figures: [&'static str; 3]) -> Result<Done, RunError> {
    let (row, form) = (with.settings, with.form);
    let base = Point::base(row, form);
    let cases = Cases::new("increase of shader invocations in %", VARIED);
    let found = Vec::new();
    let mut tried = Tried { row, form, cases, found, ran: Ran::default() };
    let curves = over_eyes(&mut tried, &base)?;
    over_the_rest(&mut tried, &base)?;
    let corners = over_corners(&mut tried, &base)?;
    let ours = tried.increase(&base)?;
    let entries = entries(row, form, &base)?;
    let Tried { cases, ran: work, .. } = tried;
    let band = cases.band(full(row))?;
    let at = |quads: u32| {
        entries.iter().find(|(count, ..)| *count == quads).map(|(_, all, one)| 100.0 * (all / one - 1.0))
    };
    let text = described(&base, ours, corners);
    let facts = numbers([
        ("increase_percent", ours),
        ("increase_least_percent", band.min),
        ("increase_most_percent", band.max),
        ("increase_lowering_corner_percent", corners[0]),
        ("increase_raising_corner_percent", corners[1]),
        ("increase_at_64_entries_percent", at(64).unwrap_or(f64::NAN)),
        ("increase_at_16384_entries_percent", at(16_384).unwrap_or(f64::NAN)),
    ]);
    let ran = ran(&work);
    let images = base.images(figures[2], shape(row, form))?;
    let figures =
        vec![over_entries(figures[0], row, &entries), banded(figures[1], row, form, &curves), images];
    let judged = ClaimRow { numbers: facts, ran, ..with.banded(&row.about, text, band) };
    Ok(Done { row: judged.limited(&cache_sizes(row, form, &entries)), figures })
}

const VARIED: &str =
    "one at a time about the values given, eyes and size_px jointly, and two corners of the ranges";

/// Cases of the full form: one at a time, eyes with sizes, and both corners.
fn full(row: &Views) -> usize {
    let jointly = row.eyes.values() * row.size_px.values();
    let views = [row.lens_over_eyes.values(), row.shutter.values(), row.scene.values(), row.samples.values()];
    one_at_a_time([jointly, one_at_a_time(views), row.quads.values(), row.ways.values(), row.policy.values()])
        + 2
}

fn described(base: &Point, ours: f64, [low, high]: [f64; 2]) -> String {
    format!(
        "{ours:+.1} % with eyes {} apart, {}x{} pixels a view, and the other settings as given; {low:+.1} to {high:+.1} % with every open \
         setting at the value of its range that lowers or raises the number by itself",
        base.eyes, base.size_px.0, base.size_px.1
    )
}

/// At which sizes of the cache the condition is met: at all of them it says nothing about the size that the
/// claim names.
fn cache_sizes(row: &Views, form: Form, entries: &[Entries]) -> String {
    let increase = |(quads, all, one): &Entries| (*quads, 100.0 * (all / one - 1.0));
    let (met, not): (Vec<_>, Vec<_>) =
        entries.iter().map(increase).partition(|(_, increase)| meets(row, form, *increase));
    let list = |some: &[(u32, f64)]| -> String {
        let each = some.iter().map(|(quads, increase)| format!("{quads} entries ({increase:+.1} %)"));
        each.collect::<Vec<_>>().join(", ")
    };
    match (met.is_empty(), not.is_empty()) {
        (_, true) => format!(
            "The condition says nothing about the size of the cache: with the other settings as given it is met at {}.",
            list(&met)
        ),
        (true, false) => {
            format!("With the other settings as given the condition is not met at {}.", list(&not))
        }
        (false, false) => format!(
            "With the other settings as given the condition is met at {}, not at {}.",
            list(&met),
            list(&not)
        ),
    }
}

/// Whether an increase in % is as near as it has to be to what the paper reports.
fn meets(row: &Views, form: Form, increase: f64) -> bool {
    (increase - row.increase_percent.get(form)).abs() <= *row.within_points.get(form)
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
    let points = each(
        row.policy.all(form),
        |policy| policy.name().to_owned(),
        |point, value| point.policy = value,
        base,
    );
    tried.along("policy", points).map(|_| ())
}

/// Lanes of all views and of one over the entries of the cache, for the figure.
fn entries(row: &Views, form: Form, base: &Point) -> Result<Vec<Entries>, RunError> {
    let shape = shape(row, form);
    let pixels = f64::from(base.size_px.0) * f64::from(base.size_px.1);
    let at = |&quads: &u32| {
        let lanes = Point { quads, ..base.clone() }.lanes(shape)?;
        Ok((quads, lanes.all as f64 / pixels, lanes.one as f64 / pixels))
    };
    row.curve_entries.get(form).iter().map(at).collect()
}

fn over_entries(name: &'static str, row: &Views, entries: &[Entries]) -> Figure {
    let over =
        |of: fn(&Entries) -> f64| entries.iter().map(|at| (f64::from(at.0), of(at))).collect::<Vec<_>>();
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

/// The band over the distance of the eyes, a curve for each size of the image, with what the paper reports
/// and the limits of the row.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn base() -> Point {
        Point {
            samples: 8,
            eyes: 0.065,
            size_px: (640, 360),
            lens_over_eyes: 0.4,
            shutter: 0.5,
            scene: ("default".to_owned(), 18),
            quads: 1024,
            ways: 4,
            policy: Policy::Lru,
        }
    }

    /// Open settings add up: neither end is in a sweep that varies them one at a time.
    #[test]
    fn corners_join_what_raises_and_what_lowers_the_number_by_itself() {
        let far = Point { eyes: 0.28, size_px: (320, 180), ..base() };
        let near = Point { eyes: 0.02, ..base() };
        let (small, fifo) = (Point { quads: 256, ..base() }, Point { policy: Policy::Fifo, ..base() });
        let found = [(base(), 10.0), (far, 40.0), (near, 3.0), (small, 12.0), (fifo, 9.0)];
        let most = corner(&base(), &found, |a, b| a > b);
        assert_eq!((most.eyes, most.size_px, most.quads), (0.28, (320, 180), 256));
        assert!(most.policy == Policy::Lru && most.lens_over_eyes == 0.4);
        let least = corner(&base(), &found, |a, b| a < b);
        assert_eq!((least.eyes, least.size_px, least.quads), (0.02, (640, 360), 1024));
        assert_eq!(least.policy, Policy::Fifo);
    }
}
