//! All rows of a paper as text, JSON and files. A larger result of an earlier call is not replaced by a smaller one.
//! Also the figures of the papers.

use std::fs;

use output::plot::{AxisSpec, Chart, ChartPanel, Picture, PlotMark, PlotStyle, Scale, Series};
use output::table::Table;
use output::{Claim, Destination, OutDir, OutputError};
use run::RunError;
use serde::{Deserialize, Serialize};

use super::row::{ClaimRow, Verdict};
use super::settings::{Form, Listed, SettingsOrigin};
use super::{Done, Paper, ReproduceOptions};

/// The rows of a paper.
#[derive(Serialize)]
pub struct PaperReport {
    /// Which paper.
    pub paper: Paper,
    /// Title of the paper.
    pub title: &'static str,
    /// How much was computed.
    pub form: Form,
    /// The file of settings.
    pub settings: SettingsOrigin,
    /// Whether every row of kind E holds.
    pub equalities_hold: bool,
    /// The rows in order.
    pub rows: Vec<ClaimRow>,
    /// Figures.
    #[serde(skip)]
    figures: Vec<Figure>,
}

/// The files of a paper.
pub(super) fn claim(paper: Paper) -> Claim {
    let (number, stem) = (paper.number(), stem(paper));
    Claim::new(format!("reproduce {number}"))
        .plots([format!("plots/{number}_*")])
        .files([format!("{stem}.md"), format!("{stem}.json")])
}

pub(super) fn stem(paper: Paper) -> String {
    format!("reproduce_{}", paper.number())
}

impl PaperReport {
    pub(super) fn new(paper: Paper, form: Form, settings: SettingsOrigin, done: Vec<Done>) -> Self {
        let (mut rows, mut figures) = (Vec::new(), Vec::new());
        for Done { mut row, figures: drawn } in done {
            row.figures = drawn.iter().map(Figure::path).collect();
            row.figure = row.figures.first().cloned();
            rows.push(row.judged());
            figures.extend(drawn);
        }
        let equalities_hold = !rows.iter().any(ClaimRow::is_unequal);
        Self { paper, title: paper.title(), form, settings, equalities_hold, rows, figures }
    }

    /// The rows of kind E that do not hold, and those that ran nothing.
    pub fn failing(&self) -> Vec<&str> {
        self.rows.iter().filter(|row| row.fails()).map(|row| row.about.id.as_str()).collect()
    }

    /// Text for the terminal: a table, and the reasons below it.
    pub fn text(&self) -> String {
        let mut table = Table::new(["claim", "kind", "verdict"]);
        for row in &self.rows {
            table.row([
                format!("{:<6} {}", row.about.id, row.about.claim),
                letters(row),
                row.verdict_text.clone(),
            ]);
        }
        let mut text =
            format!("Paper {}: {}\n{}\n\n{table}", self.paper.number(), self.title, self.settings_text());
        self.rows.iter().for_each(|row| text += &described(row));
        let count = |verdict| self.rows.iter().filter(|row| row.verdict == verdict).count();
        let [holds, differs, depends, not_yet] = Verdict::ALL.map(count);
        let where_ = if self.form == Form::Quick { " at the settings of the quick form" } else { "" };
        text + &format!("\n{holds} hold, {differs} differ, {depends} depend, {not_yet} not yet{where_}\n")
    }

    /// File and hash of the settings.
    fn settings_text(&self) -> String {
        let whose = if self.settings.committed { "" } else { ", which is NOT the committed one" };
        let form = if self.form == Form::Quick { ", quick form" } else { "" };
        format!("settings {} (SHA-256 {}){whose}{form}", self.settings.file, self.settings.sha256)
    }

