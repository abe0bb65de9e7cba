//! Integer counters, one per event, and how they run over time.

use crate::events::EVENTS;
use crate::{Event, Unit};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;
use std::ops::{AddAssign, Index, IndexMut};

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

    /// The events of every unit that the GPU has, with their counts. Units that a GPU may lack and that did
    /// nothing are left out.
    pub fn reported(&self) -> impl Iterator<Item = (Event, u64)> + '_ {
        let is_reported = |unit: Unit| !unit.is_optional() || self.uses(unit);
        Unit::ALL
            .into_iter()
            .filter(move |&unit| is_reported(unit))
            .flat_map(|unit| unit.events().map(|at| (Event::ALL[at], self.0[at])))
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
    /// Write a map from event name to count, in declaration order, as [`Counts::reported`].
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.reported().map(|(event, count)| (event.name(), count)))
    }
}

impl<'de> Deserialize<'de> for Counts {
    /// Reads a map from event name to count; events that are left out have a count of 0.
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let mut counts = Self::default();
        for (name, count) in BTreeMap::<String, u64>::deserialize(from)? {
            counts[Event::try_from(name).map_err(serde::de::Error::custom)?] = count;
        }
        Ok(counts)
    }
}

/// Activity during one bin of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bin {
    /// Count of every event in the bin.
    pub counts: Counts,
    /// Busy time of every unit in the bin, in picoseconds.
    pub busy_ps: [u64; Unit::COUNT],
}

/// Activity of one frame over time, in equal bins from its start. The last bin may extend past the end of the
/// frame; that part is empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timeline {
    /// Length of a bin in picoseconds, at least 1.
    pub bin_ps: u64,
    /// Length of the frame in picoseconds, from its first command to its last pixel.
    pub duration_ps: u64,
    /// The bins; `bins.len() * bin_ps >= duration_ps`.
    pub bins: Vec<Bin>,
}

impl Timeline {
    /// Length of the frame in seconds.
    pub fn duration_s(&self) -> f64 {
        self.duration_ps as f64 * 1e-12
    }

    /// Counts of the whole frame.
    pub fn total(&self) -> Counts {
        self.bins.iter().fold(Counts::default(), |mut total, bin| {
            total += &bin.counts;
            total
        })
    }

    /// Busy time of every unit in the whole frame, in picoseconds.
    pub fn busy_ps(&self) -> [u64; Unit::COUNT] {
        let mut total = [0; Unit::COUNT];
        for bin in &self.bins {
            for (sum, busy) in total.iter_mut().zip(bin.busy_ps) {
                *sum += busy;
            }
        }
        total
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
    fn units_that_a_gpu_lacks_are_not_reported() {
        let mut counts = Counts::default();
        let optional: usize =
            [Unit::Compute, Unit::Llc, Unit::Edram].iter().map(|unit| unit.events().len()).sum();
        assert_eq!(counts.reported().count(), Event::COUNT - optional);
        counts[Event::LlcReads] = 3;
        assert_eq!(counts.reported().filter(|(event, _)| event.unit() == Unit::Llc).count(), 4);
        assert!(counts.reported().is_sorted_by_key(|(event, _)| event), "in declaration order");
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
