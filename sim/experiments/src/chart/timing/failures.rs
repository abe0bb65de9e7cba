//! Streams made to break levels, and rates from outside.

use std::collections::BTreeMap;

use serde::Serialize;
use timing::streams;

use super::animations::Packets;
use super::measure::{self, Speed, TimingRow, Written};
use run::GpuSpec;
use run::{RunError, cheapest_level};
use timing::Level;

/// The GPU of the class of the card whose rates are known.
const CARD: &str = "discrete";
/// Values of `--accuracy` in the chart.
const ASKED_PERCENT: [f64; 3] = [1.0, 5.0, 20.0];
/// Triangles of a batch: few, so that the front end and the tiles take turns.
const BATCH: u32 = 512;

/// A stream on a GPU.
#[derive(Clone, Debug, Serialize)]
pub struct FailureRow {
    /// The property that breaks a level.
    pub stream: &'static str,
    /// The GPU.
    pub gpu: String,
    /// Cycles by the reference.
    pub stepped_cycles: u64,
    /// The other levels by name.
    pub levels: BTreeMap<&'static str, FailedLevel>,
    /// Levels that `--accuracy` would choose.
    pub chosen: Vec<Chosen>,
}

/// The level that is chosen where so many percent are requested.
#[derive(Clone, Debug, Serialize)]
pub struct Chosen {
    /// Requested error, percent.
    pub asked_percent: f64,
    /// The cheapest level within it.
    pub level: Level,
}

/// A level on such a stream.
#[derive(Clone, Debug, Serialize)]
pub struct FailedLevel {
    /// Relative error of the cycles.
    pub cycle_error_percent: f64,
    /// Relative error of the energy.
    pub energy_error_percent: f64,
    /// Codes of the warnings that a run would give.
    pub warns: Vec<&'static str>,
}

/// A rate by a microbenchmark that asks for nothing else, in units of 1e9 a second.
#[derive(Clone, Debug, Serialize)]
pub struct RateRow {
    /// The work that the rate counts.
    pub rate: &'static str,
    /// One of it, over a second.
    pub unit: &'static str,
    /// Rate by each level.
    pub giga_per_s: BTreeMap<&'static str, f64>,
    /// The card: listed or measured, of unit rates of 2012-class rasterizers.
    pub card: &'static str,
}

/// Every stream on every GPU of `gpus`.
pub(super) fn failures(gpus: &[GpuSpec]) -> Result<Vec<FailureRow>, RunError> {
    let cases: Vec<_> = gpus.iter().map(|gpu| streams::failures(&gpu.units, BATCH)).collect();
    let mut rows = Vec::new();
    for stream in 0..cases.iter().map(Vec::len).max().unwrap_or(0) {
        for (gpu, case) in gpus.iter().zip(&cases).filter_map(|(gpu, cases)| Some((gpu, cases.get(stream)?)))
        {
            let mut gpu = GpuSpec { units: case.units.clone(), ..gpu.clone() };
            gpu.pipeline.batch_triangles = BATCH;
            let packets = Packets::of(&case.packets);
            rows.push(failure(
                case.name,
                measure::rows((case.name, None), &gpu, &packets, &mut Speed::default())?,
            ));
        }
    }
    Ok(rows)
}

fn failure(stream: &'static str, found: Vec<TimingRow>) -> FailureRow {
    let error = |level: Level| {
        let row = found.iter().find(|row| row.level == level);
        row.map_or(0.0, |row| row.cycle_error_percent.abs().max(row.energy_error_percent.abs()))
    };
    let chosen = |asked| Chosen { asked_percent: asked, level: cheapest_level(error, asked) };
    let level = |row: &TimingRow| FailedLevel {
        cycle_error_percent: row.cycle_error_percent,
        energy_error_percent: row.energy_error_percent,
        warns: row.warns.clone(),
    };
    FailureRow {
        stream,
        gpu: found.first().map_or_else(String::new, |row| row.gpu.clone()),
        stepped_cycles: found.first().map_or(0, |row| row.stepped_cycles),
        levels: found.iter().map(|row| (row.level.name(), level(row))).collect(),
        chosen: ASKED_PERCENT.map(chosen).into(),
    }
}

/// Every rate of the large GPU.
pub(super) fn rates() -> Result<Vec<RateRow>, RunError> {
    let gpu = GpuSpec::load(CARD)?;
    let card = |name: &str| match name {
        name if name.contains("nothing to memory") => "29.6 listed",
        name if name.contains("blended") => "13.3 measured",
        "triangles" => "1.85 listed",
        "texels" => "118.4 listed",
        _ => "264 listed",
    };
    let row = |rate: streams::Rate| {
        let written = Written::new(&gpu, &Packets::of(&rate.packets))?;
        let mut giga_per_s = BTreeMap::new();
        for level in Level::ALL {
            let (timed, _) = measure::timed(level, &gpu, &written)?;
            giga_per_s.insert(level.name(), rate.amount / timed.timeline.duration_s() / 1e9);
        }
        Ok(RateRow { rate: rate.name, unit: rate.unit, giga_per_s, card: card(rate.name) })
    };
    streams::rates().into_iter().map(row).collect()
}
