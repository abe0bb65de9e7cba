//! Numbers as text with SI prefixes, means with standard deviations, and aligned tables for the terminal.

use std::fmt;

use serde::Serialize;

/// SI prefixes in ascending order: sign and power of ten.
const PREFIXES: [(&str, i32); 11] = [
    ("f", -15),
    ("p", -12),
    ("n", -9),
    ("µ", -6),
    ("m", -3),
    ("", 0),
    ("k", 3),
    ("M", 6),
    ("G", 9),
    ("T", 12),
    ("P", 15),
];

/// SI prefix with its factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prefix {
    /// Sign, for example `m`; empty for the plain unit.
    pub sign: &'static str,
    /// 1000 for `m`.
    pub factor: f64,
}

impl Prefix {
    /// No prefix.
    pub const NONE: Self = Self { sign: "", factor: 1.0 };

    /// Prefix that brings `magnitude` into [1, 1000), within the range of prefixes.
    pub fn of(magnitude: f64) -> Self {
        let magnitude = magnitude.abs();
        if magnitude == 0.0 || !magnitude.is_finite() {
            return Self::NONE;
        }
        let below = PREFIXES.iter().rposition(|(_, power)| magnitude >= power_of_ten(*power));
        Self::at(below.unwrap_or(0))
    }

    fn at(index: usize) -> Self {
        let (sign, power) = PREFIXES[index.min(PREFIXES.len() - 1)];
        Self { sign, factor: power_of_ten(-power) }
    }

    fn larger(self) -> Self {
        let index = PREFIXES.iter().position(|(sign, _)| *sign == self.sign).unwrap_or(0);
        Self::at(index + 1)
    }
}

/// 10^power, correctly rounded: the parser is exact where a power function need not be.
pub(crate) fn power_of_ten(power: i32) -> f64 {
    format!("1e{power}").parse().unwrap_or(f64::NAN)
}

/// Value with three significant digits and a prefix: `12.3 mJ`, `4.56 ms`; `n/a` if not finite.
pub fn si(value: f64, unit: &str) -> String {
    si_digits(value, unit, 3)
}

/// Value with `digits` significant digits (at least 1) and a prefix. A number without a unit has no prefix.
pub fn si_digits(value: f64, unit: &str, digits: usize) -> String {
    if !value.is_finite() {
        return "n/a".to_owned();
    }
    if unit.is_empty() {
        return plain(value, digits);
    }
    let mut prefix = Prefix::of(value);
    let mut text = significant(value * prefix.factor, digits);
    // 999.96 rounds to 1000, which reads better as 1.00 of the next prefix.
    if text.trim_start_matches('-').parse::<f64>().is_ok_and(|rounded| rounded >= 1000.0) {
        prefix = prefix.larger();
        text = significant(value * prefix.factor, digits);
    }
    format!("{text} {}{unit}", prefix.sign).trim_end().to_owned()
}

/// `12.3 ± 0.4 mJ`: mean and standard deviation with the prefix and the decimals of the mean; the mean alone
/// if there is no deviation.
pub fn si_mean_sd(stats: MeanSd, unit: &str) -> String {
    if !stats.mean.is_finite() {
        return "n/a".to_owned();
    }
    let Some(sd) = stats.sd.filter(|sd| sd.is_finite()) else { return si_digits(stats.mean, unit, 4) };
    let prefix = if unit.is_empty() { Prefix::NONE } else { Prefix::of(stats.mean) };
    let decimals =
        if unit.is_empty() { plain_decimals(stats.mean, 4) } else { decimals(stats.mean * prefix.factor, 4) };
    let (mean, sd) = (stats.mean * prefix.factor, sd * prefix.factor);
    format!("{mean:.decimals$} ± {sd:.decimals$} {}{unit}", prefix.sign).trim_end().to_owned()
}

/// `value` without prefix or exponent, to `digits` significant digits.
fn significant(value: f64, digits: usize) -> String {
    let decimals = decimals(value, digits);
    format!("{value:.decimals$}")
}

fn decimals(value: f64, digits: usize) -> usize {
    let mut whole = 1;
    while whole < 16 && value.abs() >= power_of_ten(whole) {
        whole += 1;
    }
    digits.saturating_sub(whole as usize)
}

/// A number without a unit to four digits, without an exponent where it can be read without.
pub fn digits(value: f64) -> String {
    plain(value, 4)
}

