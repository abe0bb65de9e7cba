//! Integer counters, one per event.

use std::ops::{AddAssign, Index, IndexMut};

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

use crate::events::EVENTS;
use crate::{Event, Unit};

/// How often each event happened. Workers own their counts and add them up with `+=`, which is exact and
/// does not depend on the order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts([u64; Event::COUNT]);

impl Default for Counts {
    fn default() -> Self {
        Self([0; Event::COUNT])
    }
}

impl Counts {
    /// Each event with its count, in declaration order.
    pub fn iter(&self) -> impl Iterator<Item = (Event, u64)> + '_ {
        Event::ALL.into_iter().zip(self.0.iter().copied())
    }

    /// Whether nothing was counted.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|&count| count == 0)
    }

    /// Whether `unit` did anything at all; a unit that did not is not modelled.
    pub fn uses(&self, unit: Unit) -> bool {
        self.iter().any(|(event, count)| count > 0 && event.unit() == unit)
    }

    /// The counts of the events of `unit`, in declaration order, to be added to.
    pub fn of_mut(&mut self, unit: Unit) -> &mut [u64] {
        let (first, end) = EVENTS[unit as usize];
        &mut self.0[first..end]
    }

    /// `numerator / denominator` as a ratio, or `None` when nothing was counted below the line.
    pub fn ratio(&self, numerator: Event, denominator: Event) -> Option<f64> {
        let below = self[denominator];
        (below > 0).then(|| self[numerator] as f64 / below as f64)
    }

    /// Samples hit over samples tested, in [0, 1]: the sample test efficiency of the paper.
    pub fn sample_test_efficiency(&self) -> Option<f64> {
        self.ratio(Event::SamplesHit, Event::SamplesTested)
    }
}

impl Index<Event> for Counts {
    type Output = u64;
    fn index(&self, event: Event) -> &u64 {
        &self.0[event as usize]
    }
}

impl IndexMut<Event> for Counts {
    fn index_mut(&mut self, event: Event) -> &mut u64 {
        &mut self.0[event as usize]
    }
}

impl AddAssign<&Self> for Counts {
    fn add_assign(&mut self, other: &Self) {
        for (mine, theirs) in self.0.iter_mut().zip(&other.0) {
            *mine += theirs;
        }
    }
}

impl Serialize for Counts {
    /// A map from event name to count, in declaration order.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(Event::COUNT))?;
        for (event, count) in self.iter() {
            map.serialize_entry(event.name(), &count)?;
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adding_up_is_per_event() {
        let mut total = Counts::default();
        let mut part = Counts::default();
        part[Event::SamplesTested] = 8;
        part[Event::SamplesHit] = 2;
        total += &part;
        total += &part;
        assert_eq!(total[Event::SamplesTested], 16);
        assert_eq!(total.sample_test_efficiency(), Some(0.25));
        assert_eq!(total[Event::Draws], 0);
    }

    #[test]
    fn a_ratio_over_nothing_is_none() {
        assert_eq!(Counts::default().sample_test_efficiency(), None);
    }

    #[test]
    fn a_unit_is_used_when_one_of_its_events_is() {
        let mut counts = Counts::default();
        assert!(!counts.uses(Unit::Texture));
        counts[Event::TextureFetches] = 1;
        assert!(counts.uses(Unit::Texture));
        assert!(!counts.uses(Unit::Dram));
    }
}
