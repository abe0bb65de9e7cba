//! `quintile stress`: the failure catalogue, each method on each family.
//!
//! - [`truth`]: when a triangle truly touches a tile.
//! - [`measure`]: the sets of tests compared, what they are tried on, and all of it for one value of a family.
//! - [`choice`]: `auto` against every fixed choice of tests.
//! - [`StressChart`]: every row, as a study with tables, CSV and pictures.

pub mod choice;
pub mod measure;
pub mod truth;

use choice::{Choices, FamilyCosts};
use measure::{METHODS, StressRow, TestMethod};
use output::dir::SUMMARY;
use output::plot::{
    Chart, ChartPanel, Matrix, MatrixPanel, Paint, Picture, PlotMark, PlotStyle, Scale, Series,
};
use output::terminal::Progress;
use output::{Claim, OutputError};
use run::{GpuSpec, RunError};
use serde::{Serialize, Serializer};
use workloads::stress::{Family, Size, families, family};

use crate::study::table::{Sheet, TableBuilder, count, fixed, optional, plain, share};
use crate::study::{Gallery, Study, StudyError, each, files};

/// The seed of the scenes.
const SEED: u64 = 1;

/// The family called `name`.
///
/// # Errors
/// When the family does not exist; names the known ones.
pub fn family_named(name: &str) -> Result<&'static Family, RunError> {
    let unknown = || {
        let names: Vec<_> = families().map(|family| family.name).collect();
        RunError::setting(format_args!("no family called `{name}`; there are {}", names.join(", ")))
    };
    family(name).ok_or_else(unknown)
}

/// Effort of the measurement.
#[derive(Clone, Copy, Debug)]
pub struct StressEffort {
    /// One family; all where there is none.
    pub only: Option<&'static Family>,
    /// Fewer values, and smaller scenes.
    pub quick: bool,
}

/// Everything a sweep found out.
pub struct StressChart {
    /// The families swept.
    pub families: Vec<&'static Family>,
    /// Size of their scenes.
    pub size: Size,
    /// A row for each family, value and method, in this order.
    pub rows: Vec<StressRow>,
    /// `auto` against every fixed choice of tests.
    pub auto: Choices,
}

/// The part of `summary.json`.
#[derive(Serialize)]
pub struct StressSummary<'a> {
    /// Samples lost over all rows: must be none.
    pub samples_lost: u64,
    /// Boxes over all rows that leave out what truly touches: must be none.
    pub pairs_wrong: u64,
    /// Side of the images in pixels.
    pub side_px: u32,
    /// `auto` against the best fixed choice of tests.
    pub auto: &'a Choices,
    /// Every row.
    pub rows: &'a [StressRow],
}

/// As JSON a report is its summary.
impl Serialize for StressChart {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.summary().serialize(serializer)
    }
}

