//! In pieces of any size the device records what it records in memory, or refuses it with the same words.

use super::*;
use crate::device::DeviceSpec;
use crate::io::Cut;
use crate::metadata::Metadata;
use crate::trace::Trace;
use proptest::prelude::*;

/// Puts pieces together again.
#[derive(Default)]
struct All {
    voltage_v: Vec<f32>,
    current_a: Vec<f32>,
    lost: Vec<usize>,
}

impl Sink for All {
    fn take(&mut self, stretch: &Stretch<'_>) -> Result<(), WriteError> {
        assert_eq!(stretch.first, self.voltage_v.len() as u64);
        if stretch.lost {
            self.lost.extend(stretch.first as usize..stretch.first as usize + stretch.len());
        }
        self.voltage_v.extend_from_slice(stretch.voltage_v);
        self.current_a.extend_from_slice(stretch.current_a);
        Ok(())
    }
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]
    #[test]
    fn property_in_pieces_the_device_records_what_it_records_in_memory(
        watts in prop::collection::vec(prop_oneof![30 => 0.0_f32..60.0, 1 => Just(-1.0_f32), 1 => Just(2e4_f32)], 1..3000),
        spoilt in prop::bool::weighted(0.2),
        rates_hz in (prop_oneof![Just(1000.0), 300.0..5e4_f64], prop_oneof![Just(1000.0), Just(1e5), 2.0..9e4_f64]),
        start_s in prop_oneof![Just(0.0), -3.0..1e3_f64],
        low_pass_s in prop_oneof![Just(None), Just(Some(0.01))],
        noise in prop_oneof![Just(0.0), Just(0.01)],
        (packet_samples, packet_loss) in prop_oneof![Just((1, 0.0)), Just((7, 0.4)), Just((64, 0.9))],
        piece in prop_oneof![1_usize..40, 200..4000_usize],
    ) {
        let watts: Vec<f32> = if spoilt { watts } else { watts.iter().map(|w| w.clamp(0.0, 60.0)).collect() };
        let trace = Trace::new(vec![1.0; watts.len()], watts, rates_hz.0, start_s, Metadata::default()).unwrap();
        let device = Device::new(DeviceSpec {
            rate_hz: rates_hz.1, low_pass_s, current_noise_a: noise, packet_samples, packet_loss,
            current_range_a: [-4.0, 4.0], ..DeviceSpec::default()
        }).unwrap();
        let cut = Cut(&trace, piece);
        match (device.resample(&trace), device.resample_in_pieces(&cut)) {
            (Ok(whole), Ok(pieces)) => {
                let mut all = All::default();
                pieces.pour(&mut all).unwrap();
                prop_assert_eq!(bits(&all.voltage_v), bits(whole.trace.voltage_v()));
                prop_assert_eq!(bits(&all.current_a), bits(whole.trace.current_a()));
                prop_assert_eq!(all.lost, whole.trace.lost().iter().cloned().flatten().collect::<Vec<_>>());
                prop_assert_eq!(pieces.heading(), whole.trace.heading());
                prop_assert_eq!(pieces.energy_j, crate::energy::PowerIntegral::new(&whole.trace).total_j());
                prop_assert_eq!(
                    (pieces.clipped_currents, pieces.clipped_voltages),
                    (whole.clipped_currents, whole.clipped_voltages)
                );
            }
            (whole, pieces) => {
                let said = pieces.map(|_| String::new()).unwrap_or_else(|error| error.to_string());
                let says = whole.map(|_| String::new()).unwrap_or_else(|error| error.to_string());
                prop_assert_eq!(said, says);
            }
        }
    }
}
