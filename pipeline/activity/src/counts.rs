//! Integer counters, one per event.

use std::ops::{AddAssign, Index, IndexMut};

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

use crate::events::EVENTS;
use crate::{Event, Unit};

/// Count of every event. Each worker has its own counts, which are summed with `+=`. The sum is exact and
/// independent of the order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts([u64; Event::COUNT]);

impl Default for Counts {
    fn default() -> Self {
        Self([0; Event::COUNT])
    }
}

impl Counts {
    /// Every event with its count, in declaration order.
    pub fn iter(&self) -> impl Iterator<Item = (Event, u64)> + '_ {
        Event::ALL.into_iter().zip(self.0.iter().copied())
    }

    /// Whether all counts are 0.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|&count| count == 0)
    }

    /// Whether any event of `unit` happened. A unit without events is not modelled.
    pub fn uses(&self, unit: Unit) -> bool {
        self.iter().any(|(event, count)| count > 0 && event.unit() == unit)
    }

    /// Mutable counts of the events of `unit`, in declaration order.
    pub fn of_mut(&mut self, unit: Unit) -> &mut [u64] {
        let (first, end) = EVENTS[unit as usize];
        &mut self.0[first..end]
    }

    /// `numerator / denominator`, or `None` if the denominator's count is 0.
    pub fn ratio(&self, numerator: Event, denominator: Event) -> Option<f64> {
        let total = self[denominator];
        (total > 0).then(|| self[numerator] as f64 / total as f64)
    }

    /// Sample test efficiency: samples hit over samples tested, in [0, 1].
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
        for (sum, count) in self.0.iter_mut().zip(&other.0) {
            *sum += count;
        }
    }
}

impl Serialize for Counts {
    /// Write a map from event name to count, in declaration order.
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
    fn a_ratio_with_denominator_0_is_none() {
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
