//! A table of rows in Parquet: columns of whole numbers, numbers or text, each of which may lack values.

use std::io::Write;
use std::sync::Arc;

use ::parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use ::parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use ::parquet::errors::ParquetError;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use ::parquet::schema::types::Type;

/// A column; `None` is a missing value.
pub(crate) struct Column {
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
pub(crate) fn write<W: Write + Send>(columns: &[Column], out: W) -> Result<(), ParquetError> {
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
    use super::*;

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
