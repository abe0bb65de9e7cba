//! Heat maps: a value over the image, and costs or errors of methods by test case. Images in colour beside
//! each other, each with a caption.

use pipeline::texture::linear_to_srgb8;

use super::axis::{Along, Axis, is_drawable};
use super::panel::{Key, legend_lines, tick_label};
use super::picture::{Across, Picture, PlotStyle, Point, Text, shortened, text, text_width};
use super::{AXIS, BACKGROUND, CLASSES, Colour, INK, MUTED, heat};
use crate::table::digits;

/// A rectangle of the image with a value.
#[derive(Clone, Copy, Debug)]
pub struct HeatTile {
    /// First pixel of the tile.
    pub origin: [u32; 2],
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Value of the tile.
    pub value: f64,
}

/// Mapping of values to colours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum HeatScale<'a> {
    /// 0 to the largest value.
    #[default]
    Even,
    /// 0 to this value; larger values are clamped. Compared maps use the same value.
    UpTo(f64),
    /// 0 to the 99th percentile of values above 0; larger values are clamped, so that a few hot pixels do not
    /// make all others white.
    Clipped,
    /// Classes 0, 1, ... with these names, at most four.
    Classes(&'a [&'a str]),
}

/// Heat map with a colour bar.
#[derive(Clone, Copy, Debug)]
pub struct HeatMapPlot<'a> {
    /// Title.
    pub title: &'a str,
    /// Scene, GPU and platform, for the line below the title.
    pub subject: &'a str,
    /// Quantity, for the label of the colour bar.
    pub label: &'a str,
    /// Width and height of the image in pixels.
    pub size: [u32; 2],
    /// The rectangles, which cover the image.
    pub tiles: &'a [HeatTile],
    /// Mapping to colours.
    pub shading: HeatScale<'a>,
    /// Displayed brightness of each pixel, 0 to 1. Its outlines are drawn over the map; empty for none.
    pub brightness: &'a [f32],
}

/// Largest size of the map.
const MAX_IMAGE_PX: (f64, f64) = (960.0, 640.0);
/// Width of the colour bar.
const BAR: f64 = 110.0;
/// Steps of the colour bar.
const STEPS: u32 = 120;
/// Brightness steps between neighbours at which an outline starts, and at which it is darkest.
const OUTLINE: [f32; 2] = [0.05, 0.4];
/// Opacity of the darkest outline.
const OUTLINE_ALPHA: f32 = 0.5;

