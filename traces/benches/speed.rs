//! Times the steps of an analysis on a synthetic V-sync trace: `cargo bench -p traces --bench speed [-- SAMPLES]`, a
//! million by default.

use std::error::Error;
use std::time::Instant;
use traces::device::{Device, DeviceSpec};
use traces::energy::PowerIntegral;
use traces::frames::{Marks, default_window, find, profile};
use traces::{CurveBuilder, io};

fn main() -> Result<(), Box<dyn Error>> {
    let samples: u32 =
        std::env::args().skip(1).find(|arg| arg != "--bench").map_or(Ok(1_000_000), |text| text.parse())?;
    let mut builder = CurveBuilder::new(0.0)?;
    let frames = samples / 1667;
    for _ in 0..frames {
        for draw in 0..100 {
            builder.push(1.5e-4, 8.0 + f64::from(draw * 37 % 29))?;
        }
        builder.push(1.0 / 30.0 - 0.015, 5.0)?;
    }
    let curve = builder.build()?;
    let device = Device::new(DeviceSpec::default())?;
    let clock = Instant::now();
    let trace = device.sample(&curve, 0.0, curve.end_s())?.trace;
    let millions = trace.samples() as f64 / 1e6;
    let report = |what: &str, clock: Instant| {
        println!("{what:<10} {:8.2} million samples/s", millions / clock.elapsed().as_secs_f64());
    };
    report("sample", clock);

    let power: Vec<f64> = trace.powers_w().collect();
    let clock = Instant::now();
    let distances = profile::summed_squared_difference(&power, &power[8000..8250]);
    report("profile", clock);
    std::hint::black_box(distances);

    let clock = Instant::now();
    let found = find(&trace, &Marks::one(5.0 / 30.0, default_window(1.0 / 30.0, 50e3), trace.end_s()))?;
    let energies = PowerIntegral::new(&trace).frames(&found);
    report("find", clock);
    println!("{} of {frames} frames", energies.len());

    let path = std::env::temp_dir().join(format!("traces-speed-{}.parquet", std::process::id()));
    let clock = Instant::now();
    io::parquet::save(&trace, &path)?;
    report("write", clock);
    println!("{:.2} bytes a sample", std::fs::metadata(&path)?.len() as f64 / 1e6 / millions);
    let clock = Instant::now();
    let read = io::parquet::read(&path);
    report("read", clock);
    std::fs::remove_file(&path)?;
    assert!(read? == trace);
    Ok(())
}
