//! A Parquet file with all its pages, those included that the parquet crate would need C for.

use super::zstd::ZstdPages;
use parquet::basic::Compression;
use parquet::bloom_filter::Sbbf;
use parquet::column::page::PageReader;
use parquet::errors::Result;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData, RowGroupMetaData};
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::record::reader::RowIter;
use parquet::schema::types::Type;
use std::fs::File;
use std::path::{Path, PathBuf};

/// A reader as that of the parquet crate, which also unpacks Zstandard.
pub(crate) struct PackedFile {
    path: PathBuf,
    file: SerializedFileReader<File>,
}

impl PackedFile {
    /// Reads the footer of an open file; `path` is where it lies.
    pub fn new(path: &Path, file: File) -> Result<Self> {
        Ok(Self { path: path.to_owned(), file: SerializedFileReader::new(file)? })
    }

    /// Whether columns packed so can be read.
    pub fn unpacks(compression: Compression) -> bool {
        !matches!(compression, Compression::BROTLI(_) | Compression::LZO)
    }
}

impl FileReader for PackedFile {
    fn metadata(&self) -> &ParquetMetaData {
        self.file.metadata()
    }

    fn num_row_groups(&self) -> usize {
        self.file.num_row_groups()
    }

    fn get_row_group(&self, index: usize) -> Result<Box<dyn RowGroupReader + '_>> {
        Ok(Box::new(PackedGroup { path: &self.path, group: self.file.get_row_group(index)? }))
    }

    fn get_row_iter(&self, projection: Option<Type>) -> Result<RowIter<'_>> {
        RowIter::from_file(projection, self)
    }
}

/// Where the pages of a column begin, by what the file says.
pub(super) fn first_page(chunk: &ColumnChunkMetaData) -> i64 {
    let data = chunk.data_page_offset();
    chunk.dictionary_page_offset().map_or(data, |dictionary| dictionary.min(data))
}

/// The rows that were written together.
struct PackedGroup<'a> {
    path: &'a Path,
    group: Box<dyn RowGroupReader + 'a>,
}

impl RowGroupReader for PackedGroup<'_> {
    fn metadata(&self) -> &RowGroupMetaData {
        self.group.metadata()
    }

    fn num_columns(&self) -> usize {
        self.group.num_columns()
    }

    fn get_column_page_reader(&self, column: usize) -> Result<Box<dyn PageReader>> {
        let chunk = self.metadata().column(column);
        if !matches!(chunk.compression(), Compression::ZSTD(_)) {
            return self.group.get_column_page_reader(column);
        }
        let [start, length] = [first_page(chunk), chunk.compressed_size()].map(|bytes| bytes.max(0) as u64);
        Ok(Box::new(ZstdPages::new(File::open(self.path)?, start, length)?))
    }

    fn get_column_bloom_filter(&self, column: usize) -> Option<&Sbbf> {
        self.group.get_column_bloom_filter(column)
    }

    fn get_row_iter(&self, projection: Option<Type>) -> Result<RowIter<'_>> {
        RowIter::from_row_group(projection, self)
    }
}
