//! What is compared: named sets of tests, and what each leaves of a tile.

use pipeline::Features;
use pipeline::setup::Triangle;
use pipeline::traversal::{Box5, EdgeBounds, TileRect, narrow};
use pipeline::{Shear, Viewport};

/// A named set of tests.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// Its name in tables and charts.
    pub name: &'static str,
    /// The tests that are on.
    pub features: Features,
}

const NONE: Features = Features::NONE;
const SIDES: Features = Features { side_planes: true, ..NONE };
const EDGES: Features = Features { edges: true, ..NONE };
const SCREEN: Features = Features { screen: true, ..NONE };

/// The sets that `quintile stress` compares, each a line.
pub const METHODS: [Method; 10] = [
    Method { name: "box only", features: NONE },
    Method { name: "sides", features: SIDES },
    Method { name: "edges", features: EDGES },
    Method { name: "screen", features: SCREEN },
    Method { name: "sides+edges", features: Features { edges: true, ..SIDES } },
    Method { name: "sides+screen", features: Features { screen: true, ..SIDES } },
    Method { name: "edges+screen", features: Features { screen: true, ..EDGES } },
    Method { name: "sides+edges+screen", features: Features { edges: true, screen: true, ..SIDES } },
    Method { name: "z_max", features: Features { z_max: true, ..NONE } },
    Method { name: "all", features: Features::ALL },
];

/// A test that can be switched on: its letter in charts, its name, and how.
#[derive(Clone, Copy, Debug)]
pub struct Switch {
    /// Its letter in charts.
    pub letter: char,
    /// Its name, as in a GPU file.
    pub name: &'static str,
    on: fn(&mut Features),
}

/// Every test that can be switched on, each a line.
pub const SWITCHES: [Switch; 4] = [
    Switch { letter: 's', name: "side_planes", on: |features| features.side_planes = true },
    Switch { letter: 'e', name: "edges", on: |features| features.edges = true },
    Switch { letter: 'c', name: "screen", on: |features| features.screen = true },
    Switch { letter: 'z', name: "z_max", on: |features| features.z_max = true },
];

/// Every combination of switches, with the letters of those that are on (`-` for none).
pub fn combinations() -> Vec<(String, Features)> {
    (0..1_u32 << SWITCHES.len())
        .map(|mask| {
            let on = SWITCHES.iter().enumerate().filter(|(bit, _)| mask >> bit & 1 == 1);
            let (mut letters, mut features) = (String::new(), NONE);
            for (_, switch) in on {
                letters.push(switch.letter);
                (switch.on)(&mut features);
            }
            (if letters.is_empty() { "-".to_owned() } else { letters }, features)
        })
        .collect()
}

/// A tile with what the tests need to know of the camera.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// The tile.
    pub tile: TileRect,
    /// The lens.
    pub shear: Shear,
}

impl Place {
    /// The tile of `side_px` pixels whose first pixel is `origin`.
    pub fn new(viewport: Viewport, shear: Shear, origin: [u32; 2], side_px: u32) -> Self {
        Self { tile: TileRect::new(viewport, origin, side_px), shear }
    }

    /// The box of lens and time that the tests in `features` leave for `triangle`, or `None` where they cull the tile. A test
    /// that bounds lens or time has its line here.
    pub fn bound(&self, features: &Features, triangle: &Triangle) -> Option<Box5> {
        let lens = !self.shear.is_none();
        let mut within = Box5::whole(lens);
        // As in traversal: a still triangle before a pinhole has nothing to narrow.
        if features.side_planes && (triangle.moving || lens || triangle.behind) {
            within = narrow(triangle, &self.shear, &self.tile, &within)?;
        }
        let missed = || EdgeBounds::new(triangle, &self.shear, &self.tile, &within).miss();
        if features.edges && missed() { None } else { Some(within) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_is_there_once() {
        let all = combinations();
        assert_eq!(all.len(), 16);
        assert_eq!(all[0], ("-".to_owned(), Features::NONE));
        assert_eq!(all[15], ("secz".to_owned(), Features::ALL));
        for (place, one) in all.iter().enumerate() {
            assert!(all[place + 1..].iter().all(|other| other.0 != one.0 && other.1 != one.1));
        }
    }
}
