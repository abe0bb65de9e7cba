//! Axes: quantity, range and ticks. Only ticks with room for their labels are labelled.

use super::picture::text_width;
use crate::table::{Prefix, power_of_ten};

/// Scale of an axis.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Logarithmic, ticks at powers of ten.
    #[default]
    Decades,
    /// Logarithmic, ticks at powers of two.
    Doublings,
    /// Linear; starts at zero if zero is near the data.
    Even,
    /// Linear from zero.
    FromZero,
    /// Places 0, 1, 2, ... with these names.
    Listed(Vec<String>),
}

/// Quantity and scale of an axis.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AxisSpec {
    /// Name of the quantity. It includes the unit if `unit` is empty.
    pub name: String,
    /// Unit without prefix; the values choose the prefix.
    pub unit: String,
    /// Scale.
    pub scale: Scale,
    /// Label of zero on a logarithmic scale, where zero has its own row; `0` if empty.
    pub zero: String,
}

impl AxisSpec {
    /// Linear axis of `name` in `unit`.
    pub fn even(name: &str, unit: &str) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), scale: Scale::Even, zero: String::new() }
    }
}

impl Scale {
    fn is_logarithmic(&self) -> bool {
        matches!(self, Self::Decades | Self::Doublings)
    }

    /// Coordinate of a value; `None` if the scale cannot show it.
    fn coordinate(&self, value: f64) -> Option<f64> {
        let coordinate = if self.is_logarithmic() { libm::log10(value) } else { value };
        coordinate.is_finite().then_some(coordinate)
    }
}

/// Direction of an axis; labels need room along it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Direction {
    Across,
    Up,
}

/// Direction and length of an axis on the page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Along {
    direction: Direction,
    length_px: f64,
}

impl Along {
    pub fn across(length_px: f64) -> Self {
        Self { direction: Direction::Across, length_px }
    }

    pub fn up(length_px: f64) -> Self {
        Self { direction: Direction::Up, length_px }
    }
}

/// A tick: coordinate and label. Small ticks have no label. `10^5` is written with a raised 5.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    pub at: f64,
    pub label: String,
}

/// A range of coordinates with its labels.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    scale: Scale,
    pub low: f64,
    pub high: f64,
    pub ticks: Vec<Tick>,
    /// Name with prefix and unit: `power (mW)`.
    pub label: String,
    /// Coordinate of the break of a logarithmic axis. The row of zero is below it.
    pub broken_at: Option<f64>,
}

/// Range of values on a scale, and whether zero is among them and needs its own row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    pub low: f64,
    pub high: f64,
    /// Share of the axis that the row of zero has; 0 without a row.
    zero_row: f64,
}

/// Markers on an axis: how far their outlines reach from their points, and the length of the axis, in pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct MarkerRoom {
    /// 0 without markers.
    pub reach: f64,
    pub length: f64,
}

impl MarkerRoom {
    /// Share of a range that is added at either end, so that markers stay within the panel. `length` is the
    /// share of the axis that shows the range.
    fn share(self, length: f64) -> f64 {
        if self.reach == 0.0 {
            return 0.0;
        }
        self.reach / (length * self.length - 2.0 * self.reach).max(self.reach)
    }

    /// Share of the axis for the row of zero: a marker is in its middle.
    fn zero_row(self) -> f64 {
        (2.0 * self.reach / self.length).clamp(ZERO_ROW, 0.5)
    }
}

/// Size of the labels of ticks in pixels.
pub(super) const TICK_PX: f64 = 12.0;
/// Least share of a logarithmic axis reserved for zero.
const ZERO_ROW: f64 = 0.13;

/// Whether an axis can be drawn from `low` to `high`: both are finite, and so is their sum.
pub(super) fn is_drawable(low: f64, high: f64) -> bool {
    low.abs() < 1e100 && high.abs() < 1e100
}