/// An integer in groups of three, any other number without a unit to four digits.
pub fn count_or_digits(value: f64) -> String {
    if value.fract() != 0.0 || value.abs() >= 1e15 {
        return digits(value);
    }
    let sign = if value < 0.0 { "-" } else { "" };
    format!("{sign}{}", grouped(value.abs() as u64))
}

/// A number without a unit to three digits; large numbers as integers in groups of three.
pub fn number(value: f64) -> String {
    if (9999.5..1e18).contains(&value) { grouped(libm::round(value) as u64) } else { plain(value, 3) }
}

/// A number without a unit to `digits` significant digits.
fn plain(value: f64, digits: usize) -> String {
    if value == 0.0 || (1e-3..1e9).contains(&value.abs()) {
        return format!("{value:.*}", plain_decimals(value, digits));
    }
    format!("{value:.*e}", digits - 1)
}

/// Number of decimals of `value` at `digits` significant digits.
fn plain_decimals(value: f64, digits: usize) -> usize {
    let power = if value == 0.0 { digits as i32 - 1 } else { libm::floor(libm::log10(value.abs())) as i32 };
    (digits as i32 - 1 - power).clamp(0, 12) as usize
}

/// An integer in groups of three, as everywhere in reports, messages and the book: `1,234,567`.
pub fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let groups: Vec<&str> =
        digits.as_bytes().rchunks(3).rev().filter_map(|g| str::from_utf8(g).ok()).collect();
    groups.join(",")
}

/// Count with its noun: `1 frame`, `2,000 frames`.
pub fn counted(count: usize, thing: &str) -> String {
    let ending = if count == 1 { "" } else { "s" };
    format!("{} {thing}{ending}", grouped(count as u64))
}

/// Text table for a terminal: the first column is left-aligned, the others right-aligned unless all of them
/// are texts.
#[derive(Clone, Debug, Default)]
pub struct Table {
    rows: Vec<Vec<String>>,
    of_texts: bool,
}

