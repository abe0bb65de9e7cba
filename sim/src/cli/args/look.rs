//! Flags for the style of pictures.

use clap::Args;

use output::plot::{COLUMN_MM, Look};

/// Style of pictures. The default is a width of their own and letters for a screen.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Pictures")]
pub struct LookArgs {
    /// Width of pictures in millimetres, 30 to 400, or `column` for 85 mm; letters are then 8 points high
    #[arg(long, value_name = "MM|column", allow_negative_numbers = true, value_parser = width)]
    pub width: Option<f64>,
    /// Title of pictures in place of their own; an empty one omits title and subtitle, for papers with
    /// captions
    #[arg(long, value_name = "TEXT")]
    pub title: Option<String>,
    /// Size of ordinary letters of pictures in points, 4 to 32
    #[arg(long, value_name = "PT", allow_negative_numbers = true, value_parser = font_size)]
    pub font_size: Option<f64>,
}

impl LookArgs {
    /// The flags as a style.
    pub fn look(&self) -> Look {
        Look { width_mm: self.width, font_pt: self.font_size, title: self.title.clone() }
    }
}

fn width(text: &str) -> Result<f64, String> {
    if text == "column" {
        return Ok(COLUMN_MM);
    }
    within(text.strip_suffix("mm").unwrap_or(text), 30.0..=400.0).ok_or_else(|| {
        format!("`{text}` is not a width; give 30 to 400 millimetres, or `column` for {COLUMN_MM}")
    })
}

fn font_size(text: &str) -> Result<f64, String> {
    within(text.strip_suffix("pt").unwrap_or(text), 4.0..=32.0)
        .ok_or_else(|| format!("`{text}` is not a size of letters; give 4 to 32 points"))
}

fn within(text: &str, range: std::ops::RangeInclusive<f64>) -> Option<f64> {
    text.trim().parse().ok().filter(|value| range.contains(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_and_sizes_are_checked() {
        assert_eq!([width("column"), width("120"), width("85 mm")], [Ok(85.0), Ok(120.0), Ok(85.0)]);
        assert_eq!([font_size("7.5"), font_size("9pt")], [Ok(7.5), Ok(9.0)]);
        for wrong in ["", "0", "-85", "1e9", "NaN", "wide", "85cm"] {
            assert!(width(wrong).unwrap_err().contains("30 to 400"), "{wrong}");
            assert!(font_size(wrong).unwrap_err().contains("4 to 32"), "{wrong}");
        }
    }
}
