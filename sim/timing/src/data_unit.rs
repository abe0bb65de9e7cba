//! Units that work for warps before the operations of the cores.

use activity::{Event, Unit};

/// Events of a [`DataUnit`] that may have a rate.
pub const DATA_EVENTS: usize = 3;

/// A unit that works for warps on the cores before their operations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataUnit {
    /// The texture units, for pixels.
    Texture,
    /// Shared memory, atomic units and buffers, for groups.
    Compute,
}

impl DataUnit {
    /// Both, in the order of their numbers.
    pub const ALL: [Self; 2] = [Self::Texture, Self::Compute];

    /// The unit.
    pub const fn unit(self) -> Unit {
        match self {
            Self::Texture => Unit::Texture,
            Self::Compute => Unit::Compute,
        }
    }

    /// Its port at the L2.
    pub const fn port(self) -> usize {
        match self {
            Self::Texture => 2,
            Self::Compute => 4,
        }
    }

    /// Its events that may have a rate.
    pub const fn events(self) -> [Event; DATA_EVENTS] {
        match self {
            Self::Texture => [Event::TextureFetches, Event::TextureLines, Event::TextureMisses],
            Self::Compute => [Event::SharedCycles, Event::AtomicSteps, Event::BufferLines],
        }
    }
}
