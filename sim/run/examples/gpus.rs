//! Cycles and energy of one frame of a scene on every built-in GPU: `cargo run --release -p run --example gpus -- default`.

use output::progress::Progress;
use output::table::si;
use run::{GpuSpec, Plan, RunError, RunOptions, frames_of};

fn main() -> Result<(), RunError> {
    let scene = std::env::args().nth(1).unwrap_or_else(|| "tiny".to_owned());
    for gpu in GpuSpec::names() {
        let options = RunOptions { scene: scene.clone().into(), gpu: gpu.into(), ..RunOptions::default() };
        let plan = Plan::resolve(options)?;
        for frame in frames_of(&plan, &[0], &Progress::new(true))? {
            println!("{gpu:10} {:9} cycles {:>10}", frame.cycles, si(frame.cost().energy_j, "J"));
        }
    }
    Ok(())
}
