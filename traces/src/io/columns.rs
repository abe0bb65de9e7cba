//! The columns of a trace, chosen by their names or by hand, and the interface that a reader of their rows
//! implements.

use std::collections::BTreeMap;
use std::path::Path;

use super::samples::Description;
use super::time_base::Stamps;
use super::{CURRENT_A, POWER_W, ReadError, ReadOptions, Repair, TIME_S, VOLTAGE_V};
use crate::units::{MICRO, PhysicalQuantity, quantity_word, trace_unit, written_out_unit};

/// A column that is read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Picked {
    pub index: usize,
    pub name: String,
    pub scale: f64,
    /// Whether its name or the file states its unit.
    pub has_unit: bool,
}

/// The columns of a rail, as indices into [`Layout::values`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Rail {
    Measured { voltage: usize, current: usize },
    Specified { volts: f64, current: usize },
    Power { power: usize },
}

/// The columns that make up a trace.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Layout {
    pub time: Option<Picked>,
    pub values: Vec<Picked>,
    pub rails: Vec<Rail>,
    /// Names of the rails, in order.
    pub names: Vec<String>,
    /// Columns of power that are not read, as their rails have voltage and current.
    pub unread: Vec<String>,
    /// What columns without names are taken for, in words; absent where all is stated.
    pub guess: Option<String>,
}

impl Layout {
    /// Indices of the voltage and the current of the only rail, if neither needs scaling.
    pub fn unscaled_channels(&self) -> Option<[usize; 2]> {
        match self.rails[..] {
            [Rail::Measured { voltage, current }] => {
                self.values.iter().all(|column| column.scale == 1.0).then_some([voltage, current])
            }
            _ => None,
        }
    }

    /// Converts values of the file to V, A or W.
    pub fn scale(&self, values: &mut [Vec<f32>]) {
        for (values, column) in values.iter_mut().zip(&self.values) {
            if column.scale != 1.0 {
                values.iter_mut().for_each(|value| *value = (f64::from(*value) * column.scale) as f32);
            }
        }
    }
}

impl Rail {
    /// The power in a row of values, W.
    pub fn power_w(&self, values: &[Vec<f32>], row: usize) -> f64 {
        let value = |column: usize| f64::from(values[column][row]);
        match *self {
            Self::Measured { voltage, current } => value(voltage) * value(current),
            Self::Specified { volts, current } => volts * value(current),
            Self::Power { power } => value(power),
        }
    }
}

/// Rows of a file, as they are in it.
#[derive(Debug)]
pub(crate) struct RowBatch {
    /// Times of the rows; absent in files without.
    pub stamps: Stamps,
    /// One list per column of the layout, in the units of the file.
    pub values: Vec<Vec<f32>>,
}

impl Default for RowBatch {
    fn default() -> Self {
        Self { stamps: Stamps::Absent, values: Vec::new() }
    }
}

/// The columns of each rail, by what they measure.
type Rails = BTreeMap<String, BTreeMap<PhysicalQuantity, Picked>>;

/// Chooses the columns of a trace.
pub(super) fn layout(path: &Path, names: &[String], options: &ReadOptions) -> Result<Layout, ReadError> {
    if options.by_hand() { by_hand(path, names, options) } else { by_name(path, names, options) }
}

/// Names of columns that have none.
pub(super) fn numbered(columns: usize) -> Vec<String> {
    (1..=columns).map(|number| format!("column {number}")).collect()
}