impl HeatMapPlot<'_> {
    /// Draws the map.
    pub fn picture(&self, plot_style: &PlotStyle) -> Picture {
        let [width, height] = self.size.map(|side| f64::from(side.max(1)));
        let most = self.tiles.iter().map(|tile| tile.value).fold(0.0, f64::max);
        let high = self.high(most);
        let subject = match self.shading {
            HeatScale::Clipped if high < most => {
                format!(
                    "{}; darkest from {} on, the 99th percentile; most: {}",
                    self.subject,
                    digits(high),
                    digits(most)
                )
            }
            _ => self.subject.to_owned(),
        };
        let usual = MAX_IMAGE_PX.0.min(MAX_IMAGE_PX.1 * width / height) + 48.0 + BAR;
        let mut picture = Picture::titled(plot_style, (usual.max(760.0), 300.0), [self.title, &subject]);
        if self.tiles.is_empty() || !is_drawable(0.0, high) {
            return picture.nothing("nothing was counted");
        }
        if let HeatScale::Classes(names) = self.shading {
            let top = picture.height + 10.0;
            let keys =
                names.iter().zip(CLASSES).map(|(name, colour)| (Key::Area(colour), (*name).to_owned()));
            picture.height += legend_lines(&mut picture, top, &keys.collect::<Vec<_>>());
        }
        let (left, top) = (picture.margin(), picture.height + 8.0);
        let aside = if self.is_classes() { 0.0 } else { BAR };
        let scale = ((picture.width() - 2.0 * left - aside) / width).min(MAX_IMAGE_PX.1 / height);
        self.draw_tiles(&mut picture, (left, top), scale, high);
        self.draw_outlines(&mut picture, (left, top), scale);
        let bottom = top + height * scale;
        picture.height = bottom + 16.0;
        if !self.is_classes() {
            let bottom = bottom.max(top + 150.0);
            let axis = Axis::new(self.label, "", (0.0, high), Along::up(bottom - top));
            bar(&mut picture, &axis, (left + width * scale + 34.0, top, bottom), high < most);
            picture.height = bottom + 16.0;
        }
        picture
    }

    fn is_classes(&self) -> bool {
        matches!(self.shading, HeatScale::Classes(_))
    }

    /// Value of the darkest colour.
    fn high(&self, most: f64) -> f64 {
        match self.shading {
            HeatScale::Even | HeatScale::Classes(_) => most,
            HeatScale::UpTo(high) => high,
            HeatScale::Clipped => {
                let mut values: Vec<f64> =
                    self.tiles.iter().map(|tile| tile.value).filter(|value| *value > 0.0).collect();
                values.sort_by(f64::total_cmp);
                values.get((values.len() * 99).div_ceil(100).saturating_sub(1)).copied().unwrap_or(most)
            }
        }
    }

    fn colour(&self, value: f64, high: f64) -> Colour {
        match self.shading {
            HeatScale::Classes(_) => CLASSES[(value.max(0.0) as usize).min(CLASSES.len() - 1)],
            _ => heat(if high > 0.0 { value / high } else { 0.0 }),
        }
    }

    fn draw_tiles(&self, picture: &mut Picture, (left, top): Point, scale: f64, high: f64) {
        for tile in self.tiles {
            let at = |x: u32, y: u32| (left + f64::from(x) * scale, top + f64::from(y) * scale);
            let ([x, y], [w, h]) = (tile.origin, tile.size);
            picture.rect(at(x, y), at(x + w, y + h), self.colour(tile.value, high));
        }
    }

    /// Draws outlines where neighbouring pixels differ in brightness. Equal pixels of a row are one rectangle.
    fn draw_outlines(&self, picture: &mut Picture, (left, top): Point, scale: f64) {
        let width = self.size[0] as usize;
        if width == 0 || self.brightness.len() != width * self.size[1] as usize {
            return;
        }
        let shade = |x: usize, y: usize| {
            let at = |x: usize, y: usize| self.brightness.get(y * width + x.min(width - 1)).copied();
            let here = at(x, y).unwrap_or(0.0);
            let step = [at(x + 1, y), at(x, y + 1)].into_iter().flatten().map(|next| (next - here).abs());
            let step = step.fold(0.0, f32::max);
            if step < OUTLINE[0] { 0 } else { (1.0 + 4.0 * (step / OUTLINE[1]).min(1.0)) as u32 }
        };
        for y in 0..self.size[1] as usize {
            let shades: Vec<u32> = (0..width).map(|x| shade(x, y)).collect();
            let mut x = 0;
            for equal in shades.chunk_by(|a, b| a == b) {
                let at = |x: usize, y: usize| (left + x as f64 * scale, top + y as f64 * scale);
                if equal[0] > 0 {
                    let alpha = OUTLINE_ALPHA * equal[0] as f32 / 5.0;
                    picture.rect(at(x, y), at(x + equal.len(), y + 1), INK.alpha(f64::from(alpha)));
                }
                x += equal.len();
            }
        }
    }
}

/// Draws the colour bar from `bottom` up to `top`. Its upper label says if larger values exist.
fn bar(picture: &mut Picture, axis: &Axis, (left, top, bottom): (f64, f64, f64), beyond: bool) {
    let y = |fraction: f64| bottom - fraction * (bottom - top);
    for step in 0..STEPS {
        let [low, high] = [step, step + 1].map(|s| f64::from(s) / f64::from(STEPS));
        picture.rect((left, y(high)), (left + 16.0, y(low)), heat((low + high) / 2.0));
    }
    for tick in &axis.ticks {
        let at = y(axis.fraction_at(tick.at));
        if beyond && at < top + 18.0 {
            continue;
        }
        picture.line((left + 16.0, at), (left + 21.0, at), AXIS, 1.0);
        tick_label(picture, &tick.label, (left + 25.0, at), Across::Left);
    }
    if beyond {
        tick_label(picture, &format!("≥ {}", digits(axis.high)), (left + 20.0, top + 4.0), Across::Left);
    }
    let middle = (left - 11.0, (top + bottom) / 2.0);
    picture.text(Text { across: Across::Centre, upwards: true, size: 12.0, ..text(&axis.label, middle) });
}

