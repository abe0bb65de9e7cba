//! Names beside points, where they hide nothing and nothing hides them.

use super::palette::{AXIS, Colour};
use super::panel::Panel;
use super::picture::{Picture, Point, Text, text};
use super::text::text_width;

/// A name, the point it belongs to, and the radius of the point's marker.
#[derive(Clone, Copy, Debug)]
pub(super) struct Label<'a> {
    pub name: &'a str,
    pub at: Point,
    pub radius: f64,
    pub colour: Colour,
    pub bold: bool,
}

/// Size of names in pixels.
const NAME_PX: f64 = 11.5;
/// Half the height of the box kept free around a name.
const HALF: f64 = 6.5;
/// Distances from the marker at which there may be a name, from near to far.
const REACHES: [f64; 6] = [3.0, 8.0, 16.0, 28.0, 44.0, 64.0];
/// Directions tried at each distance.
const DIRECTIONS: u32 = 16;
/// From this distance on a line leads from the name to its point.
const LEADER: f64 = 12.0;

/// Left, top, right, bottom.
type Box4 = [f64; 4];

fn overlaps(a: &Box4, b: &Box4) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// Writes the names, the first ones first: each at the nearest place within the panel where it is on no name, no marker and no line
/// (`obstacles`). Returns how many found no place and are left out.
pub(super) fn write(
    picture: &mut Picture,
    panel: &Panel,
    labels: &[Label<'_>],
    obstacles: &[Point],
) -> usize {
    let mut taken: Vec<Box4> = obstacles.iter().map(|(x, y)| [x - 2.5, y - 2.5, x + 2.5, y + 2.5]).collect();
    taken.extend(labels.iter().map(|Label { at: (x, y), radius: r, .. }| [x - r, y - r, x + r, y + r]));
    let mut left_out = 0;
    for label in labels {
        let Some((place, reach)) = nearest(label, panel, &taken) else {
            left_out += 1;
            continue;
        };
        if reach >= LEADER {
            let (x, y) = label.at;
            let end = (x.clamp(place[0], place[2]), y.clamp(place[1], place[3]));
            let length = libm::hypot(end.0 - x, end.1 - y).max(1.0);
            let start = (x + (end.0 - x) / length * label.radius, y + (end.1 - y) / length * label.radius);
            picture.line(start, end, AXIS, 0.8);
        }
        let at = (place[0] + 1.0, 0.5 * (place[1] + place[3]));
        let (colour, bold) = (label.colour, label.bold);
        picture.text(Text { size: NAME_PX, colour, bold, ..text(label.name, at) });
        taken.push(place);
    }
    left_out
}

/// The nearest free box for a name, and how far it is from its marker.
fn nearest(label: &Label<'_>, panel: &Panel, taken: &[Box4]) -> Option<(Box4, f64)> {
    let width = text_width(label.name, NAME_PX, label.bold) + 2.0;
    let is_free = |place: &Box4| {
        let inside = place[0] >= panel.left
            && place[2] <= panel.right
            && place[1] >= panel.top
            && place[3] <= panel.bottom;
        inside && !taken.iter().any(|other| overlaps(place, other))
    };
    REACHES.iter().find_map(|&reach| {
        let from_marker = label.radius + reach;
        (0..DIRECTIONS).find_map(|number| {
            // To the right first, then on both sides of it.
            let turn = if number % 2 == 0 { number / 2 } else { DIRECTIONS - 1 - number / 2 };
            let angle = std::f64::consts::TAU * f64::from(turn) / f64::from(DIRECTIONS);
            let (sin, cos) = libm::sincos(angle);
            let (x, y) = (label.at.0 + from_marker * cos, label.at.1 - (from_marker + 0.5 * HALF) * sin);
            // The box touches the circle with the side that faces it.
            let left = x - 0.5 * width * (1.0 - cos);
            let middle = y - 0.7 * HALF * sin;
            let place = [left, middle - HALF, left + width, middle + HALF];
            is_free(&place).then_some((place, reach))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::axis::{Axis, Way};
    use super::super::look::Look;
    use super::super::palette::INK;
    use super::super::picture::Shape;
    use super::*;

    fn panel() -> Panel {
        let x = Axis::new("x", "", (0.0, 1.0), (Way::Across, 400.0));
        let y = Axis::new("y", "", (0.0, 1.0), (Way::Up, 300.0));
        Panel { left: 0.0, top: 0.0, right: 400.0, bottom: 300.0, x, y }
    }

    fn placed(points: &[Point]) -> (usize, Vec<Box4>) {
        let mut picture = Picture::titled(&Look::default(), (400.0, 300.0), ["", ""]);
        let labels: Vec<Label<'_>> = points
            .iter()
            .map(|&at| Label { name: "lens-and-motion", at, radius: 3.0, colour: INK, bold: false })
            .collect();
        let left_out = write(&mut picture, &panel(), &labels, points);
        let boxes = picture.shapes.iter().filter_map(|shape| match shape {
            Shape::Text(text) => {
                let (x, y) = text.at;
                Some([x, y - 5.0, x + text_width(&text.text, text.size, text.bold), y + 5.0])
            }
            _ => None,
        });
        (left_out, boxes.collect())
    }

    #[test]
    fn names_are_on_no_other_name_and_on_no_point() {
        // Points in a heap, along an edge and in a corner.
        let heap = (0..8).map(|i| (200.0 + f64::from(i % 3) * 9.0, 150.0 + f64::from(i) * 4.0));
        let edge = (0..6).map(|i| (398.0, 20.0 + f64::from(i) * 15.0));
        let points: Vec<Point> = heap.chain(edge).chain([(1.0, 299.0), (0.0, 0.0)]).collect();
        let (left_out, boxes) = placed(&points);
        assert_eq!((left_out, boxes.len()), (0, points.len()));
        for (index, place) in boxes.iter().enumerate() {
            assert!(boxes[..index].iter().all(|other| !overlaps(place, other)), "{place:?}");
            assert!(
                points.iter().all(|(x, y)| !overlaps(place, &[x - 1.0, y - 1.0, x + 1.0, y + 1.0])),
                "{place:?}"
            );
            assert!(
                place[0] >= 0.0 && place[2] <= 400.0 && place[1] >= 0.0 && place[3] <= 300.0,
                "{place:?}"
            );
        }
    }

    #[test]
    fn names_without_room_are_counted() {
        let (left_out, boxes) = placed(&[(200.0, 150.0); 300]);
        assert!(left_out > 100 && left_out + boxes.len() == 300);
    }
}
