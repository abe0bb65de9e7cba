//! Cycles, energy and area of one frame of a scene on every built-in GPU: `cargo run --release -p
//! run --example gpus -- default`.

use output::table::{digits, si};
use output::terminal::Progress;
use run::{GpuSpec, Plan, RunError, RunOptions, area_mm2, frames_of};

fn main() -> Result<(), RunError> {
    let scene = std::env::args().nth(1).unwrap_or_else(|| "tiny".to_owned());
    for gpu in GpuSpec::names() {
        let options = RunOptions { scene: scene.clone().into(), gpu: gpu.into(), ..RunOptions::default() };
        let plan = Plan::resolve(options)?;
        let area = area_mm2(&plan);
        let [low, mm2, high] = [area.low, area.nominal, area.high].map(digits);
        for frame in frames_of(&plan, &[0], &Progress::new(true))? {
            let energy = si(frame.cost().energy_j, "J");
            println!("{gpu:10} {:9} cycles {energy:>10} {mm2:>6} mm2 ({low} to {high})", frame.cycles);
        }
    }
    Ok(())
}
