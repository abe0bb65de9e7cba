//! What holds for every plot: text lies inside the picture and on no other text, and odd input is no error.

use super::picture::{Across, Picture, Shape, Text};
use super::render::text_width;
use super::*;

/// Left, top, right, bottom of a text in pixels.
fn extent(text: &Text) -> [f64; 4] {
    let width = text_width(&text.text, text.size, text.bold);
    let before = match text.across {
        Across::Left => 0.0,
        Across::Centre => width / 2.0,
        Across::Right => width,
    };
    let (x, y, half) = (text.at.0, text.at.1, text.size * 0.45);
    if text.upwards {
        [x - half, y - (width - before), x + half, y + before]
    } else {
        [x - before, y - half, x - before + width, y + half]
    }
}

fn check_texts(picture: &Picture) {
    let texts: Vec<&Text> = picture
        .shapes
        .iter()
        .filter_map(|shape| match shape {
            Shape::Text(text) => Some(text),
            _ => None,
        })
        .collect();
    for (index, text) in texts.iter().enumerate() {
        let [left, top, right, bottom] = extent(text);
        let inside = left >= 0.0 && top >= 0.0 && right <= picture.width && bottom <= picture.height;
        assert!(
            inside,
            "{:?} at {:?} leaves {} of {}x{}",
            text.text, text.at, picture.title, picture.width, picture.height
        );
        for other in &texts[..index] {
            let [l, t, r, b] = extent(other);
            let apart = right <= l || r <= left || bottom <= t || b <= top;
            assert!(apart, "{:?} is on {:?} in {}", text.text, other.text, picture.title);
        }
    }
}

fn check(picture: &Picture) {
    check_texts(picture);
    assert!(picture.svg().unwrap().ends_with("</svg>\n"));
    assert!(picture.png().unwrap().starts_with(b"\x89PNG"));
}

fn power_run(rate_hz: f64, power_w: &[f64]) -> Picture {
    let starts = [0.0, 0.001, f64::NAN, 0.5, 1e9];
    let mark_s = Some((0.0, 0.002));
    let subject = "scene";
    let run = PowerRun {
        subject,
        rate_hz,
        start_s: 0.0,
        power_w,
        found_starts_s: &starts,
        true_starts_s: &starts,
        mark_s,
    };
    run.picture()
}

#[test]
fn power_run_takes_anything() {
    for rate_hz in [50_000.0, 1.0, 1e-9, 1e12, 0.0, -1.0, f64::NAN, f64::INFINITY] {
        check(&power_run(rate_hz, &[10.0, 12.0, 30.0, f64::NAN, 11.0]));
    }
    let huge = [f64::MAX, f64::MIN, f64::MAX];
    for power_w in [&[][..], &[5.0], &[0.0, 0.0], &[f64::NAN; 3], &[f64::INFINITY, 1.0], &huge, &[-3.0, 2.0]]
    {
        check(&power_run(1000.0, power_w));
    }
    check(&power_run(1000.0, &vec![7.0; 5000]));
}

fn frame_power(parts: usize, bins: usize, power: f64, bin_s: f64) -> Picture {
    let names: Vec<String> =
        (0..parts).map(|i| format!("a part with a rather long name, number {i}")).collect();
    let part = |(i, name): (usize, &'static str)| PowerPart {
        name,
        overhead: i % 3 == 0,
        power_w: vec![power; bins],
    };
    let names = names.into_iter().map(|name| &*Box::leak(name.into_boxed_str()));
    let parts = names.enumerate().map(part).collect();
    FramePower { subject: "scene", frame: 3, bin_s, parts, samples: &[(0.001, 4.0), (f64::NAN, 1.0)] }
        .picture()
}

#[test]
fn frame_power_takes_anything() {
    for (parts, bins, power, bin_s) in [
        (0, 0, 0.0, 1e-6),
        (1, 1, 5.0, 1e-6),
        (3, 0, 5.0, 1e-6),
        (40, 700, 0.5, 1e-5),
        (16, 2000, f64::NAN, 1e-6),
        (4, 10, f64::MAX, 1e-6),
        (4, 10, 1.0, f64::NAN),
        (4, 10, 1.0, 0.0),
        (4, 10, -1.0, 1.0),
    ] {
        check(&frame_power(parts, bins, power, bin_s));
    }
}

