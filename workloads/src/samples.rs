//! Sample tables by name or file.

use std::path::Path;

use activity::spec::suggestion;
use pipeline::sampling::SampleSource;
use pipeline::{SampleSpec, SampleTable};

use crate::error::LoadError;
use crate::visibility::FixedSamples;

/// A requested sample table.
#[derive(Clone, Debug)]
pub enum SampleChoice {
    /// A table made from a description.
    Described(SampleSpec),
    /// A table from a file.
    Fixed(FixedSamples),
}

impl SampleChoice {
    /// Loads a table: a named one (see [`SampleSpec::names`]), a description in a `.ron` file, or samples in
    /// any other file.
    ///
    /// # Errors
    /// [`LoadError`] for an unknown name, or an unreadable or invalid file.
    pub fn load(name_or_path: &str) -> Result<Self, LoadError> {
        if let Some(spec) = SampleSpec::named(name_or_path) {
            return Ok(Self::Described(spec));
        }
        let path = Path::new(name_or_path);
        match path.extension() {
            Some(end) if end.eq_ignore_ascii_case("ron") => Ok(Self::Described(activity::spec::load(path)?)),
            Some(_) => FixedSamples::load(path).map(Self::Fixed),
            None => Err(unknown(name_or_path)),
        }
    }

    /// Samples per pixel, if the table fixes them.
    pub fn per_pixel(&self) -> Option<u32> {
        match self {
            Self::Described(_) => None,
            Self::Fixed(table) => Some(table.per_pixel()),
        }
    }

    /// The table with `per_pixel` samples per pixel.
    ///
    /// # Errors
    /// [`LoadError::Setting`] if the table has another number, or cannot be made with this one.
    pub fn source(&self, per_pixel: u32, seed: u64) -> Result<Box<dyn SampleSource>, LoadError> {
        let wrong = |message| Err(LoadError::Setting { setting: "sample table", message });
        match self {
            Self::Fixed(table) if table.per_pixel() != per_pixel => {
                let has = table.per_pixel();
                wrong(format!(
                    "it has {has} samples per pixel, not {per_pixel}: ask for {has} or leave the number out"
                ))
            }
            Self::Fixed(table) => Ok(Box::new(table.clone())),
            Self::Described(spec) => match SampleTable::new(spec, per_pixel, seed) {
                Ok(table) => Ok(Box::new(table)),
                Err(error) => wrong(error.to_string()),
            },
        }
    }
}

fn unknown(name: &str) -> LoadError {
    let names: Vec<&str> = SampleSpec::names().map(|(name, _)| name).collect();
    let (list, near) = (names.join(", "), suggestion(name, &names));
    let near = if near.starts_with("did you mean") { format!(" {near}") } else { String::new() };
    let message = format!(
        "none is called `{name}`;{near} built in: {list}; or a description in a .ron file, or a .smp file"
    );
    LoadError::Setting { setting: "sample table", message }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pipeline::sampling::Sample;

    fn described(text: &str) -> Result<SampleSpec, String> {
        activity::spec::parse(text, "table.ron").map_err(|error| error.to_string())
    }

    #[test]
    fn known_names_load_and_others_are_listed() {
        assert!(SampleSpec::names().all(|(name, _)| SampleChoice::load(name).is_ok()));
        let text = SampleChoice::load("jitered").unwrap_err().to_string();
        assert!(text.contains("did you mean `jittered`?") && text.contains("owen, sobol"), "{text}");
        let error = SampleChoice::load("/nowhere/a.smp").unwrap_err();
        assert!(!error.is_usage() && error.to_string().contains("/nowhere/a.smp"), "{error}");
    }

    #[test]
    fn descriptions_may_be_partial() {
        assert_eq!(described("()").unwrap(), SampleSpec::default());
        let text = "(pattern: Interleaved(points: 16), lens: Polygon(blades: 7, rotation_deg: 12), regions: Grid(2, 1))";
        let spec = described(text).unwrap();
        assert_eq!(SampleTable::new(&spec, 4, 1).unwrap().regions().len(), 2);
        let given = described("(pattern: Given(points: [(0, 0.5, 0.25), (-1, 1, 0)]))").unwrap();
        let found: Vec<f32> =
            SampleTable::new(&given, 2, 1).unwrap().pixel(0, 0).iter().map(|s: &Sample| s.t).collect();
        assert!(found.contains(&0.25) && found.contains(&0.0), "{found:?}");
        assert!(
            described("(regions: Rectangles([(u: (-1, 0), v: (-1, 1)), (u: (0, 1), v: (-1, 1))]))").is_ok()
        );
    }

    #[test]
    fn mistakes_say_where_they_are() {
        for (text, place, what) in [
            ("(pattren: Owen)", "table.ron:1:", "did you mean `pattern`?"),
            ("(\n pattern: Owne)", "table.ron:2:", "did you mean `Owen`?"),
            ("(\n lens: Polygon(blades: 2))", "table.ron:2:", "2 blades; it takes 3 to 64"),
            ("(\n\n pattern: Interleaved(points: 0))", "table.ron:3:", "0 points; it takes 1 to 65536"),
            ("(pattern: Given(points: [(0, 0, 1)]))", "table.ron:1:", "point 0 lies outside"),
            ("(pattern: Given(points: []))", "table.ron:1:", "0 points"),
            ("(regions: Across(0))", "table.ron:1:", "0 regions; it takes 1 to 256"),
            (
                "(regions: Rectangles([(u: (-1, 0.5), v: (-1, 1)), (u: (0, 1), v: (0, 1))]))",
                "table.ron:1:",
                "regions 0 and 1 overlap",
            ),
            ("(regions: Rectangles([(u: (0.5, 0.5), v: (-1, 1))]))", "table.ron:1:", "region 0 has to lie"),
        ] {
            let message = described(text).unwrap_err();
            assert!(message.starts_with(place) && message.contains(what), "{text}: {message}");
        }
    }
}