    /// The table of the book's chapter, and the settings of each row.
    fn markdown(&self) -> String {
        let mut text = format!("{}\n\n", self.settings_text());
        text += "| id | kind | paper | ours | verdict |\n|---|---|---|---|---|\n";
        for row in &self.rows {
            let verdict = match row.note.as_str() {
                "" => format!("*{}*", row.verdict_text),
                note => format!("*{}*: {note}", row.verdict_text),
            };
            text += &format!(
                "| {} | {} | {} | {} | {verdict} |\n",
                row.about.id,
                letters(row),
                row.about.paper,
                row.ours
            );
        }
        for row in &self.rows {
            text += &format!(
                "\n## {}: {}\n\nHolds when {}. {}\n\nRun: {}.\n\n| setting | | value | tried | passage or reason |\n|---|---|---|---|---|\n",
                row.about.id,
                row.about.claim,
                row.about.holds_when,
                row.about.limits,
                ran(row)
            );
            for one in &row.settings {
                let tried: Vec<String> = one.tried.iter().map(ToString::to_string).collect();
                text += &format!(
                    "| `{}` | {} | {} | {} | {} |\n",
                    one.name,
                    one.basis,
                    one.value,
                    tried.join(", "),
                    one.source
                );
            }
        }
        text
    }

    /// Writes figures and tables.
    pub(super) fn write(&self, dir: &OutDir) -> Result<(), OutputError> {
        for figure in &self.figures {
            figure.picture.write(dir, stem_of(&figure.path()))?;
        }
        let stem = stem(self.paper);
        dir.write_file(&format!("{stem}.md"), |out| Ok(out.write_all(self.markdown().as_bytes())?))?;
        dir.write_json(&format!("{stem}.json"), self)?;
        Ok(())
    }
}

/// Text of a row.
fn described(row: &ClaimRow) -> String {
    let about = &row.about;
    let mut text = format!("\n{}: {}\n", about.id, row.verdict_text);
    let mut line = |name: &str, what: &str| {
        if !what.is_empty() {
            text += &format!("  {name:<8} {what}\n");
        }
    };
    line("paper", &about.paper);
    line("ours", &row.ours);
    line("holds", &format!("when {}", about.holds_when));
    line("note", &row.note);
    line("limits", &about.limits);
    line("run", &ran(row));
    line("less", &row.less_work.join(", "));
    for (name, basis) in [("stated", "stated"), ("open", "open")] {
        line(name, &settings(&row.settings, basis));
    }
    line("settings", &format!("SHA-256 {}", row.settings_sha256));
    line("figures", &row.figures.join(" "));
    text
}

/// Amount of work of a row.
fn ran(row: &ClaimRow) -> String {
    let each = row.ran.iter().map(|number| format!("{} {}", number.name.replace('_', " "), number.value));
    each.collect::<Vec<_>>().join(", ")
}

/// Settings of one kind with the values tried.
fn settings(all: &[Listed], basis: &str) -> String {
    let one = |one: &Listed| {
        let tried: Vec<String> = one.tried.iter().map(ToString::to_string).collect();
        let of = if tried.is_empty() { String::new() } else { format!(" of {}", tried.join(", ")) };
        format!("{} {}{of}", one.name, one.value)
    };
    all.iter().filter(|listed| listed.basis == basis).map(one).collect::<Vec<_>>().join("; ")
}

/// Letter of the row's kind, with an F if it has figures.
fn letters(row: &ClaimRow) -> String {
    let drawn = if row.figures.is_empty() { "" } else { ",F" };
    format!("{}{drawn}", row.about.kind.letter())
}

/// A figure's path without its ending.
fn stem_of(path: &str) -> &str {
    path.strip_suffix(".svg").unwrap_or(path)
}

/// The fields of an earlier report that are compared.
#[derive(Deserialize)]
struct Earlier {
    form: Form,
    rows: Vec<Id>,
}

#[derive(Deserialize)]
struct Id {
    id: String,
}

