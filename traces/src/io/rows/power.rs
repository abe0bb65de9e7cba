//! Voltages, currents and powers of what columns hold.

use super::{Chunk, Rows};
use crate::io::columns::{Layout, Rail};

impl Rows {
    /// Appends a chunk's rows, all rails together, to voltages (V) and currents (A). Where rails are added or only the
    /// power is known, the voltage is 1 V and the current stands for the power.
    pub(super) fn channels(&self, chunk: &mut Chunk, voltage_v: &mut Vec<f32>, current_a: &mut Vec<f32>) {
        self.layout.scale(&mut chunk.values);
        match self.layout.rails[..] {
            [Rail::Measured { voltage, current }] => {
                voltage_v.extend_from_slice(&chunk.values[voltage]);
                current_a.extend_from_slice(&chunk.values[current]);
            }
            [Rail::Specified { volts, current }] => {
                voltage_v.resize(voltage_v.len() + chunk.values[current].len(), volts as f32);
                current_a.extend_from_slice(&chunk.values[current]);
            }
            ref rails => {
                let rows = chunk.values.first().map_or(0, Vec::len);
                voltage_v.resize(voltage_v.len() + rows, 1.0);
                let power_w =
                    |row: usize| rails.iter().map(|rail| rail.power_w(&chunk.values, row)).sum::<f64>();
                current_a.extend((0..rows).map(|row| power_w(row) as f32));
            }
        }
    }
}

impl Layout {
    /// Puts values as they stand in the file into V, A or W.
    pub(super) fn scale(&self, values: &mut [Vec<f32>]) {
        for (values, column) in values.iter_mut().zip(&self.values) {
            if column.scale != 1.0 {
                values.iter_mut().for_each(|value| *value = (f64::from(*value) * column.scale) as f32);
            }
        }
    }
}

impl Rail {
    pub(super) fn power_w(&self, values: &[Vec<f32>], row: usize) -> f64 {
        let value = |column: usize| f64::from(values[column][row]);
        match *self {
            Self::Measured { voltage, current } => value(voltage) * value(current),
            Self::Specified { volts, current } => volts * value(current),
            Self::Power { power } => value(power),
        }
    }
}
