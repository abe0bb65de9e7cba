//! Every number of the GPU files, platform files and energy tables that come with the program, replaced by
//! extreme values: one small frame then runs, or the file is refused, in bounded memory.

use std::ops::Range;
use std::process::Command;

use run::MachineTexts;
use timing::Level;

/// Values that break what is not bounded: none, one, the largest 32-bit count, large, below zero, no number.
const EXTREMES: [&str; 8] = ["0", "1", "1e-30", "4294967295", "1e30", "-1", "NaN", "inf"];
/// Address space of the process that runs the frames, KiB: no file may ask for more.
const LIMIT_KIB: u64 = 6 << 20;

/// The places of the numbers of RON `text`, those in strings and comments left out.
fn numbers(text: &str) -> Vec<Range<usize>> {
    let bytes = text.as_bytes();
    let (mut found, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        match bytes[at] {
            b'"' => at += 2 + text[at + 1..].find('"').unwrap_or(text.len() - at - 2),
            b'/' if bytes.get(at + 1) == Some(&b'/') => {
                at += text[at..].find('\n').unwrap_or(text.len() - at)
            }
            byte if byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-' => {
                let inside = |byte: &u8| byte.is_ascii_alphanumeric() || b"_.-+".contains(byte);
                let end = bytes[at..]
                    .iter()
                    .position(|byte| !inside(byte))
                    .map_or(bytes.len(), |length| at + length);
                if text[at..end].parse::<f64>().is_ok() {
                    found.push(at..end);
                }
                at = end;
            }
            _ => at += 1,
        }
    }
    found
}

/// Runs `name` of this file again in a process with bounded memory, where the system can bound it.
fn bounded(name: &str) -> bool {
    const INSIDE: &str = "QUINTILE_SWEEP_INSIDE";
    if std::env::var_os(INSIDE).is_some() || !cfg!(target_os = "linux") {
        return true;
    }
    let program = std::env::current_exe().expect("the test knows its program");
    let script = format!("ulimit -v {LIMIT_KIB} && exec \"$0\" --exact machine_files::{name} --nocapture");
    let output = Command::new("sh").arg("-c").arg(script).arg(program).env(INSIDE, "1").output();
    let output = output.expect("a shell starts");
    let text =
        [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    assert!(output.status.success() && text.contains("1 passed"), "{}: {text}", output.status);
    false
}

/// Replaces each number of `text` by each extreme and runs a frame; what went wrong.
fn sweep(name: &str, text: &str, machine: impl Fn(&str) -> Result<f64, (bool, String)>) -> Vec<String> {
    let mut complaints = Vec::new();
    let places = numbers(text);
    assert!(places.len() > 20, "{name}: {} numbers", places.len());
    for place in places {
        let line = 1 + text[..place.start].matches('\n').count();
        for value in EXTREMES {
            let changed = format!("{}{value}{}", &text[..place.start], &text[place.end..]);
            let complaint = match machine(&changed) {
                Ok(energy_j) if energy_j.is_finite() && energy_j >= 0.0 => None,
                Ok(energy_j) => Some(format!("the frame takes {energy_j} J")),
                Err((false, message)) => Some(format!("a failure, not a refusal: {message}")),
                Err((true, message)) => (message.len() < 20).then_some(message),
            };
            let what = &text[place.clone()];
            complaints
                .extend(complaint.map(|complaint| format!("{name}:{line}: {value} for {what}: {complaint}")));
        }
    }
    complaints
}

fn one_frame(machine: MachineTexts<'_>) -> Result<f64, (bool, String)> {
    let run = |level| machine.one_frame(level).map_err(|error| (error.is_usage(), error.to_string()));
    run(Level::Bound)?;
    run(Level::Packet)
}

#[test]
fn gpu_files_with_extreme_numbers_run_or_are_refused() {
    if !bounded("gpu_files_with_extreme_numbers_run_or_are_refused") {
        return;
    }
    let text = include_str!("../../run/gpus/reference.ron");
    let of = |text: &str| one_frame(MachineTexts { gpu: Some(text), ..MachineTexts::default() });
    let complaints = sweep("reference.ron", text, of);
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn platform_files_with_extreme_numbers_run_or_are_refused() {
    if !bounded("platform_files_with_extreme_numbers_run_or_are_refused") {
        return;
    }
    let text = include_str!("../../../power-model/platforms/reference.ron");
    let of = |text: &str| one_frame(MachineTexts { platform: Some(text), ..MachineTexts::default() });
    let complaints = sweep("reference.ron", text, of);
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn energy_tables_with_extreme_numbers_run_or_are_refused() {
    if !bounded("energy_tables_with_extreme_numbers_run_or_are_refused") {
        return;
    }
    let text = include_str!("../../../power-model/tables/28nm.ron");
    let of = |text: &str| one_frame(MachineTexts { table: Some(text), ..MachineTexts::default() });
    let complaints = sweep("28nm.ron", text, of);
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn an_endless_queue_is_refused_with_its_place_and_range() {
    let text = include_str!("../../run/gpus/reference.ron");
    for (at, _) in text.match_indices("queue: ") {
        let number = text[at + 7..].find(|c: char| !c.is_ascii_digit()).unwrap_or(0);
        let changed = format!("{}4294967295{}", &text[..at + 7], &text[at + 7 + number..]);
        let line = 1 + text[..at].matches('\n').count();
        let machine = MachineTexts { gpu: Some(&changed), ..MachineTexts::default() };
        let (usage, message) = one_frame(machine).expect_err("a queue that no memory holds");
        assert!(usage && message.starts_with(&format!("gpu.ron:{line}:")), "{message}");
        assert!(message.contains("`queue`: 4294967295 is out of range; it has to be "), "{message}");
    }
}
