//! Definitions at the beginning of a JLS file, written and read: sources, signals, and the places of their
//! data.

use crate::chunk::{ChunkFile, ChunkHeader, ChunkWriter, List};
use crate::{
    ANNOTATIONS, DATA_SAMPLES, DEFINITION, ENTRIES_PER_ENTRY, ENTRY_SAMPLES, F32, FIXED_RATE, HEAD, JSON,
    JlsReadError, LEVELS, SIGNAL, SIGNAL_MASK, SIGNAL_TEXTS, SOURCE, SOURCE_TEXTS, SUMMARY_ENTRIES,
    USER_DATA, UTC, VARIABLE_RATE, field,
};
use std::collections::BTreeMap;
use std::io::{self, Seek, Write};

/// Tag of the chunk with the places of the data of a signal of fixed rate, and of its indices, one per level.
const FIXED_RATE_HEAD: u8 = FIXED_RATE + HEAD;
/// Numbers of signals and sources are below this.
const MAX_NUMBER: u16 = 256;
/// Annotations and UTC entries in a summary.
const STAMPS_PER_SUMMARY: u32 = 100;
/// The longest name of a source.
const MAX_NAME_CHARS: usize = 64;

/// Name and unit of a signal to be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SignalName<'a> {
    /// As instruments name it: `current`, `voltage`.
    pub name: &'a str,
    /// The unit of its samples: `A`, `V`.
    pub unit: &'a str,
}

/// Places of the heads of a signal's tracks, which are overwritten once the places of its data are known.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Heads {
    pub samples: u64,
    pub utc: u64,
}

/// The numbers of a signal: type, rate in Hz, samples of a chunk, samples of an entry, entries of a summary,
/// entries that become one of the level above, annotations and UTC entries of a summary.
type Numbers = [u32; 8];

/// Writes everything before the samples: sources, the signals, numbered from 1, and a description in JSON.
pub(crate) fn write<W: Write + Seek, const N: usize>(
    chunks: &mut ChunkWriter<W>,
    device: &str,
    signals: [SignalName<'_>; N],
    rate_hz: u32,
    description: &str,
) -> io::Result<[Heads; N]> {
    let [mut notes, mut sources, mut list] = [List::default(); 3];
    chunks.append(&mut notes, USER_DATA, 0, |_| ())?;
    // Source and signal 0 are those of annotations to the whole file, which readers expect; named as pyjls
    // does.
    write_source(chunks, &mut sources, 0, ["global_annotation_source", "jls", "-", "1.0.0", "-"])?;
    let unused = [F32, 0, 16, 16, 10, 10, STAMPS_PER_SUMMARY, STAMPS_PER_SUMMARY];
    write_signal(chunks, &mut list, 0, unused, SignalName { name: "global_annotation_signal", unit: "" })?;
    track(chunks, &mut list, VARIABLE_RATE, 0)?;
    track(chunks, &mut list, ANNOTATIONS, 0)?;
    write_source(chunks, &mut sources, 1, [&source_name(device), "", "", "", ""])?;
    let [block, samples, entries, fanout] =
        [DATA_SAMPLES, ENTRY_SAMPLES, SUMMARY_ENTRIES, ENTRIES_PER_ENTRY].map(|count| count as u32);
    let mut heads = [Heads::default(); N];
    for ((heads, named), number) in heads.iter_mut().zip(signals).zip(1..) {
        let numbers = [F32, rate_hz, block, samples, entries, fanout, STAMPS_PER_SUMMARY, STAMPS_PER_SUMMARY];
        write_signal(chunks, &mut list, number, numbers, named)?;
        heads.samples = track(chunks, &mut list, FIXED_RATE, number)?;
        track(chunks, &mut list, ANNOTATIONS, number)?;
        heads.utc = track(chunks, &mut list, UTC, number)?;
    }
    chunks.append(&mut notes, USER_DATA, JSON, |bytes| {
        bytes.extend(description.as_bytes());
        bytes.push(0);
    })?;
    Ok(heads)
}

/// The payload of a head: where the data and each level of indices begin.
pub(crate) fn head(firsts: &[u64]) -> Vec<u8> {
    let levels = (0..LEVELS).map(|level| firsts.get(level).copied().unwrap_or(0));
    levels.flat_map(u64::to_le_bytes).collect()
}

/// Texts are ended by a zero and 0x1f each.
fn put_texts(bytes: &mut Vec<u8>, texts: &[&str]) {
    for text in texts {
        bytes.extend(text.as_bytes());
        bytes.extend([0, 0x1f]);
    }
}

/// The instrument as a name. pyjls looks signals up by `source.signal`, so there is no full stop in it.
fn source_name(device: &str) -> String {
    let plain = |c: char| if c == '.' || c.is_control() { '_' } else { c };
    let name: String = device.trim().chars().map(plain).take(MAX_NAME_CHARS).collect();
    if name.is_empty() { "trace".to_owned() } else { name }
}

/// Name, vendor, model, version and serial number.
fn write_source<W: Write + Seek>(
    chunks: &mut ChunkWriter<W>,
    list: &mut List,
    number: u16,
    texts: [&str; 5],
) -> io::Result<()> {
    let put = |bytes: &mut Vec<u8>| {
        bytes.extend([0; SOURCE_TEXTS]);
        put_texts(bytes, &texts);
    };
    chunks.append(list, SOURCE, number, put).map(|_| ())
}

/// A signal of a source of its number 0 or else of source 1; without a rate it is one of variable rate.
fn write_signal<W: Write + Seek>(
    chunks: &mut ChunkWriter<W>,
    list: &mut List,
    number: u16,
    numbers: Numbers,
    SignalName { name, unit }: SignalName<'_>,
) -> io::Result<()> {
    let put = |bytes: &mut Vec<u8>| {
        let end = bytes.len() + SIGNAL_TEXTS;
        bytes.extend(number.min(1).to_le_bytes());
        bytes.extend([u8::from(numbers[1] == 0), 0]);
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        bytes.resize(end, 0);
        put_texts(bytes, &[name, unit]);
    };
    chunks.append(list, SIGNAL, number, put).map(|_| ())
}

/// A track of a signal with a head that leads nowhere yet; where the head is.
fn track<W: Write + Seek>(
    chunks: &mut ChunkWriter<W>,
    list: &mut List,
    track: u8,
    signal: u16,
) -> io::Result<u64> {
    chunks.append(list, track + DEFINITION, signal, |_| ())?;
    chunks.append(list, track + HEAD, signal, |bytes| bytes.extend(head(&[])))
}

/// A signal of fixed rate.
#[derive(Clone, Debug, Default)]
pub struct Signal {
    /// Number of the signal in the file.
    pub number: u16,
    /// The number of its source.
    pub source: u16,
    /// As the instrument names it.
    pub name: String,
    /// The unit of its samples.
    pub unit: String,
    pub(crate) data_type: u32,
    /// Samples per second.
    pub rate_hz: u32,
    /// Places of the first chunk of data and of the first index of each level; 0 for none.
    pub(crate) heads: [u64; LEVELS],
}

impl Signal {
    /// Whether its samples are floating-point numbers.
    pub fn is_float(&self) -> bool {
        self.data_type & 0xf == 4
    }
}

/// Definition of a source: an instrument that recorded signals.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceDefinition {
    /// Name, vendor, model, version and serial number, as far as they are there.
    texts: Vec<String>,
}

