//! Pieces of time, and the faces that a triangle may show in each.

/// Which faces a sample of a box may see: the one that appears clockwise on the screen (edges above zero), and the
/// counter-clockwise one.
pub type Faces = [bool; 2];

/// A part of the time in which only some faces can be seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// First and last time, both included. Pieces do not overlap.
    pub t: [f32; 2],
    /// The faces that the triangle may show, drawn or not.
    pub faces: Faces,
}

impl Piece {
    /// Whether it is known which face is shown.
    pub fn is_decided(&self) -> bool {
        self.faces != [true; 2]
    }

    /// The faces that the triangle may show and that are drawn.
    pub fn seen(&self, drawn: Faces) -> Faces {
        [0, 1].map(|face| self.faces[face] && drawn[face])
    }
}

/// Pieces of time in order.
#[derive(Clone, Copy, Debug)]
pub struct Timeline {
    pieces: [Piece; Self::MOST],
    len: usize,
}

impl Timeline {
    /// The most pieces there can be.
    pub const MOST: usize = 8;
    /// The most often time can be bisected.
    pub const MOST_SPLITS: u32 = Self::MOST.ilog2();

    /// No time at all.
    pub const fn empty() -> Self {
        Self { pieces: [Piece { t: [0.0; 2], faces: [false; 2] }; Self::MOST], len: 0 }
    }

    /// One piece.
    pub fn one(piece: Piece) -> Self {
        let mut timeline = Self::empty();
        timeline.push(piece);
        timeline
    }

    /// Adds a piece after the others. One that shows the same as the last, and follows it at once, goes into that. Where all
    /// places are taken the last piece grows, which keeps too much rather than too little.
    pub fn push(&mut self, piece: Piece) {
        let full = self.len == Self::MOST;
        match self.pieces[..self.len].last_mut() {
            Some(last) if full || (last.faces == piece.faces && last.t[1].next_up() >= piece.t[0]) => {
                last.t[1] = last.t[1].max(piece.t[1]);
                last.faces = [0, 1].map(|face| last.faces[face] | piece.faces[face]);
            }
            _ => {
                self.pieces[self.len] = piece;
                self.len += 1;
            }
        }
    }

    /// The pieces.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces[..self.len]
    }

    /// What both say, of one time.
    pub fn meet(&self, other: &Self) -> Self {
        let mut both = Self::empty();
        for a in self.pieces() {
            for b in other.pieces() {
                let t = [a.t[0].max(b.t[0]), a.t[1].min(b.t[1])];
                let faces = a.seen(b.faces);
                if t[0] <= t[1] && faces != [false; 2] {
                    both.push(Piece { t, faces });
                }
            }
        }
        both
    }

    /// From the first time to the last.
    pub fn hull(&self) -> Option<[f32; 2]> {
        let pieces = self.pieces();
        Some([pieces.first()?.t[0], pieces.last()?.t[1]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_timeline_grows_rather_than_forgets() {
        let mut timeline = Timeline::empty();
        for k in 0..12_u8 {
            let t = f32::from(k);
            timeline.push(Piece { t: [t, t + 0.5], faces: [k % 2 == 0, k % 2 == 1] });
        }
        assert_eq!(timeline.pieces().len(), Timeline::MOST);
        assert_eq!(timeline.hull(), Some([0.0, 11.5]));
        assert_eq!(timeline.pieces()[Timeline::MOST - 1].faces, [true; 2]);
    }
}
