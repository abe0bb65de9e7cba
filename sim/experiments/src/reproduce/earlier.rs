//! What a folder already holds: rows of an earlier call that this one would lose.

use std::fs;

use serde::Deserialize;

use super::settings::Form;
use super::{Options, Paper, report};
use output::Destination;
use run::RunError;

/// As much of a report as is asked for here.
#[derive(Deserialize)]
struct Earlier {
    form: Form,
    rows: Vec<Id>,
}

#[derive(Deserialize)]
struct Id {
    id: String,
}

/// Refuses a folder with a result of `paper` that has rows which are not computed now, or all of them in full where this is the quick
/// form. What cannot be read is no result.
pub(super) fn check(paper: Paper, options: &Options, out: &Destination) -> Result<(), RunError> {
    let file = out.folder.join(format!("{}.json", report::stem(paper)));
    let text = if out.force { None } else { fs::read_to_string(file).ok() };
    let Some(Earlier { form, rows }) = text.and_then(|text| serde_json::from_str(&text).ok()) else {
        return Ok(());
    };
    let lost = rows.iter().filter(|row| !options.wants(&row.id)).count();
    let smaller = form == Form::Full && options.quick;
    if lost == 0 && !smaller {
        return Ok(());
    }
    let ids: Vec<&str> = rows.iter().map(|row| row.id.as_str()).collect();
    let why = match lost {
        0 => "this is the quick form".to_owned(),
        lost => format!("{lost} of them are not computed now"),
    };
    Err(RunError::Setting(format!(
        "{}: holds a {} result of Paper {} with {} rows ({}), and {why}; give another folder with --out, or --force to lose it",
        out.folder.display(),
        form.name(),
        paper.number(),
        ids.len(),
        ids.join(", ")
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_larger_result_is_not_replaced_by_a_smaller_one() {
        let folder = tempfile::tempdir().unwrap();
        let out = Destination::new(folder.path());
        let options = |quick, rows: &[&str]| Options {
            quick,
            rows: rows.iter().map(|row| (*row).to_owned()).collect(),
            ..Options::default()
        };
        let refusal =
            |options: &Options| check(Paper::Six, options, &out).err().map(|error| error.to_string());
        assert_eq!(refusal(&options(true, &["VI-2"])), None, "an empty folder");
        let file = folder.path().join("reproduce_VI.json");
        fs::write(&file, r#"{"form": "full", "rows": [{"id": "VI-1"}, {"id": "VI-2"}]}"#).unwrap();
        for (smaller, why) in [
            (options(false, &["vi-2"]), "1 of them are not computed now"),
            (options(true, &[]), "this is the quick form"),
        ] {
            let message = refusal(&smaller).unwrap();
            assert!(message.contains("a full result of Paper VI with 2 rows (VI-1, VI-2)"), "{message}");
            assert!(message.contains(why) && message.contains("--force"), "{message}");
        }
        assert_eq!(refusal(&options(false, &[])), None, "all rows anew");
        assert_eq!(refusal(&options(false, &["VI-1", "vi-2"])), None);
        let forced = Destination { force: true, ..out.clone() };
        assert!(check(Paper::Six, &options(true, &["VI-2"]), &forced).is_ok());
        assert!(check(Paper::Two, &options(true, &[]), &out).is_ok(), "a result of another paper");
        fs::write(&file, "mine").unwrap();
        assert_eq!(refusal(&options(true, &["VI-2"])), None, "no result; whose it is is asked elsewhere");
    }
}
