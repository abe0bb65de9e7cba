//! Properties of every plot: text lies inside the picture and on no other text, and odd input is no error.
//! Colours differ for every kind of vision.

use activity::Unit;
use power_model::Part;

use super::picture::{Across, Picture, Shape, Text, text_width};
use super::*;

/// Every look that a picture has to fit: its own, that of a column, of a page, and large letters.
fn looks() -> [PlotStyle; 4] {
    let plot_style = PlotStyle::default();
    [
        plot_style.clone(),
        PlotStyle { width_mm: Some(COLUMN_MM), title: Some(String::new()), ..plot_style.clone() },
        PlotStyle { width_mm: Some(175.0), font_pt: Some(7.0), title: Some("A title of its own".to_owned()) },
        PlotStyle { font_pt: Some(16.0), ..plot_style },
    ]
}

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
        let inside = left >= 0.0 && top >= 0.0 && right <= picture.width() && bottom <= picture.height;
        assert!(
            inside,
            "{:?} at {:?} leaves {} of {}x{}",
            text.text,
            text.at,
            picture.title,
            picture.width(),
            picture.height
        );
        for other in &texts[..index] {
            let [l, t, r, b] = extent(other);
            let apart = right <= l || r <= left || bottom <= t || b <= top;
            assert!(apart, "{:?} is on {:?} in {}", text.text, other.text, picture.title);
        }
    }
}

fn check(drawn: impl Fn(&PlotStyle) -> Picture) {
    for plot_style in looks() {
        let picture = drawn(&plot_style);
        check_texts(&picture);
        assert!(picture.svg().unwrap().ends_with("</svg>\n"));
    }
    assert!(drawn(&PlotStyle::default()).png().unwrap().starts_with(b"\x89PNG"));
}

fn power_run(rate_hz: f64, power_w: &[f64], plot_style: &PlotStyle) -> Picture {
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
    run.picture(plot_style)
}

#[test]
fn power_run_takes_anything() {
    for rate_hz in [50_000.0, 1.0, 1e-9, 1e12, 0.0, -1.0, f64::NAN, f64::INFINITY] {
        check(|plot_style| power_run(rate_hz, &[10.0, 12.0, 30.0, f64::NAN, 11.0], plot_style));
    }
    let huge = [f64::MAX, f64::MIN, f64::MAX];
    for power_w in [&[][..], &[5.0], &[0.0, 0.0], &[f64::NAN; 3], &[f64::INFINITY, 1.0], &huge, &[-3.0, 2.0]]
    {
        check(|plot_style| power_run(1000.0, power_w, plot_style));
    }
    check(|plot_style| power_run(1000.0, &vec![7.0; 5000], plot_style));
}

fn frame_power(parts: usize, bins: usize, power: f64, bin_s: f64, plot_style: &PlotStyle) -> Picture {
    let part = |part: &Part| PowerPart { part: *part, power_w: vec![power; bins] };
    let parts = Part::ALL.iter().cycle().take(parts).map(part).collect();
    let samples = &[(0.001, 4.0), (f64::NAN, 1.0)];
    FramePowerPlot { subject: "scene", frame: 3, bin_s, parts, samples, frame_j: Some(0.0163) }
        .picture(plot_style)
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
        check(|plot_style| frame_power(parts, bins, power, bin_s, plot_style));
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
        let measured_j = crate::MeanSd::of(frames.iter().filter_map(|frame| frame.measured_j));
        for pixels in [0, 921_600] {
            check(|plot_style| {
                FrameEnergyPlot { subject: "scene", frames, measured_j, pixels }.picture(plot_style)
            });
        }
    }
}

#[test]
fn unit_busy_takes_anything() {
    let lane = |bins| UnitLane { name: "a unit whose name goes on and on and on", busy: vec![0.7; bins] };
    for units in [vec![], vec![lane(0)], vec![lane(1)], vec![lane(5000); 14], vec![lane(3), lane(9)]] {
        for bin_s in [1e-6, f64::NAN, 0.0] {
            check(|plot_style| {
                UnitPlot { subject: "scene", frame: 0, bin_s, units: units.clone() }.picture(plot_style)
            });
        }
    }
    let units = vec![UnitLane { name: "odd", busy: vec![f64::NAN, -5.0, 7.0] }];
    check(|plot_style| {
        UnitPlot { subject: "scene", frame: 0, bin_s: 1e-3, units: units.clone() }.picture(plot_style)
    });
}

