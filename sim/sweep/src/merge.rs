//! All results of a sweep in one table in Parquet: columns of whole numbers, numbers or text, each of which
//! may lack values.

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

use activity::Event;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

use crate::execute::{Measured, Outcome, PassMeans};
use crate::plan::{Point, SweepPlan};
use crate::{Folder, Status, SweepError};

/// Name of the table.
pub const RESULTS: &str = "results.parquet";

/// Writes `results.parquet` of the sweep in `folder`: a row for each point, in the order of the plan. Returns
/// its path. With `partial`, points without a result are rows with a reason, too.
///
/// # Errors
/// [`SweepError::Unfinished`] if points are missing, [`SweepError::InTheWay`] if a file of the user has this
/// name, and if a file cannot be read or written.
pub fn merge(folder: &Folder, partial: bool) -> Result<PathBuf, SweepError> {
    let plan = folder.plan()?;
    let mut dir = folder.open("sweep merge", [RESULTS])?;
    let mut rows = Vec::with_capacity(plan.points.len());
    let mut missing = 0;
    for point in &plan.points {
        let result = folder.result(point)?.map(|result| result.outcome);
        missing += usize::from(result.is_none());
        rows.push(result.unwrap_or_else(|| Outcome::Error("not finished".to_owned())));
    }
    if missing > 0 && !partial {
        let (root, points) = (folder.path().to_owned(), plan.points.len());
        return Err(SweepError::Unfinished { damaged: damaged(folder)?, folder: root, missing, points });
    }
    folder.clean()?;
    let columns = columns(&plan, &rows);
    dir.write_file(RESULTS, |out| Ok(write_table(&columns, out)?))?;
    dir.publish()?;
    Ok(folder.path().join(RESULTS))
}

/// End of a message with the first damaged file; empty if there is none.
fn damaged(folder: &Folder) -> Result<String, SweepError> {
    let (_, damaged) = Status::of(folder)?;
    Ok(damaged.first().map_or(String::new(), |message| format!("; {message}")))
}

/// Columns of the table: id, settings, numbers, counters, reason of a failure.
fn columns(plan: &SweepPlan, rows: &[Outcome]) -> Vec<Column> {
    let ids = plan.points.iter().map(|point| Some(point.id.clone())).collect();
    let mut columns = vec![Column { name: "id".to_owned(), values: Values::Text(ids) }];
    columns.extend(settings(plan));
    let is_set = |name: &str| columns.iter().any(|column: &Column| column.name == name);
    let used: Vec<Column> = used(rows).into_iter().filter(|used| !is_set(&used.name)).collect();
    columns.extend(used);
    columns.extend(numbers(rows));
    columns.extend(passes(rows));
    columns.extend(counters(rows));
    let reasons = rows.iter().map(|row| match row {
        Outcome::Error(reason) => Some(reason.clone()),
        Outcome::ScreenedOut(reason) => Some(format!("screened out: {reason}")),
        Outcome::Undecided(reason) => Some(format!("undecided: {reason}")),
        Outcome::Measured(_) => None,
    });
    columns.push(Column { name: "error".to_owned(), values: Values::Text(reasons.collect()) });
    columns
}

/// A column for each setting of the sweep: those of all points, then those that vary, in order of first use.
fn settings(plan: &SweepPlan) -> Vec<Column> {
    let column = |path: &str, texts: Vec<Option<String>>| Column {
        name: path.to_owned(),
        values: Values::of_texts(texts),
    };
    let common = plan
        .settings
        .iter()
        .map(|setting| column(&setting.path, vec![Some(setting.value.to_string()); plan.points.len()]));
    let mut paths: Vec<&str> = Vec::new();
    for setting in plan.points.iter().flat_map(|point| &point.settings) {
        if !paths.contains(&&*setting.path) {
            paths.push(&setting.path);
        }
    }
    let varied = paths.into_iter().map(|path| {
        let value = |point: &Point| {
            let found = point.settings.iter().find(|setting| &*setting.path == path);
            found.map(|setting| setting.value.to_string())
        };
        column(path, plan.points.iter().map(value).collect())
    });
    common.chain(varied).collect()
}

/// Settings in use that are the same for all kinds of sweeps.
fn used(rows: &[Outcome]) -> Vec<Column> {
    let names: Vec<&String> =
        rows.iter().find_map(Outcome::measured).map_or(Vec::new(), |first| first.used.keys().collect());
    let column = |name: &String| {
        let texts = rows.iter().map(|row| row.measured()?.used.get(name).cloned()).collect();
        Column { name: name.clone(), values: Values::of_texts(texts) }
    };
    names.into_iter().map(column).collect()
}

