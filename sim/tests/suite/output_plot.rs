//! Plots as files: real text in SVG, letters without any system font in PNG, the same bytes every time.

use output::plot::{FrameEnergyPlot, FrameEnergyPoint, Picture, PlotStyle, PowerRun};
use output::{Claim, Destination};

fn picture(subject: &str, power_w: &[f64]) -> Picture {
    let run = PowerRun {
        subject,
        rate_hz: 50_000.0,
        start_s: 0.0,
        power_w,
        found_starts_s: &[0.001, 0.002],
        true_starts_s: &[0.001, 0.002],
        mark_s: Some((0.001, 0.0015)),
    };
    run.picture(&PlotStyle::default())
}

fn wave() -> Vec<f64> {
    (0..5000).map(|i| 20.0 + f64::from(i % 50)).collect()
}

#[test]
fn svg_has_real_text_units_and_no_reference_to_anywhere() {
    let svg = picture("tiny", &wave()).svg().unwrap();
    for word in ["Power over the run", "power (W)", "time (ms)", "marked window", "DejaVu Sans, Verdana"] {
        assert!(svg.contains(word), "{word}");
    }
    assert!(!svg.contains("href") && !svg.contains(" id="));
    assert_eq!(svg.matches("http").count(), 1, "only the name space");
    assert!(svg.starts_with("<svg width=\"1200\" height=\""), "{}", &svg[..120]);
    let height = svg.split("height=\"").nth(1).unwrap().split('"').next().unwrap();
    let fine = 2 * height.parse::<u32>().unwrap();
    assert!(
        svg.contains("role=\"img\"") && svg.contains(&format!("viewBox=\"0 0 2400 {fine}\"")),
        "{height}"
    );
}

#[test]
fn names_from_outside_are_harmless() {
    let svg = picture("<script>alert(1)</script> \"&\" 名前\u{1b}", &wave()).svg().unwrap();
    assert!(!svg.contains("<script") && svg.contains("&lt;script&gt;"), "{svg}");
    assert!(!svg.contains('\u{1b}'));
}

#[test]
fn png_has_dark_letters_where_the_title_is() {
    let png = picture("tiny", &wave()).png().unwrap();
    let pixels = image::load_from_memory(&png).unwrap().to_rgb8();
    assert_eq!(pixels.width(), 1200);
    let dark = (20..230).flat_map(|x| (15..38).map(move |y| (x, y)));
    let dark = dark.filter(|(x, y)| pixels.get_pixel(*x, *y).0.iter().all(|channel| *channel < 110)).count();
    assert!((400..2500).contains(&dark), "{dark} dark pixels");
}

#[test]
fn the_same_input_gives_the_same_bytes_on_any_thread() {
    let power_w = wave();
    let make = || (picture("tiny", &power_w).svg().unwrap(), picture("tiny", &power_w).png().unwrap());
    let first = make();
    std::thread::scope(|scope| {
        let others: Vec<_> = (0..2).map(|_| scope.spawn(make)).collect();
        for other in others {
            assert!(other.join().unwrap() == first);
        }
    });
}

#[test]
fn an_empty_plot_says_so() {
    let empty = FrameEnergyPlot { subject: "tiny", frames: &[], measured_j: None, pixels: 1 };
    assert!(empty.picture(&PlotStyle::default()).svg().unwrap().contains("no frames to show"));
    assert!(picture("tiny", &[]).svg().unwrap().contains("no samples to show"));
}

#[test]
fn the_second_axis_is_energy_per_pixel() {
    let frames =
        [0.5, 0.6].map(|energy| FrameEnergyPoint { frame: 0, measured_j: Some(energy), true_j: None });
    let plot = FrameEnergyPlot { subject: "tiny", frames: &frames, measured_j: None, pixels: 1_000_000 };
    let svg = plot.picture(&PlotStyle::default()).svg().unwrap();
    assert!(svg.contains("energy per frame (mJ)") && svg.contains("energy per pixel (nJ)"));
}

#[test]
fn both_files_are_written() {
    let temp = tempfile::tempdir().unwrap();
    let claim = Claim::new("test").plots(["plots/power_run"]);
    let mut dir = Destination::new(temp.path()).open([claim]).unwrap();
    picture("tiny", &wave()).write(&dir, "plots/power_run").unwrap();
    dir.publish().unwrap();
    assert!(temp.path().join("plots/power_run.svg").is_file());
    assert!(temp.path().join("plots/power_run.png").is_file());
}