#[test]
fn stalls_take_anything() {
    let lane = |name, intervals| StallLane {
        name,
        shares: vec![[0.5, 0.2, 0.1]; intervals],
        bottleneck: vec![true; intervals / 2],
    };
    for units in [vec![], vec![lane("dram", 0)], vec![lane("dram", 100), lane("a unit with a name", 3)]] {
        let lanes = UnitPlot { subject: "scene", frame: 1, bin_s: 1e-5, units };
        check(|plot_style| lanes.picture(plot_style));
    }
}

#[test]
fn curves_and_their_legends_fit() {
    let names = ["owen", "sobol", "random", "jittered", "interleaved"];
    let panel = |scale: f64| {
        let curves = names.iter().zip(1..).map(|(name, k)| Series {
            note: "-0.71".to_owned(),
            ..Series::curve(*name, (0..9).map(|i| (f64::from(1 << i), scale / f64::from((1 << i) + k))))
        });
        let [title, across, up] = ["motion", "samples per pixel", "RMSE"];
        ChartPanel::new(title, [across, up], curves.collect()).on(Scale::Doublings, Scale::Decades)
    };
    let empty = ChartPanel { series: Vec::new(), ..panel(1.0) };
    let long = "a title that goes on and on, so that it takes more than the one line there is over a panel";
    let other = ChartPanel {
        title: long.to_owned(),
        ..ChartPanel::new("", ["x", "y"], vec![Series::curve("other", [(1.0, 0.0), (2.0, 5.0)])])
    };
    let failing = |range| other.clone().failing(Some(range), "the simulator warns");
    for panels in [
        vec![],
        vec![panel(1.0)],
        vec![panel(1e-6), panel(3e7), panel(0.1)],
        vec![panel(0.0), empty],
        vec![other.clone(), panel(1.0)],
        vec![panel(1.0); 4],
        vec![failing(0.0..1.2), failing(1.9..f64::INFINITY)],
        vec![failing(7.0..3.0)],
    ] {
        for subject in ["of a scene".to_owned(), [long; 5].join(" ")] {
            check(|plot_style| Chart::new(long, &subject, panels.clone()).picture(plot_style));
        }
    }
    let small = |name: &str| ChartPanel { title: name.to_owned(), ..panel(1.0) };
    let panels: Vec<_> = ["sides+edges+screen", "all but coarse"].repeat(7).into_iter().map(small).collect();
    check(|plot_style| Chart::new("small", "s", panels.clone()).small(7).picture(plot_style));
}

#[test]
fn every_mark_is_drawn_and_nothing_says_so() {
    let points = |name: &str| vec![(0.5, 1.5, name.to_owned()), (0.7, 0.2, String::new())];
    let marks = [
        PlotMark::Band(vec![(0.0, 1.0, 2.0)]),
        PlotMark::Line(vec![(0.0, 1.0), (1.0, 2.0)]),
        PlotMark::Curve(vec![(0.0, 1.0), (1.0, 2.0)]),
        PlotMark::Faint(vec![vec![(0.0, 1.0), (1.0, 2.0)]]),
        PlotMark::Dots(points("named")),
        PlotMark::Rings(points("ring")),
        PlotMark::Bars(vec![(0.0, 1.0, 3.0)]),
        PlotMark::Spreads(vec![SpreadPoint {
            at: (0.5, 1.5),
            across: [0.4, 0.8],
            up: [1.0, 2.0],
            name: "middle".to_owned(),
        }]),
        PlotMark::Steps(vec![(0.2, 1.0), (0.6, 0.5), (0.9, 0.1)]),
        PlotMark::Uprights(vec![0.3, f64::NAN]),
    ];
    let series: Vec<Series> = marks.into_iter().map(|mark| Series::new("a", mark)).collect();
    let panel =
        |series| ChartPanel::over("", [AxisSpec::even("time", "s"), AxisSpec::even("power", "W")], series);
    let drawn = |series: Vec<Series>, plot_style: &PlotStyle| {
        Chart::new("t", "s", vec![panel(series)]).picture(plot_style)
    };
    check(|plot_style| drawn(series.clone(), plot_style));
    let svg = drawn(series, &PlotStyle::default()).svg().unwrap();
    assert!(["named", "ring", "middle", "power (W)"].iter().all(|word| svg.contains(word)));
    assert!(drawn(vec![], &PlotStyle::default()).svg().unwrap().contains("nothing to show"));
}

