//! `--again`: a run as its `summary.json` records it.

use std::path::Path;

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::provenance::{Host, Input};
use super::summary::SCHEMA;
use super::{Choice, RunError, RunOptions};

/// What of a summary a run is repeated by.
#[derive(Deserialize)]
struct Recorded {
    version: String,
    request: RunOptions,
    inputs: Vec<Input>,
    choice: Option<Choice>,
    host: Host,
}

/// The version of the form, and of whatever else there is nothing.
#[derive(Deserialize)]
struct Form {
    schema: u32,
    #[serde(flatten)]
    _other: std::collections::BTreeMap<String, IgnoredAny>,
}

/// The options of the run that wrote the summary at `path`; with its choice, where `--accuracy` or `--budget` made one.
///
/// # Errors
/// When that is no summary of this version, or, without `force`, when the program (built from `revision`) or an input is another.
pub fn again(
    path: &Path,
    force: bool,
    revision: Option<&str>,
) -> Result<(RunOptions, Option<Choice>), RunError> {
    let name = path.display();
    let text = std::fs::read(path).map_err(|source| RunError::Input { path: name.to_string(), source })?;
    let refuse = |message: String| RunError::Setting(format!("{name}: {message}"));
    let form: Form = serde_json::from_slice(&text).map_err(|_| {
        refuse("it is not the summary of a run; give the summary.json that `quintile run` wrote".to_owned())
    })?;
    if form.schema != SCHEMA {
        let message = format!(
            "its schema is {}, this version reads {SCHEMA}; repeat the run with the version that wrote it, or by its `request`",
            form.schema
        );
        return Err(refuse(message));
    }
    let recorded: Recorded = serde_json::from_slice(&text)
        .map_err(|error| refuse(format!("it is damaged: {error}; get the file again")))?;
    if !force {
        recorded.check(revision).map_err(refuse)?;
    }
    Ok((recorded.request, recorded.choice))
}

impl Recorded {
    /// Refuses what would give other results.
    fn check(&self, revision: Option<&str>) -> Result<(), String> {
        let of = |version: &str, revision: Option<&str>| {
            revision.map_or(version.to_owned(), |revision| format!("{version} ({revision})"))
        };
        let (then, now) =
            (of(&self.version, self.host.revision.as_deref()), of(env!("CARGO_PKG_VERSION"), revision));
        if then != now {
            return Err(format!(
                "Quintile {then} made this run, and this is {now}: results may differ; take that version, or repeat it with --force"
            ));
        }
        self.inputs.iter().try_for_each(|then| self.check_input(then))
    }

    fn check_input(&self, then: &Input) -> Result<(), String> {
        let now = Input::now(Path::new(&then.path)).map_err(|error| error.to_string())?;
        let changed = match (&then.sha256, &now.sha256) {
            (then, now) if then == now => return Ok(()),
            (Some(_), None) => format!("is missing; the run was made in {}", self.host.directory),
            (None, Some(_)) => "was missing when the run was made".to_owned(),
            _ => "was changed after the run was made".to_owned(),
        };
        Err(format!(
            "its input {} {changed}: put that file as it was, or repeat the run with --force",
            then.path
        ))
    }
}
