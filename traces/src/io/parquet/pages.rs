//! A reader of Parquet files that also decompresses Zstandard, for which the parquet crate would need C.
//!
//! Page headers are in Thrift's compact protocol (thrift-compact-protocol.md of Apache Thrift); field numbers
//! are those of `PageHeader` in parquet.thrift.

use bytes::Bytes;
use parquet::basic::{Compression, Encoding};
use parquet::bloom_filter::Sbbf;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData, RowGroupMetaData};
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::record::reader::RowIter;
use parquet::schema::types::Type;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// A reader as that of the parquet crate, which also unpacks Zstandard.
pub(crate) struct PagedFile {
    path: PathBuf,
    file: SerializedFileReader<File>,
}

impl PagedFile {
    /// Reads the footer of an open file; `path` is where it lies.
    pub fn new(path: &Path, file: File) -> Result<Self> {
        Ok(Self { path: path.to_owned(), file: SerializedFileReader::new(file)? })
    }

    /// Whether columns packed so can be read.
    pub fn unpacks(compression: Compression) -> bool {
        !matches!(compression, Compression::BROTLI(_) | Compression::LZO)
    }
}

impl FileReader for PagedFile {
    fn metadata(&self) -> &ParquetMetaData {
        self.file.metadata()
    }

    fn num_row_groups(&self) -> usize {
        self.file.num_row_groups()
    }

    fn get_row_group(&self, index: usize) -> Result<Box<dyn RowGroupReader + '_>> {
        Ok(Box::new(PagedGroup { path: &self.path, group: self.file.get_row_group(index)? }))
    }

    fn get_row_iter(&self, projection: Option<Type>) -> Result<RowIter<'_>> {
        RowIter::from_file(projection, self)
    }
}

/// The place of the first page of a column, as the file states it.
pub(super) fn first_page(chunk: &ColumnChunkMetaData) -> i64 {
    let data = chunk.data_page_offset();
    chunk.dictionary_page_offset().map_or(data, |dictionary| dictionary.min(data))
}

/// The rows that were written together.
struct PagedGroup<'a> {
    path: &'a Path,
    group: Box<dyn RowGroupReader + 'a>,
}

impl RowGroupReader for PagedGroup<'_> {
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

/// Longest page header that is read, in bytes: it may hold statistics.
const MAX_HEADER_BYTES: usize = 1 << 16;
/// Largest page that is decompressed, in bytes.
const MAX_PAGE_BYTES: u64 = 1 << 28;
/// Deepest nesting of structs.
const MAX_DEPTH: usize = 8;

/// The pages of one column of one row group.
pub(super) struct ZstdPages {
    file: File,
    /// Places of the next header and of the end of the last page.
    at: u64,
    end: u64,
    header: Option<Header>,
}

/// The relevant fields of a page header.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Header {
    kind: i64,
    unpacked: u64,
    packed: u64,
    values: u32,
    encoding: i64,
    nulls: u32,
    rows: u32,
    definition_bytes: u32,
    repetition_bytes: u32,
    stored: bool,
    bytes: u64,
}

fn damaged(reason: &str) -> ParquetError {
    ParquetError::General(format!("page: {reason}"))
}

impl ZstdPages {
    /// Pages in `length` bytes of a file from `start` on, as far as the file goes.
    pub fn new(file: File, start: u64, length: u64) -> Result<Self> {
        let end = start.saturating_add(length).min(file.metadata()?.len());
        Ok(Self { file, at: start, end, header: None })
    }

    /// The header of the next page, `None` at the end.
    fn header(&mut self) -> Result<Option<Header>> {
        if self.header.is_none() && self.at < self.end {
            let mut bytes = vec![0; MAX_HEADER_BYTES.min((self.end - self.at) as usize)];
            self.file.seek(SeekFrom::Start(self.at))?;
            self.file.read_exact(&mut bytes)?;
            let header = Header::read(&bytes).ok_or_else(|| damaged("its header is damaged"))?;
            if header.packed > self.end - self.at - header.bytes || header.unpacked > MAX_PAGE_BYTES {
                return Err(damaged("its size is wrong"));
            }
            self.header = Some(header);
        }
        Ok(self.header)
    }

    /// The bytes of the page, as many at the front as they are as `plain` says, the rest unpacked.
    fn body(&mut self, header: &Header) -> Result<Bytes> {
        let mut packed = vec![0; header.packed as usize];
        self.file.seek(SeekFrom::Start(self.at + header.bytes))?;
        self.file.read_exact(&mut packed)?;
        if header.stored {
            return Ok(packed.into());
        }
        let plain = u64::from(header.definition_bytes) + u64::from(header.repetition_bytes);
        if plain > header.packed || plain > header.unpacked {
            return Err(damaged("its levels are longer than it"));
        }
        let mut body = packed[..plain as usize].to_vec();
        if header.unpacked > plain {
            let decoder = ruzstd::decoding::StreamingDecoder::new(&packed[plain as usize..])
                .map_err(|error| damaged(&error.to_string()))?;
            decoder.take(header.unpacked - plain + 1).read_to_end(&mut body)?;
        }
        if body.len() as u64 != header.unpacked {
            Err(damaged("it unpacks to another size"))
        } else {
            Ok(body.into())
        }
    }

