//! The public queries and scenes.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;
use workloads::collision::{Object, PairSearch, components, detect};
use workloads::visibility::load_mts;

use super::{SEARCHES, may_collide};

fn public() -> PathBuf {
    crate::common::real_scenes().join("../ccd")
}

fn files_below(folder: &Path, into: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files_below(&path, into);
        } else if path.extension().is_some_and(|kind| kind == "gz") {
            into.push(path);
        }
    }
}

/// The rows of a query file: a point, and whether the query is a collision.
fn rows(path: &Path) -> Vec<([f64; 3], bool)> {
    let file = BufReader::new(GzDecoder::new(std::fs::File::open(path).unwrap()));
    let row = |line: String| {
        let n: Vec<f64> = line.split(',').map(|cell| cell.trim().parse().unwrap()).collect();
        ([n[0] / n[1], n[2] / n[3], n[4] / n[5]], n[6] != 0.0)
    };
    file.lines().map(|line| line.unwrap()).filter(|line| !line.is_empty()).map(row).collect()
}

#[test]
#[cfg_attr(not(collision_data), ignore = "no folder ccd beside QUINTILE_SCENES")]
fn no_public_query_is_missed() {
    let folder = public();
    let mut files = Vec::new();
    files_below(&folder.join("queries"), &mut files);
    assert_eq!(files.len(), 42);
    let (mut collide, mut apart, mut reported) = (0, 0, [0; SEARCHES.len()]);
    for path in files {
        let vertex_face = path.parent().unwrap().ends_with("vertex-face");
        for (number, query) in rows(&path).chunks(8).enumerate() {
            let [from, to] = [0, 4].map(|end| [0, 1, 2, 3].map(|corner| query[end + corner].0));
            let pair = if vertex_face {
                [[from, to].map(|p| [p[0]; 3]), [from, to].map(|p| [p[1], p[2], p[3]])]
            } else {
                [[from, to].map(|p| [p[0], p[1], p[1]]), [from, to].map(|p| [p[2], p[3], p[3]])]
            };
            for (search, reported) in SEARCHES.iter().zip(&mut reported) {
                // Each query is searched by the coarsest search, and by another one in turn.
                if *search != SEARCHES[0] && *search != SEARCHES[number % SEARCHES.len()] {
                    continue;
                }
                let found = may_collide(pair[0], pair[1], search);
                assert!(found || !query[0].1, "{}: {pair:?} missed by {search:?}", path.display());
                *reported += u32::from(found && !query[0].1);
            }
            if query[0].1 { collide += 1 } else { apart += 1 }
        }
    }
    println!("{collide} collide, {apart} do not; false positives by search: {reported:?}");
    assert!(collide > 0 && apart > 0 && reported[6] < reported[0]);
}

/// Pairs that truly collide in the public scenes (the `README.md` beside them): their number, and that of all
/// pairs.
#[test]
#[cfg_attr(not(collision_data), ignore = "no folder ccd beside QUINTILE_SCENES")]
fn public_scenes_keep_every_pair_that_collides() {
    let folder = public();
    let search = PairSearch { resolution: 32, bins: 4, ..PairSearch::default() };
    for (name, objects, colliding) in [
        ("cloth-ball", 2, 0),
        ("cloth-funnel", 4, 0),
        ("armadillo-rollers", 7, 2),
        ("n-body", 305, 125),
        ("rod-twist", 4, 6),
    ] {
        let meshes = load_mts(&folder.join(format!("{name}.mts.gz"))).unwrap();
        assert_eq!(meshes.len(), objects, "{name}");
        let all: Vec<_> = meshes.iter().map(|mesh| Object::new(mesh, 0.0).unwrap()).collect();
        let start = std::time::Instant::now();
        let answers = detect(&all, &search);
        let found = answers.iter().filter(|answer| answer.verdict.may_collide()).count();
        println!(
            "{name}: {} candidates, {found} may collide, {colliding} do; {:.0} ms",
            answers.len(),
            start.elapsed().as_secs_f64() * 1e3
        );
        assert!(found >= colliding, "{name}: {found} of {colliding}");
        assert_eq!(components(&meshes[0]).len(), 1, "{name}");
    }
}
