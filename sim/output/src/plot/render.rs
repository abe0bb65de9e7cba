//! Pictures as files: SVG by the backend of `plotters`, PNG by its rasterizer and an own buffer.
//!
//! Both are drawn at twice the resolution of the picture. For PNG, two by two pixels are averaged. The picture's
//! [`Paper`](super::picture::Paper) gives the pixels of the file for a pixel of the layout.

use std::convert::Infallible;
use std::fmt::Display;
use std::ops::Range;

use plotters::backend::SVGBackend;
use plotters::style::{FontTransform, RGBAColor, TextStyle};
use plotters_backend::text_anchor::{HPos, Pos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind, rasterizer,
};

use super::picture::{
    Across, Picture, Point, SCALE, Shape, Text, drawable, plotters_font, register, text_width,
};
use super::{BACKGROUND, Colour};
use crate::dir::{OutDir, OutputError};
use crate::image;

/// Why a plot could not be rendered.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// The font inside the command cannot be read.
    #[error("the font for plots is damaged: build the command anew")]
    Font,
    /// A backend failed.
    #[error("cannot draw the plot: {0}")]
    Draw(String),
    /// The PNG encoder failed.
    #[error(transparent)]
    Encode(#[from] image::ImageError),
}

impl Picture {
    /// The text of an SVG file with real text in it, without ids, so that several fit into one page.
    ///
    /// # Errors
    /// [`PlotError`] when the font is damaged or the backend fails.
    pub fn svg(&self) -> Result<String, PlotError> {
        let (width, height) = self.fine_size(SCALE);
        let mut svg = String::new();
        self.play(&mut SVGBackend::with_string(&mut svg, (width, height)), SCALE)?;
        let fine = format!("width=\"{width}\" height=\"{height}\"");
        let label = attribute(&drawable(&self.title));
        let size = |side: f64| match self.paper.width_mm {
            Some(width_mm) => format!("{:.2}mm", side / self.width() * width_mm),
            None => format!("{:.0}", side * self.paper.zoom),
        };
        let (width, height) = (size(self.width()), size(self.height));
        let shown = format!("width=\"{width}\" height=\"{height}\" role=\"img\" aria-label=\"{label}\"");
        Ok(svg.replacen(&fine, &shown, 1))
    }

    /// The bytes of a PNG file.
    ///
    /// # Errors
    /// [`PlotError`] when the font is damaged, or drawing or encoding fails.
    pub fn png(&self) -> Result<Vec<u8>, PlotError> {
        let scale = SCALE * self.paper.zoom;
        let (width, height) = self.fine_size(scale);
        let mut raster = Raster::new(width, height);
        self.play(&mut raster, scale)?;
        Ok(image::encode_png(width / 2, height / 2, &raster.halved())?)
    }

    /// Writes the plot to `<stem>.svg` and `<stem>.png` in `dir`.
    ///
    /// # Errors
    /// [`OutputError::Write`] with the file and the cause.
    pub fn write(&self, dir: &OutDir, stem: &str) -> Result<(), OutputError> {
        dir.write_file(&format!("{stem}.svg"), |out| Ok(out.write_all(self.svg()?.as_bytes())?))?;
        dir.write_file(&format!("{stem}.png"), |out| Ok(out.write_all(&self.png()?)?))?;
        Ok(())
    }

    fn fine_size(&self, scale: f64) -> (u32, u32) {
        ((self.width() * scale) as u32, (self.height * scale) as u32)
    }

    /// Draws everything with `scale` steps of the backend to a pixel of the layout.
    fn play<B: DrawingBackend>(&self, backend: &mut B, scale: f64) -> Result<(), PlotError> {
        if !register() {
            return Err(PlotError::Font);
        }
        let paper = Shape::Rect { from: (0.0, 0.0), to: (self.width(), self.height), fill: BACKGROUND };
        for shape in std::iter::once(&paper).chain(&self.shapes) {
            draw(backend, shape, scale).map_err(failed)?;
        }
        backend.present().map_err(failed)
    }
}

fn failed(error: impl Display) -> PlotError {
    PlotError::Draw(error.to_string())
}

struct Stroke {
    colour: BackendColor,
    width: u32,
}

impl BackendStyle for Stroke {
    fn color(&self) -> BackendColor {
        self.colour
    }

    fn stroke_width(&self) -> u32 {
        self.width
    }
}