    fn pass(&mut self) {
        if let Some(header) = self.header.take() {
            self.at += header.bytes + header.packed;
        }
    }
}

impl PageReader for ZstdPages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        let Some(header) = self.header()? else { return Ok(None) };
        let buf = self.body(&header)?;
        self.pass();
        let encoding = encoding(header.encoding)?;
        Ok(Some(match header.kind {
            0 => Page::DataPage {
                buf,
                num_values: header.values,
                encoding,
                def_level_encoding: Encoding::RLE,
                rep_level_encoding: Encoding::RLE,
                statistics: None,
            },
            2 => Page::DictionaryPage { buf, num_values: header.values, encoding, is_sorted: false },
            3 => Page::DataPageV2 {
                buf,
                num_values: header.values,
                encoding,
                num_nulls: header.nulls,
                num_rows: header.rows,
                def_levels_byte_len: header.definition_bytes,
                rep_levels_byte_len: header.repetition_bytes,
                is_compressed: false,
                statistics: None,
            },
            _ => return Err(damaged("its kind is unknown")),
        }))
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        Ok(self.header()?.map(|header| PageMetadata {
            num_rows: (header.kind == 3).then_some(header.rows as usize),
            num_levels: Some(header.values as usize),
            is_dict: header.kind == 2,
        }))
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.header()?;
        self.pass();
        Ok(())
    }
}

impl Iterator for ZstdPages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

fn encoding(number: i64) -> Result<Encoding> {
    Ok(match number {
        0 => Encoding::PLAIN,
        2 => Encoding::PLAIN_DICTIONARY,
        3 => Encoding::RLE,
        5 => Encoding::DELTA_BINARY_PACKED,
        6 => Encoding::DELTA_LENGTH_BYTE_ARRAY,
        7 => Encoding::DELTA_BYTE_ARRAY,
        8 => Encoding::RLE_DICTIONARY,
        9 => Encoding::BYTE_STREAM_SPLIT,
        _ => return Err(damaged("its encoding is unknown")),
    })
}

impl Header {
    fn read(bytes: &[u8]) -> Option<Self> {
        let mut header = Self::default();
        let mut thrift = Thrift { bytes, at: 0 };
        thrift.fields(&mut Vec::new(), &mut |path, value| {
            let small = || u32::try_from(value).unwrap_or(u32::MAX);
            match *path {
                [1] => header.kind = value,
                [2] => header.unpacked = u64::try_from(value).unwrap_or(u64::MAX),
                [3] => header.packed = u64::try_from(value).unwrap_or(u64::MAX),
                [5 | 7 | 8, 1] => header.values = small(),
                [5 | 7, 2] | [8, 4] => header.encoding = value,
                [8, 2] => header.nulls = small(),
                [8, 3] => header.rows = small(),
                [8, 5] => header.definition_bytes = small(),
                [8, 6] => header.repetition_bytes = small(),
                [8, 7] => header.stored = value == 0,
                _ => {}
            }
        })?;
        header.bytes = thrift.at as u64;
        Some(header)
    }
}

/// A reader of Thrift's compact protocol.
struct Thrift<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Thrift<'_> {
    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn unsigned(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    fn signed(&mut self) -> Option<i64> {
        let value = self.unsigned()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    /// Reads a struct; passes the path and value of every number and truth value in it to `visit`.
    fn fields(&mut self, path: &mut Vec<i64>, visit: &mut dyn FnMut(&[i64], i64)) -> Option<()> {
        let mut field = 0;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(());
            }
            field = if head >> 4 == 0 { self.signed()? } else { field + i64::from(head >> 4) };
            path.push(field);
            self.value(head & 0x0f, path, visit)?;
            path.pop();
        }
    }

    fn value(&mut self, kind: u8, path: &mut Vec<i64>, visit: &mut dyn FnMut(&[i64], i64)) -> Option<()> {
        match kind {
            1 | 2 => visit(path, i64::from(kind == 1)),
            3 => self.at += 1,
            4..=6 => {
                let value = self.signed()?;
                visit(path, value);
            }
            7 => self.at += 8,
            8 => {
                let length = usize::try_from(self.unsigned()?).ok()?;
                self.at = self.at.checked_add(length)?;
            }
            12 if path.len() < MAX_DEPTH => self.fields(path, visit)?,
            _ => return None,
        }
        (self.at <= self.bytes.len()).then_some(())
    }
}
