//! Units that other programs put into the metadata of fields. Arrow keeps them in a schema of its own among
//! the metadata of a Parquet file (`ARROW:schema`: Base64 of an IPC message, which is a FlatBuffer;
//! Schema.fbs and Message.fbs of Apache Arrow).

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::collections::BTreeMap;

/// Keys of units; letter case does not count.
const KEYS: [&str; 2] = ["unit", "units"];
/// Fields of the tables `Message`, `Schema`, `Field` and `KeyValue`.
const HEADER: usize = 2;
const FIELDS: usize = 1;
const METADATA: usize = 6;
const NAME: usize = 0;
const KEY: usize = 0;
const VALUE: usize = 1;

fn is_key(text: &str) -> bool {
    KEYS.iter().any(|key| key.eq_ignore_ascii_case(text))
}

/// The unit of each field that has one, by its name. What cannot be read has none.
pub(super) fn units(schema: &str) -> BTreeMap<String, String> {
    let bytes = STANDARD.decode(schema).unwrap_or_default();
    read(&bytes).unwrap_or_default()
}

fn read(bytes: &[u8]) -> Option<BTreeMap<String, String>> {
    let flat = Flat { bytes };
    // The length of the message stands before it, since Arrow 0.15 after four bytes of ones.
    let begin = if flat.u32(0)? == u32::MAX { 8 } else { 4 };
    let schema = flat.table(flat.follow(begin)?, HEADER)?;
    let mut units = BTreeMap::new();
    for field in flat.tables(schema, FIELDS)? {
        let Some(name) = flat.text(field, NAME) else { continue };
        let pairs = flat.tables(field, METADATA).unwrap_or_default();
        let unit = |pair: &&usize| flat.text(**pair, KEY).is_some_and(is_key);
        if let Some(unit) = pairs.iter().find(unit).and_then(|pair| flat.text(*pair, VALUE)) {
            units.insert(name.to_owned(), unit.trim().to_owned());
        }
    }
    Some(units)
}

/// A FlatBuffer; every place is checked.
struct Flat<'a> {
    bytes: &'a [u8],
}

impl<'a> Flat<'a> {
    fn u32(&self, at: usize) -> Option<u32> {
        self.bytes.get(at..)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
    }

    fn u16(&self, at: usize) -> Option<u16> {
        self.bytes.get(at..)?.first_chunk().map(|bytes| u16::from_le_bytes(*bytes))
    }

    /// The target of an offset.
    fn follow(&self, at: usize) -> Option<usize> {
        at.checked_add(self.u32(at)? as usize)
    }

    /// The place of a table's field; `None` if it is absent.
    fn field(&self, table: usize, field: usize) -> Option<usize> {
        let back = i64::from(self.u32(table)?.cast_signed());
        let layout = usize::try_from(i64::try_from(table).ok()? - back).ok()?;
        let entry = 4 + 2 * field;
        if entry >= usize::from(self.u16(layout)?) {
            return None;
        }
        let offset = usize::from(self.u16(layout + entry)?);
        (offset > 0).then_some(table + offset)
    }

    fn table(&self, table: usize, field: usize) -> Option<usize> {
        self.follow(self.field(table, field)?)
    }

    /// The tables in a list.
    fn tables(&self, table: usize, field: usize) -> Option<Vec<usize>> {
        let list = self.table(table, field)?;
        let count = self.u32(list)? as usize;
        // Each takes four bytes, so a false number is not believed.
        (count <= self.bytes.len() / 4).then_some(())?;
        (0..count).map(|index| self.follow(list + 4 + 4 * index)).collect()
    }

    fn text(&self, table: usize, field: usize) -> Option<&'a str> {
        let at = self.table(table, field)?;
        let bytes = self.bytes.get(at + 4..)?.get(..self.u32(at)? as usize)?;
        str::from_utf8(bytes).ok()
    }
}