#[test]
fn frame_energy_takes_anything() {
    let point = |frame, measured_j, true_j| FrameEnergyPoint { frame, measured_j, true_j };
    let many: Vec<_> = (0..1000).map(|i| point(i, Some(0.5), Some(0.5 + i as f64 * 1e-6))).collect();
    let cases: [&[FrameEnergyPoint]; 7] = [
        &[],
        &[point(0, None, None)],
        &[point(7, Some(0.0), None)],
        &[point(0, Some(f64::NAN), Some(1.0))],
        &[point(0, Some(0.5), Some(0.5)), point(1, Some(0.5), Some(0.5))],
        &[point(u64::MAX, Some(f64::MAX), Some(f64::MIN))],
        &many,
    ];
    for frames in cases {
        let measured_j = crate::output::MeanSd::of(frames.iter().filter_map(|frame| frame.measured_j));
        for pixels in [0, 921_600] {
            check(&FrameEnergy { subject: "scene", frames, measured_j, pixels }.picture());
        }
    }
}

#[test]
fn unit_busy_takes_anything() {
    let lane = |bins| UnitLane { name: "a unit whose name goes on and on and on", busy: vec![0.7; bins] };
    for units in [vec![], vec![lane(0)], vec![lane(1)], vec![lane(5000); 14], vec![lane(3), lane(9)]] {
        for bin_s in [1e-6, f64::NAN, 0.0] {
            check(&UnitBusy { subject: "scene", frame: 0, bin_s, units: units.clone() }.picture());
        }
    }
    let units = vec![UnitLane { name: "odd", busy: vec![f64::NAN, -5.0, 7.0] }];
    check(&UnitBusy { subject: "scene", frame: 0, bin_s: 1e-3, units }.picture());
}

#[test]
fn curves_and_their_legends_fit() {
    let names = ["owen", "sobol", "random", "jittered", "interleaved"];
    let panel = |scale: f64| {
        let curves = names.iter().zip(1..).map(|(name, k)| Curve {
            name: (*name).to_owned(),
            note: "-0.71".to_owned(),
            points: (0..9).map(|i| (f64::from(1 << i), scale / f64::from((1 << i) + k))).collect(),
        });
        let [title, across, up] = ["motion", "samples per pixel", "RMSE"];
        CurvePanel::new(title, [across, up], curves.collect()).on(Scale::Doublings, Scale::Decades)
    };
    let empty = CurvePanel { curves: Vec::new(), ..panel(1.0) };
    let long = "a title that goes on and on, so that it takes more than the one line there is over a panel";
    let other = CurvePanel {
        title: long.to_owned(),
        ..CurvePanel::new("", ["x", "y"], vec![Curve::new("other", [(1.0, 0.0), (2.0, 5.0)])])
    };
    let failing = |range| other.clone().failing(Some(range), "the simulator warns");
    for panels in [
        vec![],
        vec![panel(1.0)],
        vec![panel(1e-6), panel(3e7), panel(0.1)],
        vec![panel(0.0), empty],
        vec![other.clone(), panel(1.0)],
        vec![failing(0.0..1.2), failing(1.9..f64::INFINITY)],
        vec![failing(7.0..3.0)],
    ] {
        for subject in ["of a scene".to_owned(), [long; 5].join(" ")] {
            check(&Curves { title: long, subject: &subject, panels: panels.clone() }.picture());
        }
    }
}

/// Panels are as wide as their longest names need.
#[test]
fn names_of_curves_and_axes_are_whole() {
    let names = ["64 squares along a side: lost by the bound that is not cut", "all methods"];
    let panel = |name: &str| {
        let across = "length of beams for which the sides that they have cross each other (%)";
        CurvePanel::new("panel", [across, "y"], vec![Curve::new(name, [(1.0, 1.0), (2.0, 5.0)])])
    };
    let picture = Curves { title: "Names", subject: "long ones", panels: names.map(panel).into() }.picture();
    check(&picture);
    for name in names {
        let is_name = |shape: &Shape| matches!(shape, Shape::Text(text) if text.text == name);
        assert!(picture.shapes.iter().any(is_name), "{name}");
    }
}

#[test]
fn heat_maps_of_any_shape_fit() {
    for (size, value) in [([1280, 720], 12.0), ([3, 800], 1e9), ([1, 1], 0.0), ([900, 2], f64::NAN)] {
        let tiles = [HeatTile { origin: [0, 0], size, value }];
        let (title, subject) =
            ("samples_tested per pixel, frame 12", "default on reference: 6 364 653 in all");
        check(&HeatMapPlot { title, subject, label: "events per pixel", size, tiles: &tiles }.picture());
    }
}