impl Table {
    /// Empty table with these columns.
    pub fn new<'a>(header: impl IntoIterator<Item = &'a str>) -> Self {
        Self { rows: vec![header.into_iter().map(str::to_owned).collect()], of_texts: false }
    }

    /// Empty table with these columns, all left-aligned.
    pub fn of_texts<'a>(header: impl IntoIterator<Item = &'a str>) -> Self {
        Self { of_texts: true, ..Self::new(header) }
    }

    /// Adds a row; missing cells are empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) -> &mut Self {
        self.rows.push(cells.into_iter().map(Into::into).collect());
        self
    }

    fn widths(&self) -> Vec<usize> {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |column: usize| {
            self.rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max()
        };
        (0..columns).map(|column| width(column).unwrap_or(0)).collect()
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widths = self.widths();
        for row in &self.rows {
            let mut line = String::new();
            for (column, width) in widths.iter().enumerate() {
                let cell = row.get(column).map_or("", String::as_str);
                let gap = if column == 0 { "" } else { "  " };
                let left = column == 0 || self.of_texts;
                line += &if left { format!("{gap}{cell:<width$}") } else { format!("{gap}{cell:>width$}") };
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

/// Quotes words for a shell and joins them.
pub fn shell_line<'a>(words: impl IntoIterator<Item = &'a String>) -> String {
    let plain = |letter: char| letter.is_ascii_alphanumeric() || "-_./,:=%+@".contains(letter);
    let quoted = |word: &String| match word.is_empty() || !word.chars().all(plain) {
        true => format!("'{}'", word.replace('\'', "'\\''")),
        false => word.clone(),
    };
    words.into_iter().map(quoted).collect::<Vec<_>>().join(" ")
}

/// Mean and standard deviation, in the unit of the values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanSd {
    /// Arithmetic mean.
    pub mean: f64,
    /// Sample standard deviation (divided by n - 1); `None` for a single value.
    pub sd: Option<f64>,
}

impl MeanSd {
    /// Statistics of the finite `values`; `None` without any.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let values: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
        if values.is_empty() {
            return None;
        }
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
        let sd = (values.len() > 1).then(|| (squares / (values.len() - 1) as f64).sqrt());
        Some(Self { mean, sd })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_and_a_prefix() {
        assert_eq!(si(0.0123, "J"), "12.3 mJ");
        assert_eq!(si(0.004_561, "s"), "4.56 ms");
        assert_eq!(si(123.4, "W"), "123 W");
        assert_eq!(si(1e-3, "s"), "1.00 ms");
        assert_eq!(si(-2.5e-7, "A"), "-250 nA");
        assert_eq!(si_digits(1234.56, "Hz", 4), "1.235 kHz");
    }

    /// A prefix without a unit, as in `69.4 µ`, would be meaningless.
    #[test]
    fn numbers_without_a_unit_have_no_prefix() {
        assert_eq!(
            [si(7.0, ""), si(6.94e-5, ""), si(0.0529, ""), si(0.0, "")],
            ["7.00", "6.94e-5", "0.0529", "0"]
        );
        assert_eq!([number(12_345_678.4), number(6.94e-5), number(123.4)], ["12,345,678", "6.94e-5", "123"]);
        assert_eq!([si(12_345.0, ""), si_digits(0.529_12, "", 4)], ["12345", "0.5291"]);
        assert_eq!(si_mean_sd(MeanSd { mean: 0.0529, sd: Some(0.0001) }, ""), "0.05290 ± 0.00010");
    }

    #[test]
    fn rounding_up_moves_to_the_next_prefix() {
        assert_eq!(si(0.999_96, "J"), "1.00 J");
        assert_eq!(si(999.6, "W"), "1.00 kW");
        assert_eq!(si(999.4, "W"), "999 W");
    }

    #[test]
    fn zero_and_infinite_values_have_a_text() {
        assert_eq!(si(0.0, "J"), "0.00 J");
        assert_eq!(si(f64::NAN, "J"), "n/a");
        assert_eq!(si(f64::INFINITY, "J"), "n/a");
        assert_eq!(si(1e-30, "J"), "0.00 fJ");
        assert_eq!(si(5e20, "J"), "500000 PJ");
    }

    #[test]
    fn mean_and_deviation_share_a_prefix() {
        assert_eq!(si_mean_sd(MeanSd { mean: 0.012_34, sd: Some(0.000_4) }, "J"), "12.34 ± 0.40 mJ");
        assert_eq!(si_mean_sd(MeanSd { mean: f64::NAN, sd: None }, "J"), "n/a");
        assert_eq!(si_mean_sd(MeanSd { mean: 0.012_34, sd: None }, "J"), "12.34 mJ");
    }

    #[test]
    fn columns_are_aligned_by_characters() {
        let mut table = Table::new(["unit", "busy"]);
        table.row(["setup", "3.0 %"]).row(["µ", "12.0 %"]).row(["short"]);
        assert_eq!(table.to_string(), "unit     busy\nsetup   3.0 %\nµ      12.0 %\nshort\n");
        let mut texts = Table::of_texts(["name", "what"]);
        texts.row(["setup", "a"]).row(["µ", "long"]);
        assert_eq!(texts.to_string(), "name   what\nsetup  a\nµ      long\n");
    }

    #[test]
    fn groups_of_three() {
        assert_eq!(grouped(0), "0");
        assert_eq!([count_or_digits(-12_345.0), count_or_digits(0.5)], ["-12,345", "0.5000"]);
        assert_eq!([counted(1, "frame"), counted(2000, "frame")], ["1 frame", "2,000 frames"]);
        assert_eq!(grouped(1_234_567), "1,234,567");
    }

    #[test]
    fn words_are_quoted_where_a_shell_would_change_them() {
        let line =
            |words: &[&str]| shell_line(&words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>());
        assert_eq!(line(&["run", "a.ron", "--frames", "0..9"]), "run a.ron --frames 0..9");
        assert_eq!(line(&["my scene.ron", "a'b", "", "$x"]), "'my scene.ron' 'a'\\''b' '' '$x'");
    }

    #[test]
    fn a_known_sample() {
        let stats = MeanSd::of([2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0, f64::NAN]).unwrap();
        assert_eq!(stats.mean, 5.0);
        assert!((stats.sd.unwrap() - (32.0_f64 / 7.0).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn one_value_has_no_spread_and_none_has_no_mean() {
        assert_eq!(MeanSd::of([3.0]), Some(MeanSd { mean: 3.0, sd: None }));
        assert_eq!(MeanSd::of([f64::NAN]), None);
    }
}
