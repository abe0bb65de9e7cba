//! Errors and warnings of `quintile trace`, and exit codes for files without a trace.

use crate::support::{Inputs, quintile};

/// Ten frames of 10 ms at 5 kHz.
fn recording(inputs: &Inputs) -> String {
    let row = |i: u32| {
        let busy = i % 50 < 20;
        format!("{},12,{}\n", f64::from(i) / 5000.0, if busy { 2.0 } else { 0.2 })
    };
    inputs.put("t.csv", "time_s,voltage_V,current_A\n".to_owned() + &(0..500).map(row).collect::<String>())
}

#[test]
fn bad_values_are_refused_with_the_option_they_are_of() {
    let inputs = Inputs::new();
    let trace = recording(&inputs);
    let (stamps, out) = (inputs.put("stamps.txt", "1\n2\n3\n4\n"), inputs.path("o.csv"));
    let svg = inputs.path("o.svg");
    let sample = ["sample", &trace, "--device-rate", "1000", "--out", &out];
    let marked = ["energy", &trace, "--mark", "0.02"];
    for (args, says) in [
        (vec!["convert", &trace, &out, "--voltage", "0"], vec!["--voltage", "above 0"]),
        (vec!["convert", &trace, &out, "--voltage", "-3"], vec!["--voltage", "above 0"]),
        ([&marked[..], &["--idle-w=-3"]].concat(), vec!["--idle-w", "at least 0"]),
        ([&marked[..], &["--pass", "a=0", "--pass", "a=1"]].concat(), vec!["--pass a is given twice"]),
        (
            vec!["align", &trace, &stamps, "--anchor", "1=0.01", "--anchor", "2=7"],
            vec!["--anchor 2=7", "0 s to 0.1 s"],
        ),
        (
            vec!["convert", &trace, &out, "--start", "5"],
            vec!["t.csv", "column time_s has the times", "--start"],
        ),
        (vec!["convert", &trace, &out, "--rate", "9000"], vec!["column time_s it is 5000 Hz", "--rate"]),
        (vec!["convert", &trace, &out, "--rate", "9000", "--repair"], vec!["column time_s it is 5000 Hz"]),
        ([&sample[..], &["--specified-voltage", "0"]].concat(), vec!["--specified-voltage", "above 0"]),
        ([&sample[..], &["--current-gain=-1"]].concat(), vec!["--current-gain", "above zero"]),
        (vec!["plot", &trace, "--from", "0.05", "--to", "1", "--out", &svg], vec!["not within the trace"]),
    ] {
        let ended = quintile().call(["trace"].iter().chain(&args));
        assert_eq!(ended.code, Some(2), "{args:?}: {}", ended.stderr);
        assert!(says.iter().all(|part| ended.stderr.contains(part)), "{args:?}: {}", ended.stderr);
    }
}

#[test]
fn a_file_that_cannot_be_read_ends_every_command_with_2() {
    let inputs = Inputs::new();
    let trace = recording(&inputs);
    let (gone, bad) = (inputs.path("gone.csv"), inputs.put("bad.txt", "0.02s\n0.04s\n"));
    let cut = inputs.put("summary.json", "{\"schema\": 3, \"scene\": \"ti");
    let (out, svg) = (inputs.path("o.csv"), inputs.path("o.svg"));
    let missing = ["gone.csv: cannot read it: No such file", "check the path"];
    for (args, says) in [
        (vec!["run", "--again", &gone], missing),
        (vec!["trace", "frames", &gone, "--mark", "0.02"], missing),
        (vec!["trace", "frames", &trace, "--mark-file", &gone], missing),
        (vec!["trace", "align", &trace, &gone], missing),
        (vec!["trace", "convert", &gone, &out], missing),
        (vec!["trace", "plot", &gone, "--out", &svg], missing),
        (vec!["trace", "sample", &trace, "--device", &gone, "--out", &out], missing),
        (vec!["trace", "pareto", &gone], missing),
        (vec!["compare", &gone, &gone], missing),
        (vec!["trace", "frames", &trace, "--mark-file", &bad], ["line 1: `0.02s` is not a time", "seconds"]),
        (vec!["run", "--again", &cut], ["summary.json: it is cut off or damaged", "get the file again"]),
    ] {
        let ended = quintile().call(&args);
        assert_eq!(ended.code, Some(2), "{args:?}: {}", ended.stderr);
        assert!(says.iter().all(|part| ended.stderr.contains(part)), "{args:?}: {}", ended.stderr);
    }
}

