//! `quintile trace sample`.

use serde_json::json;
use traces::device::{Device, DeviceSpec, Peaks, RATES_HZ};
use traces::energy::energies_j;
use traces::io::TraceReader;

use super::convert::{check, may_be_saved, save};
use super::failure::wrong;
use super::report;
use crate::cli::Failure;
use crate::cli::args::trace::SampleArgs;
use crate::cli::terminal::print_json;
use output::table::si;
use output::terminal::Terminal;
use warnings::Code;

/// A recorder whose codes are used to a smaller share loses energy to rounding.
const FEW_CODES: f64 = 0.05;

pub(super) fn run(args: &SampleArgs, terminal: &Terminal) -> Result<(), Failure> {
    check(&args.out)?;
    let inputs = args.device.as_deref().into_iter().chain([args.input.trace.as_path()]);
    may_be_saved("--out", &args.out, inputs)?;
    args.check_rate()?;
    let (trace, _) = args.input.source(terminal)?;
    let peaks = Peaks::of(&*trace)?;
    let device = Device::new(args.spec(&peaks)?).map_err(|error| wrong(error.to_string()))?;
    let sampled = device.resample_in_pieces(&*trace)?;
    if sampled.clipped_currents + sampled.clipped_voltages > 0 {
        let message = format!(
            "{} currents and {} voltages were beyond the device's range; widen it with --current-range or --voltage-range",
            sampled.clipped_currents, sampled.clipped_voltages
        );
        terminal.warn_of(Code::Clipped, &message);
    }
    warn_of_few_codes(device.spec(), &peaks, terminal);
    if let Some(losses) = sampled.losses() {
        terminal.warn_of(Code::PacketsLost, &format!("{losses}; --repair fills them"));
    }
    save(&sampled, &args.out, terminal)?;
    let header = sampled.header();
    let before_j = energies_j(&*trace, &[(header.start_s, header.end_s())])?[0];
    let after_j = sampled.energy_j;
    // A trace of no energy has no relative error.
    let error = (before_j != 0.0).then(|| after_j / before_j - 1.0);
    let samples = header.samples;
    if args.json {
        return print_json(
            &json!({ "samples": samples, "device": device.spec(), "energy_J": before_j, "sampled_energy_J": after_j,
                "relative_error": error, "lost_samples": header.lost_samples, "clipped_currents": sampled.clipped_currents,
                "clipped_voltages": sampled.clipped_voltages }),
            true,
        );
    }
    let DeviceSpec { rate_hz, bits, current_range_a, .. } = device.spec();
    let relative = error.map_or(String::new(), |error| format!(" ({:+.3} %)", 100.0 * error));
    let line = format!(
        "{}: {samples} samples at {rate_hz} Hz, {bits} bits of {} to {}; {before_j:.6} J became {after_j:.6} J{relative}",
        args.out.display(),
        si(current_range_a[0], "A"),
        si(current_range_a[1], "A"),
    );
    report(&line, args.piped, terminal)
}

/// Warns where rounding to codes is coarse against the trace.
fn warn_of_few_codes(spec: &DeviceSpec, peaks: &Peaks, terminal: &Terminal) {
    let share = spec.share_of_current_codes(peaks);
    if share < FEW_CODES {
        let message = format!(
            "the largest current, {}, uses {:.2} % of the device's range of {} to {}: its energy is rounded to few codes; \
             narrow the range with --current-range",
            si(peaks.current_a, "A"),
            share * 100.0,
            si(spec.current_range_a[0], "A"),
            si(spec.current_range_a[1], "A")
        );
        terminal.warn_of(Code::RangeUnused, &message);
    }
}

impl SampleArgs {
    /// The device: that of the file, or the default one with a range that fits, and what options change of it.
    fn spec(&self, peaks: &Peaks) -> Result<DeviceSpec, Failure> {
        let base = self.base(peaks)?;
        let ranged = match self.current_range {
            Some(range_a) => base.clone().with_current_range(range_a),
            None => base.clone(),
        };
        let mut spec = match self.voltage_range {
            Some(range_v) => ranged.with_voltage_range(range_v),
            None => ranged,
        };
        self.change(&mut spec);
        if self.device.is_none() {
            return Ok(spec.named_by_rate_and_bits());
        }
        if spec != base {
            spec.name += " (changed by options)";
        }
        Ok(spec)
    }

    /// The device before options change it.
    fn base(&self, peaks: &Peaks) -> Result<DeviceSpec, Failure> {
        let Some(path) = &self.device else {
            let rail_v = self.rail_voltage.unwrap_or(peaks.voltage_v);
            return Ok(DeviceSpec::fitting(rail_v, peaks.power_w));
        };
        let hint =
            "--device takes a JSON file with the fields of a device, such as those that `--json` prints";
        let unread = |error: String| wrong(format!("{}: {error}; {hint}", path.display()));
        let text = std::fs::read_to_string(path).map_err(|error| unread(error.to_string()))?;
        serde_json::from_str(&text).map_err(|error| unread(error.to_string()))
    }

    /// Puts the options that are given into `spec`; ranges are there already.
    fn change(&self, spec: &mut DeviceSpec) {
        let set = |field: &mut f64, asked: Option<f64>| *field = asked.unwrap_or(*field);
        set(&mut spec.rate_hz, self.device_rate);
        set(&mut spec.rail_v, self.rail_voltage);
        set(&mut spec.rail_ohm, self.rail_ohm);
        set(&mut spec.current_noise_a, self.current_noise);
        set(&mut spec.voltage_noise_v, self.voltage_noise);
        set(&mut spec.current_gain, self.current_gain);
        set(&mut spec.current_offset_a, self.current_offset);
        set(&mut spec.voltage_gain, self.voltage_gain);
        set(&mut spec.voltage_offset_v, self.voltage_offset);
        set(&mut spec.packet_loss, self.packet_loss);
        spec.bits = self.bits.unwrap_or(spec.bits);
        spec.specified_voltage_v = self.specified_voltage.or(spec.specified_voltage_v);
        spec.low_pass_s = self.low_pass.or(spec.low_pass_s);
        spec.packet_samples = self.packet_samples.unwrap_or(spec.packet_samples);
        spec.seed = self.seed.unwrap_or(spec.seed);
    }

    /// Refuses a rate that no modelled device has.
    fn check_rate(&self) -> Result<(), Failure> {
        match self.device_rate.filter(|rate| !RATES_HZ.contains(rate)) {
            Some(rate) => {
                Err(wrong(format!("--device-rate {rate}: a device takes 1 to 1e7 samples per second")))
            }
            None => Ok(()),
        }
    }
}