/// Chooses among columns without names: those requested by number; else times, voltages and currents in this
/// order, without times where there are two.
pub(super) fn layout_of_unnamed(
    path: &Path,
    columns: usize,
    options: &ReadOptions,
) -> Result<Layout, ReadError> {
    let names = numbered(columns);
    let usual: &[&str] = if columns == 2 { &[VOLTAGE_V, CURRENT_A] } else { &[TIME_S, VOLTAGE_V, CURRENT_A] };
    let by_number = options.by_hand() || options.time.is_some();
    let guessed =
        names.iter().enumerate().map(|(index, name)| match usual.get(index).filter(|_| !by_number) {
            Some(usual) => (*usual).to_owned(),
            None => name.clone(),
        });
    let guessed: Vec<String> = guessed.collect();
    let mut layout = layout(path, &guessed, options).map_err(|error| match error {
        ReadError::MissingColumn { column, .. } => no_names(path, &column, columns),
        other => other,
    })?;
    let is_free = layout.values.iter().all(|column| column.index > 0);
    if by_number && layout.time.is_none() && is_free && (columns > 2 || options.rate_hz.is_none()) {
        layout.time = Some(Picked { index: 0, name: String::new(), scale: 1.0, has_unit: false });
    }
    let mut guess = Vec::new();
    let time =
        layout.time.iter_mut().filter(|_| options.time.is_none()).map(|time| (time, PhysicalQuantity::Time));
    let rail = layout.rails.first().copied().filter(|_| !by_number);
    let values = layout.values.iter_mut().enumerate().filter_map(|(index, column)| match rail? {
        Rail::Measured { voltage, .. } if voltage == index => Some((column, PhysicalQuantity::Voltage)),
        _ => Some((column, PhysicalQuantity::Current)),
    });
    for (column, of) in time.chain(values) {
        (column.name, column.has_unit) = (names[column.index].clone(), false);
        guess.push(format!("{} as {}", column.name, of.name()));
    }
    layout.guess = (!guess.is_empty()).then(|| guess.join(", "));
    Ok(layout)
}

/// The error of columns without names, of which none is known to be `column`.
pub(super) fn no_names(path: &Path, column: &str, columns: usize) -> ReadError {
    let reason = format!(
        "no column {column}: the file has {columns} columns without names; choose them by number, such as --time-column 1 \
         --power-column 2, or add a line of names"
    );
    ReadError::Conflict { path: path.to_owned(), reason }
}

fn missing(path: &Path, names: &[String], column: &str) -> ReadError {
    let shown: Vec<&str> = names.iter().take(20).map(String::as_str).collect();
    let found = if shown.is_empty() { "none".to_owned() } else { shown.join(", ") };
    ReadError::MissingColumn { path: path.to_owned(), column: column.to_owned(), found }
}

/// A column by its name, else by its number from 1.
fn pick(path: &Path, names: &[String], column: &str, of: PhysicalQuantity) -> Result<Picked, ReadError> {
    let named = names.iter().position(|name| name.eq_ignore_ascii_case(column));
    let numbered =
        || column.parse::<usize>().ok().and_then(|n| n.checked_sub(1)).filter(|&n| n < names.len());
    let index = named.or_else(numbered).ok_or_else(|| missing(path, names, column))?;
    let parsed = parse_name(&names[index]);
    if let Some(other) = parsed.as_ref().filter(|named| named.quantity != of && named.sure) {
        let reason = format!(
            "column {} holds {} by its name, but is requested as that of {}: choose another, or rename it",
            names[index],
            other.quantity.name(),
            of.name()
        );
        return Err(ReadError::Conflict { path: path.to_owned(), reason });
    }
    let named = parsed.filter(|named| named.quantity == of);
    let (scale, has_unit) = named.map_or((1.0, false), |named| (named.scale, named.has_unit));
    Ok(Picked { index, name: names[index].clone(), scale, has_unit })
}

/// Factor from a column to s, V, A or W, by the unit that the file has beside its name, if that is not empty.
///
/// # Errors
/// [`ReadError::Unit`] if name and unit contradict each other, or the unit is of something else;
/// [`ReadError::UnitUnknown`].
fn scale_by(path: &Path, picked: &Picked, text: &str, of: PhysicalQuantity) -> Result<f64, ReadError> {
    if text.is_empty() {
        return Ok(picked.scale);
    }
    let Some((quantity, scale)) = unit(text) else {
        let (path, column, unit) = (path.to_owned(), picked.name.clone(), text.to_owned());
        return Err(ReadError::UnitUnknown { path, column, unit });
    };
    let stated = parse_name(&picked.name).filter(|named| named.quantity == of && named.has_unit);
    if quantity == of && stated.is_none_or(|stated| stated.scale == scale) {
        return Ok(scale);
    }
    let (path, column, unit) = (path.to_owned(), picked.name.clone(), text.to_owned());
    Err(ReadError::Unit { path, column, unit, of: of.name() })
}

