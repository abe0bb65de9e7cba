//! Order of packets over passes. The front end of a pass works beside the tiles of the pass before, as that of a batch
//! does within a pass, so its packets come before these tiles in the stream, too.

use activity::{LineAccess, Packet, PacketKind, StreamWriter};

/// Receiver of packets, each with the lines it requests from the L2.
pub(super) type Emit<'e> = Box<dyn FnMut(&Packet, &[LineAccess]) + 'e>;

/// Pass and batch of a packet, which rise along the stream.
type Place = (u32, u32);

/// Emits packets. Tiles are held while no later batch of the front end is known.
pub(super) struct PacketOrder<'e> {
    /// `None` if nobody receives packets.
    emit: Option<Emit<'e>>,
    /// Tiles, all of one batch, and their place.
    held: StreamWriter,
    held_at: Option<Place>,
    /// Place of the front end.
    front: Place,
}

impl<'e> PacketOrder<'e> {
    pub fn new(emit: Option<Emit<'e>>) -> Self {
        Self { emit, held: StreamWriter::default(), held_at: None, front: (0, 0) }
    }

    /// Adds the next packet.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        if self.emit.is_none() {
            return;
        }
        let place = (packet.pass, packet.batch);
        if packet.kind.is_of_front_end() {
            // One batch of the front end is ahead of the tiles.
            if place != self.front && self.held_at.is_some_and(|held| held < self.front) {
                self.release();
            }
            self.front = place;
            return self.emit(packet, lines);
        }
        let is_barrier = matches!(packet.kind, PacketKind::Barrier(_));
        if is_barrier || self.held_at.is_some_and(|held| held != place) {
            self.release();
        }
        if is_barrier || place < self.front {
            return self.emit(packet, lines);
        }
        self.held.push(packet, lines);
        self.held_at = Some(place);
    }

    fn emit(&mut self, packet: &Packet, lines: &[LineAccess]) {
        if let Some(emit) = &mut self.emit {
            emit(packet, lines);
        }
    }

    /// Emits the tiles that are held.
    fn release(&mut self) {
        if self.held_at.take().is_none() {
            return;
        }
        let held = std::mem::take(&mut self.held).finish();
        let replayed = held.replay(|packet, lines| self.emit(packet, lines));
        debug_assert!(replayed.is_ok(), "{replayed:?}");
    }
}

/// At its end a frame emits what it holds, finished or not.
impl Drop for PacketOrder<'_> {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.release();
        }
    }
}

#[cfg(test)]
mod tests {
    use activity::Waits;

    use super::*;

    /// The packets of kinds, passes and batches in the order in which they are emitted.
    fn emitted(packets: &[(PacketKind, u32, u32)]) -> Vec<(PacketKind, u32, u32)> {
        let mut found = Vec::new();
        let mut order = PacketOrder::new(Some(Box::new(|packet: &Packet, _: &[LineAccess]| {
            found.push((packet.kind, packet.pass, packet.batch));
        })));
        for &(kind, pass, batch) in packets {
            order.push(&Packet { batch, ..Packet::new(kind, pass) }, &[]);
        }
        drop(order);
        found
    }

    const V: PacketKind = PacketKind::Vertices;
    const T: PacketKind = PacketKind::Tile;
    const BARRIER: PacketKind = PacketKind::Barrier(Waits::Tiles);

    #[test]
    fn the_front_end_of_a_pass_comes_before_the_last_tiles_of_the_one_before() {
        // Two batches, and then a pass of one.
        let in_passes =
            [(V, 0, 0), (V, 0, 1), (T, 0, 0), (T, 0, 1), (T, 0, 1), (V, 1, 0), (V, 1, 0), (T, 1, 0)];
        let in_order =
            [(V, 0, 0), (V, 0, 1), (T, 0, 0), (V, 1, 0), (V, 1, 0), (T, 0, 1), (T, 0, 1), (T, 1, 0)];
        assert_eq!(emitted(&in_passes), in_order);
        // That is the order within a pass.
        let batches = in_order.map(|(kind, pass, batch)| (kind, 0, 2 * pass + batch));
        assert_eq!(emitted(&batches), batches);
    }

    #[test]
    fn no_more_than_a_batch_of_the_front_end_is_ahead() {
        let passes = [(V, 0, 0), (T, 0, 0), (V, 1, 0), (V, 1, 1), (T, 1, 0), (T, 1, 1)];
        let order = [(V, 0, 0), (V, 1, 0), (T, 0, 0), (V, 1, 1), (T, 1, 0), (T, 1, 1)];
        assert_eq!(emitted(&passes), order);
        // A pass without tiles.
        let empty = [(V, 0, 0), (T, 0, 0), (V, 1, 0), (V, 2, 0), (T, 2, 0)];
        assert_eq!(emitted(&empty), [(V, 0, 0), (V, 1, 0), (T, 0, 0), (V, 2, 0), (T, 2, 0)]);
    }

    #[test]
    fn barriers_and_passes_without_a_front_end_keep_their_place() {
        let passes = [(V, 0, 0), (T, 0, 0), (BARRIER, 1, 0), (V, 1, 0), (T, 1, 0), (T, 2, 0), (T, 3, 0)];
        assert_eq!(emitted(&passes), passes);
    }
}
