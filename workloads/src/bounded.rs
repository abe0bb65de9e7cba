//! Bounded numbers, checked while a file is parsed so that messages have line and column.

use serde::{Deserialize, Deserializer, de::Error};

/// Largest coordinate or length in scene units. Products of larger ones overflow 32-bit floats.
const MAX_LENGTH: f64 = 1e15;
/// Latest time, s.
const MAX_TIME_S: f64 = 1e9;
/// Largest angle, degrees.
const MAX_ANGLE_DEG: f64 = 1e9;
/// Largest radiance.
const MAX_RADIANCE: f32 = 1e9;

/// Largest end of the frame range: 46 hours at 60 Hz.
const MAX_FRAME: u32 = 10_000_000;

/// Parses an optional value.
fn checked<'de, D, T>(from: D, holds: impl Fn(&T) -> bool, due: &str) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + std::fmt::Debug,
{
    match Option::<T>::deserialize(from)? {
        Some(value) if !holds(&value) => Err(D::Error::custom(format!("{value:?} is not {due}"))),
        value => Ok(value),
    }
}

/// Parses a required value.
fn required<'de, D, T>(from: D, holds: impl Fn(&T) -> bool, due: &str) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + std::fmt::Debug,
{
    let value = T::deserialize(from)?;
    if holds(&value) { Ok(value) } else { Err(D::Error::custom(format!("{value:?} is not {due}"))) }
}

pub(crate) fn side<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u32>, D::Error> {
    checked(from, |value| (1..=16_384).contains(value), "a number of pixels from 1 to 16384")
}

pub(crate) fn samples<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u32>, D::Error> {
    checked(from, |value| (1..=256).contains(value), "a number of samples from 1 to 256")
}

pub(crate) fn frame_rate<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    checked(from, |value| (0.1..=1e5).contains(value), "a rate from 0.1 to 100000 frames per second")
}

pub(crate) fn moment<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    checked(from, |value: &f64| *value > 0.0 && *value <= MAX_TIME_S, "a time above 0 and up to 1e9 seconds")
}

pub(crate) fn time<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    required(from, |value: &f64| value.abs() <= MAX_TIME_S, "a time from -1e9 to 1e9 seconds")
}

pub(crate) fn turns<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    required(from, |value: &f64| value.abs() <= 1e9, "a number of turns per second from -1e9 to 1e9")
}

pub(crate) fn length<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    required(from, |value: &f64| *value > 0.0 && *value <= MAX_LENGTH, "a length above 0 and up to 1e15")
}

pub(crate) fn lengths<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 3], D::Error> {
    let fits = |value: &[f64; 3]| value.iter().all(|length| *length > 0.0 && *length <= MAX_LENGTH);
    required(from, fits, "three lengths, each above 0 and up to 1e15")
}

pub(crate) fn repeats<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    required(from, |value: &f64| *value > 0.0 && *value <= 1e6, "a number of repeats above 0 and up to 1e6")
}

pub(crate) fn segments<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
    required(from, |value| (3..=2048).contains(value), "a number of segments from 3 to 2048")
}

pub(crate) fn cells<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
    required(from, |value| (1..=2048).contains(value), "a number of cells along an edge from 1 to 2048")
}

pub(crate) fn teeth<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
    required(from, |value| (3..=1024).contains(value), "a number of teeth from 3 to 1024")
}

pub(crate) fn share<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f32>, D::Error> {
    checked(from, |value| (0.0..=1.0).contains(value), "a share from 0 to 1")
}

/// A range within the lens.
pub(crate) fn lens_part<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f32; 2]>, D::Error> {
    let fits = |[low, high]: &[f32; 2]| -1.0 <= *low && low < high && *high <= 1.0;
    checked(from, fits, "a range within -1 and 1, the lower end first")
}

/// A range within the shutter or a side of the image.
pub(crate) fn part<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f32; 2]>, D::Error> {
    let fits = |[low, high]: &[f32; 2]| 0.0 <= *low && low < high && *high <= 1.0;
    checked(from, fits, "a range within 0 and 1, the lower end first")
}

pub(crate) fn blades<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
    required(from, |value| (1..=64).contains(value), "a number of blades from 1 to 64")
}

pub(crate) fn texels<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
    required(from, |value| (2..=4096).contains(value), "a number of texels from 2 to 4096")
}

pub(crate) fn coordinates<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 3], D::Error> {
    required(from, within(MAX_LENGTH), "three numbers from -1e15 to 1e15")
}

pub(crate) fn angles<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 3], D::Error> {
    required(from, within(MAX_ANGLE_DEG), "three angles from -1e9 to 1e9 degrees")
}

pub(crate) fn optional_angles<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f64; 3]>, D::Error> {
    checked(from, within(MAX_ANGLE_DEG), "three angles from -1e9 to 1e9 degrees")
}

pub(crate) fn color<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f32; 3]>, D::Error> {
    checked(from, is_color, "a colour: linear red, green and blue, each 0 to 1e9")
}

pub(crate) fn colors<'de, D: Deserializer<'de>>(from: D) -> Result<[[f32; 3]; 2], D::Error> {
    required(from, |pair: &[[f32; 3]; 2]| pair.iter().all(is_color), "two colours: linear RGB, each 0 to 1e9")
}

fn is_color(value: &[f32; 3]) -> bool {
    value.iter().all(|part| (0.0..=MAX_RADIANCE).contains(part))
}

fn within<const N: usize>(most: f64) -> impl Fn(&[f64; N]) -> bool {
    move |value| value.iter().all(|part| part.abs() <= most)
}

pub(crate) fn height<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    checked(from, |value| (1e-30..=1e30).contains(value), "a height above zero (1e-30 to 1e30)")
}

pub(crate) fn depth<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f32>, D::Error> {
    checked(from, |value: &f32| *value > 0.0 && *value <= 1e15, "a depth above zero and up to 1e15")
}

pub(crate) fn near<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    checked(from, |value: &f64| *value > 0.0 && *value <= MAX_LENGTH, "a depth above zero and up to 1e15")
}

pub(crate) fn radius<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f32>, D::Error> {
    checked(from, |value| (0.0..=1e15_f32).contains(value), "a radius from 0 to 1e15")
}

pub(crate) fn fraction<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    checked(from, |value| (0.0..=1.0).contains(value), "a fraction of the frame period from 0 to 1")
}

pub(crate) fn field_of_view<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    checked(from, |value| (0.1..=175.0).contains(value), "an angle from 0.1 to 175 degrees")
}

pub(crate) fn vector<'de, D, const N: usize>(from: D) -> Result<Option<[f64; N]>, D::Error>
where
    D: Deserializer<'de>,
    [f64; N]: Deserialize<'de>,
{
    checked(from, within(MAX_LENGTH), "a vector of numbers from -1e15 to 1e15")
}

pub(crate) fn frames<'de, D: Deserializer<'de>>(from: D) -> Result<Option<(u32, u32)>, D::Error> {
    checked(
        from,
        |&(start, end)| start < end && end <= MAX_FRAME,
        "a range of frames; give the first, and one after the last, at most 10000000",
    )
}