fn draw<B: DrawingBackend>(
    backend: &mut B,
    shape: &Shape,
    scale: f64,
) -> Result<(), DrawingErrorKind<B::ErrorType>> {
    let at = |point: Point| fine(point, scale);
    match shape {
        Shape::Rect { from, to, fill } => backend.draw_rect(at(*from), at(*to), &colour(*fill), true),
        Shape::Polyline { points, stroke, width } => {
            let width = (width * scale).max(1.0) as u32;
            backend.draw_path(fine_path(points, scale), &Stroke { colour: colour(*stroke), width })
        }
        Shape::Polygon { points, fill } => backend.fill_polygon(fine_path(points, scale), &colour(*fill)),
        Shape::Dot { centre, radius, fill } => {
            backend.draw_circle(at(*centre), (radius * scale) as u32, &colour(*fill), true)
        }
        Shape::Text(text) => draw_text(backend, text, scale),
    }
}

fn draw_text<B: DrawingBackend>(
    backend: &mut B,
    text: &Text,
    scale: f64,
) -> Result<(), DrawingErrorKind<B::ErrorType>> {
    let h_pos = match text.across {
        Across::Left => HPos::Left,
        Across::Centre => HPos::Center,
        Across::Right => HPos::Right,
    };
    let turn = if text.upwards { FontTransform::Rotate270 } else { FontTransform::None };
    let style = TextStyle {
        font: plotters_font(text.size * scale, text.bold).transform(turn),
        color: colour(text.colour),
        pos: Pos::new(h_pos, VPos::Center),
    };
    backend.draw_text(&text.text, &style, fine(text.at, scale))
}

fn colour(colour: Colour) -> BackendColor {
    let [r, g, b] = colour.rgb;
    let RGBAColor(r, g, b, alpha) = RGBAColor(r, g, b, colour.alpha);
    BackendColor { alpha, rgb: (r, g, b) }
}

fn fine(point: Point, scale: f64) -> BackendCoord {
    let round = |value: f64| libm::round(value * scale) as i32;
    (round(point.0), round(point.1))
}

/// The path on the fine grid, without points that fall together.
fn fine_path(points: &[Point], scale: f64) -> Vec<BackendCoord> {
    let mut path: Vec<BackendCoord> = points.iter().map(|point| fine(*point, scale)).collect();
    path.dedup();
    path
}

