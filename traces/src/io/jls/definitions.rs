//! What stands at the beginning of a JLS file: who recorded what, and where it will be found.

use super::chunks::{Chunks, List};
use super::format::{
    ANNOTATIONS, DEFINITION, F32, FIXED_RATE, HEAD, JSON, LEVELS, SIGNAL, SIGNAL_TEXTS, SOURCE, SOURCE_TEXTS,
    USER_DATA, UTC, VARIABLE_RATE,
};
use super::signal::{BLOCK, ENTRIES, ENTRY_SAMPLES, FANOUT};
use std::io::{self, Seek, Write};

/// Annotations and UTC entries in a summary.
const STAMPS: u32 = 100;
/// The longest name of a source.
const NAME_CHARS: usize = 64;

/// What a signal is called, and its unit.
pub(super) type Named = (&'static str, &'static str);

/// Where the heads of a signal's tracks are, to be written anew once it is known what they lead to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Heads {
    pub samples: u64,
    pub utc: u64,
}

/// The numbers of a signal: type, rate in Hz, samples of a chunk, samples of an entry, entries of a summary, entries that
/// become one of the level above, annotations and UTC entries of a summary.
type Numbers = [u32; 8];

/// Writes everything before the samples: sources, the signals, numbered from 1, and a description in JSON.
pub(super) fn write<W: Write + Seek, const N: usize>(
    chunks: &mut Chunks<W>,
    device: &str,
    signals: [Named; N],
    rate_hz: u32,
    description: &str,
) -> io::Result<[Heads; N]> {
    let [mut notes, mut sources, mut list] = [List::default(); 3];
    chunks.append(&mut notes, USER_DATA, 0, |_| ())?;
    // Source and signal 0 are those of annotations to the whole file, which readers expect; named as pyjls does.
    source(chunks, &mut sources, 0, ["global_annotation_source", "jls", "-", "1.0.0", "-"])?;
    let unused = [F32, 0, 16, 16, 10, 10, STAMPS, STAMPS];
    signal(chunks, &mut list, 0, unused, ("global_annotation_signal", ""))?;
    track(chunks, &mut list, VARIABLE_RATE, 0)?;
    track(chunks, &mut list, ANNOTATIONS, 0)?;
    source(chunks, &mut sources, 1, [&source_name(device), "", "", "", ""])?;
    let [block, samples, entries, fanout] = [BLOCK, ENTRY_SAMPLES, ENTRIES, FANOUT].map(|count| count as u32);
    let mut heads = [Heads::default(); N];
    for ((heads, named), number) in heads.iter_mut().zip(signals).zip(1..) {
        let numbers = [F32, rate_hz, block, samples, entries, fanout, STAMPS, STAMPS];
        signal(chunks, &mut list, number, numbers, named)?;
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
pub(super) fn head(firsts: &[u64]) -> Vec<u8> {
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
    let name: String = device.trim().chars().map(plain).take(NAME_CHARS).collect();
    if name.is_empty() { "trace".to_owned() } else { name }
}

/// Name, vendor, model, version and serial number.
fn source<W: Write + Seek>(
    chunks: &mut Chunks<W>,
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
fn signal<W: Write + Seek>(
    chunks: &mut Chunks<W>,
    list: &mut List,
    number: u16,
    numbers: Numbers,
    (name, unit): Named,
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
    chunks: &mut Chunks<W>,
    list: &mut List,
    track: u8,
    signal: u16,
) -> io::Result<u64> {
    chunks.append(list, track + DEFINITION, signal, |_| ())?;
    chunks.append(list, track + HEAD, signal, |bytes| bytes.extend(head(&[])))
}