fn by_hand(path: &Path, names: &[String], options: &ReadOptions) -> Result<Layout, ReadError> {
    let pick = |column: &Option<String>, of| column.as_deref().map(|c| pick(path, names, c, of)).transpose();
    let time = match &options.time {
        Some(column) => Some(self::pick(path, names, column, PhysicalQuantity::Time)?),
        None => time_column(path, names)?,
    };
    if let Some(power) = pick(&options.power, PhysicalQuantity::Power)? {
        return Ok(Layout {
            time,
            values: vec![power],
            rails: vec![Rail::Power { power: 0 }],
            names: vec![String::new()],
            unread: Vec::new(),
            guess: None,
        });
    }
    let current =
        pick(&options.current, PhysicalQuantity::Current)?.ok_or_else(|| missing(path, names, CURRENT_A))?;
    let (values, rail) = match (options.fixed_voltage_v, pick(&options.voltage, PhysicalQuantity::Voltage)?) {
        (Some(volts), _) => (vec![current], Rail::Specified { volts, current: 0 }),
        (None, Some(voltage)) => (vec![voltage, current], Rail::Measured { voltage: 0, current: 1 }),
        (None, None) => return Err(missing(path, names, VOLTAGE_V)),
    };
    let names = vec![String::new()];
    Ok(Layout { time, values, rails: vec![rail], names, unread: Vec::new(), guess: None })
}

fn time_column(path: &Path, names: &[String]) -> Result<Option<Picked>, ReadError> {
    let mut times = names.iter().enumerate().filter_map(|(index, name)| {
        let named = parse_name(name)
            .filter(|named| named.quantity == PhysicalQuantity::Time && named.rail.is_empty())?;
        Some(Picked { index, name: name.clone(), scale: named.scale, has_unit: named.has_unit })
    });
    let first = times.next();
    // Nanoseconds are whole numbers and thereby exact: of two columns of times, theirs is taken.
    Ok(match times.find(|other| first.as_ref().is_some_and(|first| other.scale < first.scale)) {
        Some(finer) => Some(finer),
        None => {
            if let Some(first) = &first
                && names.iter().filter(|name| name.eq_ignore_ascii_case(&first.name)).count() > 1
            {
                return Err(ReadError::DuplicateColumn { path: path.to_owned(), column: first.name.clone() });
            }
            first
        }
    })
}

fn by_name(path: &Path, names: &[String], options: &ReadOptions) -> Result<Layout, ReadError> {
    let mut rails = Rails::new();
    for (index, name) in names.iter().enumerate() {
        let Some(named) = parse_name(name).filter(|named| named.quantity != PhysicalQuantity::Time) else {
            continue;
        };
        let picked = Picked { index, name: name.clone(), scale: named.scale, has_unit: named.has_unit };
        if rails.entry(named.rail).or_default().insert(named.quantity, picked).is_some() {
            return Err(ReadError::DuplicateColumn {
                path: path.to_owned(),
                column: native_name(named.quantity).to_owned(),
            });
        }
    }
    let time = match &options.time {
        Some(column) => Some(pick(path, names, column, PhysicalQuantity::Time)?),
        None => time_column(path, names)?,
    };
    let mut layout = Layout { time, ..Layout::default() };
    for (name, columns) in chosen(path, names, options, rails)? {
        layout.add(path, names, options, &name, columns)?;
    }
    Ok(layout)
}

