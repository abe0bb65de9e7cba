//! Helpers of the fuzz targets: readers that want a file get one.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A folder of this process, in memory where the system has such a place.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let memory = Path::new("/dev/shm");
        let base = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
        let folder = base.join(format!("quintile-fuzz-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a temporary folder can be made");
        folder
    })
}

/// Calls `read` with the path of a file called `name` that holds `data`.
///
/// # Panics
/// If the file cannot be written.
pub fn on_disk(name: &str, data: &[u8], read: impl FnOnce(&Path)) {
    let path = folder().join(name);
    fs::write(&path, data).expect("a temporary file can be written");
    read(&path);
    let _ = fs::remove_file(path);
}