/// Names of curves are whole where there is room for them on a page.
#[test]
fn names_of_curves_are_whole() {
    let names = ["64 squares along a side: lost by the bound that is not cut", "all methods"];
    let panel = |name: &str| {
        ChartPanel::new("panel", ["x", "y"], vec![Series::curve(name, [(1.0, 1.0), (2.0, 5.0)])])
    };
    let picture = Chart::new("Names", "long ones", names.map(panel).into()).picture(&PlotStyle::default());
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
            ("samples_tested per pixel, frame 12", "default on reference: 6,364,653 in all");
        for shading in
            [HeatScale::Even, HeatScale::Clipped, HeatScale::UpTo(4.0), HeatScale::Classes(&["none", "some"])]
        {
            let label = "events per pixel";
            let plot = HeatMapPlot { title, subject, label, size, tiles: &tiles, shading, brightness: &[] };
            check(|plot_style| plot.picture(plot_style));
        }
    }
}

#[test]
fn matrices_fit() {
    let rows: Vec<_> = ["a", "sides+edges+screen"].map(|name| (name, vec![Some(1.0); 14])).into();
    let panels = vec![MatrixPanel { name: "at the value of each family that is worst for the method", rows }];
    let columns = vec!["a family with a name"; 14];
    let matrix =
        Matrix { title: "t", subject: "s", scale: ["the best", "32 times as much"], columns, panels };
    check(|plot_style| matrix.picture(plot_style));
}

/// The colour of each unit in the legend or beside the lane of a picture, by its name.
fn unit_colours(picture: &Picture) -> Vec<(String, [u8; 3])> {
    let mut found = Vec::new();
    for shape in &picture.shapes {
        let Shape::Text(text) = shape else { continue };
        if Unit::ALL.into_iter().all(|unit| unit.name() != text.text) {
            continue;
        }
        // The swatch at the same height, nearest to the name.
        let swatch = |shape: &Shape| match shape {
            Shape::Rect { from, to, fill }
                if (0.5 * (from.1 + to.1) - text.at.1).abs() < 1.0 && to.0 - from.0 < 15.0 =>
            {
                Some(((from.0 - text.at.0).abs(), fill.rgb))
            }
            _ => None,
        };
        let nearest = picture.shapes.iter().filter_map(swatch).min_by(|a, b| a.0.total_cmp(&b.0));
        found.push((text.text.clone(), nearest.unwrap().1));
    }
    found
}

/// The colour of a unit depended on which other units were in use.
#[test]
fn a_unit_has_one_colour_in_every_plot() {
    let few = [Unit::Shader, Unit::SampleTest, Unit::L2, Unit::Dram];
    for units in [&Unit::ALL[..], &few[..]] {
        let parts = units.iter().map(|&unit| PowerPart { part: Part::Unit(unit), power_w: vec![1.0; 4] });
        let parts = parts.collect();
        let power =
            FramePowerPlot { subject: "s", frame: 0, bin_s: 1e-6, parts, samples: &[], frame_j: None };
        let busy = units.iter().map(|unit| UnitLane { name: unit.name(), busy: vec![0.0; 4] }).collect();
        let busy = UnitPlot { subject: "s", frame: 0, bin_s: 1e-6, units: busy };
        let lane =
            |unit: &Unit| StallLane { name: unit.name(), shares: vec![[0.0; 3]; 4], bottleneck: vec![] };
        let stalls =
            UnitPlot { subject: "s", frame: 0, bin_s: 1e-6, units: units.iter().map(lane).collect() };
        let plot_style = PlotStyle::default();
        for picture in [power.picture(&plot_style), busy.picture(&plot_style), stalls.picture(&plot_style)] {
            let colours = unit_colours(&picture);
            assert_eq!(colours.len(), units.len(), "{}", picture.title);
            for (name, rgb) in colours {
                let unit = Unit::ALL.into_iter().find(|unit| unit.name() == name).unwrap();
                assert_eq!(part_colour(Part::Unit(unit)).rgb, rgb, "{name} in {}", picture.title);
            }
        }
    }
}

/// Requirements of papers: a width in millimetres, letters in points, a caption of their own.
#[test]
fn pictures_are_as_wide_as_requested() {
    let chart = Chart::new(
        "Own title",
        "own subject",
        vec![ChartPanel::new("", ["x", "y"], vec![Series::curve("one", [(1.0, 1.0), (10.0, 5.0)])])],
    );
    let plot_style = PlotStyle { width_mm: Some(85.0), title: Some(String::new()), ..PlotStyle::default() };
    let picture = chart.picture(&plot_style);
    let svg = picture.svg().unwrap();
    assert!(svg.contains("width=\"85.00mm\"") && !svg.contains("own subject"), "{svg}");
    let pdf: String = picture.pdf().iter().map(|&byte| char::from(byte)).collect();
    assert!(pdf.contains("/MediaBox [0 0 240.9"), "85 mm are 240.94 points");
    let png = picture.png().unwrap();
    let width = u32::from_be_bytes([png[16], png[17], png[18], png[19]]);
    assert!(width.abs_diff(1004) <= 1, "85 mm at 300 pixels an inch: {width}");
    let titled = chart
        .picture(&PlotStyle { title: Some("Another".to_owned()), ..PlotStyle::default() })
        .svg()
        .unwrap();
    assert!(titled.contains("Another") && !titled.contains("Own title") && titled.contains("own subject"));
}

