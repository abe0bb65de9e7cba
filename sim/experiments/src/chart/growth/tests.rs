use super::*;
use crate::study::written;

/// No more than there has to be.
const LEAST: Effort = Effort {
    side_px: 32,
    repeats: 1,
    triangles: &[50, 100, 200],
    samples: &[1, 4],
    blur_px: &[0.0, 2.0, 8.0, 32.0],
    base: Base { triangles: 50, samples: 4, blur_px: 4.0 },
};

fn point(triangles: u32, cpu_s: f64) -> Point {
    let (motion_px, defocus_px) = (0.0, 0.0);
    Point { triangles, samples_per_pixel: 1, motion_px, defocus_px, cpu_s, sample_tests: 7, hits: 0 }
}

#[test]
fn the_upper_half_is_fitted_and_no_more() {
    // A floor of 1 s up to a hundred, beyond it n^1.5.
    let time = |n: u32| (n, f64::from(n).powf(1.5) / 1e3);
    let points = [1, 10, 100, 1_000, 10_000].map(time).map(|(n, s)| point(n, s.max(1.0)));
    let row = Row::new(Sweep::Triangles, Kind::Still, points.into());
    assert!((row.fitted_from - 100.0).abs() < 1e-9);
    assert!((row.exponent.unwrap() - 1.5).abs() < 1e-12, "{:?}", row.exponent);
    assert!(row.tests_exponent.unwrap().abs() < 1e-12);
    assert_eq!(Row::new(Sweep::Triangles, Kind::Still, Vec::new()).exponent, None);
}

#[test]
fn what_is_counted_is_the_same_each_time_and_grows_with_blur() {
    let tests = |chart: &GrowthChart| -> Vec<Vec<u64>> {
        let points = |row: &Row| row.points.iter().map(|point| point.sample_tests).collect();
        chart.rows.iter().map(points).collect()
    };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| GrowthChart::measure(LEAST, &[], &Progress::new(true))).unwrap()
    };
    let chart = with(1);
    assert_eq!(tests(&chart), tests(&with(3)));
    for row in &chart.rows {
        assert!(row.points.iter().all(|point| point.cpu_s > 0.0 && point.hits > 0), "{row:?}");
        if row.sweep == Sweep::Blur {
            let [still, .., much] = &row.points[..] else { panic!("{row:?}") };
            assert_eq!(still.motion_px + still.defocus_px, 0.0);
            assert!(much.sample_tests > still.sample_tests, "{row:?}");
        }
    }
}

#[test]
fn the_files_are_all_there_and_agree() {
    let (folder, chart, done) = written::<GrowthChart>(LEAST);
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let json: serde_json::Value = serde_json::from_str(&read("growth.json")).unwrap();
    // Triangles and samples in four kinds, blur in three.
    assert_eq!(json["rows"].as_array().unwrap().len(), 11);
    assert_eq!(json["rows"][0]["exponent"].as_f64(), chart.rows[0].exponent);
    assert_eq!(read("growth.csv").lines().count(), 1 + 4 * 3 + 4 * 2 + 3 * 4);
    assert!(read("growth.csv").lines().nth(1).unwrap().starts_with("triangles,still,"));
    assert!(read("growth.md").contains("| blur | both |") && done.text.contains("32x32 pixels"));
    assert!(read("growth.svg").ends_with("</svg>\n"));
}