fn attribute(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// An RGB buffer that `plotters`' rasterizer draws into pixel by pixel.
///
/// Three things differ from the rasterizer's own ways: a filled rectangle ends where the next begins (it would take
/// one pixel more and darken seams), a thick path is drawn segment by segment (as one polygon it has holes where it
/// crosses itself), and text stands at the height at which SVG puts it.
struct Raster {
    width: u32,
    height: u32,
    rgb: Vec<u8>,
}

type Outcome = Result<(), DrawingErrorKind<Infallible>>;

impl Raster {
    fn new(width: u32, height: u32) -> Self {
        Self { width, height, rgb: vec![255; width as usize * height as usize * 3] }
    }

    /// The picture at half the size: means of two by two pixels.
    fn halved(&self) -> Vec<u8> {
        let row = self.width as usize * 3;
        let (columns, rows) = (self.width as usize / 2, self.height as usize / 2);
        let mut half = Vec::with_capacity(columns * rows * 3);
        for y in 0..rows {
            for at in (0..columns * 3).map(|i| 2 * y * row + i / 3 * 6 + i % 3) {
                let sum: u32 =
                    [at, at + 3, at + row, at + row + 3].iter().map(|i| u32::from(self.rgb[*i])).sum();
                half.push(((sum + 2) / 4) as u8);
            }
        }
        half
    }

    fn blend(&mut self, x: i32, y: i32, colour: BackendColor) {
        if x < 0 || x >= self.width as i32 {
            return;
        }
        self.blend_row(y, x..x + 1, colour);
    }

    /// Blends the pixels of columns inside the picture in one row.
    fn blend_row(&mut self, y: i32, columns: Range<i32>, colour: BackendColor) {
        if y < 0 || y >= self.height as i32 || columns.is_empty() {
            return;
        }
        let (r, g, b) = colour.rgb;
        let (row, pixel) = (y as usize * self.width as usize, [r, g, b]);
        let bytes = &mut self.rgb[(row + columns.start as usize) * 3..(row + columns.end as usize) * 3];
        if colour.alpha >= 1.0 {
            bytes.chunks_exact_mut(3).for_each(|old| old.copy_from_slice(&pixel));
            return;
        }
        for (old, new) in bytes.iter_mut().zip(pixel.into_iter().cycle()) {
            let mixed = f64::from(*old) + (f64::from(new) - f64::from(*old)) * colour.alpha.max(0.0);
            *old = (mixed + 0.5) as u8;
        }
    }
}

impl DrawingBackend for Raster {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    fn ensure_prepared(&mut self) -> Outcome {
        Ok(())
    }

    fn present(&mut self) -> Outcome {
        Ok(())
    }

    fn draw_pixel(&mut self, point: BackendCoord, colour: BackendColor) -> Outcome {
        self.blend(point.0, point.1, colour);
        Ok(())
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        a: BackendCoord,
        b: BackendCoord,
        style: &S,
        fill: bool,
    ) -> Outcome {
        if !fill {
            return rasterizer::draw_rect(self, a, b, style, fill);
        }
        for y in a.1.max(0)..b.1 {
            self.blend_row(y, a.0.max(0)..b.0.min(self.width as i32), style.color());
        }
        Ok(())
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Outcome {
        let mut before = None;
        for point in path {
            if let Some(from) = before {
                self.draw_line(from, point, style)?;
            }
            before = Some(point);
        }
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(&mut self, text: &str, style: &S, at: BackendCoord) -> Outcome {
        let failed = |error| DrawingErrorKind::FontError(Box::new(error));
        let (from, to) = style.layout_box(text).map_err(failed)?;
        let across = match style.anchor().h_pos {
            HPos::Left => 0,
            HPos::Right => from.0 - to.0,
            HPos::Center => (from.0 - to.0) / 2,
        };
        // The font draws its base line at half its size; half way up the capitals is 0.36 em above that.
        let down =
            (style.size() / super::picture::SIZE_OVER_EM * 0.36) as i32 - (style.size() as f32 / 2.0) as i32;
        let turn = style.transform();
        style
            .draw(text, (0, 0), |x, y, colour| {
                let (x, y) = turn.transform(x + across, y + down);
                self.draw_pixel((at.0 + x, at.1 + y), colour)
            })
            .map_err(failed)?
    }
}

/// How far a circle's control points lie from its corners, of the radius: four Bezier curves within 0.03 %.
const CIRCLE: f64 = 0.552_284_75;

impl Picture {
    /// The bytes of a PDF file. The same picture gives the same bytes.
    pub fn pdf(&self) -> Vec<u8> {
        let mut page = Page { height: self.height, content: String::new(), alphas: Vec::new() };
        let points = match self.paper.width_mm {
            Some(width_mm) => width_mm / 25.4 * 72.0 / self.width(),
            None => self.paper.zoom,
        };
        if points != 1.0 {
            page.put(&format!("{0} 0 0 {0} 0 0 cm", exact(points)));
        }
        page.draw(&Shape::Rect { from: (0.0, 0.0), to: (self.width(), self.height), fill: BACKGROUND });
        self.shapes.iter().for_each(|shape| page.draw(shape));
        let states: String =
            page.alphas.iter().enumerate().map(|(i, a)| format!("/A{i} << /ca {a} /CA {a} >> ")).collect();
        let objects = [
            "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
            "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
            format!(
                "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {} {}] /Contents 4 0 R /Resources << /Font << \
                 /F0 5 0 R /F1 6 0 R >> /ExtGState << {states}>> >> >>",
                n(self.width() * points),
                n(self.height * points)
            ),
            // A letter is a byte in the file.
            format!("<< /Length {} >>\nstream\n{}endstream", page.content.chars().count(), page.content),
            font("Helvetica"),
            font("Helvetica-Bold"),
        ];
        assembled(&objects)
    }
}

fn font(name: &str) -> String {
    format!("<< /Type /Font /Subtype /Type1 /BaseFont /{name} /Encoding /WinAnsiEncoding >>")
}

/// Objects with the table of where they are.
fn assembled(objects: &[String]) -> Vec<u8> {
    let mut bytes = b"%PDF-1.4\n".to_vec();
    let mut table = String::new();
    for (index, object) in objects.iter().enumerate() {
        table += &format!("{:010} 00000 n \n", bytes.len());
        bytes.extend(format!("{} 0 obj\n", index + 1).bytes());
        bytes.extend(object.chars().map(latin));
        bytes.extend(b"\nendobj\n");
    }
    let (start, count) = (bytes.len(), objects.len() + 1);
    let tail = format!(
        "xref\n0 {count}\n0000000000 65535 f \n{table}trailer\n<< /Size {count} /Root 1 0 R >>\nstartxref\n{start}\n%%EOF\n"
    );
    bytes.extend(tail.bytes());
    bytes
}

/// A letter in the encoding of the fonts, one byte each; what they lack is a question mark.
fn latin(letter: char) -> u8 {
    match letter {
        '\u{2013}' => 150,
        '\u{2026}' => 133,
        '\u{2265}' => b'>',
        '\u{2264}' => b'<',
        '\u{2212}' => b'-',
        _ => u8::try_from(u32::from(letter)).unwrap_or(b'?'),
    }
}

struct Page {
    height: f64,
    content: String,
    /// Opacities used, by the number of their state.
    alphas: Vec<f64>,
}

impl Page {
    fn draw(&mut self, shape: &Shape) {
        match shape {
            Shape::Rect { from, to, fill } => {
                self.paint(*fill);
                let (a, b) = (self.at(*from), self.at(*to));
                self.put(&format!("{} {} {} {} re f", n(a.0), n(a.1), n(b.0 - a.0), n(b.1 - a.1)));
            }
            Shape::Polyline { points, stroke, width } => {
                self.paint(*stroke);
                let path = self.path(points);
                self.put(&format!("{} w 1 j {path}S", n(*width)));
            }
            Shape::Polygon { points, fill } => {
                self.paint(*fill);
                let path = self.path(points);
                self.put(&format!("{path}h f"));
            }
            Shape::Dot { centre, radius, fill } => {
                self.paint(*fill);
                self.circle(self.at(*centre), *radius);
            }
            Shape::Text(text) => self.text(text),
        }
    }

    fn put(&mut self, operators: &str) {
        self.content += operators;
        self.content.push('\n');
    }

    fn at(&self, point: Point) -> Point {
        (point.0, self.height - point.1)
    }

    fn paint(&mut self, colour: Colour) {
        let known = self.alphas.iter().position(|alpha| *alpha == colour.alpha);
        let state = known.unwrap_or(self.alphas.len());
        if known.is_none() {
            self.alphas.push(colour.alpha);
        }
        let [r, g, b] = colour.rgb.map(|part| n(f64::from(part) / 255.0));
        self.put(&format!("/A{state} gs {r} {g} {b} rg {r} {g} {b} RG"));
    }

    fn path(&self, points: &[Point]) -> String {
        let step = |(index, point): (usize, &Point)| {
            let (x, y) = self.at(*point);
            format!("{} {} {} ", n(x), n(y), if index == 0 { "m" } else { "l" })
        };
        points.iter().enumerate().map(step).collect()
    }

    fn circle(&mut self, (x, y): Point, r: f64) {
        let k = CIRCLE * r;
        let quarters = [
            [(x + r, y + k), (x + k, y + r), (x, y + r)],
            [(x - k, y + r), (x - r, y + k), (x - r, y)],
            [(x - r, y - k), (x - k, y - r), (x, y - r)],
            [(x + k, y - r), (x + r, y - k), (x + r, y)],
        ];
        let mut path = format!("{} {} m ", n(x + r), n(y));
        for quarter in quarters {
            path += &quarter.map(|(x, y)| format!("{} {} ", n(x), n(y))).concat();
            path += "c ";
        }
        self.put(&format!("{path}f"));
    }

    fn text(&mut self, text: &Text) {
        self.paint(text.colour);
        let width = text_width(&text.text, text.size, text.bold);
        let back = match text.across {
            Across::Left => 0.0,
            Across::Centre => 0.5 * width,
            Across::Right => width,
        };
        let (x, y) = self.at(text.at);
        // Half the height of capitals below the middle.
        let down = 0.36 * text.size;
        let place = if text.upwards {
            format!("0 1 -1 0 {} {}", n(x + down), n(y - back))
        } else {
            format!("1 0 0 1 {} {}", n(x - back), n(y - down))
        };
        let escaped = text.text.replace('\\', "\\\\").replace('(', "\\(").replace(')', "\\)");
        self.put(&format!("BT /F{} {} Tf {place} Tm ({escaped}) Tj ET", u8::from(text.bold), n(text.size)));
    }
}

/// A number with as many digits as a page needs.
fn n(value: f64) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A number as exact as a scale of a whole page has to be.
fn exact(value: f64) -> String {
    format!("{value:.7}")
}

#[cfg(test)]
mod tests {
    use super::super::picture::PlotStyle;
    use super::*;

    #[test]
    fn the_table_points_at_the_objects() {
        let mut picture = Picture::titled(&PlotStyle::default(), (200.0, 100.0), ["A (title)", "below – it"]);
        picture.dot((10.0, 10.0), 3.0, Colour::hex(0xff_0000).alpha(0.5));
        let bytes = picture.pdf();
        let text: String = bytes.iter().map(|&byte| char::from(byte)).collect();
        assert!(text.starts_with("%PDF-1.4") && text.ends_with("%%EOF\n") && text.contains("A \\(title\\)"));
        let start: usize =
            text.rsplit("startxref\n").next().unwrap().lines().next().unwrap().parse().unwrap();
        let table: String = bytes[start..].iter().map(|&byte| char::from(byte)).collect();
        for (index, line) in table.lines().skip(3).take(6).enumerate() {
            let offset: usize = line[..10].parse().unwrap();
            assert!(bytes[offset..].starts_with(format!("{} 0 obj", index + 1).as_bytes()));
        }
        let stream = text.split("stream\n").nth(1).unwrap().trim_end_matches("end");
        assert!(text.contains(&format!("/Length {} ", stream.chars().count())));
    }
}