impl AxisSpec {
    /// Range of the drawable `values`; `None` without any. At either end `pad` of the range is added, or what
    /// `markers` need if that is more. An axis from zero begins at zero without markers.
    pub(super) fn extent(
        &self,
        values: impl IntoIterator<Item = f64>,
        pad: f64,
        markers: MarkerRoom,
    ) -> Option<Extent> {
        if let Scale::Listed(names) = &self.scale {
            let last = names.len() as f64 - 1.0;
            let room = (markers.share(1.0) * last).max(0.4);
            return Some(Extent { low: -room, high: last + room, zero_row: 0.0 });
        }
        let (mut low, mut high, mut zero) = (f64::INFINITY, f64::NEG_INFINITY, false);
        for value in values {
            zero |= value == 0.0 && self.scale.is_logarithmic();
            if let Some(coordinate) = self.scale.coordinate(value) {
                (low, high) = (low.min(coordinate), high.max(coordinate));
            }
        }
        if low > high
            || !is_drawable(low, high)
            || (self.scale.is_logarithmic() && low.abs().max(high.abs()) > 90.0)
        {
            return None;
        }
        let from_zero = match self.scale {
            Scale::FromZero => low >= 0.0,
            Scale::Even => (0.0..0.6 * high).contains(&low),
            _ => false,
        };
        let zero_row = if zero { markers.zero_row() } else { 0.0 };
        let share = markers.share(1.0 - zero_row);
        let least = if share > 0.0 { share.max(0.5 * pad) } else { 0.0 };
        let pad = pad.max(share);
        if from_zero {
            return Some(Extent { low: (low - least * high).min(0.0), high: high * (1.0 + pad), zero_row });
        }
        let room = match self.scale.is_logarithmic() {
            true => pad.max(0.01) * (high - low).max(1.0),
            false => pad * (high - low).max(1e-3 * high.abs().max(low.abs())),
        };
        Some(Extent { low: low - room, high: high + room, zero_row })
    }

    /// The axis over `extent`.
    pub(super) fn axis(&self, extent: Extent, along: Along) -> Axis {
        let Extent { low, high, zero_row } = extent;
        match &self.scale {
            Scale::Even | Scale::FromZero => {
                return Axis::new(&self.name, &self.unit, (low, high), along);
            }
            Scale::Listed(names) => {
                let ticks = names.iter().enumerate();
                let all: Vec<Tick> =
                    ticks.map(|(place, name)| Tick { at: place as f64, label: name.clone() }).collect();
                // Every second one, every third, ... where there is no room for all.
                let some = |step: usize| {
                    let label = |(place, tick): (usize, &Tick)| Tick {
                        label: if place % step == 0 { tick.label.clone() } else { String::new() },
                        at: tick.at,
                    };
                    all.iter().enumerate().map(label).collect::<Vec<_>>()
                };
                let sets = (1..=all.len().max(1)).map(some).collect();
                let ticks = first_with_room(sets, |ticks| have_room(ticks, (low, high), along));
                let label = self.name.clone();
                return Axis { scale: self.scale.clone(), low, high, ticks, label, broken_at: None };
            }
            Scale::Decades | Scale::Doublings => {}
        }
        let fits = |ticks: &[Tick]| have_room(ticks, (low, high), along);
        let mut ticks = match self.scale {
            Scale::Doublings => doublings(low, high, fits),
            _ => decades(low, high, fits),
        };
        let mut axis = Axis {
            scale: self.scale.clone(),
            low,
            high,
            ticks: Vec::new(),
            label: self.label(),
            broken_at: None,
        };
        if zero_row > 0.0 {
            let row = (zero_row / (1.0 - zero_row) * (high - low)).max(0.02);
            axis.low = low - row;
            axis.broken_at = Some(low);
            let label = if self.zero.is_empty() { "0".to_owned() } else { self.zero.clone() };
            ticks.retain(|tick| tick.label.is_empty() || tick.at >= low + 0.25 * row);
            ticks.insert(0, Tick { at: low - 0.5 * row, label });
        }
        Axis { ticks, ..axis }
    }

    fn label(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, self.unit) }
    }
}