impl Study for StressChart {
    const NAME: &'static str = "stress";
    const ABOUT: &'static str =
        "Each tile test on families of triangles from harmless to hopeless: samples lost, efficiency, cost";
    /// Several for each family.
    const PICTURES: &'static [&'static str] = &[];
    const FILES: &'static [&'static str] = &["stress.csv", "auto.csv", SUMMARY];

    type Effort = StressEffort;
    const FULL: StressEffort = StressEffort { only: None, quick: false };
    const QUICK: StressEffort = StressEffort { only: None, quick: true };

    fn measure(effort: StressEffort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let quick = effort.quick;
        let chosen = effort.only.map_or_else(|| families().collect(), |family| vec![family]);
        let size = if quick { Size::QUICK } else { Size::FULL };
        let gpu = GpuSpec::load("reference")?;
        let values =
            |&family: &&'static Family| family.sweep(quick).iter().map(move |&value| (family, value));
        let cases: Vec<(&'static Family, f64)> = chosen.iter().flat_map(values).collect();
        let measure = |&(family, value): &(&'static Family, f64)| {
            let rows = measure::measure(family, value, size, &gpu, &METHODS)?;
            // Every combination of tests on a million triangles would take longer than all the rest.
            let held = family.sweep(true).contains(&value);
            let trial = held.then(|| choice::trial(family, value, size, SEED, &gpu)).transpose()?;
            Ok::<_, RunError>((rows, trial))
        };
        let measured = each(&cases, ("values", progress), measure)?;
        let (rows, trials): (Vec<_>, Vec<_>) = measured.into_iter().unzip();
        let trials: Vec<FamilyCosts> = trials.into_iter().flatten().collect();
        let (rows, auto) = (rows.into_iter().flatten().collect(), Choices::new(&trials));
        Ok(Self { families: chosen, size, rows, auto })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        if self.families.len() > 1 {
            to.add(&stem("matrix"), &matrix(self, to.plot_style()))?;
            to.add(&stem("auto"), &self.auto.picture(to.plot_style()))?;
        }
        for family in &self.families {
            let stem = stem(family.name);
            for measure in &MEASURES {
                let picture = curves(self, family, measure, to.plot_style());
                to.add(&format!("{stem}{}", measure.stem), &picture)?;
            }
            to.add(&format!("{stem}_intervals"), &intervals(self, family, to.plot_style()))?;
        }
        Ok(())
    }

    fn tables(&self) -> Vec<Sheet> {
        let shown = match self.families[..] {
            [family] => self.of_family(family),
            _ => self.overview(),
        };
        vec![shown, self.row_sheet(), self.auto.sheet()]
    }

    fn fault(&self) -> Option<String> {
        let fault = "a test is not conservative: samples were lost or boxes are too small; please report it";
        (!self.is_clean()).then(|| fault.to_owned())
    }

    fn claim() -> Claim {
        let endings = || MEASURES.iter().map(|measure| measure.stem).chain(["_intervals"]);
        let families = families()
            .flat_map(|family| endings().map(move |ending| format!("{}{ending}", stem(family.name))));
        let plots = families.chain(["matrix", "auto"].map(stem));
        Claim::new(Self::NAME).plots(plots).files(files::<Self>())
    }
}

/// The path of a picture without its ending.
fn stem(name: &str) -> String {
    format!("plots/stress_{}", name.replace('-', "_"))
}