/// Shaded cells; a larger number is worse. Example: cost relative to the best of the column.
#[derive(Clone, Debug)]
pub struct Matrix<'a> {
    /// The title.
    pub title: &'a str,
    /// The line below the title.
    pub subject: &'a str,
    /// Meaning of the lightest shade (1 and below) and of the darkest (32 and above).
    pub scale: [&'a str; 2],
    /// Names of the columns.
    pub columns: Vec<&'a str>,
    /// Blocks of rows, from top to bottom, with the same columns.
    pub panels: Vec<MatrixPanel<'a>>,
}

/// A block of rows.
#[derive(Clone, Debug)]
pub struct MatrixPanel<'a> {
    /// Title of the block.
    pub name: &'a str,
    /// Rows: name and cells. A cell without a value is white.
    pub rows: Vec<(&'a str, Vec<Option<f64>>)>,
}

/// Least and greatest width of a cell.
const CELL: [f64; 2] = [38.0, 120.0];
const ROW: f64 = 26.0;
const HEADING: f64 = 34.0;
/// Room for the names of columns, which are rotated.
const NAMES: f64 = 150.0;
/// Value of the darkest shade; larger values have it too.
const DARKEST: f64 = 32.0;

impl Matrix<'_> {
    /// Draws the blocks from top to bottom, with the names of columns below the last.
    pub fn picture(&self, plot_style: &PlotStyle) -> Picture {
        let rows: usize = self.panels.iter().map(|panel| panel.rows.len()).sum();
        let names = self.panels.iter().flat_map(|panel| panel.rows.iter().map(|(name, _)| *name));
        let left = names.map(|name| text_width(name, 13.0, false)).fold(60.0, f64::max) + 40.0;
        let columns = self.columns.len().max(1) as f64;
        let usual = (left + CELL[1] * columns + 24.0).clamp(760.0, 1410.0);
        let least = left + CELL[0] * columns + 24.0;
        let mut picture = Picture::titled(plot_style, (usual, least), [self.title, self.subject]);
        if rows == 0 || self.columns.is_empty() {
            return picture.nothing("nothing to compare");
        }
        let width = ((picture.width() - picture.margin() - left) / columns).clamp(CELL[0] - 2.0, CELL[1]);
        let mut top = picture.height + 4.0;
        scale(self.scale, (left, top + 10.0), &mut picture);
        top += 26.0;
        for panel in &self.panels {
            picture.text(Text { bold: true, ..text(panel.name, (left, top + 0.5 * HEADING)) });
            top += HEADING;
            for (name, cells) in &panel.rows {
                draw_cells(name, cells, (left, top), width, &mut picture);
                top += ROW;
            }
        }
        for (index, name) in self.columns.iter().enumerate() {
            let at = (left + (index as f64 + 0.5) * width, top + 0.5 * NAMES);
            let name = shortened(name, 13.0, NAMES - 16.0);
            picture.text(Text { across: Across::Centre, upwards: true, ..text(&name, at) });
        }
        picture.height = top + NAMES;
        picture
    }
}

fn draw_cells(name: &str, cells: &[Option<f64>], (left, top): Point, width: f64, picture: &mut Picture) {
    let middle = top + 0.5 * ROW;
    picture.text(Text { across: Across::Right, ..text(name, (left - 10.0, middle)) });
    for (index, value) in cells.iter().enumerate() {
        let Some(value) = value.filter(|value| value.is_finite()) else { continue };
        let left = left + index as f64 * width;
        let shade = shade(value);
        picture.rect((left + 1.0, top + 1.0), (left + width - 1.0, top + ROW - 1.0), heat(shade));
        let colour = if shade > 0.55 { BACKGROUND } else { INK };
        let at = (left + 0.5 * width, middle);
        picture.text(Text { across: Across::Centre, colour, size: 11.5, ..text(&number(value), at) });
    }
}

/// Position of a cost on the scale of shades, which is logarithmic.
fn shade(over_best: f64) -> f64 {
    (libm::log2(over_best.max(1.0)) / libm::log2(DARKEST)).clamp(0.0, 1.0)
}

/// A cost in at most four characters.
fn number(value: f64) -> String {
    if value < 1.995 {
        format!("{value:.2}")
    } else if value < 9.95 {
        format!("{value:.1}")
    } else if value < 9_999.5 {
        format!("{value:.0}")
    } else {
        format!("{:.0}k", value / 1000.0)
    }
}

