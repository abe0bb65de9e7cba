//! Screen bounds: the pixels a triangle may touch at any time and from any lens position.

use super::Triangle;
use crate::geometry::{Shear, Viewport};

/// Pixels `x0..x1` by `y0..y1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRect {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// One past the last column.
    pub x1: u32,
    /// One past the last row.
    pub y1: u32,
}

impl PixelRect {
    /// The whole viewport.
    pub fn whole(viewport: Viewport) -> Self {
        Self { x0: 0, y0: 0, x1: viewport.width(), y1: viewport.height() }
    }

    /// Whether it contains no pixel.
    pub fn is_empty(&self) -> bool {
        self.x0 >= self.x1 || self.y0 >= self.y1
    }

    /// Tiles of `side_px` pixels that it touches, as a rectangle in tiles.
    pub fn tiles(&self, side_px: u32) -> Self {
        Self {
            x0: self.x0 / side_px,
            y0: self.y0 / side_px,
            x1: self.x1.div_ceil(side_px),
            y1: self.y1.div_ceil(side_px),
        }
    }

    /// Intersection of both.
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            x0: self.x0.max(other.x0),
            y0: self.y0.max(other.y0),
            x1: self.x1.min(other.x1),
            y1: self.y1.min(other.y1),
        }
    }
}

/// Pixels that `triangle` may touch: the bounding box of its vertices at the corners of shutter and lens,
/// widened by the rounding of the sample test. While `w` stays positive the image of a vertex is monotone in
/// time and lens position, so the corners are the extremes. Otherwise nothing is divided and the bounds are
/// the whole viewport. In an orthographic view the image moves as the vertex does and is linear in the lens
/// position, so corners suffice again.
pub fn bounds(triangle: &Triangle, shear: &Shear, viewport: Viewport) -> PixelRect {
    let mut nearest = f32::INFINITY;
    let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for corner in &triangle.corners {
        for p in &corner.ends()[..1 + usize::from(triangle.moving)] {
            let weight = shear.weight(p[2]);
            nearest = nearest.min(weight);
            let inverse = 1.0 / f64::from(weight);
            for (axis, range) in range.iter_mut().enumerate() {
                let (s, a) = (f64::from(shear.s[axis]), f64::from(shear.a[axis]));
                let circle = ((a * f64::from(p[2]) - s) * inverse).abs();
                let x = f64::from(p[axis]) * inverse;
                *range = [range[0].min(x - circle), range[1].max(x + circle)];
            }
        }
    }
    if nearest <= 0.0 {
        return PixelRect::whole(viewport);
    }
    let side = [viewport.width(), viewport.height()];
    let [x, y] = [0, 1].map(|axis| {
        let slack = 2.0 * f64::from(triangle.slack[axis]) / f64::from(nearest);
        let half = 0.5 * f64::from(side[axis]);
        // The cast truncates, which rounds non-negative values down.
        let pixel = |at: f64| at.clamp(0.0, f64::from(side[axis])) as u32;
        [pixel(range[axis][0] - slack + half), pixel(range[axis][1] + slack + half + 1.0)]
    });
    PixelRect { x0: x[0], y0: y[0], x1: x[1], y1: y[1] }
}

/// For each square of `side_px` pixels of the image, row by row, the indices of the rectangles that intersect
/// it, in order.
pub(crate) fn distribute(
    rects: impl IntoIterator<Item = (u32, PixelRect)>,
    viewport: Viewport,
    side_px: u32,
) -> Vec<Vec<u32>> {
    let squares = PixelRect::whole(viewport).tiles(side_px);
    let mut lists = vec![Vec::new(); (squares.x1 * squares.y1) as usize];
    for (index, rect) in rects {
        let met = rect.tiles(side_px);
        for row in met.y0..met.y1 {
            for column in met.x0..met.x1 {
                lists[(row * squares.x1 + column) as usize].push(index);
            }
        }
    }
    lists
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Cull, MovingVertex};
    use crate::setup::{Outcome, set_up};

    fn triangle(open: [[f32; 3]; 3], close: [[f32; 3]; 3]) -> Triangle {
        let v = [0, 1, 2].map(|i| MovingVertex { open: open[i], close: close[i] });
        match set_up(0, [&v[0], &v[1], &v[2]], Cull::None, &Shear::default(), 0.1, [64.0; 2]) {
            Outcome::Ready(triangle) => triangle,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_moving_box_spans_both_ends() {
        let open = [[-20.0, -20.0, 1.0], [-10.5, -20.0, 1.0], [-20.0, -10.5, 1.0]];
        let close = open.map(|[x, y, w]| [x + 30.0, y, w]);
        let rect = bounds(&triangle(open, close), &Shear::default(), Viewport::new(128, 128).unwrap());
        assert_eq!(rect, PixelRect { x0: 43, y0: 43, x1: 84, y1: 54 });
    }

    #[test]
    fn a_vertex_behind_the_camera_asks_for_everything() {
        let open = [[-20.0, -20.0, 1.0], [-10.0, -20.0, -1.0], [-20.0, -10.0, 1.0]];
        let viewport = Viewport::new(128, 96).unwrap();
        assert_eq!(bounds(&triangle(open, open), &Shear::default(), viewport), PixelRect::whole(viewport));
    }

    #[test]
    fn off_screen_is_empty() {
        let open = [[500.0, 0.0, 1.0], [600.0, 0.0, 1.0], [500.0, 10.0, 1.0]];
        assert!(bounds(&triangle(open, open), &Shear::default(), Viewport::new(128, 96).unwrap()).is_empty());
    }
}
