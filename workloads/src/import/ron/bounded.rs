//! Numbers with bounds, checked while the file is read so that a message has the line and column.

use serde::{Deserialize, Deserializer, de::Error};

fn checked<'de, D, T>(from: D, holds: impl Fn(&T) -> bool, due: &str) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + std::fmt::Debug,
{
    let value = Option::<T>::deserialize(from)?;
    match value {
        Some(value) if !holds(&value) => Err(D::Error::custom(format!("{value:?} is not {due}"))),
        value => Ok(value),
    }
}

pub(crate) fn side<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u32>, D::Error> {
    checked(from, |value| (1..=16_384).contains(value), "a number of pixels from 1 to 16384")
}

pub(crate) fn samples<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u32>, D::Error> {
    checked(from, |value| (1..=256).contains(value), "a number of samples from 1 to 256")
}

pub(crate) fn positive<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    checked(from, |value: &f64| value.is_finite() && *value > 0.0, "a finite number above zero")
}

pub(crate) fn height<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    checked(from, |value| (1e-30..=1e30).contains(value), "a height above zero (1e-30 to 1e30)")
}

pub(crate) fn depth<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f32>, D::Error> {
    checked(from, |value: &f32| value.is_finite() && *value > 0.0, "a finite depth above zero")
}

pub(crate) fn radius<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f32>, D::Error> {
    checked(from, |value: &f32| value.is_finite() && *value >= 0.0, "a finite radius from zero upwards")
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
    checked(from, |value: &[f64; N]| value.iter().all(|part| part.is_finite()), "a vector of finite numbers")
}

pub(crate) fn frames<'de, D: Deserializer<'de>>(from: D) -> Result<Option<(u32, u32)>, D::Error> {
    checked(
        from,
        |(start, end)| start < end,
        "a range of frames (first, one after the last) with anything in it",
    )
}