impl StressChart {
    /// The part of `summary.json`.
    pub fn summary(&self) -> StressSummary<'_> {
        StressSummary {
            samples_lost: self.rows.iter().map(|row| row.samples_lost).sum(),
            pairs_wrong: self.rows.iter().map(|row| row.intervals.pairs_wrong).sum(),
            side_px: self.size.side_px,
            auto: &self.auto,
            rows: &self.rows,
        }
    }

    /// Whether no method lost a sample and no box left anything out.
    pub fn is_clean(&self) -> bool {
        let summary = self.summary();
        summary.samples_lost == 0 && summary.pairs_wrong == 0
    }

    /// The rows of one family.
    pub fn of(&self, family: &Family) -> impl Iterator<Item = &StressRow> + use<'_> {
        let name = family.name;
        self.rows.iter().filter(move |row| row.family == name)
    }

    /// The largest cost over the best of `method` on `family`; `first` looks at the harmless value only.
    pub fn over_best(&self, family: &Family, method: &str, first: bool) -> Option<f64> {
        let rows = self.of(family).filter(|row| row.method == method);
        rows.take(if first { 1 } else { usize::MAX }).map(|row| row.over_best).reduce(f64::max)
    }

    /// Text below the table.
    fn below(&self) -> String {
        let (summary, rows) = (self.summary(), self.rows.len());
        format!(
            "\n{} samples lost and {} boxes too small in {rows} sweeps of {} pixels a side\n{}",
            summary.samples_lost,
            summary.pairs_wrong,
            self.size.side_px,
            self.auto.text()
        )
    }

    /// The cost of every method at the worst value of each family.
    fn overview(&self) -> Sheet {
        let table = TableBuilder::of(&self.families)
            .shown("family", |family| family.name, plain)
            .before("Cost over that of the best method, at the worst value of each family.\n\n")
            .after(self.below());
        let method = |table: TableBuilder<_>, method: &TestMethod| {
            let cost = |family: &&&'static Family| self.over_best(family, method.name, false);
            table.shown(method.name, cost, optional(fixed(2)))
        };
        METHODS.iter().fold(table, method).sheet()
    }

    /// Every number of one family.
    fn of_family(&self, family: &Family) -> Sheet {
        let of = |count: u64, row: &StressRow| count as f64 / row.intervals.pairs.max(1) as f64;
        TableBuilder::of(self.of(family))
            .shown(family.parameter, |row| row.value, plain)
            .shown("method", |row| row.method, plain)
            .shown("lost", |row| row.samples_lost, plain)
            .shown("efficiency", |row| row.work.efficiency(), optional(share(1)))
            .shown("tile madds", |row| row.work.tile_madds, count)
            .shown("sample madds", |row| row.work.sample_madds, count)
            .shown("over best", |row| row.over_best, fixed(2))
            .shown("tiles kept", |row| of(row.intervals.pairs_kept, row), share(1))
            .shown("touched", |row| of(row.intervals.pairs_touching, row), share(1))
            .shown("t width", |row| row.intervals.t_width, share(1))
            .shown("t true", |row| row.intervals.t_true, share(1))
            .shown("u width", |row| row.intervals.u_width, share(1))
            .shown("u true", |row| row.intervals.u_true, share(1))
            .shown("true widths by", |row| row.truth, plain)
            .before(format!("{}: {}\n\n", family.name, family.what))
            .after(self.below())
            .sheet()
    }

    fn row_sheet(&self) -> Sheet {
        TableBuilder::of(&self.rows)
            .data("family", |row| row.family)
            .data("value", |row| row.value)
            .data("method", |row| row.method)
            .data("triangles", |row| row.triangles)
            .data("samples_lost", |row| row.samples_lost)
            .data("compared_with", |row| row.compared_with)
            .data("samples_tested", |row| row.work.samples_tested)
            .data("samples_hit", |row| row.work.samples_hit)
            .data("tile_madds", |row| row.work.tile_madds)
            .data("sample_madds", |row| row.work.sample_madds)
            .data("over_best", |row| row.over_best)
            .data("truth", |row| row.truth)
            .data("pairs", |row| row.intervals.pairs)
            .data("pairs_touching", |row| row.intervals.pairs_touching)
            .data("pairs_kept", |row| row.intervals.pairs_kept)
            .data("pairs_wrong", |row| row.intervals.pairs_wrong)
            .data("u_width", |row| row.intervals.u_width)
            .data("v_width", |row| row.intervals.v_width)
            .data("t_width", |row| row.intervals.t_width)
            .data("u_true", |row| row.intervals.u_true)
            .data("v_true", |row| row.intervals.v_true)
            .data("t_true", |row| row.intervals.t_true)
            .data("tightness", |row| row.intervals.tightness)
            .csv("stress.csv")
            .sheet()
    }
}

/// Cost over that of the best method, by method and family: at the first and at the worst value.
fn matrix(report: &StressChart, plot_style: &PlotStyle) -> Picture {
    let panel = |name, first| MatrixPanel {
        name,
        rows: METHODS
            .iter()
            .map(|method| {
                let over = |family| report.over_best(family, method.name, first);
                (method.name, report.families.iter().map(|family| over(family)).collect())
            })
            .collect(),
    };
    let subject = format!(
        "multiply-adds of tile and sample tests over those of the best method; images of {} pixels a side; {} samples lost",
        report.size.side_px,
        report.summary().samples_lost
    );
    Matrix {
        title: "Which test pays where",
        subject: &subject,
        scale: ["the best", "32 times as much"],
        columns: report.families.iter().map(|family| family.name).collect(),
        panels: vec![
            panel("at the harmless end of each family", true),
            panel("at the value of each family that is worst for the method", false),
        ],
    }
    .picture(plot_style)
}

/// Panels of a row on a page.
const ACROSS: usize = 7;

/// A measure of a method at each value of a family.
struct Measure {
    /// Ending after the family's name in names of files; empty for the cost.
    pub stem: &'static str,
    title: &'static str,
    /// The name of the axis.
    name: &'static str,
    scale: Scale,
    of: fn(&StressRow) -> Option<f64>,
}

/// Cost and efficiency.
const MEASURES: [Measure; 2] = [
    Measure {
        stem: "",
        title: "cost",
        name: "madds per triangle",
        scale: Scale::Decades,
        of: |row| Some(row.work.madds().max(1) as f64 / row.triangles.max(1) as f64),
    },
    Measure {
        stem: "_efficiency",
        title: "sample test efficiency",
        name: "efficiency (%)",
        scale: Scale::FromZero,
        of: |row| row.work.efficiency().map(|share| 100.0 * share),
    },
];

