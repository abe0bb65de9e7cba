//! What is recorded in a JLS file: its sources and signals.

use super::chunk::{ChunkFile, Head, field};
use crate::io::ReadError;
use crate::io::columns::MICRO;
use crate::io::jls::format::{FIXED_RATE, HEAD, LEVELS, SIGNAL, SIGNAL_TEXTS, SOURCE, SOURCE_TEXTS};
use std::collections::BTreeMap;

/// Where the data of a signal of fixed rate begin, and its indices, one per level.
const FIXED_HEAD: u8 = FIXED_RATE + HEAD;
/// The lower bits of a chunk's mark are the signal's number.
pub(super) const SIGNAL_MASK: u16 = 0x0fff;
const MOST: u16 = 256;
/// Names of units and what they are in A, V or W.
const UNITS: [(&str, f64); 10] = [
    ("a", 1.0),
    ("ma", 1e-3),
    ("ua", 1e-6),
    ("na", 1e-9),
    ("v", 1.0),
    ("mv", 1e-3),
    ("uv", 1e-6),
    ("w", 1.0),
    ("mw", 1e-3),
    ("uw", 1e-6),
];

/// A signal of fixed rate.
#[derive(Clone, Debug, Default)]
pub(super) struct Signal {
    pub id: u16,
    pub source: u16,
    pub name: String,
    unit: String,
    pub data_type: u32,
    pub rate_hz: u32,
    /// Of the first chunk of data and of the first index of each level; 0 where there is none.
    pub heads: [u64; LEVELS],
}

impl Signal {
    /// What its unit is in A, V or W; `None` for other units.
    pub fn scale(&self) -> Option<f64> {
        let unit = self.unit.to_lowercase().replace(MICRO, "u");
        UNITS.iter().find(|(name, _)| *name == unit).map(|(_, scale)| *scale)
    }

    /// Whether it can be part of a trace: ranges, inputs, charge and energy cannot.
    fn counts(&self) -> bool {
        self.scale().is_some() || self.unit.is_empty() && self.data_type & 0xf == 4
    }
}

/// The signals that can be part of a trace.
pub(super) struct Definitions {
    pub signals: Vec<Signal>,
    /// What the sources call themselves: name, then vendor, model, version and serial number.
    sources: BTreeMap<u16, Vec<String>>,
}

/// The texts of a definition, each ended by a zero and 0x1f.
fn texts(payload: &[u8], from: usize) -> Vec<String> {
    let ended = payload.get(from..).unwrap_or_default().split(|&byte| byte == 0);
    ended
        .map(|text| String::from_utf8_lossy(text.strip_prefix(b"\x1f").unwrap_or(text)).into_owned())
        .collect()
}

impl Definitions {
    pub fn read(file: &mut ChunkFile) -> Result<Self, ReadError> {
        let mut sources = BTreeMap::new();
        each(file, SOURCE, |head, payload| {
            if head.meta < MOST {
                sources.insert(head.meta, texts(payload, SOURCE_TEXTS));
            }
        })?;
        let mut signals = BTreeMap::<u16, Signal>::new();
        each(file, SIGNAL, |head, payload| match (head.tag, head.meta & SIGNAL_MASK) {
            // The third byte tells fixed rates (0) from variable ones.
            (SIGNAL, id) if id < MOST && payload.get(2) == Some(&0) => {
                signals.insert(id, signal(id, payload));
            }
            (FIXED_HEAD, id) if payload.len() == 128 => {
                let heads = core::array::from_fn(|level| u64::from_le_bytes(field(payload, 8 * level)));
                signals.entry(id).and_modify(|signal| signal.heads = heads);
            }
            _ => {}
        })?;
        Ok(Self { signals: signals.into_values().filter(Signal::counts).collect(), sources })
    }

    /// The names of the signals, with those of their sources before them where there are several.
    pub fn names(&self) -> Vec<String> {
        let several = self.signals.iter().any(|signal| signal.source != self.signals[0].source);
        let source = |signal: &Signal| self.sources.get(&signal.source).and_then(|texts| texts.first());
        let name = |signal: &Signal| match source(signal).filter(|_| several) {
            Some(source) => format!("{source}.{}", signal.name),
            None => signal.name.clone(),
        };
        self.signals.iter().map(name).collect()
    }

    /// The instrument: vendor, model and serial number, or else its name.
    pub fn device(&self, signal: &Signal) -> String {
        let Some(texts) = self.sources.get(&signal.source) else { return String::new() };
        let text = |index: usize| texts.get(index).filter(|text| !text.is_empty());
        let said: Vec<&str> = [1, 2, 4].into_iter().filter_map(text).map(String::as_str).collect();
        if said.is_empty() { texts.first().cloned().unwrap_or_default() } else { said.join(" ") }
    }
}

/// Walks a list from the first chunk of a kind on.
pub(super) fn each(
    file: &mut ChunkFile,
    tag: u8,
    mut take: impl FnMut(&Head, &[u8]),
) -> Result<(), ReadError> {
    let mut payload = Vec::new();
    let mut at = file.first(tag)?;
    while let Some(head) = at {
        file.payload(&head, &mut payload)?;
        take(&head, &payload);
        at = file.follow(&head)?;
    }
    Ok(())
}

fn signal(id: u16, payload: &[u8]) -> Signal {
    let mut texts = texts(payload, SIGNAL_TEXTS).into_iter();
    Signal {
        id,
        source: u16::from_le_bytes(field(payload, 0)),
        name: texts.next().unwrap_or_default(),
        unit: texts.next().unwrap_or_default(),
        data_type: u32::from_le_bytes(field(payload, 4)),
        rate_hz: u32::from_le_bytes(field(payload, 8)),
        heads: [0; LEVELS],
    }
}
