use super::intervals::Pairs;
use super::methods::{METHODS, combinations};
use super::subject::{Subject, differing};
use super::*;
use pipeline::Features;
use pipeline::traversal::Box5;
use workloads::stress::StressScene;
use workloads::visibility::Unshaded;

const SIZE: Size = Size::SMALL;

fn with<T>(scene: &StressScene, run: impl FnOnce(&Subject<'_>) -> T) -> T {
    let gpu = GpuSpec::load("reference").unwrap();
    let draws = [scene.draw(&Unshaded).unwrap()];
    let (camera, viewport, samples) = (&scene.camera, scene.viewport, &scene.samples);
    run(&Subject { camera, viewport, samples, draws: &draws, spec: &gpu.pipeline })
}

fn text(report: &Report) -> String {
    report.tables()[0].text().unwrap()
}

#[test]
fn no_box_leaves_out_what_truly_touches() {
    for family in families() {
        for &value in family.sweep(true) {
            let scene = family.scene(value, SIZE, 5).unwrap();
            with(&scene, |subject| {
                let pairs = Pairs::of(subject, 60);
                for (name, features) in combinations() {
                    let found = pairs.under(&features);
                    assert_eq!(found.pairs_wrong, 0, "{} at {value}: {name}: {found:?}", family.name);
                    assert!(found.tightness <= 1.0 + 1e-9, "{} at {value}: {name}: {found:?}", family.name);
                }
            });
        }
    }
}

/// A deliberately wrong bound: what it does to a right one.
type Mutant = fn(Box5) -> Option<Box5>;

/// Bounds made wrong on purpose: the measurement has to see each of them.
#[test]
fn a_box_too_small_is_counted_as_wrong() {
    let cases: [(&str, usize, Mutant); 4] = [
        ("speed", 3, |b| Some(Box5 { t: [b.t[0], b.t[1] - 0.01], ..b })),
        ("large-lens", 2, |b| Some(Box5 { u: [b.u[0] + 0.05, b.u[1]], ..b })),
        ("defocus", 3, |b| Some(Box5 { v: [b.v[0], b.v[1] - 0.05], ..b })),
        ("slivers", 2, |b| (b.t[0] > 0.0).then_some(b)),
    ];
    for (name, place, mutant) in cases {
        let family = family(name).unwrap();
        let scene = family.scene(family.values[place], Size { side_px: 32, triangles: 100 }, 5).unwrap();
        with(&scene, |subject| {
            let pairs = Pairs::of(subject, 300);
            let sides = METHODS[2].features;
            let right = pairs.bounded(|place, triangle| place.bound(&sides, triangle));
            let wrong = pairs.bounded(|place, triangle| place.bound(&sides, triangle).and_then(mutant));
            assert_eq!(right.pairs_wrong, 0, "{name}");
            assert!(wrong.pairs_wrong > 0, "{name}: {wrong:?}");
        });
    }
}

#[test]
fn lost_samples_are_counted_and_the_report_is_not_clean() {
    let family = family("speed").unwrap();
    let gpu = GpuSpec::load("reference").unwrap();
    let rows = measure::measure(family, 0.1, SIZE, &gpu, &METHODS).unwrap();
    let mut report = Report { families: vec![family], size: SIZE, rows, auto: Choices::default() };
    assert!(report.is_clean(), "{}", text(&report));
    assert_eq!(report.rows[0].held_against, "brute force");
    let scene = family.scene(0.1, SIZE, 1).unwrap();
    let mut other = scene.clone();
    other.triangles.truncate(scene.triangles.len() / 2);
    let lost = with(&scene, |whole| {
        with(&other, |half| differing(&half.seen(Features::ALL).unwrap(), &whole.reference().unwrap().0))
    });
    assert!(lost > 0);
    report.rows[3].samples_lost = lost;
    assert!(!report.is_clean());
    assert!(text(&report).contains(&format!("{lost} samples lost")), "{}", text(&report));
}

#[test]
fn the_best_method_is_the_measure_of_all() {
    let gpu = GpuSpec::load("reference").unwrap();
    for (name, value) in [("speed", 1.0), ("diagonals", 128.0)] {
        let rows = measure::measure(family(name).unwrap(), value, SIZE, &gpu, &METHODS).unwrap();
        let least = rows.iter().map(|row| row.over_best).fold(f64::INFINITY, f64::min);
        assert_eq!(least, 1.0);
        assert!(rows[0].over_best > 1.0, "the bounding box alone is not the best on {name}");
        assert!(rows.iter().all(|row| row.work.samples_hit > 0));
    }
}

/// Families on which no set of tests is best at all values, and some that were hard to choose on; `quintile stress` has all.
#[test]
fn auto_is_as_good_as_the_best_fixed_choice_on_a_family() {
    let gpu = GpuSpec::load("reference").unwrap();
    for (name, seed) in [("shared-edges", 4), ("slivers", 5), ("through-lens", 6), ("speed", 7)] {
        let family = family(name).unwrap();
        let values = family.sweep(true).par_iter();
        let trials = values.map(|&value| choice::trial(family, value, Size::QUICK, seed, &gpu).unwrap());
        let choices = Choices::new(&trials.collect::<Vec<_>>());
        assert_eq!(choices.families_over(), 0, "{}", choices.text());
    }
}

#[test]
fn an_unknown_family_is_told_with_the_known_ones() {
    let error = family_named("splinters").err().unwrap();
    assert!(error.is_usage());
    assert!(error.to_string().contains("splinters") && error.to_string().contains("slivers"), "{error}");
}
