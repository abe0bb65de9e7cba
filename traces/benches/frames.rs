//! Times the analysis from file to table: `cargo bench -p traces --bench frames [-- SAMPLES]`, ten million by
//! default; `-- FILE MARK_S` times that of a file.

use std::error::Error;
use std::path::Path;
use std::time::Instant;
use traces::device::{Device, DeviceSpec};
use traces::energy::FrameTable;
use traces::frames::{FinderMethod, Marks, Window};
use traces::io::{ReadOptions, parquet};
use traces::pyramid::PowerPyramid;
use traces::{CurveBuilder, Trace, stream};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    if let [file, mark_s] = &args[..] {
        return time(Path::new(file), mark_s.parse()?);
    }
    let samples: u32 = args.first().map_or(Ok(10_000_000), |text| text.parse())?;
    let path = std::env::temp_dir().join(format!("traces-bench-{}.parquet", std::process::id()));
    parquet::save(&synthetic(samples)?, &path)?;
    time(&path, 0.45)?;
    std::fs::remove_file(&path)?;
    Ok(())
}

/// Frames of about 450 samples.
fn synthetic(samples: u32) -> Result<Trace, Box<dyn Error>> {
    let mut builder = CurveBuilder::new(0.0)?;
    for frame in 0..samples / 450 {
        for draw in 0..40_u32 {
            builder.push(1.9e-4 + 1e-8 * f64::from(frame % 97), 8.0 + f64::from(draw * 37 % 29))?;
        }
        builder.push(1.4e-3 - 4e-7 * f64::from(frame % 97), 5.0)?;
    }
    let curve = builder.build()?;
    Ok(Device::new(DeviceSpec::default())?.sample(&curve, 0.0, curve.end_s())?.trace)
}

fn time(path: &Path, mark_s: f64) -> Result<(), Box<dyn Error>> {
    let millions = stream::clock(path, &ReadOptions::default())?.samples.unwrap_or(0) as f64 / 1e6;
    let window = Window { pre_s: 1e-3, post_s: 4e-3 };
    let marks = Marks::one(mark_s, window, f64::INFINITY);
    for round in 0..3 {
        let clock = Instant::now();
        let streamed = stream::find(path, &ReadOptions::default(), &marks, FinderMethod::SumOfSquares)?;
        let found_s = clock.elapsed().as_secs_f64();
        let mut table = Vec::new();
        FrameTable::new(streamed.energies, None).write_csv(&mut table)?;
        let all_s = clock.elapsed().as_secs_f64();
        println!(
            "round {round}: find {:7.1}, with the table {:7.1} million samples/s",
            millions / found_s,
            millions / all_s
        );
    }
    let clock = Instant::now();
    let pyramid = PowerPyramid::of_file(path, &ReadOptions::default())?;
    println!("pyramid: {:7.1} million samples/s", millions / clock.elapsed().as_secs_f64());
    let kept = PowerPyramid::of_file(path, &ReadOptions::default())?;
    let mut worst_ms = 0.0_f64;
    for zoom in 0..20 {
        let to_s = pyramid.end_s() / f64::from(1 << zoom);
        let clock = Instant::now();
        std::hint::black_box(kept.columns(0.0, to_s, 2000));
        worst_ms = worst_ms.max(clock.elapsed().as_secs_f64() * 1e3);
    }
    println!("zoom: {worst_ms:.2} ms at worst");
    std::fs::remove_file(traces::pyramid::pyramid_path(path))?;
    Ok(())
}