/// Refuses a folder whose result of `paper` has rows that are not computed now, or is of the full form if
/// this is the quick form. A file that cannot be read is no result.
pub(super) fn check_earlier(
    paper: Paper,
    options: &ReproduceOptions,
    out: &Destination,
) -> Result<(), RunError> {
    let file = out.folder.join(format!("{}.json", stem(paper)));
    let text = if out.force { None } else { fs::read_to_string(file).ok() };
    let Some(Earlier { form, rows }) = text.and_then(|text| serde_json::from_str(&text).ok()) else {
        return Ok(());
    };
    let lost = rows.iter().filter(|row| !options.wants(&row.id)).count();
    let smaller = form == Form::Full && options.quick;
    if lost == 0 && !smaller {
        return Ok(());
    }
    let ids: Vec<&str> = rows.iter().map(|row| row.id.as_str()).collect();
    let why = match lost {
        0 => "this is the quick form".to_owned(),
        lost => format!("{lost} of them are not computed now"),
    };
    let why = format!(
        "holds a {} result of Paper {} with {} rows ({}), and {why}; give another folder with --out, or --force to lose it",
        form.name(),
        paper.number(),
        ids.len(),
        ids.join(", ")
    );
    Err(RunError::invalid(out.folder.display(), why))
}

/// A picture and its name.
pub struct Figure {
    /// Name of the figure without ending, for example `III_fig3`.
    pub name: &'static str,
    /// Picture.
    pub picture: Picture,
}

impl Figure {
    /// Path of the SVG below the folder of results.
    pub(super) fn path(&self) -> String {
        format!("plots/{}.svg", self.name)
    }

    /// Series on two axes, each `(quantity, unit)`.
    pub(super) fn lines(
        name: &'static str,
        title: &str,
        subject: &str,
        axes: [(&str, &str); 2],
        series: Vec<Series>,
    ) -> Self {
        let axes = axes.map(|(name, unit)| AxisSpec::even(name, unit));
        Self::of(name, [title, subject], ChartPanel::over("", axes, series))
    }

    /// Points in a plane: both axes have the same scale.
    pub(super) fn plane(name: &'static str, titles: [&str; 2], axes: [&str; 2], series: Vec<Series>) -> Self {
        let axes = axes.map(|name| AxisSpec::even(name, ""));
        Self::of(name, titles, ChartPanel::over("", axes, series).equal())
    }

    /// A figure of one panel.
    pub(super) fn of(name: &'static str, [title, subject]: [&str; 2], panel: ChartPanel) -> Self {
        Self { name, picture: Chart::new(title, subject, vec![panel]).picture(&PlotStyle::default()) }
    }
}

/// Curves over a number that doubles; `axes` are the names of the horizontal and the vertical axis.
pub(super) fn over_doublings(
    name: &'static str,
    titles: [&str; 2],
    axes: [&str; 2],
    curves: Vec<Series>,
) -> Figure {
    let panel = ChartPanel::new("", axes, curves).on(Scale::Doublings, Scale::Even);
    Figure::of(name, titles, panel)
}

/// Time.
pub(super) const TIME: (&str, &str) = ("time", "s");
/// Power.
pub(super) const POWER: (&str, &str) = ("power", "W");
/// Energy of a frame.
pub(super) const ENERGY: (&str, &str) = ("energy per frame", "J");

/// A line.
pub(super) fn line(name: &str, points: Vec<(f64, f64)>) -> Series {
    Series::new(name, PlotMark::Line(points))
}

/// Dots without names.
pub(super) fn dots(name: &str, points: Vec<(f64, f64)>) -> Series {
    let dots = points.into_iter().map(|(x, y)| (x, y, String::new())).collect();
    Series::new(name, PlotMark::Dots(dots))
}

/// A horizontal line.
pub(super) fn level(name: &str, from: f64, to: f64, height: f64) -> Series {
    line(name, vec![(from, height), (to, height)])
}