#[test]
fn files_that_hold_no_trace_are_named_with_what_to_do() {
    let inputs = Inputs::new();
    let utf_16: Vec<u8> = "\u{feff}time_s,power_W\n0,1\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    for (name, bytes, says) in [
        ("summary.json", &b"{\"schema\": 3}"[..], "that of a run is trace.parquet beside"),
        ("excel.csv", &utf_16, "excel.csv: this is a text in UTF-16"),
        ("excel.csv", &utf_16, "save it as UTF-8"),
    ] {
        let file = inputs.put(name, bytes);
        let ended = quintile().call(["trace", "frames", &file, "--mark", "0.1"]);
        assert_eq!(ended.code, Some(2), "{}", ended.stderr);
        assert!(ended.stderr.contains(says), "{}", ended.stderr);
    }
}

#[test]
fn a_proposed_start_that_does_not_come_back_is_refused() {
    let inputs = Inputs::new();
    // One frame between noise.
    let noise = |i: u32| {
        let mixed = i.wrapping_mul(2_654_435_761);
        let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(2_246_822_519);
        f64::from((mixed ^ (mixed >> 13)) % 1000) / 1000.0 - 0.5
    };
    let row = |i: u32| {
        let busy = (10_000..10_400).contains(&i);
        let level = if busy { 3.0 + (f64::from(i) / 17.0).sin() } else { 0.5 };
        format!("{},12,{}\n", f64::from(i) / 50e3, 0.1 * noise(i) + level)
    };
    let rows: String = (0..20_000).map(row).collect();
    let trace = inputs.put("t.csv", format!("time_s,voltage_V,current_A\n{rows}"));
    let ended = quintile().call(["trace", "frames", &trace, "--auto"]);
    assert_eq!(ended.code, Some(2), "{}", ended.stdout);
    assert!(ended.stderr.contains("--auto found no start that comes back"), "{}", ended.stderr);
}

#[test]
fn files_without_a_trace_fail_with_1_in_every_format_and_command() {
    let inputs = Inputs::new();
    let trace = recording(&inputs);
    let folder = inputs.path("folder.parquet");
    std::fs::create_dir(&folder).unwrap_or_default();
    let (out, svg) = (inputs.path("o.csv"), inputs.path("o.svg"));
    let empties = ["e.csv", "e.parquet", "e.jls"].map(|name| inputs.put(name, ""));
    let headed = inputs.put("h.csv", "time_s,voltage_V,current_A\n");
    let table = inputs.put("table.csv", "time_ms,energy_mJ\n");
    let files = empties.iter().chain([&headed, &folder]);
    for file in files {
        for args in [
            vec!["convert", file, &out],
            vec!["frames", file, "--mark", "0.1"],
            vec!["frames", file, "--mark", "0.1", "--stream"],
            vec!["energy", file, "--from", "0", "--to", "1"],
            vec!["plot", file, "--out", &svg],
            vec!["align", &trace, file, "--anchor", "1=0.01", "--anchor", "2=0.02"],
            vec!["pareto", if *file == headed { &table } else { file }],
        ] {
            let ended = quintile().call(["trace"].iter().chain(&args));
            assert_eq!(ended.code, Some(2), "{args:?}: {}", ended.stderr);
            assert!(!ended.stderr.contains("os error"), "{args:?}: {}", ended.stderr);
        }
    }
}

#[test]
fn plots_show_samples_where_they_are_few_and_a_damaged_pyramid_is_made_anew() {
    let inputs = Inputs::new();
    let (trace, svg) = (recording(&inputs), inputs.path("o.svg"));
    let plot = |more: &[&str]| {
        let ended =
            quintile().call(["trace", "plot", &trace, "--keep-pyramid", "--out", &svg].iter().chain(more));
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        (ended, std::fs::read(&svg).unwrap_or_default())
    };
    let short = plot(&["--from", "0.02", "--to", "0.03"]).0.stdout;
    assert!(short.contains("0.02 s to 0.03 s in 50 columns"), "{short}");
    let long = "time_s,power_W\n".to_owned()
        + &(0..80_000).map(|i| format!("{},{}\n", f64::from(i) / 5000.0, i % 100)).collect::<String>();
    inputs.put("t.csv", long);
    let made = plot(&[]).1;
    let kept = inputs.path("t.csv.pyramid");
    let mut bytes = std::fs::read(&kept).unwrap_or_default();
    bytes[3000] ^= 0x40;
    inputs.put("t.csv.pyramid", bytes);
    let (ended, again) = plot(&[]);
    assert!(ended.stderr.contains("t.csv.pyramid: damaged; made anew") && again == made, "{}", ended.stderr);
    assert_eq!((plot(&[]).0.stderr, plot(&[]).1 == made), (String::new(), true));
    let whole = std::fs::read(&kept).unwrap_or_default();
    let mut head = whole.clone();
    head[20] ^= 1;
    for damaged in [head, whole[..40].to_vec(), whole[..whole.len() - 1].to_vec()] {
        inputs.put("t.csv.pyramid", damaged);
        let (ended, again) = plot(&[]);
        assert!(
            ended.stderr.contains("t.csv.pyramid: damaged; made anew") && again == made,
            "{}",
            ended.stderr
        );
    }
}

