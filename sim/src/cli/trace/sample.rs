//! `quintile trace sample`.

use serde_json::json;
use traces::device::{Device, DeviceSpec, RATES_HZ};
use traces::energy::energies_j;
use traces::io::Source;

use super::args::SampleArgs;
use super::convert::{check, may_be_saved, save};
use super::input::wrong;
use crate::cli::Failure;
use crate::cli::terminal::{complain, print, print_json};

pub(super) fn run(args: &SampleArgs) -> Result<(), Failure> {
    check(&args.out)?;
    let inputs = args.device.as_deref().into_iter().chain([args.input.trace.as_path()]);
    may_be_saved("--out", &args.out, inputs)?;
    let device = Device::new(spec(args)?).map_err(|error| wrong(error.to_string()))?;
    let (trace, _) = args.input.source()?;
    let sampled = device.resample_in_pieces(&*trace)?;
    if sampled.clipped_currents + sampled.clipped_voltages > 0 {
        complain(&format!(
            "warning clipped: {} currents and {} voltages were beyond the device's range",
            sampled.clipped_currents, sampled.clipped_voltages
        ));
    }
    if let Some(losses) = sampled.losses() {
        complain(&format!("warning packets-lost: {losses}; --repair fills them"));
    }
    save(&sampled, &args.out)?;
    let heading = sampled.heading();
    let before_j = energies_j(&*trace, &[(heading.start_s, heading.end_s())])?[0];
    let after_j = sampled.energy_j;
    let error = after_j / before_j - 1.0;
    let samples = heading.samples;
    if args.json {
        return print_json(
            &json!({ "samples": samples, "device": device.spec(), "energy_J": before_j, "sampled_energy_J": after_j,
                "relative_error": error, "lost_samples": heading.lost_samples, "clipped_currents": sampled.clipped_currents,
                "clipped_voltages": sampled.clipped_voltages }),
            true,
        );
    }
    print(&format!(
        "{}: {samples} samples at {} Hz; {before_j:.6} J became {after_j:.6} J ({:+.3} %)",
        args.out.display(),
        device.spec().rate_hz,
        100.0 * error
    ))
}

fn spec(args: &SampleArgs) -> Result<DeviceSpec, Failure> {
    let mut spec = match &args.device {
        Some(path) => {
            let unread = |error: String| wrong(format!("{}: {error}", path.display()));
            let text = std::fs::read_to_string(path).map_err(|error| unread(error.to_string()))?;
            serde_json::from_str(&text).map_err(|error| unread(error.to_string()))?
        }
        None => DeviceSpec::default(),
    };
    let set = |field: &mut f64, asked: Option<f64>| *field = asked.unwrap_or(*field);
    set(&mut spec.rate_hz, args.device_rate);
    set(&mut spec.rail_v, args.rail_voltage);
    set(&mut spec.rail_ohm, args.rail_ohm);
    set(&mut spec.current_noise_a, args.current_noise);
    set(&mut spec.voltage_noise_v, args.voltage_noise);
    set(&mut spec.current_gain, args.current_gain);
    set(&mut spec.current_offset_a, args.current_offset);
    set(&mut spec.voltage_gain, args.voltage_gain);
    set(&mut spec.voltage_offset_v, args.voltage_offset);
    spec.bits = args.bits.unwrap_or(spec.bits);
    spec.current_range_a = args.current_range.map_or(spec.current_range_a, |a| [-a, a]);
    spec.voltage_range_v = args.voltage_range.map_or(spec.voltage_range_v, |v| [-v, v]);
    spec.specified_voltage_v = args.specified_voltage.or(spec.specified_voltage_v);
    spec.low_pass_s = args.low_pass.or(spec.low_pass_s);
    spec.packet_samples = args.packet_samples.unwrap_or(spec.packet_samples);
    set(&mut spec.packet_loss, args.packet_loss);
    spec.seed = args.seed.unwrap_or(spec.seed);
    if !RATES_HZ.contains(&spec.rate_hz) {
        return Err(wrong(format!(
            "--device-rate {}: a device takes 1 to 1e7 samples per second",
            spec.rate_hz
        )));
    }
    Ok(spec)
}