fn numbers(rows: &[Outcome]) -> Vec<Column> {
    let whole = |name: &str, of: fn(&Measured) -> u64| Column {
        name: name.to_owned(),
        values: Values::Whole(rows.iter().map(|row| i64::try_from(of(row.measured()?)).ok()).collect()),
    };
    let number = |name: &str, of: fn(&Measured) -> f64| Column {
        name: name.to_owned(),
        values: Values::Number(rows.iter().map(|row| row.measured().map(of)).collect()),
    };
    let codes = |name: &str, of: fn(&Measured) -> &String| {
        let codes = |row: &Outcome| row.measured().map(of).filter(|codes| !codes.is_empty()).cloned();
        Column { name: name.to_owned(), values: Values::Text(rows.iter().map(codes).collect()) }
    };
    vec![
        whole("cycles", |row| row.cycles),
        number("busy_ms", |row| row.busy_ms),
        number("frame_ms", |row| row.frame_ms),
        number("busy_mJ", |row| row.busy_mj),
        number("busy_low_mJ", |row| row.busy_low_mj),
        number("busy_high_mJ", |row| row.busy_high_mj),
        number("frame_mJ", |row| row.frame_mj),
        number("energy_per_pixel_nJ", |row| row.nj_per_pixel),
        whole("dram_bytes", |row| row.dram_bytes),
        number("area_mm2", |row| row.area_mm2[0]),
        number("area_low_mm2", |row| row.area_mm2[1]),
        number("area_high_mm2", |row| row.area_mm2[2]),
        codes("accuracy_warnings", |row| &row.accuracy_warnings),
        codes("warnings", |row| &row.warnings),
        number("cycles_error", |row| row.cycles_error),
        number("energy_error", |row| row.energy_error),
    ]
}

/// Time and energy of each named pass. Rows without a pass of that name have no value.
fn passes(rows: &[Outcome]) -> Vec<Column> {
    let mut names: Vec<&str> = Vec::new();
    for pass in rows.iter().filter_map(Outcome::measured).flat_map(|row| &row.passes) {
        if !names.contains(&pass.name.as_str()) {
            names.push(&pass.name);
        }
    }
    let column = |name: &str, unit: &str, of: fn(&PassMeans) -> f64| {
        let value = |row: &Outcome| row.measured()?.passes.iter().find(|pass| pass.name == name).map(of);
        Column {
            name: format!("pass.{name}.{unit}"),
            values: Values::Number(rows.iter().map(value).collect()),
        }
    };
    let both = |name: &&str| [column(name, "ms", |pass| pass.ms), column(name, "mJ", |pass| pass.mj)];
    names.iter().flat_map(both).collect()
}

/// A column for each event that a point reports.
fn counters(rows: &[Outcome]) -> Vec<Column> {
    let column = |event: Event| {
        let count = |row: &Outcome| i64::try_from(row.measured()?.counts.get(event)?).ok();
        let counts: Vec<Option<i64>> = rows.iter().map(count).collect();
        let is_reported = counts.iter().any(Option::is_some);
        is_reported.then(|| Column { name: format!("count.{}", event.name()), values: Values::Whole(counts) })
    };
    Event::ALL.into_iter().filter_map(column).collect()
}

/// A column; `None` is a missing value.
struct Column {
    /// Name.
    pub name: String,
    /// Values, one per row.
    pub values: Values,
}

/// Values of a column.
pub(crate) enum Values {
    Whole(Vec<Option<i64>>),
    Number(Vec<Option<f64>>),
    Flag(Vec<Option<bool>>),
    Text(Vec<Option<String>>),
}

impl Values {
    /// Texts as whole numbers, numbers or flags if all of them are.
    pub fn of_texts(texts: Vec<Option<String>>) -> Self {
        if texts.iter().all(Option::is_none) {
            return Self::Text(texts);
        }
        let whole = parsed(&texts).map(Self::Whole);
        let number = || parsed(&texts).map(Self::Number);
        let flag = || parsed(&texts).map(Self::Flag);
        whole.or_else(number).or_else(flag).unwrap_or(Self::Text(texts))
    }

    fn physical(&self) -> Physical {
        match self {
            Self::Whole(_) => Physical::INT64,
            Self::Number(_) => Physical::DOUBLE,
            Self::Flag(_) => Physical::BOOLEAN,
            Self::Text(_) => Physical::BYTE_ARRAY,
        }
    }
}

/// The values of all texts; `None` if one has none.
fn parsed<T: std::str::FromStr>(texts: &[Option<String>]) -> Option<Vec<Option<T>>> {
    let value = |text: &Option<String>| match text {
        Some(text) => text.parse().ok().map(Some),
        None => Some(None),
    };
    texts.iter().map(value).collect()
}

/// Writes `columns` of equal length. Equal columns give equal bytes.
///
/// # Errors
/// If `out` fails.
fn write_table<W: Write + Send>(columns: &[Column], out: W) -> Result<(), ParquetError> {
    let fields = columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
    let schema = Type::group_type_builder("sweep").with_fields(fields).build()?;
    // Fixed, so that the bytes do not change with the version of the library.
    let properties = WriterProperties::builder()
        .set_created_by("quintile sweep".to_owned())
        .set_compression(Compression::SNAPPY)
        .build();
    let mut file = SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties))?;
    let mut group = file.next_row_group()?;
    for column in columns {
        match &column.values {
            Values::Whole(values) => write_column::<Int64Type, W>(&mut group, values)?,
            Values::Number(values) => write_column::<DoubleType, W>(&mut group, values)?,
            Values::Flag(values) => write_column::<BoolType, W>(&mut group, values)?,
            Values::Text(values) => {
                let bytes = |text: &Option<String>| text.as_deref().map(ByteArray::from);
                write_column::<ByteArrayType, W>(&mut group, &values.iter().map(bytes).collect::<Vec<_>>())?;
            }
        }
    }
    group.close()?;
    file.close().map(|_| ())
}