#[test]
fn a_lost_end_is_in_the_file_and_filled_on_request() {
    let inputs = Inputs::new();
    let trace = recording(&inputs);
    for name in ["lost.csv", "lost.parquet", "lost.jls"] {
        let (lost, back) = (inputs.path(name), inputs.path(&format!("{name}.back.csv")));
        let sample = ["trace", "sample", &trace, "--device-rate", "1000", "--packet-samples", "20"];
        // With this seed the last packets are among those lost.
        let loss = ["--packet-loss", "0.8", "--seed", "3", "--out", &lost];
        let ended = quintile().call(sample.iter().chain(&loss));
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        assert!(quintile().call(["trace", "convert", &lost, &back]).code == Some(2), "{name}");
        let ended = quintile().call(["trace", "convert", &lost, &back, "--repair"]);
        assert!(ended.stdout.contains(": 100 samples at 1000 Hz"), "{name}: {ended:?}");
    }
}

#[test]
fn a_rail_that_is_the_sum_of_others_is_reported_unless_rails_are_chosen() {
    let inputs = Inputs::new();
    let row = |i: u32| format!("{},{},{},{}\n", f64::from(i) / 1000.0, i % 7, i % 11, i % 7 + i % 11);
    let rows: String = (0..200).map(row).collect();
    let trace = inputs.put("rails.csv", format!("time_s,cpu_power_W,gpu_power_W,board_power_W\n{rows}"));
    let out = inputs.path("o.csv");
    let stderr = quintile().call(["trace", "convert", &trace, &out]).stderr;
    assert!(
        stderr.contains("warning: [rail-counted-twice] board is, to rounding, the sum of cpu, gpu"),
        "{stderr}"
    );
    assert!(stderr.contains("give --rail board, or --rail cpu --rail gpu"), "{stderr}");
    let chosen = quintile().call(["trace", "convert", &trace, &out, "--rail", "cpu", "--rail", "gpu"]).stderr;
    assert!(!chosen.contains("warning"), "{chosen}");
}

#[test]
fn assumed_units_and_unread_columns_are_noted() {
    let inputs = Inputs::new();
    let note = |names: &str| {
        let rows: String = (0..99).map(|i| format!("{},12,0.5,9\n", f64::from(i) / 1000.0)).collect();
        let trace = inputs.put("t.csv", format!("{names}\n{rows}"));
        quintile().call(["trace", "convert", &trace, &inputs.path("o.csv")]).stderr
    };
    assert!(note("time_s,x,y,power").contains("no unit at power: read as"));
    let stderr = note("time_s,voltage_V,current_A,power_W");
    assert!(stderr.contains("power_W is not read: power is voltage times current"), "{stderr}");
    assert_eq!(note("time_s,voltage_V,current_A,x"), "");
}

#[test]
fn anchors_of_another_clock_or_beyond_the_stamps_give_a_warning() {
    let inputs = Inputs::new();
    let (trace, stamps) = (recording(&inputs), inputs.put("stamps.txt", "1.01\n1.02\n1.03\n1.04\n"));
    let warnings = |first: &str, second: &str| {
        let args = ["trace", "align", &trace, &stamps, "--anchor", first, "--anchor", second];
        let ended = quintile().call(args);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        ended.stderr
    };
    assert_eq!(warnings("1.01=0.02", "1.04=0.05"), "");
    assert!(warnings("1.01=0.02", "1.04=0.06").contains("warning: [anchors-off] by the anchors, a second"));
    assert!(
        warnings("1.01=0.02", "1.09=0.1")
            .contains("warning: [anchors-off] stamp 1.09 s of an anchor is beyond")
    );
}
