//! What a packet owes each unit of one machine, in cycles. Every level reads the same jobs.

use std::ops::Range;

use activity::{Event, LineAccess, Packet, PacketCounts, PacketKind, Unit};

use crate::MachineSpec;

/// A station on the way of a packet. The shader cores are two: one on the way of vertices, one on that of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
#[allow(missing_docs, reason = "the units of the block diagram")]
pub enum Place {
    Command,
    Vertex,
    Setup,
    Traversal,
    ZCull,
    SampleTest,
    Depth,
    ShadingCache,
    Pixel,
    Colour,
}

impl Place {
    /// Every place in the order of the stream.
    pub const ALL: [Self; 10] = [
        Self::Command,
        Self::Vertex,
        Self::Setup,
        Self::Traversal,
        Self::ZCull,
        Self::SampleTest,
        Self::Depth,
        Self::ShadingCache,
        Self::Pixel,
        Self::Colour,
    ];
    /// How many places there are.
    pub const COUNT: usize = Self::ALL.len();

    /// The unit that stands there.
    pub const fn unit(self) -> Unit {
        match self {
            Self::Command => Unit::Command,
            Self::Vertex | Self::Pixel => Unit::Shader,
            Self::Setup => Unit::Setup,
            Self::Traversal => Unit::Traversal,
            Self::ZCull => Unit::ZCull,
            Self::SampleTest => Unit::SampleTest,
            Self::Depth => Unit::Depth,
            Self::ShadingCache => Unit::ShadingCache,
            Self::Colour => Unit::Colour,
        }
    }
}

/// The units that ask the L2 for lines, in the order of its ports.
pub const CLIENTS: [Unit; 4] = [Unit::Command, Unit::Depth, Unit::Texture, Unit::Colour];

/// The port of the texture units.
pub const TEXTURE_PORT: usize = 2;

/// The port of a client of the L2.
pub fn port(unit: Unit) -> Option<usize> {
    CLIENTS.iter().position(|&client| client == unit)
}

/// A packet as the machine sees it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Job {
    /// Whether it goes through the front end (command to set-up) rather than the tiles' way (traversal to colour).
    pub front: bool,
    /// The batch it belongs to.
    pub batch: u32,
    /// The last place where it does anything.
    pub last: Place,
    /// Cycles it occupies each place for, by place; 0 at the shader cores.
    pub service: [u32; Place::COUNT],
    /// Threads of the shader.
    pub threads: u32,
    /// Operations of each thread.
    pub ops: u32,
    /// Bilinear fetches of all threads, and the lines of the texture cache they read.
    pub texels: [u32; 2],
    /// The first of its lines, and how many each client asks for, in the order of [`CLIENTS`].
    pub first_line: usize,
    /// See above.
    pub lines: [u32; 4],
}

impl Job {
    /// Its lines of one client, in the store it was made with.
    pub fn lines_of(&self, port: usize) -> Range<usize> {
        let before: u32 = self.lines[..port].iter().sum();
        let first = self.first_line + before as usize;
        first..first + self.lines[port] as usize
    }

    /// Whether its threads go by the texture units.
    pub fn is_textured(&self) -> bool {
        self.texels != [0; 2] || self.lines[TEXTURE_PORT] > 0
    }

    /// Warps of at most `lanes` threads.
    pub fn warps(&self, lanes: u32) -> u32 {
        self.threads.div_ceil(lanes)
    }
}

/// The share of `whole` that falls to part `part` of `parts`; all shares add up to the whole.
pub fn share(whole: u32, part: u32, parts: u32) -> Range<u32> {
    let up_to = |part: u32| (u64::from(whole) * u64::from(part) / u64::from(parts.max(1))) as u32;
    up_to(part)..up_to(part + 1)
}

/// Turns packets into jobs.
#[derive(Clone, Debug)]
pub struct Jobs {
    /// Cycles of one event, by place.
    costs: [Vec<(Event, f64)>; Place::COUNT],
    texel_cycles: [f64; 2],
    batch_triangles: u32,
    batch: u32,
}

