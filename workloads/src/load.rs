//! Finding a scene by its name or path.

use std::path::Path;

use activity::spec::suggestion;

use crate::builtin::{builtin, builtin_names};
use crate::error::LoadError;
use crate::import;
use crate::scene::Scene;

/// The scene called `name_or_path`: a built-in one, or a `.ron`, `.gltf`, `.glb`, `.ply` or `.obj` file (the
/// last two also gzipped, `.ply.gz`). A bare geometry file gets a fitted camera and default settings.
///
/// # Errors
/// [`LoadError`]; [`LoadError::is_usage`] tells the caller's mistakes from broken files.
pub fn load(name_or_path: &str) -> Result<Scene, LoadError> {
    if let Some(scene) = builtin(name_or_path) {
        return scene;
    }
    match import::Format::of(Path::new(name_or_path)) {
        Some(format) => Scene::new(import::import(Path::new(name_or_path), format)?)
            .map_err(|error| error.in_file(name_or_path)),
        None => Err(unknown(name_or_path, &[])),
    }
}

/// The error for a name that is no scene, and none of `workloads` where these could have been meant.
pub(crate) fn unknown(name: &str, workloads: &[&str]) -> LoadError {
    let mut names: Vec<&str> = builtin_names().map(|(name, _)| name).collect();
    let mut known = format!("built in: {}; ", names.join(", "));
    if !workloads.is_empty() {
        known += &format!("workloads: {}; ", workloads.join(", "));
    }
    known += "or a path to a .ron, .gltf, .glb, .ply or .obj file";
    names.extend(workloads);
    let near = suggestion(name, &names);
    if near.starts_with("did you mean") {
        known = format!("{near} {known}");
    }
    LoadError::Unknown { name: name.to_owned(), known }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_name_lists_what_there_is_and_suggests() {
        let error = load("defualt").unwrap_err();
        assert!(error.is_usage());
        let text = error.to_string();
        assert!(
            text.starts_with("no scene called `defualt`; did you mean `default`? built in: default, tiny;"),
            "{text}"
        );
        assert!(load("nothing-like-it").unwrap_err().to_string().contains("built in: default, tiny"));
    }

    #[test]
    fn a_missing_file_is_a_failure_that_names_it() {
        for name in
            ["/nowhere/a.gltf", "/nowhere/a.glb", "/nowhere/a.ply", "/nowhere/a.obj.gz", "/nowhere/a.ron"]
        {
            let error = load(name).unwrap_err();
            assert!(!error.is_usage() && error.to_string().contains(name), "{error}");
        }
    }
}