impl Axis {
    /// Axis of `name` in `unit` over `low..high`, which must be drawable ([`is_drawable`]). An empty range is
    /// widened.
    pub fn new(name: &str, unit: &str, (low, high): (f64, f64), along: Along) -> Self {
        let (low, high) = widened(low, high);
        let prefix = if unit.is_empty() { Prefix::NONE } else { Prefix::of(low.abs().max(high.abs())) };
        let label = if unit.is_empty() { name.to_owned() } else { format!("{name} ({}{unit})", prefix.sign) };
        let sets = [9, 7, 5, 4, 3, 2].map(|most| round_ticks((low, high), prefix.factor, most));
        let ticks = first_with_room(sets.into(), |ticks| have_room(ticks, (low, high), along));
        Self { scale: Scale::Even, low, high, ticks, label, broken_at: None }
    }

    /// An axis from 0 to a little above `high`.
    pub fn from_zero(name: &str, unit: &str, high: f64, along: Along) -> Self {
        Self::new(name, unit, (0.0, high * 1.06), along)
    }

    /// Whole numbers only, for counted things such as frames.
    pub fn whole(name: &str, range: (f64, f64), along: Along) -> Self {
        let mut axis = Self::new(name, "", range, along);
        axis.ticks.retain(|tick| libm::round(tick.at) == tick.at);
        for tick in &mut axis.ticks {
            tick.label = format!("{:.0}", tick.at);
        }
        axis
    }

    /// Position of `value`, clamped to [0, 1]: 0 is the low end, 1 the high end. `None` if the scale cannot
    /// show it. A logarithmic scale with a row for zero can show zero.
    pub fn place(&self, value: f64) -> Option<f64> {
        let zero_at = self.broken_at.map(|broken| 0.5 * (self.low + broken)).filter(|_| value == 0.0);
        let coordinate = zero_at.or_else(|| self.scale.coordinate(value))?;
        Some(self.fraction_at(coordinate))
    }

    /// The same for any value; a value that the scale cannot show is at the low end.
    pub fn fraction(&self, value: f64) -> f64 {
        self.place(value).unwrap_or(0.0)
    }

    /// Position of a coordinate, for example of a tick.
    pub fn fraction_at(&self, coordinate: f64) -> f64 {
        let fraction = (coordinate - self.low) / (self.high - self.low);
        if fraction.is_nan() { 0.0 } else { fraction.clamp(0.0, 1.0) }
    }

    /// Whether the scale is logarithmic.
    pub fn is_logarithmic(&self) -> bool {
        self.scale.is_logarithmic()
    }

    /// Width of the widest tick label.
    pub fn widest(&self) -> f64 {
        self.ticks.iter().map(|tick| label_width(&tick.label)).fold(0.0, f64::max)
    }
}

/// Width of a tick label. Raised digits are smaller.
pub(super) fn label_width(label: &str) -> f64 {
    let (base, raised) = label.split_once('^').unwrap_or((label, ""));
    text_width(base, TICK_PX, false) + text_width(raised, EXPONENT_SIZE_RATIO * TICK_PX, false)
}

/// Size of raised letters over that of others.
pub(super) const EXPONENT_SIZE_RATIO: f64 = 0.75;

fn have_room(ticks: &[Tick], (low, high): (f64, f64), along: Along) -> bool {
    let written: Vec<&Tick> = ticks.iter().filter(|tick| !tick.label.is_empty()).collect();
    let needs = |pair: &[&Tick]| match along.direction {
        Direction::Across => 0.5 * (label_width(&pair[0].label) + label_width(&pair[1].label)) + 9.0,
        Direction::Up => 20.0,
    };
    written.windows(2).all(|pair| along.length_px * (pair[1].at - pair[0].at) / (high - low) >= needs(pair))
}

/// First set with at least two labels and room for all of them; otherwise the last set.
fn first_with_room(mut sets: Vec<Vec<Tick>>, fits: impl Fn(&[Tick]) -> bool) -> Vec<Tick> {
    let labels = |ticks: &[Tick]| ticks.iter().filter(|tick| !tick.label.is_empty()).count();
    let first = |least: usize| sets.iter().position(|ticks| labels(ticks) >= least && fits(ticks));
    let best = first(2).or_else(|| first(1)).unwrap_or(sets.len() - 1);
    sets.swap_remove(best)
}

