//! The pixels that PNG plots are drawn into.

use std::convert::Infallible;

use plotters_backend::text_anchor::HPos;
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind, rasterizer,
};

/// An RGB buffer that `plotters`' rasterizer draws into pixel by pixel.
///
/// Three things differ from the rasterizer's own ways: a filled rectangle ends where the next begins (it would take
/// one pixel more and darken seams), a thick path is drawn segment by segment (as one polygon it has holes where it
/// crosses itself), and text stands at the height at which SVG puts it.
pub(super) struct Raster {
    width: u32,
    height: u32,
    rgb: Vec<u8>,
}

type Outcome = Result<(), DrawingErrorKind<Infallible>>;

impl Raster {
    pub(super) fn new(width: u32, height: u32) -> Self {
        Self { width, height, rgb: vec![255; width as usize * height as usize * 3] }
    }

    /// The picture at half the size: means of two by two pixels.
    pub(super) fn halved(&self) -> Vec<u8> {
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
        if x < 0 || y < 0 || x >= self.width as i32 || y >= self.height as i32 {
            return;
        }
        let at = (y as usize * self.width as usize + x as usize) * 3;
        let (r, g, b) = colour.rgb;
        for (old, new) in self.rgb[at..at + 3].iter_mut().zip([r, g, b]) {
            let mixed = f64::from(*old) + (f64::from(new) - f64::from(*old)) * colour.alpha.clamp(0.0, 1.0);
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
        for y in a.1.max(0)..b.1.min(self.height as i32) {
            for x in a.0.max(0)..b.0.min(self.width as i32) {
                self.blend(x, y, style.color());
            }
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
        let down = (style.size() / super::super::text::SIZE_OVER_EM * 0.36) as i32
            - (style.size() as f32 / 2.0) as i32;
        let turn = style.transform();
        style
            .draw(text, (0, 0), |x, y, colour| {
                let (x, y) = turn.transform(x + across, y + down);
                self.draw_pixel((at.0 + x, at.1 + y), colour)
            })
            .map_err(failed)?
    }
}
