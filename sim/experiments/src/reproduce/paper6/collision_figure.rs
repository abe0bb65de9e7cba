//! Figure 6: pixels in which two moving objects overlap in time and in depth, seen along each axis.

use output::plot::{CaptionedImage, Images, Look};
use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, View};

use crate::reproduce::Figure;

/// A triangle when the shutter opens and when it closes.
pub(super) type Ends = [[[f64; 3]; 3]; 2];

/// Time and depth of an object in a pixel; `None` where it never is.
type Boxes = Vec<Option<[[f64; 2]; 2]>>;

/// The views of the paper: their axis, and their name.
const VIEWS: [(usize, &str); 3] = [(2, "x and y"), (1, "z and x"), (0, "y and z")];

/// Red where the times of both overlap, blue where their depths do, dark grey where one of them is.
pub(super) fn overlaps(name: &str, objects: [&[Ends]; 2], pixels: u32) -> Figure {
    let image = |(axis, axes): (usize, &str)| {
        let grid = grid(&objects, axis, pixels);
        let boxes = objects.map(|object| boxes(object, axis, &grid));
        let colors: Vec<[f32; 3]> = boxes[0].iter().zip(&boxes[1]).map(|(a, b)| color([*a, *b])).collect();
        let both = colors.iter().filter(|color| color[0] == 1.0 && color[2] == 1.0).count();
        let caption = format!("{axes}: {both} pixels in time and depth");
        CaptionedImage { size: [pixels; 2], pixels: colors, caption }
    };
    let images = VIEWS.map(image);
    let subject = format!(
        "{name}, {pixels} pixels across; red where their times overlap, blue where their depths do, purple both; a pixel has a box of time and \
         depth for each object"
    );
    let title = "Overlap in time and depth (Paper VI, Figure 6)";
    let picture = Images { title, subject: &subject, across: 3, images: &images }.picture(&Look::default());
    Figure { name: "VI_fig6", picture }
}

/// Square pixels over all that both sweep.
fn grid(objects: &[&[Ends]; 2], axis: usize, pixels: u32) -> Grid {
    let points = || objects.iter().flat_map(|object| object.iter()).flatten().flatten();
    let range = |along: usize| {
        let of = points().map(|point| point[along]);
        of.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
    };
    let [across, down] = [range((axis + 1) % 3), range((axis + 2) % 3)];
    let side = (across[1] - across[0]).max(down[1] - down[0]) / f64::from(pixels);
    let middle = |[low, high]: [f64; 2]| 0.5 * (low + high) - 0.5 * side * f64::from(pixels);
    Grid { origin: [middle(across), middle(down)], tile: [side; 2], columns: pixels, rows: pixels }
}

fn boxes(object: &[Ends], axis: usize, grid: &Grid) -> Boxes {
    let rasterizer = Rasterizer::new(View::orthographic());
    let mut boxes: Boxes = vec![None; (grid.columns * grid.rows) as usize];
    let turn = |p: [f64; 3]| [p[(axis + 1) % 3], p[(axis + 2) % 3], p[axis]];
    for [open, close] in object.iter().map(|ends| ends.map(|end| end.map(turn))) {
        let Some(triangle) = MovingTriangle::new(open, close) else { continue };
        rasterizer.rasterize(&triangle, grid, |[column, row], touch| {
            let pixel = &mut boxes[(row * grid.columns + column) as usize];
            let known = pixel.unwrap_or([touch.t, touch.z]);
            let hull = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
            *pixel = Some([hull(known[0], touch.t), hull(known[1], touch.z)]);
        });
    }
    boxes
}

fn color(boxes: [Option<[[f64; 2]; 2]>; 2]) -> [f32; 3] {
    let meet = |a: [f64; 2], b: [f64; 2]| f32::from(u8::from(a[0] <= b[1] && b[0] <= a[1]));
    match boxes {
        [Some(a), Some(b)] => [meet(a[0], b[0]), 0.0, meet(a[1], b[1])],
        [None, None] => [0.0; 3],
        _ => [0.05; 3],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit square that moves, as two triangles.
    fn square(from: [f64; 3], to: [f64; 3]) -> Vec<Ends> {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let at = |[x, y, z]: [f64; 3], corner: usize| [x + corners[corner][0], y + corners[corner][1], z];
        [[0, 1, 2], [0, 2, 3]].map(|three: [usize; 3]| [from, to].map(|end| three.map(|k| at(end, k)))).into()
    }

    /// Pixels of each colour along z: overlap of time alone, of depth alone, and of both.
    fn counts(objects: [&[Ends]; 2]) -> [usize; 3] {
        let grid = grid(&objects, 2, 32);
        let [a, b] = objects.map(|object| boxes(object, 2, &grid));
        let colors: Vec<[f32; 3]> = a.iter().zip(&b).map(|(a, b)| color([*a, *b])).collect();
        [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]
            .map(|wanted| colors.iter().filter(|color| **color == wanted).count())
    }

    #[test]
    fn time_and_depth_are_distinguished() {
        let still = square([0.0; 3], [0.0; 3]);
        // In front at all times; through the square at depth 0; and there only at its end, after the first has left.
        let in_front = square([0.0, 0.0, 3.0], [0.0, 0.0, 3.0]);
        let [time, depth, both] = counts([&still, &in_front]);
        assert!(time > 500 && depth == 0 && both == 0, "{time} {depth} {both}");
        let [time, depth, both] = counts([&still, &square([-3.0, 0.0, 0.0], [0.0; 3])]);
        assert!(time == 0 && depth == 0 && both > 50, "{time} {depth} {both}");
        let leaves = square([0.0; 3], [9.0, 0.0, 0.0]);
        let [time, depth, both] = counts([&leaves, &square([-9.0, 0.0, 0.0], [0.0; 3])]);
        assert!(time == 0 && depth > 0 && both == 0, "{time} {depth} {both}");
    }
}