/// Powers of ten with small ticks between them; plain numbers if the range is about a decade or less.
fn decades(low: f64, high: f64, fits: impl Fn(&[Tick]) -> bool) -> Vec<Tick> {
    let (first, last) = (libm::ceil(low) as i32, libm::floor(high) as i32);
    let mut sets = Vec::new();
    if last > first {
        sets.extend([1, 2, 3, 5, 10, 20, 50].map(|step| powers(first, last, step)));
    } else {
        sets.extend(
            [&[1.0, 2.0, 3.0, 5.0, 7.0][..], &[1.0, 2.0, 5.0]].map(|digits| digits_at(low, high, digits)),
        );
        let (least, most) = (libm::pow(10.0, low), libm::pow(10.0, high));
        for count in [5, 4, 3, 2] {
            let mut round = round_ticks((least, most), 1.0, count);
            round.iter_mut().for_each(|tick| tick.at = libm::log10(tick.at));
            sets.push(round);
        }
    }
    let mut ticks = first_with_room(sets, fits);
    // Small ticks at all digits, or at all powers where these are many.
    let powers = libm::floor(low) as i32..=libm::floor(high) as i32;
    let digits = if last - first > 5 { 1..=1 } else { 1..=9 };
    let small = powers
        .flat_map(|power| digits.clone().map(move |digit| f64::from(power) + libm::log10(f64::from(digit))));
    let small: Vec<f64> = small.filter(|at| (low..=high).contains(at)).collect();
    for at in small {
        if ticks.iter().all(|tick| (tick.at - at).abs() > 1e-6) {
            ticks.push(Tick { at, label: String::new() });
        }
    }
    ticks.sort_by(|a, b| a.at.total_cmp(&b.at));
    ticks
}

/// Every `step`-th power of ten: as plain numbers if all are short, otherwise as 10 with an exponent.
fn powers(first: i32, last: i32, step: i32) -> Vec<Tick> {
    let plain = first >= -3 && last <= 4;
    let label = |power: i32| if plain { format!("{}", power_of_ten(power)) } else { format!("10^{power}") };
    let at = (first..=last).filter(|power| power % step == 0);
    at.map(|power| Tick { at: f64::from(power), label: label(power) }).collect()
}

/// Ticks at some digits of each decade within the range.
fn digits_at(low: f64, high: f64, digits: &[f64]) -> Vec<Tick> {
    let powers = libm::floor(low) as i32..=libm::floor(high) as i32;
    let tick = |(digit, power): (f64, i32)| {
        let label = if (-4..5).contains(&power) {
            // In f32 the shortest text is the one without rounding.
            format!("{}", (digit * power_of_ten(power)) as f32)
        } else if digit == 1.0 {
            format!("10^{power}")
        } else {
            format!("{digit}×10^{power}")
        };
        Tick { at: f64::from(power) + libm::log10(digit), label }
    };
    let all = powers.flat_map(|power| digits.iter().map(move |&digit| tick((digit, power))));
    all.filter(|tick| (low..=high).contains(&tick.at)).collect()
}

fn doublings(low: f64, high: f64, fits: impl Fn(&[Tick]) -> bool) -> Vec<Tick> {
    let set = |step: usize| -> Vec<Tick> {
        let powers = (-40..=60).filter(|power: &i32| power.rem_euclid(step as i32) == 0);
        let ticks = powers.map(|power| libm::ldexp(1.0, power));
        let label = |value: f64| {
            if (1e-4..1e6).contains(&value) {
                format!("{}", value as f32)
            } else {
                format!("2^{}", libm::log2(value))
            }
        };
        let ticks = ticks.map(|value| Tick { at: libm::log10(value), label: label(value) });
        ticks.filter(|tick| (low..=high).contains(&tick.at)).collect()
    };
    let sets = [1, 2, 3, 4, 8].map(set);
    if sets[0].len() < 2 {
        return decades(low, high, fits);
    }
    first_with_room(sets.into(), fits)
}

fn widened(low: f64, high: f64) -> (f64, f64) {
    // Below a millionth of the value the labels of neighbouring ticks would need more digits than there is room for.
    if high - low > 1e-6 * low.abs().max(high.abs()) {
        (low, high)
    } else if low == 0.0 && high == 0.0 {
        (0.0, 1.0)
    } else {
        (low - 0.1 * low.abs(), high + 0.1 * high.abs())
    }
}