impl SourceDefinition {
    fn text(&self, index: usize) -> &str {
        self.texts.get(index).map_or("", String::as_str)
    }

    /// Name of the source in the file.
    pub fn name(&self) -> &str {
        self.text(0)
    }

    /// Vendor of the source.
    pub fn vendor(&self) -> &str {
        self.text(1)
    }

    /// Model of the source.
    pub fn model(&self) -> &str {
        self.text(2)
    }

    /// Serial number of the source.
    pub fn serial_number(&self) -> &str {
        self.text(4)
    }
}

/// The signals and sources of a file.
#[derive(Debug)]
pub(crate) struct Definitions {
    pub signals: Vec<Signal>,
    /// By their numbers.
    pub sources: BTreeMap<u16, SourceDefinition>,
}

/// The texts of a definition, each ended by a zero and 0x1f.
fn texts(payload: &[u8], from: usize) -> Vec<String> {
    let ended = payload.get(from..).unwrap_or_default().split(|&byte| byte == 0);
    ended
        .map(|text| String::from_utf8_lossy(text.strip_prefix(b"\x1f").unwrap_or(text)).into_owned())
        .collect()
}

impl Definitions {
    pub fn read(file: &mut ChunkFile) -> Result<Self, JlsReadError> {
        let mut sources = BTreeMap::new();
        each(file, SOURCE, |head, payload| {
            if head.meta < MAX_NUMBER {
                sources.insert(head.meta, SourceDefinition { texts: texts(payload, SOURCE_TEXTS) });
            }
        })?;
        let mut signals = BTreeMap::<u16, Signal>::new();
        each(file, SIGNAL, |head, payload| match (head.tag, head.meta & SIGNAL_MASK) {
            // The third byte is 0 for fixed rates.
            (SIGNAL, id) if id < MAX_NUMBER && payload.get(2) == Some(&0) => {
                signals.insert(id, parse_signal(id, payload));
            }
            (FIXED_RATE_HEAD, id) if payload.len() == 128 => {
                let heads = core::array::from_fn(|level| u64::from_le_bytes(field(payload, 8 * level)));
                signals.entry(id).and_modify(|signal| signal.heads = heads);
            }
            _ => {}
        })?;
        Ok(Self { signals: signals.into_values().collect(), sources })
    }
}

/// Visits the chunks of a list, from the first chunk with this tag on.
pub(crate) fn each(
    file: &mut ChunkFile,
    tag: u8,
    mut visit: impl FnMut(&ChunkHeader, &[u8]),
) -> Result<(), JlsReadError> {
    let mut payload = Vec::new();
    let mut at = file.first(tag)?;
    while let Some(head) = at {
        file.payload(&head, &mut payload)?;
        visit(&head, &payload);
        at = file.follow(&head)?;
    }
    Ok(())
}

fn parse_signal(id: u16, payload: &[u8]) -> Signal {
    let mut texts = texts(payload, SIGNAL_TEXTS).into_iter();
    Signal {
        number: id,
        source: u16::from_le_bytes(field(payload, 0)),
        name: texts.next().unwrap_or_default(),
        unit: texts.next().unwrap_or_default(),
        data_type: u32::from_le_bytes(field(payload, 4)),
        rate_hz: u32::from_le_bytes(field(payload, 8)),
        heads: [0; LEVELS],
    }
}
