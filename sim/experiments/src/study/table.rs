//! Tables whose columns are declared once, for CSV, JSON, Markdown and the terminal.

use output::dir::BoxError;
use output::table::grouped;
use serde::ser::{SerializeMap, SerializeSeq};
use serde::{Serialize, Serializer};

/// A value as CSV and JSON have it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A name.
    Text(String),
    /// A number of things.
    Count(u64),
    /// Any other number.
    Number(f64),
    /// True or false.
    Flag(bool),
    /// No value: an empty field of CSV, `null` in JSON.
    Missing,
}

macro_rules! values {
    ($($from:ty: $value:ident => $into:expr),* $(,)?) => {
        $(impl From<$from> for Value {
            fn from($value: $from) -> Self {
                $into
            }
        })*
    };
}

values! {
    &str: text => Self::Text(text.to_owned()),
    String: text => Self::Text(text),
    u32: count => Self::Count(u64::from(count)),
    u64: count => Self::Count(count),
    usize: count => Self::Count(count as u64),
    f64: number => Self::Number(number),
    bool: flag => Self::Flag(flag),
}

impl<V: Into<Value>> From<Option<V>> for Value {
    fn from(value: Option<V>) -> Self {
        value.map_or(Self::Missing, Into::into)
    }
}

/// Shows a value as it is.
pub fn plain<V: ToString>(value: V) -> String {
    value.to_string()
}

/// Shows a count, its digits in groups of three.
pub fn count(value: impl TryInto<u64>) -> String {
    value.try_into().map_or(String::new(), grouped)
}

/// Shows a number with so many decimals.
pub fn fixed(decimals: usize) -> impl Fn(f64) -> String {
    move |value| format!("{value:.decimals$}")
}

/// Shows a percentage with so many decimals.
pub fn percent(decimals: usize) -> impl Fn(f64) -> String {
    move |value| format!("{value:.decimals$} %")
}

/// Shows a share as a percentage with so many decimals.
pub fn share(decimals: usize) -> impl Fn(f64) -> String {
    move |value| format!("{:.decimals$} %", 100.0 * value)
}

/// Shows seconds as milliseconds, or joules as millijoules, with so many decimals and without the unit.
pub fn millis(decimals: usize) -> impl Fn(f64) -> String {
    move |value| format!("{:.decimals$}", 1e3 * value)
}

/// Shows a value that may be missing; `-` where it is.
pub fn optional<V>(show: impl Fn(V) -> String) -> impl Fn(Option<V>) -> String {
    move |value| value.map_or("-".to_owned(), &show)
}

/// A table while its columns are declared.
#[derive(Debug)]
pub struct TableBuilder<R> {
    rows: Vec<R>,
    sheet: Sheet,
}

/// A table with its values and what is shown of them.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    height: usize,
    columns: Vec<Column>,
    csv: Option<&'static str>,
    before: String,
    after: String,
}

#[derive(Clone, Debug, Default)]
struct Column {
    /// In CSV and JSON; a column without a name is not there.
    name: &'static str,
    values: Vec<Value>,
    heading: String,
    /// Texts of the column; one without any is not shown.
    cells: Vec<String>,
    /// Whether it is in Markdown alone.
    detail: bool,
}

impl<R> TableBuilder<R> {
    /// A table of these rows, without columns yet.
    pub fn of(rows: impl IntoIterator<Item = R>) -> Self {
        let rows: Vec<R> = rows.into_iter().collect();
        let sheet = Sheet { height: rows.len(), ..Sheet::default() };
        Self { rows, sheet }
    }

    /// A column of CSV and JSON called `name` that is shown under `heading`.
    #[must_use]
    pub fn column<V: Into<Value>>(
        mut self,
        name: &'static str,
        heading: &str,
        read: impl Fn(&R) -> V,
        show: impl Fn(V) -> String,
    ) -> Self {
        let values = self.rows.iter().map(|row| read(row).into()).collect();
        let cells = self.rows.iter().map(|row| show(read(row))).collect();
        let column = Column { name, values, heading: heading.to_owned(), cells, detail: false };
        self.sheet.columns.push(column);
        self
    }

    /// A column of CSV and JSON alone.
    #[must_use]
    pub fn data<V: Into<Value>>(mut self, name: &'static str, read: impl Fn(&R) -> V) -> Self {
        let values = self.rows.iter().map(|row| read(row).into()).collect();
        self.sheet.columns.push(Column { name, values, ..Column::default() });
        self
    }

    /// A column that is shown and is in no file of data.
    #[must_use]
    pub fn shown<V>(self, heading: &str, read: impl Fn(&R) -> V, show: impl Fn(V) -> String) -> Self {
        self.cells(heading, |row| show(read(row)), false)
    }

    /// A column of Markdown alone.
    #[must_use]
    pub fn detail<V>(self, heading: &str, read: impl Fn(&R) -> V, show: impl Fn(V) -> String) -> Self {
        self.cells(heading, |row| show(read(row)), true)
    }

