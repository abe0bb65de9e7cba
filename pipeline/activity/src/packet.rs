//! Work packets: what moves through the units as one.

use std::ops::{AddAssign, Index, IndexMut};

use crate::events::EVENTS;
use crate::{Counts, Event, Unit};

/// What kind of work a packet is, which decides the units it passes through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PacketKind {
    /// A draw starts: state is read.
    Draw,
    /// A batch of vertices is fetched and shaded and its triangles are set up.
    Vertices,
    /// One triangle in one tile, from traversal to colour.
    Tile,
    /// A tile's samples are resolved into pixels.
    Resolve,
}

/// The events one packet causes; 32 bits are plenty for one packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PacketCounts([u32; Event::COUNT]);

impl Default for PacketCounts {
    fn default() -> Self {
        Self([0; Event::COUNT])
    }
}

impl PacketCounts {
    /// Each event with its count, in declaration order.
    pub fn iter(&self) -> impl Iterator<Item = (Event, u32)> + '_ {
        Event::ALL.into_iter().zip(self.0.iter().copied())
    }

    /// Whether the packet causes anything in `unit`.
    pub fn uses(&self, unit: Unit) -> bool {
        self.of(unit).iter().any(|&count| count > 0)
    }

    /// The counts of the events of `unit`, in declaration order.
    pub fn of(&self, unit: Unit) -> &[u32] {
        &self.0[EVENTS[unit as usize].0..EVENTS[unit as usize].1]
    }
}

impl Index<Event> for PacketCounts {
    type Output = u32;
    fn index(&self, event: Event) -> &u32 {
        &self.0[event as usize]
    }
}

impl IndexMut<Event> for PacketCounts {
    fn index_mut(&mut self, event: Event) -> &mut u32 {
        &mut self.0[event as usize]
    }
}

impl AddAssign<&Self> for PacketCounts {
    fn add_assign(&mut self, other: &Self) {
        for (mine, theirs) in self.0.iter_mut().zip(&other.0) {
            *mine += theirs;
        }
    }
}

/// A piece of work in the order in which the modelled hardware meets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet {
    /// The kind of work.
    pub kind: PacketKind,
    /// The pass it belongs to, counted from 0 in the frame.
    pub pass: u16,
    /// The tile, row by row from the top left; meaningless for draws and vertices.
    pub tile: u32,
    /// The triangle, counted through the pass; the first of the batch for vertices.
    pub triangle: u32,
    /// The events it causes in every unit.
    pub counts: PacketCounts,
}

impl Packet {
    /// A packet that causes nothing yet.
    pub fn new(kind: PacketKind, pass: u16, tile: u32, triangle: u32) -> Self {
        Self { kind, pass, tile, triangle, counts: PacketCounts::default() }
    }
}

impl AddAssign<&PacketCounts> for Counts {
    fn add_assign(&mut self, other: &PacketCounts) {
        for (event, count) in other.iter() {
            self[event] += u64::from(count);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_add_up_to_counts() {
        let mut packet = Packet::new(PacketKind::Tile, 0, 3, 7);
        packet.counts[Event::SamplesTested] = 512;
        let mut total = Counts::default();
        total += &packet.counts;
        total += &packet.counts;
        assert_eq!(total[Event::SamplesTested], 1024);
    }
}
