//! Writes ten seconds of a sine to a JLS file, reads them back and prints the mean of every second.
//!
//! `cargo run -p jls --example sine -- sine.jls`, then open the file in the Joulescope UI.

use jls::{JlsWriter, Reader, SignalName, Timestamp};
use std::error::Error;
use std::fs::File;
use std::path::PathBuf;

const RATE_HZ: u32 = 10_000;
const SECONDS: usize = 10;
/// 2025-01-01, s since 1970.
const START_S: f64 = 1_735_689_600.0;

fn write(path: &PathBuf) -> Result<(), Box<dyn Error>> {
    let signals = [SignalName { name: "current", unit: "A" }];
    let mut writer = JlsWriter::new(File::create(path)?, "sine", RATE_HZ, signals, "{}")?;
    for second in 0..SECONDS {
        let phase = |sample: usize| (second * RATE_HZ as usize + sample) as f32 * 1e-3;
        let current_a: Vec<f32> = (0..RATE_HZ as usize).map(|sample| 1.0 + phase(sample).sin()).collect();
        writer.push([&current_a])?;
    }
    let last = writer.samples() - 1;
    let time = Timestamp::from_unix_s(START_S, last as f64 / f64::from(RATE_HZ));
    writer.stamp(last, time.ok_or("beyond the times of JLS")?)?;
    Ok(writer.finish()?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "sine.jls".to_owned()));
    write(&path)?;
    let reader = Reader::open(&path)?;
    for signal in reader.signals() {
        let mut samples = reader.samples(signal)?;
        let mut second = Vec::new();
        while samples.read(signal.rate_hz as usize, &mut second)? > 0 {
            let mean = second.iter().sum::<f32>() / second.len() as f32;
            println!("{}: {mean:.4} {}", signal.name, signal.unit);
            second.clear();
        }
    }
    Ok(())
}
