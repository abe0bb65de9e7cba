//! Values that are more than a number or a name.

use super::Discard;

fn two(text: &str, between: &str, form: &str) -> Result<(f64, f64), String> {
    let wrong = || format!("`{text}` is not of the form {form}");
    let (a, b) = text.split_once(between).ok_or_else(wrong)?;
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
    Ok((number(a)?, number(b)?))
}

fn number(text: &str, must: &str, fits: impl Fn(f64) -> bool) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|value| value.is_finite() && fits(*value));
    value.ok_or_else(|| format!("`{text}` is no {must}"))
}

pub(super) fn finite(text: &str) -> Result<f64, String> {
    number(text, "finite number", |_| true)
}

pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    number(text, "finite number at or above 0", |value| value >= 0.0)
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    number(text, "finite number above 0", |value| value > 0.0)
}

pub(super) fn window(text: &str) -> Result<(f64, f64), String> {
    two(text, ",", "PRE,POST in milliseconds, for example 1,4")
}

pub(super) fn stretch(text: &str) -> Result<(f64, f64), String> {
    let (a, b) = two(text, "..", "A..B in seconds, for example 0.1..0.4")?;
    if a < b { Ok((a, b)) } else { Err(format!("`{text}` ends before it begins")) }
}

pub(super) fn anchor(text: &str) -> Result<(f64, f64), String> {
    two(text, "=", "STAMP=TIME in seconds, for example 0.5=2.513")
}

pub(super) fn pass(text: &str) -> Result<(String, f64), String> {
    let (name, ms) = text.split_once('=').ok_or_else(|| format!("`{text}` is not of the form NAME=MS"))?;
    let ms = ms.trim().parse().ok().filter(|ms: &f64| ms.is_finite() && *ms >= 0.0);
    Ok((name.to_owned(), ms.ok_or_else(|| format!("`{text}`: what follows = is no time in milliseconds"))?))
}

pub(super) fn discard(text: &str) -> Result<Discard, String> {
    match text {
        "auto" => Ok(Discard::Auto),
        _ => text
            .parse()
            .map(Discard::Count)
            .map_err(|_| format!("`{text}` is neither a number of frames nor auto")),
    }
}