/// Multiples of 1, 2 or 5 times a power of ten within the range, about `most` of them at most.
fn round_ticks((low, high): (f64, f64), factor: f64, most: u32) -> Vec<Tick> {
    let (step, power) = step((high - low) * factor / f64::from(most.max(2) - 1));
    let decimals = (-power).clamp(0, 7) as usize;
    let largest = high.abs().max(low.abs()) * factor;
    let plain = largest < 1e6 && power >= -7;
    let label =
        |value: f64| if plain { format!("{value:.decimals$}") } else { scientific(value, largest, step) };
    let first = libm::ceil(low * factor / step - 1e-9);
    (0..14)
        .map(|i| (first + f64::from(i)) * step)
        .filter(|scaled| *scaled <= high * factor + 1e-9 * step && scaled.is_finite())
        .map(|scaled| Tick { at: scaled / factor, label: label(scaled + 0.0) })
        .collect()
}

/// `2.5×10^7`: all of an axis with the exponent of its `largest`, and as many digits as its `step` needs.
fn scientific(value: f64, largest: f64, step: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let power = libm::floor(libm::log10(largest)).clamp(-300.0, 300.0) as i32;
    let decimals = (f64::from(power) - libm::floor(libm::log10(step) + 1e-9)).clamp(0.0, 6.0) as usize;
    format!("{:.decimals$}×10^{power}", value / power_of_ten(power))
}