/// The column name of our own writers.
fn native_name(quantity: PhysicalQuantity) -> &'static str {
    match quantity {
        PhysicalQuantity::Time => TIME_S,
        PhysicalQuantity::Voltage => VOLTAGE_V,
        PhysicalQuantity::Current => CURRENT_A,
        PhysicalQuantity::Power => POWER_W,
        // Traces have no columns of these.
        PhysicalQuantity::Energy | PhysicalQuantity::Rate | PhysicalQuantity::Resistance => quantity.name(),
    }
}

/// The requested rails, or all that can be read.
fn chosen(
    path: &Path,
    names: &[String],
    options: &ReadOptions,
    mut rails: Rails,
) -> Result<Rails, ReadError> {
    if options.rails.is_empty() {
        // A voltage alone (a sense line) is not a rail, unless it is the only column: then the error names
        // the missing one.
        let whole: Rails = rails
            .iter()
            .filter(|(_, columns)| {
                columns.contains_key(&PhysicalQuantity::Current)
                    || columns.contains_key(&PhysicalQuantity::Power)
            })
            .map(|(name, columns)| (name.clone(), columns.clone()))
            .collect();
        if !whole.is_empty() {
            return Ok(whole);
        }
        let column = if rails.values().any(|c| c.contains_key(&PhysicalQuantity::Voltage)) {
            CURRENT_A
        } else {
            VOLTAGE_V
        };
        return Err(missing(path, names, column));
    }
    let mut requested = Rails::new();
    for rail in &options.rails {
        let key = rail.to_ascii_lowercase();
        let columns = rails.remove(&key).ok_or_else(|| missing(path, names, &format!("of rail {rail}")))?;
        requested.insert(key, columns);
    }
    Ok(requested)
}

impl Layout {
    /// Applies the units that a file has beside the names of its columns.
    ///
    /// # Errors
    /// [`ReadError::Unit`] if they contradict the names, [`ReadError::UnitUnknown`] if they are not known.
    pub fn with_units(&mut self, path: &Path, units: &BTreeMap<String, String>) -> Result<(), ReadError> {
        let put = |picked: &mut Picked, of: PhysicalQuantity| match units.get(&picked.name) {
            Some(unit) => scale_by(path, picked, unit, of).map(|scale| {
                (picked.scale, picked.has_unit) = (scale, picked.has_unit || !unit.is_empty());
            }),
            None => Ok(()),
        };
        self.time.as_mut().map_or(Ok(()), |time| put(time, PhysicalQuantity::Time))?;
        for rail in &self.rails {
            let columns = match *rail {
                Rail::Measured { voltage, current } => {
                    vec![(voltage, PhysicalQuantity::Voltage), (current, PhysicalQuantity::Current)]
                }
                Rail::Specified { current, .. } => vec![(current, PhysicalQuantity::Current)],
                Rail::Power { power } => vec![(power, PhysicalQuantity::Power)],
            };
            columns.into_iter().try_for_each(|(index, of)| put(&mut self.values[index], of))?;
        }
        Ok(())
    }

    fn add(
        &mut self,
        path: &Path,
        names: &[String],
        options: &ReadOptions,
        rail: &str,
        mut columns: BTreeMap<PhysicalQuantity, Picked>,
    ) -> Result<(), ReadError> {
        let prefix = if rail.is_empty() { String::new() } else { format!("{rail}_") };
        let rail_of = match (columns.remove(&PhysicalQuantity::Current), options.fixed_voltage_v) {
            (Some(current), Some(volts)) => Rail::Specified { volts, current: self.value(current) },
            (Some(current), None) => match columns.remove(&PhysicalQuantity::Voltage) {
                Some(voltage) => {
                    Rail::Measured { voltage: self.value(voltage), current: self.value(current) }
                }
                None => return Err(missing(path, names, &format!("{prefix}{VOLTAGE_V}"))),
            },
            (None, _) => match columns.remove(&PhysicalQuantity::Power) {
                Some(power) => Rail::Power { power: self.value(power) },
                None => return Err(missing(path, names, &format!("{prefix}{CURRENT_A}"))),
            },
        };
        self.unread.extend(columns.remove(&PhysicalQuantity::Power).map(|power| power.name));
        self.rails.push(rail_of);
        self.names.push(rail.to_owned());
        Ok(())
    }