type Rgb = [f64; 3];
type Transform = [[f64; 3]; 3];

/// Normal vision, complete protanopia and deuteranopia, on linear RGB: Machado, Oliveira and Fernandes, "A
/// Physiologically-based Model for Simulation of Color Vision Deficiency", 2009, severity 1.
const VISIONS: [Transform; 3] = [
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [
        [0.152_286, 1.052_583, -0.204_868],
        [0.114_503, 0.786_281, 0.099_216],
        [-0.003_882, -0.048_116, 1.051_998],
    ],
    [
        [0.367_322, 0.860_646, -0.227_968],
        [0.280_085, 0.672_501, 0.047_413],
        [-0.011_820, 0.042_940, 0.968_881],
    ],
];

fn product(matrix: &Transform, v: Rgb) -> Rgb {
    [0, 1, 2].map(|row| (0..3).map(|column| matrix[row][column] * v[column]).sum())
}

fn linear(colour: Colour) -> Rgb {
    colour.rgb.map(|part| {
        let part = f64::from(part) / 255.0;
        if part <= 0.040_45 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }
    })
}

/// Oklab, in which distances are about as large as they look (B. Ottosson, 2020).
fn oklab(rgb: Rgb) -> Rgb {
    let cones = product(
        &[
            [0.412_221_470_8, 0.536_332_536_3, 0.051_445_992_9],
            [0.211_903_498_2, 0.680_699_545_1, 0.107_396_956_6],
            [0.088_302_461_9, 0.281_718_837_6, 0.629_978_700_5],
        ],
        rgb.map(|part| part.clamp(0.0, 1.0)),
    );
    product(
        &[
            [0.210_454_255_3, 0.793_617_785_0, -0.004_072_046_8],
            [1.977_998_495_1, -2.428_592_205_0, 0.450_593_709_9],
            [0.025_904_037_1, 0.782_771_766_2, -0.808_675_766_0],
        ],
        cones.map(f64::cbrt),
    )
}

/// Smallest difference of two colours over all kinds of vision.
fn distance(a: Colour, b: Colour) -> f64 {
    let in_vision = |vision: &Transform| {
        let [a, b] = [a, b].map(|colour| oklab(product(vision, linear(colour))));
        a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    };
    VISIONS.iter().map(in_vision).fold(f64::INFINITY, f64::min)
}

fn least(colours: &[Colour]) -> f64 {
    let pairs = colours.iter().enumerate().flat_map(|(i, a)| colours[..i].iter().map(|b| distance(*a, *b)));
    pairs.fold(f64::INFINITY, f64::min)
}

/// For comparison: the eight colours of Okabe and Ito are 0.076 apart by this measure.
#[test]
fn units_differ_in_every_vision() {
    let units = Unit::ALL.map(unit_colour);
    assert!(least(&units) > 0.12, "{}", least(&units));
    let neighbours = units.windows(2).map(|pair| distance(pair[0], pair[1])).fold(f64::INFINITY, f64::min);
    assert!(neighbours > 0.24, "{neighbours}");
    let parts = Part::ALL.map(part_colour);
    assert!(least(&parts) > 0.05, "{}", least(&parts));
}

#[test]
fn series_states_and_classes_differ_in_every_vision() {
    assert!(least(&SERIES) > 0.12 && least(&STATES) > 0.15 && least(&CLASSES) > 0.14);
    assert!(least(&[MEASURED, TRUTH, MARK, BACKGROUND]) > 0.14);
    assert!(SERIES.iter().all(|colour| distance(*colour, BACKGROUND) > 0.2), "seen on white");
}

#[test]
fn heat_grows_darker_in_every_vision() {
    for vision in &VISIONS {
        let lightness = |step: u32| oklab(product(vision, linear(heat(f64::from(step) / 20.0))))[0];
        assert!((0..20).all(|step| lightness(step) > lightness(step + 1) + 0.01));
    }
}

#[test]
fn a_unit_is_known_by_its_name() {
    assert!(Unit::ALL.into_iter().all(|unit| named_unit_colour(unit.name()) == Some(unit_colour(unit))));
    assert_eq!(named_unit_colour("leakage"), None);
}