/// A measure of one family along its parameter: a small panel for each method, the other methods as grey
/// lines behind it.
fn curves(report: &StressChart, family: &Family, measure: &Measure, plot_style: &PlotStyle) -> Picture {
    let rows: Vec<&StressRow> = report.of(family).collect();
    let line = |name: &str| -> Vec<(f64, f64)> {
        let values = rows.iter().filter(|row| row.method == name).map(|row| (measure.of)(row)).enumerate();
        values.filter_map(|(place, value)| Some((place as f64, value?))).collect()
    };
    let all: Vec<Vec<(f64, f64)>> = METHODS.iter().map(|method| line(method.name)).collect();
    let panel = |(method, own): (&TestMethod, &Vec<(f64, f64)>)| {
        let others = Series::new("", PlotMark::Faint(all.clone())).painted(Paint::Grey);
        let own = Series::curve("", own.iter().copied()).painted(Paint::Like(0));
        ChartPanel::new(method.name, ["", measure.name], vec![others, own])
            .on(Scale::Even, measure.scale.clone())
            .along(family.parameter, &values(&rows))
    };
    let title = format!("Failure modes: {}, {}", family.name, measure.title);
    let subject = format!(
        "{}; grey: all other methods; {} samples lost",
        family.what,
        rows.iter().map(|row| row.samples_lost).sum::<u64>()
    );
    let panels = METHODS.iter().zip(&all).map(panel).collect();
    Chart::new(&title, &subject, panels).small(ACROSS).picture(plot_style)
}

fn values(rows: &[&StressRow]) -> Vec<String> {
    let mut values: Vec<String> = rows.iter().map(|row| row.value.to_string()).collect();
    values.dedup();
    values
}

/// Width of the boxes that the side planes leave, and of the true ones.
fn intervals(report: &StressChart, family: &Family, plot_style: &PlotStyle) -> Picture {
    let rows: Vec<&StressRow> = report.of(family).collect();
    let curve = |name: &str, of: fn(&StressRow) -> f64| {
        let sides = rows.iter().filter(|row| row.method == "sides").enumerate();
        Series::curve(name, sides.map(|(place, row)| (place as f64, 100.0 * of(row))))
    };
    let panel = |title: &str, curves| {
        ChartPanel::new(title, ["", "share of all (%)"], curves)
            .on(Scale::Even, Scale::FromZero)
            .along(family.parameter, &values(&rows))
    };
    let by = ["side planes", "true"];
    let panels = vec![
        panel(
            "time",
            vec![curve(by[0], |row| row.intervals.t_width), curve(by[1], |row| row.intervals.t_true)],
        ),
        panel(
            "lens, across",
            vec![curve(by[0], |row| row.intervals.u_width), curve(by[1], |row| row.intervals.u_true)],
        ),
        panel(
            "tiles",
            vec![
                curve(by[0], |row| row.intervals.pairs_kept as f64 / row.intervals.pairs.max(1) as f64),
                curve(by[1], |row| row.intervals.pairs_touching as f64 / row.intervals.pairs.max(1) as f64),
            ],
        ),
    ];
    let title = format!("What side planes leave: {}", family.name);
    let subject = format!(
        "{}; means over triangles and tiles; true intervals from {}",
        family.what,
        rows.last().map_or("nothing", |row| row.truth)
    );
    Chart::new(&title, &subject, panels).picture(plot_style)
}

#[cfg(test)]
mod tests {
    use pipeline::Features;
    use pipeline::traversal::Box5;
    use workloads::stress::StressScene;
    use workloads::visibility::Unshaded;

    use super::measure::{METHODS, Pairs, Subject, combinations, differing};
    use super::*;

    const SIZE: Size = Size { side_px: 32, triangles: 30 };