    fn value(&mut self, column: Picked) -> usize {
        self.values.push(column);
        self.values.len() - 1
    }
}

/// The meaning of a column's name.
#[derive(Clone, Debug, PartialEq)]
struct ColumnName {
    quantity: PhysicalQuantity,
    /// Factor to s, V, A or W.
    scale: f64,
    rail: String,
    /// Whether the quantity follows from a word or a unit of more than one letter, or from a unit in
    /// brackets.
    sure: bool,
    has_unit: bool,
}

/// Quantity and factor of a unit beside a name; `None` if it is not known.
fn unit(text: &str) -> Option<(PhysicalQuantity, f64)> {
    let symbol = |text: &str| {
        let found = parse_name(&format!("_{text}")).filter(|name| name.has_unit && name.rail.is_empty());
        found.map(|name| (name.quantity, name.scale))
    };
    written_out_unit(text).or_else(|| symbol(text))
}

/// Parses `gpu_voltage_V`, `Main(mA)`, `Time (s)`, `voltage_V`: quantity, unit and rail, the remaining words.
/// `None` for the names of other things.
fn parse_name(name: &str) -> Option<ColumnName> {
    let lower = name.trim_start_matches('\u{feff}').to_ascii_lowercase().replace(MICRO, "u");
    let words: Vec<&str> =
        lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let stated = words.iter().find_map(|word| quantity_word(word));
    let unit = words.iter().rev().find_map(|word| {
        let (of, scale) = trace_unit(word, stated)?;
        Some((*word, of, scale))
    });
    let quantity = stated.or(unit.map(|(_, of, _)| of))?;
    // A single letter is a unit only where nothing but a rail stands beside it, or the quantity is stated as
    // well.
    let scale = if is_mega(name, unit) { 1e6 } else { unit.map_or(1.0, |(_, _, scale)| scale) };
    let has_unit = unit.is_some();
    let sure = words.iter().any(|word| word.len() > 1 && quantity_word(word) == stated && stated.is_some())
        || unit.is_some_and(|(word, ..)| word.len() > 1 || lower.ends_with(&format!("({word})")));
    let mut unit = unit.map(|(word, _, _)| word);
    let mut rail: Vec<&str> = Vec::new();
    for word in words.iter().rev() {
        if unit == Some(*word) {
            unit = None;
        } else if quantity_word(word) != Some(quantity) {
            rail.push(word);
        }
    }
    rail.reverse();
    Some(ColumnName { quantity, scale, rail: rail.join("_"), sure, has_unit })
}

/// `power_MW` are megawatts; where all is in capitals, `M` says nothing.
fn is_mega(name: &str, unit: Option<(&str, PhysicalQuantity, f64)>) -> bool {
    let mega = |token: &str| {
        token.starts_with('M') && unit.is_some_and(|(unit, _, _)| token.eq_ignore_ascii_case(unit))
    };
    name.contains(char::is_lowercase)
        && unit.is_some_and(|(unit, of, _)| of != PhysicalQuantity::Time && unit.len() == 2)
        && name
            .split(|c: char| !c.is_alphanumeric())
            .any(|token| mega(token) && token == token.to_uppercase())
}

/// Reader of the rows of a file, in order.
pub(super) trait RowSource: Send {
    /// Names of all columns.
    fn names(&self) -> &[String];

    /// Number of rows, in formats that state it.
    fn count(&self) -> Option<u64> {
        None
    }

    /// Skips rows, up to the end.
    fn skip(&mut self, rows: u64) -> Result<(), ReadError>;

    /// Appends up to `limit` rows to the values of `batch`, in the units of the file; the stamps are those of
    /// these rows alone, in s or ns. Returns the number of rows, 0 at the end.
    fn next(&mut self, layout: &Layout, limit: usize, batch: &mut RowBatch) -> Result<usize, ReadError>;

