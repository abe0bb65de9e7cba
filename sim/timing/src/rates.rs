//! How many of each event a unit does in a cycle.

use std::collections::BTreeMap;
use std::fmt;

use activity::{Event, spec::suggestion};
use serde::de::{self, Deserialize, Deserializer, MapAccess, Visitor};

/// The fewest events of a cycle: one in 10,000 cycles.
const SLOWEST: f64 = 1e-4;
/// The most events of a cycle: as good as no limit.
const FASTEST: f64 = 1e9;

/// Events per cycle of one unit, each 1e-4 to 1e9. Events without a rate take no time of their own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rates(BTreeMap<Event, f64>);

impl Rates {
    /// Each event with its rate, in declaration order.
    pub fn iter(&self) -> impl Iterator<Item = (Event, f64)> + '_ {
        self.0.iter().map(|(&event, &rate)| (event, rate))
    }
}

impl<'de> Deserialize<'de> for Rates {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(RatesVisitor)
    }
}

struct RatesVisitor;

impl<'de> Visitor<'de> for RatesVisitor {
    type Value = Rates;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a map from event names to events per cycle")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Rates, A::Error> {
        let mut rates = BTreeMap::new();
        while let Some(name) = map.next_key::<String>()? {
            let event = Event::from_name(&name).ok_or_else(|| {
                let known = Event::ALL.map(Event::name);
                de::Error::custom(format!("unknown event `{name}`, {}", suggestion(&name, &known)))
            })?;
            let rate = map.next_value::<f64>()?;
            if !(SLOWEST..=FASTEST).contains(&rate) {
                let message = format!(
                    "`{name}`: {rate:?} is out of range; a rate has to be {SLOWEST:e} to {FASTEST:e} events per cycle"
                );
                return Err(de::Error::custom(message));
            }
            if rates.insert(event, rate).is_some() {
                return Err(de::Error::custom(format!("`{name}` has two rates")));
            }
        }
        Ok(Rates(rates))
    }
}