/// Values over their index.
pub(super) fn by_place(values: &[f64]) -> Vec<(f64, f64)> {
    values.iter().enumerate().map(|(place, value)| (place as f64, *value)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::row::tests::row;
    use super::super::settings::AgreementKind;
    use super::*;

    fn done(id: &'static str, kind: AgreementKind, verdict: Verdict) -> Done {
        let axes = [("x", ""), ("y", "W")];
        let figure = Figure::lines("III_fig1", "t", "s", axes, Vec::new());
        let figures = if kind == AgreementKind::Order { vec![figure] } else { Vec::new() };
        Done { row: row(id, kind, verdict), figures }
    }

    fn report(verdict: Verdict) -> PaperReport {
        let rows = vec![
            done("III-8", AgreementKind::Equality, verdict),
            done("III-9", AgreementKind::Order, Verdict::Differs),
        ];
        let origin =
            SettingsOrigin { file: "paper.ron".to_owned(), sha256: "abc".to_owned(), committed: false };
        PaperReport::new(Paper::Three, Form::Quick, origin, rows)
    }

    #[test]
    fn an_equality_that_does_not_hold_is_named() {
        assert!(report(Verdict::Holds).failing().is_empty() && report(Verdict::Holds).equalities_hold);
        for verdict in [Verdict::Differs, Verdict::Depends, Verdict::NotYet] {
            assert_eq!(report(verdict).failing(), ["III-8"]);
            assert!(!report(verdict).equalities_hold);
        }
    }

    #[test]
    fn text_and_json_say_the_same() {
        let report = report(Verdict::NotYet);
        let text = report.text();
        for part in [
            "III-8  a claim",
            "O,F  differs",
            "paper    one",
            "ours     two",
            "run      draws 3",
            "holds    when it does",
            "limits   Little.",
            "settings SHA-256 abc",
            "SHA-256 abc), which is NOT the committed one, quick form",
            "0 hold, 1 differ, 0 depend, 1 not yet at the settings of the quick form",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["rows"][0]["figure"], serde_json::Value::Null);
        assert_eq!(json["rows"][1]["figure"], "plots/III_fig1.svg");
        assert_eq!((&json["rows"][1]["kind"], &json["rows"][1]["id"]), (&"O".into(), &"III-9".into()));
        assert_eq!((&json["paper"], &json["form"]), (&"III".into(), &"quick".into()));
        assert_eq!(json["rows"][0]["settings_sha256"], json["settings"]["sha256"]);
        assert!(report.markdown().contains("| III-9 | O,F | one | two | *differs*: because |"));
    }

    #[test]
    fn a_larger_result_is_not_replaced_by_a_smaller_one() {
        let folder = tempfile::tempdir().unwrap();
        let out = Destination::new(folder.path());
        let options = |quick, rows: &[&str]| ReproduceOptions {
            quick,
            rows: rows.iter().map(|row| (*row).to_owned()).collect(),
            ..ReproduceOptions::default()
        };
        let refusal = |options: &ReproduceOptions| {
            check_earlier(Paper::Six, options, &out).err().map(|error| error.to_string())
        };
        assert_eq!(refusal(&options(true, &["VI-2"])), None, "an empty folder");
        let file = folder.path().join("reproduce_VI.json");
        fs::write(&file, r#"{"form": "full", "rows": [{"id": "VI-1"}, {"id": "VI-2"}]}"#).unwrap();
        for (smaller, why) in [
            (options(false, &["vi-2"]), "1 of them are not computed now"),
            (options(true, &[]), "this is the quick form"),
        ] {
            let message = refusal(&smaller).unwrap();
            assert!(message.contains("a full result of Paper VI with 2 rows (VI-1, VI-2)"), "{message}");
            assert!(message.contains(why) && message.contains("--force"), "{message}");
        }
        assert_eq!(refusal(&options(false, &[])), None, "all rows anew");
        assert_eq!(refusal(&options(false, &["VI-1", "vi-2"])), None);
        let forced = Destination { force: true, ..out.clone() };
        assert!(check_earlier(Paper::Six, &options(true, &["VI-2"]), &forced).is_ok());
        assert!(check_earlier(Paper::Two, &options(true, &[]), &out).is_ok(), "a result of another paper");
        fs::write(&file, "mine").unwrap();
        assert_eq!(refusal(&options(true, &["VI-2"])), None, "no result; whose it is is checked elsewhere");
    }
}
