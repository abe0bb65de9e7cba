//! Headers that announce more than their files contain must not allocate memory for it. The test looks at the
//! memory of the whole process.
#![cfg(target_os = "linux")]

use std::path::Path;

use crate::common::{Files, failure};
use workloads::FixedSamples;
use workloads::visibility::{load, parse_m5d, parse_mts};

/// Peak address space of the process, in bytes, including untouched memory.
fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmPeak:")).unwrap();
    1024 * line.trim().trim_end_matches(" kB").parse::<u64>().unwrap()
}

fn words(magic: &[u8], words: &[u32]) -> Vec<u8> {
    let mut data = magic.to_vec();
    words.iter().for_each(|word| data.extend(word.to_le_bytes()));
    data
}

#[test]
fn a_header_alone_takes_no_memory() {
    const HUGE: u32 = u32::MAX;
    let before = peak_bytes();
    let path = Path::new("a");
    for scalar in [4, 8] {
        for header in [
            [scalar, HUGE, 0, 0, 0],
            [scalar, 1, 0, HUGE, 0],
            [scalar, 1, 0, 0, HUGE],
            [scalar, 1, 0, HUGE, HUGE],
        ] {
            failure(parse_mts(path, &words(b"MTS1", &header)).unwrap_err());
        }
    }
    let mut scene = words(b"M5DSCN1\0", &[HUGE, 0, 64, 48, 4, 0, 7, 0]);
    [60.0_f64, 0.577, 0.25, 8.0, 0.1].iter().for_each(|number| scene.extend(number.to_le_bytes()));
    failure(parse_m5d(path, &scene).unwrap_err());
    failure(FixedSamples::parse(path, &words(b"M5DSMP1\0", &[HUGE, HUGE, 256, 0])).unwrap_err());
    let files = Files::new();
    let header = |kind: &str| {
        format!(
            "ply\nformat {kind} 1.0\nelement vertex 99999999\nproperty float x\nproperty float y\nproperty float z\n\
             element face 99999999\nproperty list uint int vertex_indices\nend_header\n"
        )
    };
    for kind in ["ascii", "binary_little_endian"] {
        failure(load(&[files.put("a.ply", header(kind))], None).unwrap_err());
    }
    let list =
        header("binary_little_endian").replace("vertex 99999999", "vertex 0") + "\u{7f}\u{7f}\u{7f}\u{7f}";
    failure(load(&[files.put("a.ply", list)], None).unwrap_err());
    let mut stl = vec![b' '; 80];
    stl.extend(HUGE.to_le_bytes());
    failure(load(&[files.put("a.stl", stl)], None).unwrap_err());
    for text in ["OFF\n100000000 100000000 0\n", "OFF\n4294967295 1 0\n", "OFF\n1 1 0\n0 0 0\n4294967295 0\n"]
    {
        failure(load(&[files.put("a.off", text)], None).unwrap_err());
    }
    failure(
        load(&[files.put("a.obj", "v 0 0 0\nf 4294967295 1 1\nf -9223372036854775808 1 1\n")], None)
            .unwrap_err(),
    );
    let taken = peak_bytes() - before;
    // Each of these headers announces gigabytes, far beyond what a thread's heap reserves.
    assert!(taken < 256 << 20, "{taken} bytes");
}
