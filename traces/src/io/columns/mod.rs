//! What columns hold, from their names.

mod names;

use super::{ReadError, ReadOptions};
pub(super) use names::{MICRO, Quantity};
use names::{understood, unit};
use std::collections::BTreeMap;
use std::path::Path;

/// A column that is read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Picked {
    pub index: usize,
    pub name: String,
    pub scale: f64,
}

/// Where a rail's power comes from; numbers are places in [`Layout::values`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Rail {
    Measured { voltage: usize, current: usize },
    Specified { volts: f64, current: usize },
    Power { power: usize },
}

/// The columns that make up a trace.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    pub time: Option<Picked>,
    pub values: Vec<Picked>,
    pub rails: Vec<Rail>,
    /// Their names, in order.
    pub names: Vec<String>,
}

impl Layout {
    /// Where the voltage and the current of the only rail are, if nothing has to be worked out of them.
    pub fn as_they_stand(&self) -> Option<[usize; 2]> {
        match self.rails[..] {
            [Rail::Measured { voltage, current }] => {
                self.values.iter().all(|column| column.scale == 1.0).then_some([voltage, current])
            }
            _ => None,
        }
    }
}

/// The columns of each rail, by what they measure.
type Rails = BTreeMap<String, BTreeMap<Quantity, Picked>>;

/// Chooses the columns of a trace.
pub(super) fn layout(path: &Path, names: &[String], options: &ReadOptions) -> Result<Layout, ReadError> {
    if options.by_hand() { by_hand(path, names, options) } else { by_name(path, names, options) }
}

fn missing(path: &Path, names: &[String], column: &str) -> ReadError {
    let shown: Vec<&str> = names.iter().take(20).map(String::as_str).collect();
    let found = if shown.is_empty() { "none".to_owned() } else { shown.join(", ") };
    ReadError::MissingColumn { path: path.to_owned(), column: column.to_owned(), found }
}

/// A column by its name, else by its number from 1.
fn pick(path: &Path, names: &[String], column: &str, of: Quantity) -> Result<Picked, ReadError> {
    let named = names.iter().position(|name| name.eq_ignore_ascii_case(column));
    let numbered =
        || column.parse::<usize>().ok().and_then(|n| n.checked_sub(1)).filter(|&n| n < names.len());
    let index = named.or_else(numbered).ok_or_else(|| missing(path, names, column))?;
    let told = understood(&names[index]);
    if let Some(other) = told.as_ref().filter(|named| named.quantity != of && named.sure) {
        let reason = format!(
            "column {} holds {} by its name, but was asked for as that of {}: choose another, or rename it",
            names[index],
            other.quantity.name(),
            of.name()
        );
        return Err(ReadError::Asked { path: path.to_owned(), reason });
    }
    let scale = told.filter(|named| named.quantity == of).map_or(1.0, |named| named.scale);
    Ok(Picked { index, name: names[index].clone(), scale })
}

/// What to multiply a column by for s, V, A or W, by the unit that a file says beside its name; none if that is empty.
///
/// # Errors
/// [`ReadError::Unit`] if name and unit contradict each other, or the unit is of something else; [`ReadError::UnitUnknown`].
fn scale_by(path: &Path, picked: &Picked, text: &str, of: Quantity) -> Result<f64, ReadError> {
    if text.is_empty() {
        return Ok(picked.scale);
    }
    let Some(told) = unit(text) else {
        let (path, column, unit) = (path.to_owned(), picked.name.clone(), text.to_owned());
        return Err(ReadError::UnitUnknown { path, column, unit });
    };
    let stated = understood(&picked.name).filter(|named| named.quantity == of && named.has_unit);
    if told.quantity == of && stated.is_none_or(|stated| stated.scale == told.scale) {
        return Ok(told.scale);
    }
    let (path, column, unit) = (path.to_owned(), picked.name.clone(), text.to_owned());
    Err(ReadError::Unit { path, column, unit, of: of.name() })
}

fn by_hand(path: &Path, names: &[String], options: &ReadOptions) -> Result<Layout, ReadError> {
    let pick = |column: &Option<String>, of| column.as_deref().map(|c| pick(path, names, c, of)).transpose();
    let time = match &options.time {
        Some(column) => Some(self::pick(path, names, column, Quantity::Time)?),
        None => time_column(path, names)?,
    };
    if let Some(power) = pick(&options.power, Quantity::Power)? {
        return Ok(Layout {
            time,
            values: vec![power],
            rails: vec![Rail::Power { power: 0 }],
            names: vec![String::new()],
        });
    }
    let current =
        pick(&options.current, Quantity::Current)?.ok_or_else(|| missing(path, names, "current_A"))?;
    let (values, rail) = match (options.fixed_voltage_v, pick(&options.voltage, Quantity::Voltage)?) {
        (Some(volts), _) => (vec![current], Rail::Specified { volts, current: 0 }),
        (None, Some(voltage)) => (vec![voltage, current], Rail::Measured { voltage: 0, current: 1 }),
        (None, None) => return Err(missing(path, names, "voltage_V")),
    };
    Ok(Layout { time, values, rails: vec![rail], names: vec![String::new()] })
}

