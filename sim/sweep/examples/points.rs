//! Points of a sweep and the settings of each, planned but not run: `cargo run --release -p sweep --example
//! points -- FILE`; without a file, two points over the side of a tile.

use std::error::Error;
use std::path::Path;

use sweep::{Setting, SweepPlan};

/// A sweep of two points.
const TWO: &str = r#"(
    name: "two",
    settings: {"scene": "tiny", "frames": (0, 1)},
    axes: [Values(path: "gpu.pipeline.tile_px", values: [4, 8])],
)"#;

fn main() -> Result<(), Box<dyn Error>> {
    let plan = match std::env::args().nth(1) {
        Some(file) => SweepPlan::load(Path::new(&file), false, None)?,
        None => {
            let folder = tempfile::tempdir()?;
            let file = folder.path().join("two.ron");
            std::fs::write(&file, TWO)?;
            SweepPlan::load(&file, false, None)?
        }
    };
    println!("{}: {}, all points with {}", plan.name, plan.points.len(), text(&plan.settings));
    for point in &plan.points {
        println!("{} {}", point.id, text(&point.settings));
    }
    Ok(())
}

/// Settings in a line.
fn text(settings: &[Setting]) -> String {
    let settings: Vec<String> = settings.iter().map(|set| format!("{}={}", set.path, set.value)).collect();
    settings.join(" ")
}