    /// The repair made when the file was opened and in the rows read since.
    fn repair(&self, _: &Description) -> Option<Repair> {
        None
    }
}

/// A file that was opened.
pub(super) struct Opened {
    pub rows: Box<dyn RowSource>,
    pub layout: Layout,
    pub description: Description,
    /// The column of times that files of this format usually have, for messages.
    pub time: &'static str,
}

/// Opener of files of a format.
pub(super) type Open = fn(&Path, &ReadOptions) -> Result<Opened, ReadError>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rails_are_added_or_chosen() {
        let names: Vec<String> =
            ["time_s", "gpu_voltage_V", "gpu_current_A", "cpu_power_mW"].map(str::to_owned).into();
        let of = |options: &ReadOptions| layout(Path::new("a"), &names, options);
        assert_eq!(of(&ReadOptions::default()).unwrap().names, ["cpu", "gpu"]);
        let gpu = ReadOptions { rails: vec!["GPU".to_owned()], ..ReadOptions::default() };
        assert_eq!(of(&gpu).unwrap().rails, [Rail::Measured { voltage: 0, current: 1 }]);
        let other = ReadOptions { rails: vec!["ram".to_owned()], ..ReadOptions::default() };
        assert!(of(&other).unwrap_err().to_string().contains("of rail ram"));
    }

    fn read(name: &str) -> Option<(PhysicalQuantity, f64, String)> {
        parse_name(name).map(|named| (named.quantity, named.scale, named.rail))
    }

    #[test]
    fn names_of_recorders_are_parse_name() {
        let is = |quantity, scale, rail: &str| Some((quantity, scale, rail.to_owned()));
        assert_eq!(read("voltage_V"), is(PhysicalQuantity::Voltage, 1.0, ""));
        assert_eq!(read("CURRENT_a"), is(PhysicalQuantity::Current, 1.0, ""));
        assert_eq!(read("time_ns"), is(PhysicalQuantity::Time, 1e-9, ""));
        assert_eq!(read("Timestamp(ms)"), is(PhysicalQuantity::Time, 1e-3, ""));
        assert_eq!(read("Main(mA)"), is(PhysicalQuantity::Current, 1e-3, "main"));
        assert_eq!(read("Main Voltage(V)"), is(PhysicalQuantity::Voltage, 1.0, "main"));
        assert_eq!(read("gpu_power_W"), is(PhysicalQuantity::Power, 1.0, "gpu"));
        assert_eq!(read("current_A_cpu"), is(PhysicalQuantity::Current, 1.0, "cpu"));
        assert_eq!(read("note"), None);
        assert_eq!(read("power_kW"), is(PhysicalQuantity::Power, 1e3, ""));
        assert_eq!(read("power_MW"), is(PhysicalQuantity::Power, 1e6, ""));
        assert_eq!(read("power_mW"), is(PhysicalQuantity::Power, 1e-3, ""));
        assert_eq!(read("POWER_MW"), is(PhysicalQuantity::Power, 1e-3, ""));
        for name in ["current_\u{b5}A", "current (\u{3bc}A)"] {
            assert_eq!(read(name), is(PhysicalQuantity::Current, 1e-6, ""), "{name}");
        }
    }

    #[test]
    fn units_alone_are_symbols_or_words_and_others_are_not_known() {
        assert_eq!(unit("\u{3bc}A"), Some((PhysicalQuantity::Current, 1e-6)));
        assert_eq!(unit("[mA]"), Some((PhysicalQuantity::Current, 1e-3)));
        assert_eq!(unit("Volts"), Some((PhysicalQuantity::Voltage, 1.0)));
        assert_eq!(unit("msec"), Some((PhysicalQuantity::Time, 1e-3)));
        for text in ["milliamps", "mAmp", "ticks", "min", "furlong", "power", "t"] {
            assert_eq!(unit(text), None, "{text}");
        }
    }
}
