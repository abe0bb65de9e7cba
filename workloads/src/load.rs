//! Loading of scenes by name or path.

use std::path::Path;

use activity::spec::suggestion;

use crate::builtin::{builtin, builtin_names};
use crate::error::LoadError;
use crate::import;
use crate::scene::Scene;

/// Loads a scene: a built-in one by name, or a `.ron`, `.gltf`, `.glb`, `.obj`, `.ply`, `.off` or `.stl` file
/// (the last four also gzipped, as `.ply.gz`). A geometry file gets a fitted camera and default settings.
///
/// # Errors
/// [`LoadError`]; [`LoadError::is_usage`] distinguishes mistakes of the caller from broken files.
pub fn load(name_or_path: impl AsRef<Path>) -> Result<Scene, LoadError> {
    let path = name_or_path.as_ref();
    if let Some(scene) = path.to_str().and_then(builtin) {
        return scene;
    }
    match import::Format::of(path) {
        Some(format) => Scene::new(import::import(path, format)?)
            .map_err(|error| error.in_file(&path.display().to_string())),
        None => Err(unreadable(path).unwrap_or_else(|| unknown(&path.to_string_lossy(), &[]))),
    }
}

/// Parses the RON scene in `text` as if the file at `path` held it: other files are relative to its folder.
///
/// # Errors
/// As [`load`].
pub fn load_text(text: &str, path: &Path) -> Result<Scene, LoadError> {
    Scene::new(import::ron::parse(text, path)?).map_err(|error| error.in_file(&path.display().to_string()))
}

/// Error for a path that is not a scene.
fn unreadable(path: &Path) -> Option<LoadError> {
    let message = import::foreign(path).or_else(|| {
        let message = if path.is_dir() { "it is a folder" } else { "its ending is not one of a scene file" };
        path.exists().then(|| format!("{message}; give a {} file", import::ENDINGS))
    })?;
    Some(LoadError::Format { file: path.display().to_string(), message })
}

/// Error for an unknown name; `workloads` are listed if they are accepted.
pub(crate) fn unknown(name: &str, workloads: &[&str]) -> LoadError {
    let mut names: Vec<&str> = builtin_names().map(|(name, _)| name).collect();
    let mut known = format!("built in: {}; ", names.join(", "));
    if !workloads.is_empty() {
        known += &format!("workloads: {}; ", workloads.join(", "));
    }
    known += &format!("or a path to a {} file", import::ENDINGS);
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
    fn an_unknown_name_lists_known_names_and_suggests() {
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
    fn files_that_are_no_scenes_say_why() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).display().to_string();
        std::fs::write(path("a.txt"), "text").unwrap();
        std::fs::write(path("bare"), "text").unwrap();
        let cases = [
            (path("."), "it is a folder; give a .ron, .gltf"),
            (path("a.txt"), "its ending is not one of a scene file; give a .ron, .gltf"),
            (path("bare"), "its ending is not one"),
            (path("a.usdz"), "it is a USD file, which is not read; convert it to glTF"),
        ];
        for (name, expected) in cases {
            let error = load(&name).unwrap_err();
            assert!(error.is_usage() && error.to_string().contains(expected), "{error}");
        }
        assert!(load(path("nothing")).unwrap_err().to_string().starts_with("no scene called"));
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
