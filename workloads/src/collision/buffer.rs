//! What an object leaves in the tiles: a box of time and depth for each tile and bin of time.

use super::bounds::{NOTHING, hull, meet};

/// Times and depths at which an object may be in a tile, in one bin of time.
#[derive(Clone, Copy, Debug)]
pub(super) struct TzBox {
    pub t: [f64; 2],
    pub z: [f64; 2],
    /// One of the triangles that are.
    pub triangle: u32,
}

impl TzBox {
    const EMPTY: Self = Self { t: NOTHING, z: NOTHING, triangle: 0 };

    /// What two boxes share.
    pub fn meet(&self, t: [f64; 2], z: [f64; 2]) -> Option<[[f64; 2]; 2]> {
        Some([meet(self.t, t)?, meet(self.z, z)?])
    }
}

/// Boxes by place, of which few are used: emptied in the time that it took to fill it.
#[derive(Default)]
pub(super) struct TzBuffer {
    boxes: Vec<TzBox>,
    used: Vec<u32>,
}

impl TzBuffer {
    /// Empties it and makes room for `places`.
    pub fn clear(&mut self, places: usize) {
        for place in self.used.drain(..) {
            self.boxes[place as usize] = TzBox::EMPTY;
        }
        if self.boxes.len() < places {
            self.boxes.resize(places, TzBox::EMPTY);
        }
    }

    /// Adds a box to that at `place` (the union, by blending with min and max).
    pub fn add(&mut self, place: u32, added: &TzBox) {
        let known = &mut self.boxes[place as usize];
        if known.t[0] > known.t[1] {
            self.used.push(place);
        }
        *known = TzBox { t: hull(known.t, added.t), z: hull(known.z, added.z), triangle: added.triangle };
    }

    /// The box at `place`, empty where nothing was added.
    pub fn at(&self, place: u32) -> &TzBox {
        &self.boxes[place as usize]
    }

    /// Everything that was added, by place of the first addition.
    pub fn used(&self) -> impl Iterator<Item = (u32, &TzBox)> {
        self.used.iter().map(|&place| (place, self.at(place)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_grow_and_are_gone_when_it_is_cleared() {
        let mut buffer = TzBuffer::default();
        buffer.clear(4);
        buffer.add(2, &TzBox { t: [0.25, 0.5], z: [1.0, 2.0], triangle: 7 });
        buffer.add(2, &TzBox { t: [0.5, 0.75], z: [0.0, 1.0], triangle: 8 });
        let found: Vec<_> = buffer.used().map(|(place, found)| (place, found.t, found.z)).collect();
        assert_eq!(found, [(2, [0.25, 0.75], [0.0, 2.0])]);
        assert_eq!(buffer.at(2).meet([0.75, 1.0], [-1.0, 0.0]), Some([[0.75, 0.75], [0.0, 0.0]]));
        assert!(
            buffer.at(2).meet([0.0, 0.2], [-1.0, 3.0]).is_none()
                && buffer.at(1).meet([0.0, 1.0], [0.0, 1.0]).is_none()
        );
        buffer.clear(4);
        assert_eq!(buffer.used().count(), 0);
        assert!(buffer.at(2).meet([0.0, 1.0], [0.0, 1.0]).is_none());
    }
}
