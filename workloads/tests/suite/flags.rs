//! Scene flags of workloads: used flags change the result, and others are refused.

use crate::common::{drawn_on, expect, hardware, spec};
use activity::{Counts, Event};
use glam::Vec3;
use pipeline::PipelineSpec;
use workloads::catalog::find;
use workloads::job::{JobRequest, OptionSource};
use workloads::{LoadError, Overrides};

type Change = fn(&mut Overrides);

/// Flags by name, each with a value that is no workload's default.
const FLAGS: [(&str, Change); 7] = [
    ("--size", |overrides| overrides.size = Some((24, 24))),
    ("--samples", |overrides| overrides.samples = Some(5)),
    ("--shutter", |overrides| overrides.shutter = Some(0.125)),
    ("--lens", |overrides| overrides.lens_radius = Some(0.5)),
    ("--focus", |overrides| overrides.focus = Some(2.5)),
    ("--table", |overrides| overrides.table = Some("sobol".to_owned())),
    ("--clip", |overrides| overrides.clip = Some("Run".to_owned())),
];

/// Options for quick runs.
fn options(job: &str) -> OptionSource {
    let set: &[(&str, &str)] = match job {
        "ccd" => &[("balls", "3"), ("resolution", "8")],
        "caustics" => &[("cells", "8")],
        "sampling" => &[("radius", "0.1")],
        // The default scene is still; this one moves.
        "glossy" => &[("texels", "16"), ("scene", "default"), ("centre", "[0, 0.01, 0]"), ("half", "[3, 2]")],
        "soft-shadows" => &[("map_px", "32")],
        "multiview" => &[("check_cache", "false")],
        _ => &[],
    };
    let set = set.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
    OptionSource { file: None, set }
}

/// Frame 1, in which moving objects have moved.
fn drawn(job: &str, overrides: &Overrides) -> Result<(Vec<Vec3>, Counts), LoadError> {
    drawn_by(&hardware(), job, overrides)
}

fn drawn_by(spec: &PipelineSpec, job: &str, overrides: &Overrides) -> Result<(Vec<Vec3>, Counts), LoadError> {
    let job = find(job, &options(job), &JobRequest { overrides, seed: 1 }).unwrap()?;
    let (drawn, report) = drawn_on(spec, &*job, 1);
    Ok((drawn.image, report.counts()))
}

/// A small image, with a lens if the focus needs one.
fn usual(job: &str, flag: &str) -> Overrides {
    let size = (job != "ccd").then_some((32, 32));
    let lens_radius = (job == "glossy" && flag == "--focus").then_some(0.25);
    Overrides { size, lens_radius, ..Overrides::default() }
}

#[test]
fn used_flags_change_the_result() {
    for (job, taken) in [
        ("caustics", &["--size"][..]),
        ("ccd", &[]),
        ("glossy", &["--size", "--samples", "--shutter", "--lens", "--focus"]),
        ("multiview", &["--size", "--samples", "--shutter", "--focus"]),
        ("occlusion", &["--size", "--samples", "--table"]),
        ("sampling", &["--size"]),
        ("soft-shadows", &["--size", "--samples", "--shutter"]),
    ] {
        for (flag, change) in FLAGS {
            let mut changed = usual(job, flag);
            change(&mut changed);
            match drawn(job, &changed) {
                Ok(drawn_so) => {
                    assert!(taken.contains(&flag), "{job} takes {flag}");
                    let usual = drawn(job, &usual(job, flag)).unwrap();
                    assert!(drawn_so != usual, "{job} ignores {flag}");
                }
                Err(error) => {
                    assert!(!taken.contains(&flag) && error.is_usage(), "{job} {flag}: {error}");
                    // Only glTF scenes have something to choose.
                    let name = flag.trim_start_matches("--");
                    expect(&error.to_string(), &[if flag == "--clip" { name } else { flag }]);
                }
            }
        }
    }
}

#[test]
fn replacing_options_are_named() {
    for (job, flag, option) in [
        ("ccd", "--size", "--set resolution="),
        ("ccd", "--samples", "leave it out"),
        ("caustics", "--samples", "leave it out"),
        ("multiview", "--lens", "--set aperture="),
        ("occlusion", "--lens", "--set lens="),
        ("occlusion", "--shutter", "--set motion="),
        ("soft-shadows", "--table", "--set points="),
        ("soft-shadows", "--lens", "leave it out"),
    ] {
        let mut overrides = Overrides::default();
        FLAGS.iter().find(|(name, _)| *name == flag).unwrap().1(&mut overrides);
        let error = drawn(job, &overrides).unwrap_err();
        expect(&error.to_string(), &[flag, job, option]);
    }
}

/// Zero disparity needs a depth, but no lens.
#[test]
fn views_of_a_scene_without_a_lens_are_focused() {
    let files = crate::common::Files::new();
    let scene = files.put("s.ron", "(objects: [(shape: Sphere(radius: 1))])");
    let mut options = options("multiview");
    options.set.push(("scene".to_owned(), scene));
    let made = |focus| {
        let overrides = Overrides { focus, ..usual("multiview", "--focus") };
        find("multiview", &options, &JobRequest { overrides: &overrides, seed: 1 }).unwrap()
    };
    assert!(made(Some(2.5)).is_ok());
    expect(&made(None).err().unwrap().to_string(), &["focus", "no lens"]);
}

#[test]
fn what_draws_no_samples_of_a_table_names_none() {
    let table = |job: &str| {
        let request = JobRequest { overrides: &Overrides::default(), seed: 1 };
        find(job, &options(job), &request).unwrap().unwrap().settings().table.clone()
    };
    assert_eq!(["caustics", "ccd", "occlusion"].map(table), ["none", "none", "owen"]);
}

#[test]
fn caustics_need_no_compute_unit() {
    let overrides = Overrides { size: Some((32, 18)), ..Overrides::default() };
    let [with, without] = [hardware(), spec()].map(|spec| drawn_by(&spec, "caustics", &overrides).unwrap());
    assert_eq!(with.0, without.0);
    assert!(with.1[Event::Groups] > 0 && without.1[Event::Groups] == 0);
}