/// Draws the scale of shades from `left` on.
fn scale([least, most]: [&str; 2], (left, middle): Point, picture: &mut Picture) {
    let note = |text: Text| Text { size: 12.0, colour: MUTED, ..text };
    picture.text(note(text(least, (left, middle))));
    let left = left + text_width(least, 12.0, false) + 8.0;
    for step in 0..60 {
        let from = left + f64::from(step) * 2.0;
        picture.rect((from, middle - 6.0), (from + 2.0, middle + 6.0), heat(f64::from(step) / 59.0));
    }
    picture.text(note(text(most, (left + 128.0, middle))));
}

/// An image with a caption.
#[derive(Clone, Debug)]
pub struct CaptionedImage {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Linear RGB radiance of each pixel, row by row from the top left.
    pub pixels: Vec<[f32; 3]>,
    /// Caption.
    pub caption: String,
}

/// Images in rows.
#[derive(Clone, Copy, Debug)]
pub struct Images<'a> {
    /// Title.
    pub title: &'a str,
    /// What the images show, for the line below the title.
    pub subject: &'a str,
    /// Images in a row.
    pub across: usize,
    /// The images, row by row, with captions below them.
    pub images: &'a [CaptionedImage],
}

/// Width of the whole picture, unless a [`PlotStyle`] sets it.
const WIDTH: f64 = 960.0;
/// Empty pixels between images.
const GAP: f64 = 12.0;
/// Height of a caption.
const CAPTION: f64 = 24.0;

impl Images<'_> {
    /// Draws the images. All of a row have the same width.
    pub fn picture(&self, plot_style: &PlotStyle) -> Picture {
        let mut picture = Picture::titled(plot_style, (WIDTH, 300.0), [self.title, self.subject]);
        if self.images.is_empty() {
            return picture.nothing("no image was drawn");
        }
        let (across, left) = (self.across.max(1), picture.margin());
        let width = (picture.width() - 2.0 * left + GAP) / across as f64 - GAP;
        for row in self.images.chunks(across) {
            let top = picture.height + 8.0;
            let mut bottom = top;
            for (place, image) in row.iter().enumerate() {
                let left = left + place as f64 * (width + GAP);
                let scale = width / f64::from(image.size[0]);
                draw(&mut picture, image, (left, top), scale);
                let below = top + f64::from(image.size[1]) * scale;
                let at = (left + 0.5 * width, below + 0.5 * CAPTION);
                picture.text(Text { across: Across::Centre, ..text(&image.caption, at) });
                bottom = bottom.max(below + CAPTION);
            }
            picture.height = bottom;
        }
        picture.height += 12.0;
        picture
    }
}

