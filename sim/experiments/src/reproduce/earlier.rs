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
