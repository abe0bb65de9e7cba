//! What the passes of all pairs draw, as three views of the whole scene side by side: along x, y and z.

use glam::Vec3;

use super::bounds::Bounds;
use super::object::Object;
use super::pass::Pass;

/// Linear RGB of pixels with one fragment and with the most.
const DRAWN: [Vec3; 2] = [Vec3::new(0.60, 0.72, 0.84), Vec3::new(0.0, 0.06, 0.28)];
/// Linear RGB of pixels in which one tile is left, and the most.
const LEFT: [Vec3; 2] = [Vec3::new(0.90, 0.42, 0.15), Vec3::new(0.62, 0.06, 0.0)];

/// Fragments and tiles left of all pairs, by the pixel that they lie in.
pub(super) struct Picture {
    space: [[f64; 2]; 3],
    side: usize,
    /// Fragments drawn, and tiles in which a pair may collide.
    pixels: Vec<[u32; 2]>,
}

impl Picture {
    /// Three empty views of `side` by `side` pixels that hold the way of all `objects`.
    pub fn new(objects: &[Object], side: usize) -> Self {
        let whole = objects.iter().fold(Bounds::NOTHING, |whole, object| whole.hull(object.bounds()));
        Self { space: whole.space, side, pixels: vec![[0; 2]; 3 * side * side] }
    }

    /// Counts a fragment in a tile of `pass`.
    pub fn fragment(&mut self, pass: &Pass, tile: [u32; 2]) {
        self.pixel(pass, tile)[0] += 1;
    }

    /// Counts a tile of `pass` in which a pair may collide.
    pub fn left(&mut self, pass: &Pass, tile: [u32; 2]) {
        self.pixel(pass, tile)[1] += 1;
    }

    /// The pixel that holds the middle of a tile; the larger coordinate is on the right and above.
    fn pixel(&mut self, pass: &Pass, tile: [u32; 2]) -> &mut [u32; 2] {
        let middle = pass.bounds(tile, [0.0; 2], [0.0; 2]).space;
        let [column, row] = [1, 2].map(|across| {
            let axis = (pass.axis + across) % 3;
            let ([low, high], [from, to]) = (self.space[axis], middle[axis]);
            let share = (0.5 * (from + to) - low) / (high - low);
            // What is no number, where all lies in a plane, becomes 0.
            ((share * self.side as f64) as usize).min(self.side - 1)
        });
        &mut self.pixels[(self.side - 1 - row) * 3 * self.side + pass.axis * self.side + column]
    }

    /// White where nothing is; blue by the fragments and red by the tiles left, both on a logarithmic scale.
    pub fn image(&self) -> Vec<Vec3> {
        let most = [0, 1].map(|which| self.pixels.iter().map(|pixel| pixel[which]).max().unwrap_or(0));
        let shade = |[first, last]: [Vec3; 2], count: u32, most: u32| {
            let log = |count: u32| libm::logf(count as f32);
            first.lerp(last, if most > 1 { log(count) / log(most) } else { 1.0 })
        };
        let colour = |&[drawn, left]: &[u32; 2]| match (drawn, left) {
            (0, 0) => Vec3::ONE,
            (_, 0) => shade(DRAWN, drawn, most[0]),
            _ => shade(LEFT, left, most[1]),
        };
        self.pixels.iter().map(colour).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_become_colours() {
        let object =
            |x: f64| Object::from_ends(vec![[[[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]]; 2]], 0.0);
        let objects: Vec<Object> = [0.0, 4.0].into_iter().filter_map(object).collect();
        let mut picture = Picture::new(&objects, 2);
        assert_eq!(picture.image(), [Vec3::ONE; 12]);
        picture.pixels[0] = [1, 0];
        picture.pixels[1] = [9, 0];
        picture.pixels[2] = [9, 1];
        assert_eq!(picture.image()[..4], [DRAWN[0], DRAWN[1], LEFT[1], Vec3::ONE]);
    }
}
