//! Where in the image something happens.

use super::axis::{Axis, is_drawable};
use super::palette::{AXIS, MUTED, heat};
use super::picture::{Across, Picture, Text, text};

/// A rectangle of the image with a value.
#[derive(Clone, Copy, Debug)]
pub struct HeatTile {
    /// Its first pixel.
    pub origin: [u32; 2],
    /// Its pixels across and down.
    pub size: [u32; 2],
    /// Its value.
    pub value: f64,
}

/// A map of a value over the image, with a bar of its colours.
#[derive(Clone, Copy, Debug)]
pub struct HeatMapPlot<'a> {
    /// What is shown.
    pub title: &'a str,
    /// What was run, for the line below the title.
    pub subject: &'a str,
    /// What the colours stand for.
    pub label: &'a str,
    /// Pixels of the image across and down.
    pub size: [u32; 2],
    /// The rectangles, which cover the image.
    pub tiles: &'a [HeatTile],
}

/// Room for the map at most.
const ROOM: (f64, f64) = (960.0, 640.0);
const LEFT: f64 = 24.0;
const TOP: f64 = 74.0;
/// Steps of the bar of colours.
const STEPS: u32 = 120;

impl HeatMapPlot<'_> {
    /// The map, from nothing to the largest value.
    pub fn picture(&self) -> Picture {
        let [width, height] = self.size.map(|side| f64::from(side.max(1)));
        let scale = (ROOM.0 / width).min(ROOM.1 / height);
        let (right, bottom) = (LEFT + width * scale, TOP + (height * scale).max(160.0));
        let mut picture = Picture::new((right + 120.0).max(760.0), bottom + 24.0, self.title, self.subject);
        let high = self.tiles.iter().map(|tile| tile.value).fold(0.0, f64::max);
        if self.tiles.is_empty() || !is_drawable(0.0, high) {
            return picture.nothing("nothing was counted");
        }
        let axis = Axis::new(self.label, "", 0.0, high);
        for tile in self.tiles {
            let at = |x: u32, y: u32| (LEFT + f64::from(x) * scale, TOP + f64::from(y) * scale);
            let ([x, y], [w, h]) = (tile.origin, tile.size);
            picture.rect(at(x, y), at(x + w, y + h), heat(axis.fraction(tile.value)));
        }
        bar(&mut picture, &axis, (right + 24.0, bottom));
        picture
    }
}

/// The bar of colours, from `bottom` up to [`TOP`].
fn bar(picture: &mut Picture, axis: &Axis, (left, bottom): (f64, f64)) {
    let y = |fraction: f64| bottom - fraction * (bottom - TOP);
    for step in 0..STEPS {
        let [low, high] = [step, step + 1].map(|s| f64::from(s) / f64::from(STEPS));
        picture.rect((left, y(high)), (left + 16.0, y(low)), heat((low + high) / 2.0));
    }
    for (value, label) in &axis.ticks {
        let at = y(axis.fraction(*value));
        picture.line((left + 16.0, at), (left + 21.0, at), AXIS, 1.0);
        picture.text(Text { colour: MUTED, size: 12.0, ..text(label, (left + 25.0, at)) });
    }
    let middle = (left - 9.0, (TOP + bottom) / 2.0);
    picture.text(Text { across: Across::Centre, upwards: true, size: 12.0, ..text(&axis.label, middle) });
}
