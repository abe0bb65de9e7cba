//! Times writing and reading of JLS: `cargo bench -p traces --bench jls_speed [-- SAMPLES FILE]`, ten million
//! samples in a temporary file by default; prints million samples/s of both. With `--write` the file is
//! written, and kept.

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;
use traces::Metadata;
use traces::io::{ReadOptions, atomic, jls, read};

/// Samples pushed at once.
const PIECE: usize = 1 << 16;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let (samples, path): (u64, PathBuf) = match &words[..] {
        [] => {
            let name = format!("traces-jls-{}.jls", std::process::id());
            (10_000_000, std::env::temp_dir().join(name))
        }
        [samples, path, ..] => (samples.parse()?, path.into()),
        _ => return Err("jls_speed SAMPLES FILE [--write]".into()),
    };
    let path = path.as_path();
    let noise: Vec<f32> =
        (0..PIECE as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 12) as f32 * 1e-6).collect();
    let report = |what: &str, clock: Instant| {
        println!("{what} {:.2}", samples as f64 / 1e6 / clock.elapsed().as_secs_f64());
    };
    let clock = Instant::now();
    atomic::write_file(path, |out| {
        let mut file = jls::Writer::new(out, 1e6, 0.0, &Metadata::default())?;
        while file.samples() < samples {
            let count = (samples - file.samples()).min(PIECE as u64) as usize;
            file.push(&noise[..count], &noise[..count])?;
        }
        file.finish()
    })?;
    report("write", clock);
    println!("bytes_per_sample {:.3}", std::fs::metadata(path)?.len() as f64 / samples as f64);
    if words.len() > 2 {
        return Ok(());
    }
    let clock = Instant::now();
    let trace = read(path, &ReadOptions::default())?.trace;
    report("read", clock);
    std::fs::remove_file(path)?;
    assert_eq!(trace.samples() as u64, samples);
    Ok(())
}