    fn cells(mut self, heading: &str, show: impl Fn(&R) -> String, detail: bool) -> Self {
        let cells = self.rows.iter().map(show).collect();
        self.sheet.columns.push(Column { heading: heading.to_owned(), cells, detail, ..Column::default() });
        self
    }

    /// The same table, written into a file as CSV.
    #[must_use]
    pub fn csv(mut self, file: &'static str) -> Self {
        self.sheet.csv = Some(file);
        self
    }

    /// The same table with lines printed before it.
    #[must_use]
    pub fn before(mut self, lines: impl Into<String>) -> Self {
        self.sheet.before = lines.into();
        self
    }

    /// The same table with lines printed after it.
    #[must_use]
    pub fn after(mut self, lines: impl Into<String>) -> Self {
        self.sheet.after = lines.into();
        self
    }

    /// The table with all of its columns.
    pub fn sheet(self) -> Sheet {
        self.sheet
    }
}

impl Sheet {
    /// The file it is written into as CSV.
    pub fn csv_file(&self) -> Option<&'static str> {
        self.csv
    }

    /// Writes names and values as CSV.
    ///
    /// # Errors
    /// Errors of `out`.
    pub fn write_csv(&self, out: &mut dyn std::io::Write) -> Result<(), BoxError> {
        let mut table = csv::WriterBuilder::new().has_headers(false).from_writer(out);
        table.write_record(self.data().map(|column| column.name))?;
        for row in 0..self.height {
            table.serialize(self.data().map(|column| &column.values[row]).collect::<Vec<_>>())?;
        }
        Ok(table.flush()?)
    }

    /// The table as Markdown; `None` where nothing is shown.
    pub fn markdown(&self) -> Option<String> {
        let columns: Vec<&Column> = self.columns.iter().filter(|column| column.is_shown()).collect();
        columns.first()?;
        let line = |cell: &dyn Fn(&Column) -> String| {
            let cells: Vec<String> = columns.iter().map(|column| cell(column)).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let heading = line(&|column| column.heading.clone()) + &"|---".repeat(columns.len()) + "|\n";
        let rows = (0..self.height).map(|row| line(&|column| column.cells[row].clone()));
        Some(heading + &rows.collect::<String>())
    }

    /// The table for a terminal; `None` without a column to print.
    pub fn text(&self) -> Option<String> {
        let printed = || self.columns.iter().filter(|column| column.is_shown() && !column.detail);
        printed().next()?;
        let mut table = output::table::Table::new(printed().map(|column| column.heading.as_str()));
        for row in 0..self.height {
            table.row(printed().map(|column| column.cells[row].as_str()));
        }
        Some(format!("{}{table}{}", self.before, self.after))
    }

    fn data(&self) -> impl Iterator<Item = &Column> {
        self.columns.iter().filter(|column| !column.name.is_empty())
    }
}

impl Column {
    fn is_shown(&self) -> bool {
        !self.heading.is_empty() || !self.cells.is_empty()
    }
}

/// A list of rows, each a map from names to values.
impl Serialize for Sheet {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        struct Line<'a>(&'a Sheet, usize);
        impl Serialize for Line<'_> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                let mut map = serializer.serialize_map(None)?;
                self.0
                    .data()
                    .try_for_each(|column| map.serialize_entry(column.name, &column.values[self.1]))?;
                map.end()
            }
        }
        let mut rows = serializer.serialize_seq(Some(self.height))?;
        (0..self.height).try_for_each(|row| rows.serialize_element(&Line(self, row)))?;
        rows.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_declared_once_and_comes_out_in_every_form() {
        let sheet = TableBuilder::of([("a", 0.5, Some(2_u32)), ("b", 1.0, None)])
            .column("name", "what", |row| row.0, plain)
            .column("error", "RMSE", |row| row.1, fixed(2))
            .data("count", |row| row.2)
            .detail("share", |row| row.1, share(0))
            .after("done\n")
            .sheet();
        let mut csv = Vec::new();
        sheet.write_csv(&mut csv).unwrap();
        assert_eq!(String::from_utf8(csv).unwrap(), "name,error,count\na,0.5,2\nb,1.0,\n");
        assert_eq!(sheet.text().unwrap(), "what  RMSE\na     0.50\nb     1.00\ndone\n");
        assert_eq!(
            sheet.markdown().unwrap(),
            "| what | RMSE | share |\n|---|---|---|\n| a | 0.50 | 50 % |\n| b | 1.00 | 100 % |\n"
        );
        let json = serde_json::to_string(&sheet).unwrap();
        let second = r#"{"name":"b","error":1.0,"count":null}"#;
        assert_eq!(json, format!(r#"[{{"name":"a","error":0.5,"count":2}},{second}]"#));
        let hidden = TableBuilder::of([1_u32]).data("n", |n| *n).sheet();
        assert!(hidden.text().is_none() && hidden.markdown().is_none());
    }
}
