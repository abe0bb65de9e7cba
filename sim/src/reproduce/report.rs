//! All rows of a paper as text, JSON and files.

use serde::Serialize;

use super::row::{Row, Verdict};
use super::{Done, Effort, Figure, Paper};
use crate::output::table::Table;
use crate::output::{OutDir, OutputError};

/// The rows of a paper.
#[derive(Serialize)]
pub struct Report {
    /// Which paper.
    pub paper: Paper,
    /// Its title.
    pub title: &'static str,
    /// How much was simulated and recorded.
    pub effort: Effort,
    /// Whether every row of kind E holds.
    pub equalities_hold: bool,
    /// The rows in order.
    pub rows: Vec<Row>,
    /// What was drawn.
    #[serde(skip)]
    figures: Vec<Figure>,
}

/// What an earlier run left: should this one die on the way, nothing old may stand in for it.
pub(super) fn remove_stale(dir: &OutDir, paper: Paper) -> Result<(), OutputError> {
    dir.remove_stale("", &format!("{}.", stem(paper)), &["json", "md"])?;
    dir.remove_stale("plots", &format!("{}_fig", paper.number()), &["svg", "png"])
}

fn stem(paper: Paper) -> String {
    format!("reproduce_{}", paper.number())
}

impl Report {
    pub(super) fn new(paper: Paper, effort: Effort, done: Vec<Done>) -> Self {
        let (mut rows, mut figures) = (Vec::new(), Vec::new());
        for Done { mut row, figures: drawn } in done {
            row.figures = drawn.iter().map(Figure::path).collect();
            row.figure = row.figures.first().cloned();
            rows.push(row);
            figures.extend(drawn);
        }
        let equalities_hold = !rows.iter().any(Row::fails);
        Self { paper, title: paper.title(), effort, equalities_hold, rows, figures }
    }

    /// The rows of kind E that do not hold.
    pub fn failing(&self) -> Vec<&'static str> {
        self.rows.iter().filter(|row| row.fails()).map(|row| row.id).collect()
    }

    /// What is printed: a table, and below it the reasons.
    pub fn text(&self) -> String {
        let mut table = Table::new(["claim", "kind", "verdict"]);
        for row in &self.rows {
            table.row([format!("{:<6} {}", row.id, row.claim), letters(row), row.verdict.name().to_owned()]);
        }
        let held = |verdict| self.rows.iter().filter(|row| row.verdict == verdict).count();
        let mut text = format!("Paper {}: {}\n\n{table}", self.paper.number(), self.title);
        for row in &self.rows {
            text += &format!(
                "\n{}: {}\n  paper    {}\n  ours     {}\n  note     {}\n",
                row.id,
                row.verdict.name(),
                row.paper,
                row.ours,
                row.note
            );
            if !row.figures.is_empty() {
                text += &format!("  figures  {}\n", row.figures.join(" "));
            }
        }
        let [holds, differs, not_yet] = [Verdict::Holds, Verdict::Differs, Verdict::NotYet].map(held);
        text + &format!("\n{holds} hold, {differs} differ, {not_yet} not yet\n")
    }

    /// The table of the book's chapter.
    fn markdown(&self) -> String {
        let mut text = "| id | kind | paper | ours | verdict |\n|---|---|---|---|---|\n".to_owned();
        for row in &self.rows {
            let verdict = match row.verdict {
                Verdict::Holds => "*holds*".to_owned(),
                other => format!("*{}*: {}", other.name(), row.note),
            };
            text +=
                &format!("| {} | {} | {} | {} | {verdict} |\n", row.id, letters(row), row.paper, row.ours);
        }
        text
    }

    /// Writes figures and tables; the JSON comes last.
    pub(super) fn write(&self, dir: &OutDir) -> Result<(), OutputError> {
        for figure in &self.figures {
            figure.picture.write(dir, stem_of(&figure.path()))?;
        }
        let stem = stem(self.paper);
        dir.write_atomic(&format!("{stem}.md"), |out| Ok(out.write_all(self.markdown().as_bytes())?))?;
        dir.write_json(&format!("{stem}.json"), self)?;
        Ok(())
    }
}

/// Letters of the row's kind, with an F where there are figures.
fn letters(row: &Row) -> String {
    let drawn = if row.figures.is_empty() { "" } else { ",F" };
    format!("{}{drawn}", row.kind.letter())
}

/// A figure's path without its ending.
fn stem_of(path: &str) -> &str {
    path.strip_suffix(".svg").unwrap_or(path)
}

#[cfg(test)]
mod tests {
    use super::super::row::{Kind, numbers};
    use super::*;

    fn done(id: &'static str, kind: Kind, verdict: Verdict) -> Done {
        let row = Row {
            id,
            kind,
            claim: "a claim",
            paper: "one",
            ours: "two".to_owned(),
            verdict,
            note: "because".to_owned(),
            numbers: numbers([("n", 2.0)]),
            figure: None,
            figures: Vec::new(),
        };
        let axes = [("x", ""), ("y", "W")];
        let figure = Figure::lines("III_fig1", "t", "s", axes, Vec::new());
        Done { row, figures: if kind == Kind::Order { vec![figure] } else { Vec::new() } }
    }

    fn report(verdict: Verdict) -> Report {
        let rows = vec![done("III-8", Kind::Equality, verdict), done("III-9", Kind::Order, Verdict::Differs)];
        Report::new(Paper::Three, Effort::QUICK, rows)
    }

    #[test]
    fn an_equality_that_does_not_hold_is_named() {
        assert!(report(Verdict::Holds).failing().is_empty() && report(Verdict::Holds).equalities_hold);
        for verdict in [Verdict::Differs, Verdict::NotYet] {
            assert_eq!(report(verdict).failing(), ["III-8"]);
            assert!(!report(verdict).equalities_hold);
        }
    }

    #[test]
    fn text_and_json_say_the_same() {
        let report = report(Verdict::NotYet);
        let text = report.text();
        for part in
            ["III-8  a claim", "O,F  differs", "paper    one", "ours     two", "0 hold, 1 differ, 1 not yet"]
        {
            assert!(text.contains(part), "{part}: {text}");
        }
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["rows"][0]["figure"], serde_json::Value::Null);
        assert_eq!(json["rows"][1]["figure"], "plots/III_fig1.svg");
        assert_eq!(json["rows"][1]["kind"], "O");
        assert_eq!(json["paper"], "III");
        assert!(report.markdown().contains("| III-9 | O,F | one | two | *differs*: because |"));
    }
}
