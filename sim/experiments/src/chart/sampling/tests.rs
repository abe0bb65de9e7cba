use super::*;
use crate::chart::image::neighbours;
use crate::study::written;

/// Small enough for a test.
const SMALL: Effort = Effort {
    scene: ("tiny", 1),
    size: [64, 48],
    most_samples: 32,
    reference_frames: 4,
    reference_samples: 256,
    seeds: 2,
    every_up_to: 2,
};

/// No more than there has to be.
const LEAST: Effort =
    Effort { size: [16, 9], most_samples: 2, reference_frames: 1, reference_samples: 8, ..SMALL };

fn row<'a>(rows: &'a [Row], scene: &str, table: &str) -> &'a Row {
    rows.iter().find(|row| row.scene == scene && row.table == table).unwrap()
}

#[test]
fn random_converges_as_theory_says_and_the_default_faster() {
    let chart = SamplingChart::measure(SMALL, &[], &Progress::new(true)).unwrap();
    for scene in ["motion", "defocus", "motion and defocus"] {
        // Independent samples: the error of the mean falls with the root of their number.
        let random = row(&chart.rows, scene, "random").exponent.unwrap();
        assert!((random + 0.5).abs() < 0.06, "{scene}: {random}");
        let owen = row(&chart.rows, scene, "owen");
        assert!(owen.exponent.unwrap() < -0.6, "{scene}: {:?}", owen.exponent);
        let last = |row: &Row| row.points[row.points.len() - 1].rmse;
        assert!(last(owen) < 0.8 * last(row(&chart.rows, scene, "random")), "{scene}");
    }
    // The fence: half of it seen at random, so one sample errs by a half in every channel.
    let fence = row(&chart.failures.many_edges, "fence", "random");
    assert!((fence.points[0].rmse - 0.5).abs() < 0.02, "{}", fence.points[0].rmse);
    let owen = row(&chart.failures.many_edges, "fence", "owen").exponent.unwrap();
    assert!(owen > -0.6, "the default table has nothing to gain there: {owen}");
}

#[test]
fn the_numbers_do_not_depend_on_threads() {
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let chart = pool.install(|| SamplingChart::measure(LEAST, &[], &Progress::new(true))).unwrap();
        let errors = chart.rows.iter().flat_map(|row| &row.points).map(|point| point.rmse.to_bits());
        errors.collect::<Vec<_>>()
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn equal_errors_are_alike_and_alternating_ones_opposite() {
    let row = |signs: [f64; 4]| signs.iter().flat_map(|s| [*s; 3]).collect::<Vec<_>>();
    assert_eq!(neighbours(&row([1.0; 4]), 4), 1.0);
    assert_eq!(neighbours(&row([1.0, -1.0, 1.0, -1.0]), 4), -1.0);
    assert_eq!(neighbours(&row([0.0; 4]), 4), 0.0);
    assert_eq!(neighbours(&row([1.0; 4]), 1), 0.0, "a column has no neighbours");
}

#[test]
fn the_files_are_all_there_and_agree() {
    let (folder, chart, _) = written::<SamplingChart>(LEAST);
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let json: serde_json::Value = serde_json::from_str(&read("sampling.json")).unwrap();
    assert_eq!(json["rows"].as_array().unwrap().len(), chart.rows.len());
    assert_eq!(json["reference_samples_per_pixel"], 8);
    let (three, five, two) = (3, 5, 2);
    // Header; scene, table, samples; numbers of samples one by one; the fence.
    assert_eq!(read("sampling.csv").lines().count(), 1 + three * five * two + three * two + five * two);
    assert!(read("sampling.md").contains("| motion | owen |"));
    for stem in SamplingChart::PICTURES {
        assert!(read(&format!("{stem}.svg")).ends_with("</svg>\n"));
    }
}
