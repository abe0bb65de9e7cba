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
    fn ranges_and_sizes() {
        assert_eq!(frames("3..7"), Ok(3..7));
        assert!(frames("3-7").unwrap_err().contains("0..36"));
        assert!(frames("-3..7").is_err());
        assert_eq!(size("1280x720"), Ok((1280, 720)));
        assert!(size("1280").unwrap_err().contains("1280x720"));
    }
}
