//! CPU time of collision detection on the public scenes, without reading the files.
//!
//! `cargo bench -p workloads --bench collision -- FOLDER [RESOLUTION BINS]`, with the scenes in FOLDER.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run may as well panic")]

use std::path::PathBuf;

use cpu_time::ProcessTime;
use workloads::collision::load_cases;
use workloads::collision::{Object, PairSearch, detect};

/// Measurements per scene; the median counts.
const ROUNDS: usize = 5;

fn main() {
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    let Some(folder) = words.next() else { return println!("name the folder of the scenes") };
    let mut search = PairSearch::default();
    let mut number = |default| words.next().map_or(default, |word| word.parse().unwrap());
    (search.resolution, search.bins) = (number(search.resolution), number(search.bins));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    println!("scene triangles pairs may_collide seen ms Mpairs_of_triangles_per_s");
    for name in ["cloth-funnel", "armadillo-rollers", "cloth-ball", "n-body", "rod-twist"] {
        let file = PathBuf::from(&folder).join(format!("{name}.mts.gz"));
        if !file.is_file() {
            continue;
        }
        let case = load_cases(&[file]).unwrap().remove(0);
        let mut times = Vec::new();
        let mut line = String::new();
        for _ in 0..ROUNDS {
            let started = ProcessTime::now();
            let object = |mesh| Object::new(mesh, case.uncertainty).unwrap();
            let objects: Vec<Object> = case.objects.iter().map(object).collect();
            let answers = pool.install(|| detect(&objects, &search));
            let ms = started.elapsed().as_secs_f64() * 1e3;
            times.push(ms);
            let may = answers.iter().filter(|answer| answer.verdict.may_collide()).count();
            let seen = answers
                .iter()
                .filter(|a| matches!(a.verdict, workloads::collision::PairVerdict::Maybe { seen: true, .. }))
                .count();
            let triangles: usize = objects.iter().map(Object::len).sum();
            let product: f64 =
                answers.iter().map(|a| objects[a.a].len() as f64 * objects[a.b].len() as f64).sum();
            line = format!("{name} {triangles} {} {may} {seen}", answers.len());
            line += &format!(" {{ms}} {:.0}", product / 1e6 / (ms * 1e-3));
        }
        times.sort_by(f64::total_cmp);
        println!("{}", line.replace("{ms}", &format!("{:.0}", times[ROUNDS / 2])));
    }
}
