//! A picture as PDF: one page, drawn with the standard fonts every viewer has.
//!
//! Operators and structure are those of ISO 32000-1:2008, sections 7.5 and 8.5.

use super::super::palette::{BACKGROUND, Colour};
use super::super::picture::{Across, Picture, Point, Shape, Text};
use super::super::text::text_width;

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
    use super::super::super::picture::Look;
    use super::*;

    #[test]
    fn the_table_points_at_the_objects() {
        let mut picture = Picture::titled(&Look::default(), (200.0, 100.0), ["A (title)", "below – it"]);
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
