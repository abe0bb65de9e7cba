//! Sample tables by name or description.

use serde::{Deserialize, Serialize};

use super::{LensRegions, LensShape, Pattern};

/// What a sample table is to be like; a file in RON holds one. What is left out is as in the default table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SampleSpec {
    /// How the samples of a pixel are spread.
    pub pattern: Pattern,
    /// The shape of the aperture, or of each region's.
    pub lens: LensShape,
    /// How the lens is divided.
    pub regions: LensRegions,
}

/// The tables that have a name, each with what it is.
const NAMED: [(&str, &str); 5] = [
    ("owen", "Sobol points, Owen scrambled by pixel; the default"),
    ("sobol", "Sobol points as they are, the same in every pixel"),
    ("random", "independent uniform numbers"),
    ("jittered", "a random point in each cell of pixel, lens and shutter"),
    ("interleaved", "64 places on lens and in time, shared by all pixels"),
];

impl SampleSpec {
    /// The tables that have a name, each with a line that says what it is.
    pub fn names() -> impl Iterator<Item = (&'static str, &'static str)> {
        NAMED.into_iter()
    }

    /// The table called `name`.
    pub fn named(name: &str) -> Option<Self> {
        let pattern = match name {
            "owen" => Pattern::Owen,
            "sobol" => Pattern::Sobol,
            "random" => Pattern::Random,
            "jittered" => Pattern::Jittered,
            "interleaved" => Pattern::Interleaved { points: 64 },
            _ => return None,
        };
        Some(Self { pattern, ..Self::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::super::SampleTable;
    use super::*;

    #[test]
    fn every_name_makes_a_table() {
        for (name, _) in SampleSpec::names() {
            let table = SampleTable::new(&SampleSpec::named(name).unwrap(), 6, 1).unwrap();
            assert_eq!(table.per_pixel(), 6, "{name}");
        }
        assert_eq!(SampleSpec::named("owen"), Some(SampleSpec::default()));
        assert_eq!(SampleSpec::named("sobel"), None);
    }
}