fn field(column: &Column) -> Result<Arc<Type>, ParquetError> {
    let physical = column.values.physical();
    let logical = (physical == Physical::BYTE_ARRAY).then_some(LogicalType::String);
    let field = Type::primitive_type_builder(&column.name, physical)
        .with_repetition(Repetition::OPTIONAL)
        .with_logical_type(logical)
        .build()?;
    Ok(Arc::new(field))
}

fn write_column<T: DataType, W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    values: &[Option<T::T>],
) -> Result<(), ParquetError> {
    let given: Vec<T::T> = values.iter().flatten().cloned().collect();
    let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
    let mut column =
        group.next_column()?.ok_or_else(|| ParquetError::General("no column left".to_owned()))?;
    column.typed::<T>().write_batch(&given, Some(&levels), None)?;
    column.close()
}

#[cfg(test)]
mod tests {
    use output::terminal::Progress;
    use traces::table::InputTable;

    use super::*;
    use crate::setting::Setting;
    use crate::{Shard, ShardWork};

    fn plan() -> SweepPlan {
        let point = |samples: &str, tile: &str| Point {
            id: format!("{samples}{tile}"),
            settings: [("samples", samples), ("gpu.pipeline.tile_px", tile)]
                .map(|(path, value)| Setting::new(path, value))
                .into(),
        };
        SweepPlan {
            name: "a".to_owned(),
            settings: [("scene", "tiny"), ("frames", "0..1")]
                .map(|(path, value)| Setting::new(path, value))
                .into(),
            points: vec![point("1", "8"), point("2", "7"), point("2", "4")],
            ..SweepPlan::default()
        }
    }

    fn bytes(shards: &[&str], threads: usize) -> Vec<u8> {
        let root = tempfile::tempdir().unwrap();
        let (folder, plan) = (Folder::at(root.path()), plan());
        folder.write_plan(&plan).unwrap();
        assert!(matches!(merge(&folder, false), Err(SweepError::Unfinished { missing: 3, points: 3, .. })));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for shard in shards {
            let work = ShardWork::new(&plan, &folder, Shard::parse(shard).unwrap(), false).unwrap();
            pool.install(|| work.run(&Progress::new(true))).unwrap();
        }
        std::fs::read(merge(&folder, false).unwrap()).unwrap()
    }

    #[test]
    fn the_table_is_the_same_bytes_for_any_shards_and_threads() {
        let all = bytes(&["1/1"], 2);
        assert_eq!(all, bytes(&["2/2", "1/2"], 1));
        assert_eq!(all, bytes(&["3/3", "1/3", "2/3", "2/3"], 3));
    }

    #[test]
    fn every_point_is_a_row_with_numbers_or_a_reason() {
        let root = tempfile::tempdir().unwrap();
        let (folder, plan) = (Folder::at(root.path()), plan());
        folder.write_plan(&plan).unwrap();
        let work = ShardWork::new(&plan, &folder, Shard::parse("1/2").unwrap(), false).unwrap();
        work.run(&Progress::new(true)).unwrap();
        let table = InputTable::read(&merge(&folder, true).unwrap()).unwrap();
        let cells = |name: &str| table.texts(name).unwrap();
        assert_eq!(cells("samples"), ["1", "2", "2"]);
        let errors = cells("error");
        assert!(errors[0].is_empty() && errors[1] == "not finished" && errors[2].is_empty(), "{errors:?}");
        let cycles = cells("cycles");
        assert!(cycles[1].is_empty() && cycles[0].parse::<u64>().unwrap() > 0, "{cycles:?}");
        assert_eq!(cells("gpu")[0], "reference");
        let work = ShardWork::new(&plan, &folder, Shard::default(), false).unwrap();
        let status = work.run(&Progress::new(true)).unwrap();
        assert_eq!((status.points, status.failed), (3, 1));
        let table = InputTable::read(&merge(&folder, false).unwrap()).unwrap();
        assert!(table.texts("error").unwrap()[1].starts_with("--set gpu.pipeline.tile_px=7: "));
    }

    #[test]
    fn texts_are_typed_if_all_of_them_are() {
        let of = |texts: &[&str]| {
            let texts = texts.iter().map(|text| (!text.is_empty()).then(|| (*text).to_owned()));
            Values::of_texts(texts.collect())
        };
        assert!(matches!(of(&["1", "", "-2"]), Values::Whole(values) if values == [Some(1), None, Some(-2)]));
        assert!(matches!(of(&["1", "2.5"]), Values::Number(values) if values == [Some(1.0), Some(2.5)]));
        assert!(
            matches!(of(&["true", "false"]), Values::Flag(values) if values == [Some(true), Some(false)])
        );
        assert!(matches!(of(&["1", "a"]), Values::Text(_)) && matches!(of(&["", ""]), Values::Text(_)));
    }
}
