//! Values of flags that have a form of their own. Errors say which form.

use std::ops::Range;

use pipeline::Features;

use crate::stress::methods::SWITCHES;

/// Frames from the first to one past the last.
pub(super) fn frames(text: &str) -> Result<Range<u32>, String> {
    let wrong = || format!("`{text}` is not a range of frames; write it as 0..36");
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    let number = |part: &str| part.trim().parse().map_err(|_| wrong());
    Ok(number(start)?..number(end)?)
}

/// Tile tests by the names they have in a GPU's file.
pub(super) fn tests(text: &str) -> Result<Features, String> {
    match text {
        "all" => return Ok(Features::ALL),
        "none" => return Ok(Features::NONE),
        "auto" => return Ok(Features { auto: true, ..Features::ALL }),
        _ => {}
    }
    let mut features = Features::NONE;
    for name in text.split(',').map(|name| name.trim().replace('-', "_")) {
        let switch = SWITCHES.iter().find(|switch| switch.name == name).ok_or_else(|| {
            let names = SWITCHES.map(|switch| switch.name).join(", ");
            format!("`{name}` is no tile test; there are {names}, or all, none, auto")
        })?;
        (switch.on)(&mut features);
    }
    Ok(features)
}

/// A name and a value with `=` between.
pub(super) fn setting(text: &str) -> Result<(String, String), String> {
    let (name, value) =
        text.split_once('=').ok_or_else(|| format!("`{text}` has no value; write it as name=value"))?;
    Ok((name.trim().to_owned(), value.trim().to_owned()))
}

/// A share in percent, more than none and at most all, as a fraction.
pub(super) fn percent(text: &str) -> Result<f64, String> {
    let number =
        text.trim_end().strip_suffix('%').ok_or_else(|| format!("`{text}` has no %; write it as 2%"))?;
    let value: f64 = number.trim().parse().map_err(|_| format!("`{text}` is not a share; write it as 2%"))?;
    if value > 0.0 && value <= 100.0 {
        return Ok(value / 100.0);
    }
    Err(format!("`{text}` cannot be met; it has to be more than 0% and at most 100%, for example 2%"))
}

/// Units of time and their seconds, those that end like another first.
const TIMES: [(&str, f64); 4] = [("ms", 1e-3), ("min", 60.0), ("h", 3600.0), ("s", 1.0)];

/// A length of time in seconds.
pub(super) fn duration(text: &str) -> Result<f64, String> {
    let wrong = || format!("`{text}` is not a time; write it as 30s, 500ms, 2min or 1h");
    let (number, unit_s) = TIMES
        .iter()
        .find_map(|(unit, seconds)| Some((text.trim().strip_suffix(unit)?, seconds)))
        .ok_or_else(wrong)?;
    let value: f64 = number.trim().parse().map_err(|_| wrong())?;
    if value > 0.0 && value.is_finite() { Ok(value * unit_s) } else { Err(wrong()) }
}

/// A seed.
pub(super) fn seed(text: &str) -> Result<u64, String> {
    text.trim().parse().map_err(|_| format!("a seed has to be a whole number from 0 to {}", u64::MAX))
}

/// Width and height.
pub(super) fn size(text: &str) -> Result<(u32, u32), String> {
    let wrong = || format!("`{text}` is not a size; write it as 1280x720");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let side = |part: &str| part.trim().parse().map_err(|_| wrong());
    Ok((side(width)?, side(height)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tile_tests_by_name() {
        assert_eq!(tests("all"), Ok(Features::ALL));
        assert_eq!(tests("edges, z-max"), Ok(Features { edges: true, z_max: true, ..Features::NONE }));
        assert!(
            tests("edges,hiz")
                .unwrap_err()
                .contains("`hiz` is no tile test; there are lens_lines, side_planes")
        );
        assert!(tests("").is_err());
    }

    #[test]
    fn shares_and_times() {
        assert_eq!([percent("2%"), percent("0.5 %"), percent("100%")], [Ok(0.02), Ok(0.005), Ok(1.0)]);
        assert!(percent("2").unwrap_err().contains("write it as 2%"));
        for wrong in ["0%", "-1%", "101%", "NaN%", "%", "two%"] {
            assert!(percent(wrong).unwrap_err().contains("2%"), "{wrong}");
        }
        assert_eq!(
            [duration("30s"), duration("500ms"), duration("2 min"), duration("1h")].map(Result::unwrap),
            [30.0, 0.5, 120.0, 3600.0]
        );
        for wrong in ["30", "s", "-1s", "0s", "infs", "NaNs", "3 days"] {
            assert!(duration(wrong).unwrap_err().contains("30s"), "{wrong}");
        }
    }

    #[test]
    fn seeds_are_whole_numbers_from_zero() {
        assert_eq!([seed("0"), seed("18446744073709551615")], [Ok(0), Ok(u64::MAX)]);
        for wrong in ["-1", "1.5", "18446744073709551616", "one", ""] {
            assert!(seed(wrong).unwrap_err().contains("from 0 to 18446744073709551615"), "{wrong}");
        }
    }

    #[test]
    fn ranges_and_sizes() {
        assert_eq!(frames("3..7"), Ok(3..7));
        assert!(frames("3-7").unwrap_err().contains("0..36"));
        assert!(frames("-3..7").is_err());
        assert_eq!(size("1280x720"), Ok((1280, 720)));
        assert!(size("1280").unwrap_err().contains("1280x720"));
    }
}