/// The smallest 1, 2 or 5 times a power of ten that is at least `wanted`, and that power.
fn step(wanted: f64) -> (f64, i32) {
    let mut power = libm::floor(libm::log10(wanted)).clamp(-300.0, 300.0) as i32;
    for _ in 0..2 {
        for digit in [1.0, 2.0, 5.0] {
            let step = digit * power_of_ten(power);
            if step >= wanted * (1.0 - 1e-9) {
                return (step, power);
            }
        }
        power += 1;
    }
    (power_of_ten(power), power)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ACROSS: Along = Along { direction: Direction::Across, length_px: 800.0 };
    const MARKERS: MarkerRoom = MarkerRoom { reach: 5.0, length: 800.0 };

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|tick| tick.label.as_str()).filter(|label| !label.is_empty()).collect()
    }

    fn logarithmic(values: &[f64], along: Along) -> Axis {
        let spec = AxisSpec::default();
        spec.axis(spec.extent(values.iter().copied(), 0.04, MARKERS).unwrap(), along)
    }

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = Axis::new("time", "s", (0.0, 0.016), ACROSS);
        assert_eq!(axis.label, "time (ms)");
        assert_eq!(labels(&axis), ["0", "2", "4", "6", "8", "10", "12", "14", "16"]);
        let axis = Axis::new("power", "W", (10.05, 10.45), Along::up(400.0));
        assert_eq!(
            labels(&axis),
            ["10.05", "10.10", "10.15", "10.20", "10.25", "10.30", "10.35", "10.40", "10.45"]
        );
        assert_eq!(labels(&Axis::new("pairs", "", (0.0, 2.5e7), Along::up(200.0)))[1], "0.5×10^7");
    }

    #[test]
    fn an_empty_range_is_widened() {
        for (low, high) in [(0.0, 0.0), (5.0, 5.0), (-3.0, -3.0), (1e-30, 1e-30)] {
            let axis = Axis::new("x", "W", (low, high), ACROSS);
            assert!(axis.low < axis.high && !axis.ticks.is_empty(), "{axis:?}");
        }
    }

    /// The axis of a chart of the book had 0.03, 0.05, 0.07, 0.1 and 1.5e5.
    #[test]
    fn decades_are_ticked_with_exponents_where_numbers_are_long() {
        assert_eq!(labels(&logarithmic(&[3.0, 2e3], ACROSS)), ["10", "100", "1000"]);
        assert_eq!(labels(&logarithmic(&[0.03, 0.4], ACROSS)), ["0.03", "0.05", "0.07", "0.1", "0.2", "0.3"]);
        assert_eq!(labels(&logarithmic(&[0.03, 0.4], Along::up(100.0))), ["0.05", "0.1", "0.2"]);
        assert_eq!(labels(&logarithmic(&[3e4, 2e6], ACROSS)), ["10^5", "10^6"]);
        assert_eq!(labels(&logarithmic(&[1.2e5, 6e5], ACROSS)), ["2×10^5", "3×10^5", "5×10^5"]);
        let small =
            logarithmic(&[3.0, 2e3], ACROSS).ticks.iter().filter(|tick| tick.label.is_empty()).count();
        assert_eq!(small, 7 + 8 + 8 + 1, "ticks at every digit of a decade");
    }

    #[test]
    fn labels_have_room_and_are_more_than_one() {
        for values in [[7.2, 9.2], [15_000.0, 22_000.0], [1e-5, 1e9], [0.05, 0.4], [1.0, 1.0], [3e-30, 2e30]]
        {
            for along in [Along::across(324.0), Along::up(324.0), Along::across(130.0), Along::up(90.0)] {
                let axis = logarithmic(&values, along);
                assert!(have_room(&axis.ticks, (axis.low, axis.high), along), "{values:?} {axis:?}");
                assert!(
                    (2..=16).contains(&labels(&axis).len()) || values[0] == values[1],
                    "{values:?} {axis:?}"
                );
            }
        }
        let spec = AxisSpec { scale: Scale::Doublings, ..AxisSpec::default() };
        let axis = spec.axis(spec.extent([4.0, 16_384.0], 0.04, MARKERS).unwrap(), Along::across(324.0));
        assert_eq!(labels(&axis), ["4", "16", "64", "256", "1024", "4096", "16384"]);
    }

    #[test]
    fn zero_has_a_row_of_its_own_below() {
        let spec = AxisSpec { zero: "exact".to_owned(), ..AxisSpec::default() };
        let axis = spec.axis(spec.extent([0.0, 1.0, 100.0], 0.04, MARKERS).unwrap(), Along::up(372.0));
        assert_eq!(axis.ticks[0].label, "exact");
        let broken = axis.fraction_at(axis.broken_at.unwrap());
        let [zero, one] = [0.0, 1.0].map(|value| axis.place(value).unwrap());
        assert!(0.0 < zero && zero < broken && broken < one && axis.place(-1.0).is_none());
        assert!(spec.extent([0.0], 0.04, MARKERS).is_none(), "no decade to be seen");
        assert!(logarithmic(&[1.0, 100.0], ACROSS).place(0.0).is_none());
    }

    #[test]
    fn points_at_the_ends_keep_off_the_frame() {
        for scale in [Scale::Even, Scale::Decades, Scale::FromZero] {
            let spec = AxisSpec { scale: scale.clone(), ..AxisSpec::default() };
            for values in [[0.2, 1.0], [95.0, 100.0], [1.0, 1e6], [0.0, 7.0]] {
                if values[0] == 0.0 && scale == Scale::Decades {
                    continue;
                }
                let axis = spec.axis(spec.extent(values, 0.04, MARKERS).unwrap(), ACROSS);
                let [low, high] = values.map(|value| axis.place(value).unwrap());
                assert!(low > 0.01 && high < 0.99, "{values:?} {axis:?}");
            }
        }
    }

    #[test]
    fn shares_start_at_zero_and_what_is_far_off_does_not() {
        let extent = |scale, values: [f64; 2]| {
            AxisSpec { scale, ..AxisSpec::default() }
                .extent(values, 0.06, MarkerRoom { reach: 0.0, ..MARKERS })
                .unwrap()
        };
        assert_eq!(extent(Scale::Even, [0.2, 1.0]).low, 0.0);
        assert!(extent(Scale::Even, [95.0, 100.0]).low > 90.0);
        assert_eq!(extent(Scale::FromZero, [95.0, 100.0]).low, 0.0);
    }

    #[test]
    fn frames_are_whole() {
        assert_eq!(labels(&Axis::whole("frame", (0.0, 2.0), ACROSS)), ["0", "1", "2"]);
    }
}
