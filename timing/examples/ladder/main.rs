//! Two tables of the book: streams that break levels of timing, and rates of a machine by microbenchmarks.
//!
//! ```sh
//! cargo run --release -p timing --example ladder
//! ```

mod streams;

use streams::{Gpu, failures, rates};

fn main() -> Result<(), String> {
    println!("| stream | GPU | cycles | `packet` | `bound` |\n|---|---|---|---|---|");
    for name in ["mobile", "reference", "discrete"] {
        let gpu = Gpu::builtin(name).map_err(|error| error.to_string())?;
        for case in failures(&gpu) {
            let [truth, packet, bound] = case.gpu.run(&case.packets)?.map(|timed| timed.cycles as f64);
            let [packet, bound] = [packet, bound].map(|cycles| (cycles / truth - 1.0) * 100.0);
            println!("| {} | `{}` | {truth} | {packet:+.1} % | {bound:+.1} % |", case.name, gpu.name);
        }
    }
    println!("\n| rate | `stepped` | `packet` | `bound` |\n|---|---|---|---|");
    let gpu = Gpu::builtin("discrete").map_err(|error| error.to_string())?;
    for rate in rates() {
        let timed = gpu.run(&rate.packets)?;
        let [a, b, c] = timed.map(|timed| rate.amount / timed.timeline.duration_s() / 1e9);
        println!("| {} | {a:.1} G{} | {b:.1} | {c:.1} |", rate.name, rate.unit);
    }
    Ok(())
}