impl Jobs {
    /// For packets in batches of `batch_triangles` on `machine`.
    pub fn new(machine: &MachineSpec, batch_triangles: u32) -> Self {
        let costs = Place::ALL.map(|place| {
            let rates = machine.common(place.unit()).rates;
            rates.iter().flat_map(|rates| rates.iter()).map(|(event, rate)| (event, rate.recip())).collect()
        });
        let cycles = |event| {
            machine.texture.rates.iter().find(|(e, _)| *e == event).map_or(0.0, |(_, rate)| rate.recip())
        };
        Self {
            costs,
            texel_cycles: [Event::TextureFetches, Event::TextureLines].map(cycles),
            batch_triangles: batch_triangles.max(1),
            batch: 0,
        }
    }

    /// The job of the next packet of the stream; `lines` are its lines, which are kept in `store`.
    pub fn job(&mut self, packet: &Packet, lines: &[LineAccess], store: &mut Vec<LineAccess>) -> Job {
        let counts = &packet.counts;
        let front = matches!(packet.kind, PacketKind::Draw | PacketKind::Vertices);
        let batch = self.batch_of(packet, front);
        let places = if front { Place::Command as usize..3 } else { 3..Place::COUNT };
        let mut job = Job {
            front,
            batch,
            last: if front { Place::Command } else { Place::Traversal },
            service: [0; Place::COUNT],
            threads: counts[if front { Event::VertexInvocations } else { Event::PixelInvocations }],
            ops: 0,
            texels: [counts[Event::TextureFetches], counts[Event::TextureLines]],
            first_line: store.len(),
            lines: [0; 4],
        };
        job.ops = counts[Event::ShaderOps].div_ceil(job.threads.max(1));
        if !lines.is_empty() {
            job.lines = sorted(lines, store);
        }
        for place in &Place::ALL[places] {
            let used =
                counts.uses(place.unit()) || port(place.unit()).is_some_and(|port| job.lines[port] > 0);
            if used {
                job.last = *place;
                job.service[*place as usize] = self.cycles(*place, counts);
            }
        }
        job
    }

    /// Cycles of the texture units for some fetches and lines.
    pub fn texture_cycles(&self, fetches: u32, lines: u32) -> u32 {
        let [fetch, line] = self.texel_cycles;
        whole((f64::from(fetches) * fetch).max(f64::from(lines) * line))
    }

    /// Cycles that a packet with `counts` occupies `place` for, lines not counted. The parts of a unit work side by side: the
    /// slowest sets the pace.
    fn cycles(&self, place: Place, counts: &PacketCounts) -> u32 {
        let parts =
            self.costs[place as usize].iter().map(|&(event, cycles)| f64::from(counts[event]) * cycles);
        whole(parts.fold(0.0, f64::max))
    }

    fn batch_of(&mut self, packet: &Packet, front: bool) -> u32 {
        let own = packet.triangle / self.batch_triangles;
        match packet.kind {
            PacketKind::Tile if packet.triangle != u32::MAX => self.batch = own,
            _ => {}
        }
        if front { own } else { self.batch }
    }
}

/// Puts `lines` into `store`, those of each client side by side in the order of the ports, and counts them.
fn sorted(lines: &[LineAccess], store: &mut Vec<LineAccess>) -> [u32; 4] {
    CLIENTS.map(|client| {
        let before = store.len();
        store.extend(lines.iter().filter(|access| access.client == client));
        (store.len() - before) as u32
    })
}

/// Rounded up, but for what is rounding itself.
fn whole(cycles: f64) -> u32 {
    let cycles = (cycles - 1e-6).max(0.0);
    // `ceil` is a call where the processor is taken for an old one.
    let below = cycles as u32;
    below.saturating_add(u32::from(f64::from(below) < cycles))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up() {
        for (whole, parts) in [(0, 1), (7, 3), (100, 7), (3, 5)] {
            assert_eq!((0..parts).map(|part| share(whole, part, parts).len() as u32).sum::<u32>(), whole);
        }
    }

    #[test]
    fn the_port_of_the_texture_units_is_theirs() {
        assert_eq!(port(Unit::Texture), Some(TEXTURE_PORT));
    }

    #[test]
    fn cycles_round_up_and_not_too_far() {
        assert_eq!(
            [0.0, 0.2, 1.0, 3.0 * (1.0 / 3.0), 49.0 * (1.0 / 49.0), 2.1].map(whole),
            [0, 1, 1, 1, 1, 3]
        );
        assert_eq!([4.2e9, 1e10, 1e300].map(whole), [4_200_000_000, u32::MAX, u32::MAX]);
    }
}