    fn with<T>(scene: &StressScene, run: impl FnOnce(&Subject<'_>) -> T) -> T {
        let gpu = GpuSpec::load("reference").unwrap();
        let draws = [scene.draw(&Unshaded).unwrap()];
        let (camera, viewport, samples) = (&scene.camera, scene.viewport, &scene.samples);
        run(&Subject { camera, viewport, samples, draws: &draws, spec: &gpu.pipeline })
    }

    fn text(report: &StressChart) -> String {
        report.tables()[0].text().unwrap()
    }

    #[test]
    fn no_box_leaves_out_what_truly_touches() {
        for family in families() {
            for &value in family.sweep(true) {
                let scene = family.scene(value, SIZE, 5).unwrap();
                with(&scene, |subject| {
                    let pairs = Pairs::of(subject, 60);
                    for (name, features) in combinations() {
                        let found = pairs.under(&features);
                        assert_eq!(found.pairs_wrong, 0, "{} at {value}: {name}: {found:?}", family.name);
                        assert!(
                            found.tightness <= 1.0 + 1e-9,
                            "{} at {value}: {name}: {found:?}",
                            family.name
                        );
                    }
                });
            }
        }
    }

    /// A deliberately wrong bound: what it does to a right one.
    type Mutant = fn(Box5) -> Option<Box5>;

    /// Bounds made wrong on purpose: the measurement has to see each of them.
    #[test]
    fn a_box_too_small_is_counted_as_wrong() {
        let cases: [(&str, usize, Mutant); 4] = [
            ("speed", 3, |b| Some(Box5 { t: [b.t[0], b.t[1] - 0.01], ..b })),
            ("large-lens", 2, |b| Some(Box5 { u: [b.u[0] + 0.05, b.u[1]], ..b })),
            ("defocus", 3, |b| Some(Box5 { v: [b.v[0], b.v[1] - 0.05], ..b })),
            ("slivers", 2, |b| (b.t[0] > 0.0).then_some(b)),
        ];
        for (name, place, mutant) in cases {
            let family = family(name).unwrap();
            let scene = family.scene(family.values[place], Size { side_px: 32, triangles: 100 }, 5).unwrap();
            with(&scene, |subject| {
                let pairs = Pairs::of(subject, 300);
                let sides = METHODS[2].features;
                let right = pairs.bounded(|place, triangle| place.bound(&sides, triangle));
                let wrong = pairs.bounded(|place, triangle| place.bound(&sides, triangle).and_then(mutant));
                assert_eq!(right.pairs_wrong, 0, "{name}");
                assert!(wrong.pairs_wrong > 0, "{name}: {wrong:?}");
            });
        }
    }

    #[test]
    fn lost_samples_are_counted_and_the_report_is_not_clean() {
        let family = family("speed").unwrap();
        let gpu = GpuSpec::load("reference").unwrap();
        let rows = measure::measure(family, 0.1, SIZE, &gpu, &METHODS).unwrap();
        let mut report = StressChart { families: vec![family], size: SIZE, rows, auto: Choices::default() };
        assert!(report.is_clean(), "{}", text(&report));
        assert_eq!(report.rows[0].compared_with, "brute force");
        let scene = family.scene(0.1, SIZE, 1).unwrap();
        let mut other = scene.clone();
        other.triangles.truncate(scene.triangles.len() / 2);
        let lost = with(&scene, |whole| {
            with(&other, |half| differing(&half.seen(Features::ALL).unwrap(), &whole.reference().unwrap().0))
        });
        assert!(lost > 0);
        report.rows[3].samples_lost = lost;
        assert!(!report.is_clean());
        assert!(text(&report).contains(&format!("{lost} samples lost")), "{}", text(&report));
    }

    #[test]
    fn the_best_method_is_the_measure_of_all() {
        let gpu = GpuSpec::load("reference").unwrap();
        for (name, value) in [("speed", 1.0), ("diagonals", 128.0)] {
            let rows = measure::measure(family(name).unwrap(), value, SIZE, &gpu, &METHODS).unwrap();
            let least = rows.iter().map(|row| row.over_best).fold(f64::INFINITY, f64::min);
            assert_eq!(least, 1.0);
            assert!(rows[0].over_best > 1.0, "the bounding box alone is not the best on {name}");
            assert!(rows.iter().all(|row| row.work.samples_hit > 0));
        }
    }

    #[test]
    fn an_unknown_family_is_reported_with_the_known_ones() {
        let error = family_named("splinters").err().unwrap();
        assert!(error.is_usage());
        assert!(error.to_string().contains("splinters") && error.to_string().contains("slivers"), "{error}");
    }
}
