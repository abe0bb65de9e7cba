//! The marks' windows, and the exact distance to them.

use super::StreamError;
use super::clock::Clock;
use super::piece::Piece;
use crate::frames::{MarkError, Marks, Placement};
use crate::io::{Chunk, ReadOptions, Rows};
use multiversion::multiversion;
use std::path::Path;

/// The marks' windows, read by themselves.
pub(super) fn templates(
    path: &Path,
    options: &ReadOptions,
    placement: &Placement,
    marks: &Marks,
    clock: Clock,
) -> Result<Vec<Vec<f64>>, StreamError> {
    let mut templates = Vec::new();
    for (placed, &mark_s) in placement.marks.iter().zip(&marks.starts_s) {
        let mut rows = Rows::open(path, options)?;
        rows.skip(placed.first as u64)?;
        let (mut chunk, mut piece) = (Chunk::default(), Piece::default());
        let mut missing = placement.samples;
        while missing > 0 {
            let read = rows.append(missing, &mut chunk, &mut piece.voltage_v, &mut piece.current_a)?;
            if read == 0 {
                break;
            }
            missing -= read;
        }
        if piece.len() < placement.samples {
            let end_s = clock.time_s((placed.first + piece.len()) as f64);
            return Err(MarkError::OutsideTrace { mark_s, start_s: clock.start_s, end_s }.into());
        }
        templates.push((0..placement.samples).map(|place| piece.power_w(place)).collect());
    }
    Ok(templates)
}

/// Powers of some samples, W.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn powers(voltage_v: &[f32], current_a: &[f32], into: &mut Vec<f64>) {
    into.clear();
    into.extend(voltage_v.iter().zip(current_a).map(|(&v, &i)| f64::from(v) * f64::from(i)));
}

/// Summed squared difference of powers and a template, in eight lanes: always the same order, whatever vectors there are.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn difference(power_w: &[f64], template: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let whole = template.len() / 8 * 8;
    for (t, power) in template[..whole].chunks_exact(8).zip(power_w.chunks_exact(8)) {
        for lane in 0..8 {
            let difference = power[lane] - t[lane];
            lanes[lane] += difference * difference;
        }
    }
    let rest = template.iter().zip(power_w).skip(whole).map(|(t, power)| (power - t) * (power - t));
    lanes.iter().sum::<f64>() + rest.sum::<f64>()
}
