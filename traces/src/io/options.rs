//! What a reader may be told.

/// How to read a file. The default takes every rail that the names of the columns tell of and mends nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Rails to add up, by name; all of them if empty.
    pub rails: Vec<String>,
    /// The column of times, by name or by number from 1; found by its name without it.
    pub time: Option<String>,
    /// The column of voltages, likewise.
    pub voltage: Option<String>,
    /// The column of currents, likewise.
    pub current: Option<String>,
    /// A column of powers in place of voltage and current, likewise.
    pub power: Option<String>,
    /// Voltage by specification, V, in place of what was measured.
    pub fixed_voltage_v: Option<f64>,
    /// Samples per second, in place of what file and times say, Hz.
    pub rate_hz: Option<f64>,
    /// Left edge of the first sample where there are no times, s.
    pub start_s: Option<f64>,
    /// What stands between the fields of a text; guessed from its first line without it.
    pub delimiter: Option<u8>,
    /// Whether the first line of a text holds names; without it, it does unless all its fields are numbers.
    pub header: Option<bool>,
    /// Whether to mend values that are not finite, unsorted rows and missing stretches.
    pub repair: bool,
}

impl ReadOptions {
    /// Columns chosen by hand, so that names need not mean anything.
    pub(super) fn by_hand(&self) -> bool {
        self.voltage.is_some() || self.current.is_some() || self.power.is_some()
    }
}