/// Draws the pixels, equal ones of a row as one rectangle.
fn draw(picture: &mut Picture, image: &CaptionedImage, (left, top): (f64, f64), scale: f64) {
    for (y, row) in image.pixels.chunks(image.size[0].max(1) as usize).enumerate() {
        let row: Vec<[u8; 3]> = row.iter().map(|pixel| pixel.map(linear_to_srgb8)).collect();
        let mut x = 0;
        for equal in row.chunk_by(|a, b| a == b) {
            let at = |x: usize, y: usize| (left + x as f64 * scale, top + y as f64 * scale);
            picture.rect(at(x, y), at(x + equal.len(), y + 1), Colour { rgb: equal[0], alpha: 1.0 });
            x += equal.len();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::picture::Shape;
    use super::*;

    fn plot<'a>(tiles: &'a [HeatTile], shading: HeatScale<'a>, brightness: &'a [f32]) -> HeatMapPlot<'a> {
        HeatMapPlot { title: "t", subject: "s", label: "l", size: [200, 1], tiles, shading, brightness }
    }

    fn row(value: impl Fn(u32) -> f64) -> Vec<HeatTile> {
        (0..200).map(|x| HeatTile { origin: [x, 0], size: [1, 1], value: value(x) }).collect()
    }

    fn fills_of(picture: &Picture) -> Vec<Colour> {
        let fill = |shape: &Shape| match shape {
            Shape::Rect { fill, .. } => Some(*fill),
            _ => None,
        };
        picture.shapes.iter().filter_map(fill).collect()
    }

    /// A few hot pixels must not make all others white.
    #[test]
    fn one_hot_pixel_leaves_the_others_their_colours() {
        let tiles = row(|x| if x == 7 { 820.0 } else { f64::from(x % 10) + 1.0 });
        let picture = plot(&tiles, HeatScale::Clipped, &[]).picture(&PlotStyle::default());
        let fills = fills_of(&picture);
        assert_eq!(fills[9], heat(1.0), "ten of one in ten is the darkest");
        assert_eq!(fills[7], heat(1.0));
        let svg = picture.svg().unwrap();
        assert!(svg.contains("≥ 10.00") && svg.contains("most: 820.0"), "{svg}");
        let even = plot(&tiles, HeatScale::Even, &[]).picture(&PlotStyle::default());
        assert_eq!(fills_of(&even)[9], heat(10.0 / 820.0), "nearly white");
    }

    #[test]
    fn maps_up_to_the_same_value_can_be_compared() {
        let shade = |most: f64, shading| {
            let tiles = row(|x| if x == 0 { most } else { 10.0 });
            fills_of(&plot(&tiles, shading, &[]).picture(&PlotStyle::default()))[1]
        };
        assert_eq!(shade(20.0, HeatScale::UpTo(40.0)), shade(40.0, HeatScale::UpTo(40.0)));
        assert_ne!(shade(20.0, HeatScale::Even), shade(40.0, HeatScale::Even));
    }

    #[test]
    fn classes_are_named_and_have_no_shades_between_them() {
        let names = ["not shaded", "shaded without light", "with light"];
        let picture =
            plot(&row(|x| f64::from(x % 3)), HeatScale::Classes(&names), &[]).picture(&PlotStyle::default());
        let svg = picture.svg().unwrap();
        assert!(names.iter().all(|name| svg.contains(name)));
        let fills = fills_of(&picture);
        assert!(fills.iter().all(|fill| CLASSES.contains(fill)), "{fills:?}");
    }

    #[test]
    fn outlines_of_the_image_are_drawn_over_the_map() {
        let brightness: Vec<f32> = (0..200).map(|x| if x < 100 { 0.1 } else { 0.9 }).collect();
        let dark = |brightness: &[f32]| {
            let picture = plot(&row(|_| 1.0), HeatScale::Even, brightness).picture(&PlotStyle::default());
            fills_of(&picture).iter().filter(|fill| fill.rgb == INK.rgb).count()
        };
        assert_eq!((dark(&brightness), dark(&[])), (1, 0));
    }

    #[test]
    fn shades_double_with_each_octave() {
        assert_eq!(shade(1.0), 0.0);
        assert!((shade(4.0) - 0.4).abs() < 1e-12);
        assert_eq!(shade(1e9), 1.0);
        assert_eq!(
            [number(1.0), number(12.34), number(9999.0), number(123_456.0)],
            ["1.00", "12", "9999", "123k"]
        );
    }

    #[test]
    fn nothing_is_said_and_cells_are_there() {
        let empty = Matrix { title: "t", subject: "s", scale: ["a", "b"], columns: vec![], panels: vec![] };
        assert!(empty.picture(&PlotStyle::default()).svg().unwrap().contains("nothing to compare"));
        let rows = vec![("one", vec![Some(1.0), None]), ("two", vec![Some(77.0), Some(f64::NAN)])];
        let panels = vec![MatrixPanel { name: "all", rows }];
        let svg = Matrix { title: "t", subject: "s", scale: ["a", "b"], columns: vec!["a", "b"], panels }
            .picture(&PlotStyle::default())
            .svg()
            .unwrap();
        assert!(svg.contains("77") && svg.contains("one"), "{svg}");
    }

    #[test]
    fn pixels_are_rectangles_in_their_place() {
        let pixels = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0], [0.0; 3], [0.0; 3]];
        let image = |caption: &str| CaptionedImage {
            size: [3, 2],
            pixels: pixels.into(),
            caption: caption.to_owned(),
        };
        let images = ["one", "two"].map(image);
        let images = Images { title: "t", subject: "s", across: 2, images: &images };
        let picture = images.picture(&PlotStyle::default());
        let rects = picture.shapes.iter().filter_map(|shape| match shape {
            Shape::Rect { from, to, fill } => Some((to.0 - from.0, to.1 - from.1, fill.rgb)),
            _ => None,
        });
        let rects: Vec<_> = rects.collect();
        assert_eq!(rects.len(), 8);
        let [two, one] = [rects[0], rects[1]];
        assert_eq!((two.2, one.2), ([255, 0, 0], [0; 3]));
        assert!((two.0 - 2.0 * one.0).abs() < 1e-9 && (one.0 - one.1).abs() < 1e-9, "square pixels");
        let svg = picture.svg().unwrap();
        assert!(svg.contains("one") && svg.contains("two"));
    }
}