fn time_column(path: &Path, names: &[String]) -> Result<Option<Picked>, ReadError> {
    let mut times = names.iter().enumerate().filter_map(|(index, name)| {
        let named =
            understood(name).filter(|named| named.quantity == Quantity::Time && named.rail.is_empty())?;
        Some(Picked { index, name: name.clone(), scale: named.scale })
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
        let Some(named) = understood(name).filter(|named| named.quantity != Quantity::Time) else { continue };
        let picked = Picked { index, name: name.clone(), scale: named.scale };
        if rails.entry(named.rail).or_default().insert(named.quantity, picked).is_some() {
            return Err(ReadError::DuplicateColumn {
                path: path.to_owned(),
                column: native(named.quantity).to_owned(),
            });
        }
    }
    let time = match &options.time {
        Some(column) => Some(pick(path, names, column, Quantity::Time)?),
        None => time_column(path, names)?,
    };
    let mut layout = Layout { time, values: Vec::new(), rails: Vec::new(), names: Vec::new() };
    for (name, columns) in chosen(path, names, options, rails)? {
        layout.add(path, names, options, &name, columns)?;
    }
    Ok(layout)
}

impl Quantity {
    fn name(self) -> &'static str {
        match self {
            Self::Time => "times",
            Self::Voltage => "voltages",
            Self::Current => "currents",
            Self::Power => "powers",
        }
    }
}

fn native(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Time => "time_s",
        Quantity::Voltage => "voltage_V",
        Quantity::Current => "current_A",
        Quantity::Power => "power_W",
    }
}

/// The rails that were asked for, or all that can be read.
fn chosen(
    path: &Path,
    names: &[String],
    options: &ReadOptions,
    mut rails: Rails,
) -> Result<Rails, ReadError> {
    if options.rails.is_empty() {
        // A voltage alone (a sense line) is no rail, unless it is all there is and what is missing is to be told.
        let whole: Rails = rails
            .iter()
            .filter(|(_, columns)| {
                columns.contains_key(&Quantity::Current) || columns.contains_key(&Quantity::Power)
            })
            .map(|(name, columns)| (name.clone(), columns.clone()))
            .collect();
        if !whole.is_empty() {
            return Ok(whole);
        }
        let column = if rails.values().any(|c| c.contains_key(&Quantity::Voltage)) {
            "current_A"
        } else {
            "voltage_V"
        };
        return Err(missing(path, names, column));
    }
    let mut asked = Rails::new();
    for rail in &options.rails {
        let key = rail.to_ascii_lowercase();
        let columns = rails.remove(&key).ok_or_else(|| missing(path, names, &format!("of rail {rail}")))?;
        asked.insert(key, columns);
    }
    Ok(asked)
}

impl Layout {
    /// Takes units from where a file has them beside the names of its columns.
    ///
    /// # Errors
    /// [`ReadError::Unit`] where they do not go with the names, [`ReadError::UnitUnknown`] where they are not known.
    pub fn with_units(&mut self, path: &Path, units: &BTreeMap<String, String>) -> Result<(), ReadError> {
        let put = |picked: &mut Picked, of: Quantity| match units.get(&picked.name) {
            Some(unit) => scale_by(path, picked, unit, of).map(|scale| picked.scale = scale),
            None => Ok(()),
        };
        self.time.as_mut().map_or(Ok(()), |time| put(time, Quantity::Time))?;
        for rail in &self.rails {
            let columns = match *rail {
                Rail::Measured { voltage, current } => {
                    vec![(voltage, Quantity::Voltage), (current, Quantity::Current)]
                }
                Rail::Specified { current, .. } => vec![(current, Quantity::Current)],
                Rail::Power { power } => vec![(power, Quantity::Power)],
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
        mut columns: BTreeMap<Quantity, Picked>,
    ) -> Result<(), ReadError> {
        let prefix = if rail.is_empty() { String::new() } else { format!("{rail}_") };
        let rail_of = match (columns.remove(&Quantity::Current), options.fixed_voltage_v) {
            (Some(current), Some(volts)) => Rail::Specified { volts, current: self.value(current) },
            (Some(current), None) => match columns.remove(&Quantity::Voltage) {
                Some(voltage) => {
                    Rail::Measured { voltage: self.value(voltage), current: self.value(current) }
                }
                None => return Err(missing(path, names, &format!("{prefix}voltage_V"))),
            },
            (None, _) => match columns.remove(&Quantity::Power) {
                Some(power) => Rail::Power { power: self.value(power) },
                None => return Err(missing(path, names, &format!("{prefix}current_A"))),
            },
        };
        self.rails.push(rail_of);
        self.names.push(rail.to_owned());
        Ok(())
    }

    fn value(&mut self, column: Picked) -> usize {
        self.values.push(column);
        self.values.len() - 1
    }
}

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
}
