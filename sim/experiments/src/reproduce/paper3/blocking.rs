//! Rows III-4 and III-5: what a blocking finish at the end of each frame does to a measurement.

use output::plot::Series;
use power_model::{Circumstances, FramePower};
use run::RunError;
use traces::energy::{Pooled, pooled};

use super::super::report::{ENERGY, POWER, TIME, level, line};
use super::super::row::{Cases, ClaimRow, numbers, one_at_a_time};
use super::super::stage::{MARKED, Stage, looped, objects};
use super::super::{Done, Figure};
use super::{Bench, BlockingPhone, FRAME, settled};

fn blocked(seed: u64) -> Circumstances {
    Circumstances { blocking_finish: true, ..settled(seed) }
}

/// The mean at each place over several lists.
fn means(lists: &[Vec<f64>]) -> Vec<f64> {
    let places = lists.iter().map(Vec::len).min().unwrap_or(0);
    (0..places).map(|place| lists.iter().map(|list| list[place]).sum::<f64>() / lists.len() as f64).collect()
}

/// The least or most time for which a frame is worked on, ms.
fn work_ms(frames: &[FramePower], pick: fn(f64, f64) -> f64) -> f64 {
    frames.iter().map(|frame| 1e3 * frame.duration_s()).reduce(pick).unwrap_or(f64::NAN)
}

/// Results of both methods for the frames of the phone's sequence.
struct Methods {
    new: Vec<f64>,
    old: Vec<f64>,
}

impl Methods {
    /// On a machine that draws these frames.
    fn of(bench: &Bench<'_>, stage: &Stage, frames: &[FramePower]) -> Result<Self, RunError> {
        let shown: Vec<&FramePower> = frames.iter().collect();
        let (mut new, mut old) = (Vec::new(), Vec::new());
        for seed in 1..=bench.repeats() {
            let plain = bench.on(stage, &shown, settled(seed))?;
            // The paper's phone application records its own timestamps, which its frames are cut by.
            new.push(plain.by_timestamps_j());
            old.push(bench.on(stage, &shown, blocked(seed + 1000))?.begin_to_finish_j());
        }
        Ok(Self { new: means(&new), old: means(&old) })
    }

    fn higher(&self) -> usize {
        self.new.iter().zip(&self.old).filter(|(new, old)| old > new).count()
    }

    fn lower(&self) -> usize {
        self.new.len() - self.higher()
    }

    /// As a band has it: the share of frames for which the old method gives more, and whether it errs both ways.
    fn judged(&self) -> (f64, bool) {
        (self.higher() as f64 / self.new.len() as f64, self.higher() > 0 && self.lower() > 0)
    }

    /// The least or most that the old method gives more, mJ.
    fn gain_mj(&self, pick: fn(f64, f64) -> f64) -> f64 {
        self.new.iter().zip(&self.old).map(|(new, old)| 1e3 * (old - new)).reduce(pick).unwrap_or(0.0)
    }
}

/// III-4: on the phone the old method gives more for some frames and less for others.
pub(super) fn phone(bench: &Bench<'_>) -> Result<Done, RunError> {
    let with = bench.with(|settings| &settings.iii_4);
    let (row, form) = (with.settings, with.form);
    let (waiting_w, idle_w, edge) = (*row.waiting_w.get(form), *row.idle_w.get(form), *row.edge.get(form));
    let base_stage = Stage::phone_idling(idle_w)?.waiting(waiting_w)?;
    let mut waits = row.waiting_w.all(form).to_vec();
    waits.sort_by(f64::total_cmp);
    let at = waits.iter().map(|&waiting_w| {
        let stage = base_stage.clone().waiting(waiting_w)?;
        let (share, both) = Methods::of(bench, &stage, &bench.phone_frames)?.judged();
        Ok((waiting_w, share, both))
    });
    let at: Vec<_> = at.collect::<Result<_, RunError>>()?;
    let mut tried = Cases::new(
        "share of frames for which the old method gives more",
        "waiting_w, idle_w and edge one at a time about the values given",
    );
    let over_waiting = at.iter().map(|(waiting_w, share, _)| (*waiting_w, *share)).collect();
    tried.along("waiting_w", at).with_base(waiting_w);
    tried.along("idle_w", over_idle(bench, row, waiting_w)?).with_base(idle_w);
    tried.along("edge", over_edge(bench, row, &base_stage)?).with_base(edge);
    let full = one_at_a_time([row.waiting_w.values(), row.idle_w.values(), row.edge.values()]);
    let band = tried.band(full)?;
    let base = Methods::of(bench, &base_stage, &bench.phone_frames)?;
    let (least, most) = (base.gain_mj(f64::min), base.gain_mj(f64::max));
    let ours = format!(
        "with {waiting_w} W waiting, {idle_w} W idle and objects of {edge}: of {} frames the old method gives more for {} and less for {} \
         ({least:+.1} to {most:+.1} mJ, {} repetitions)",
        base.new.len(),
        base.higher(),
        base.lower(),
        bench.repeats()
    );
    let facts = numbers([
        ("shortest_work_ms", work_ms(&bench.phone_frames, f64::min)),
        ("longest_work_ms", work_ms(&bench.phone_frames, f64::max)),
        ("frames_higher", base.higher() as f64),
        ("frames_lower", base.lower() as f64),
        ("least_difference_mJ", least),
        ("most_difference_mJ", most),
    ]);
    let recordings = 2 * bench.repeats() * (1 + band.cases.len() as u64);
    let ran = numbers([
        ("frames_simulated", bench.phone_frames.len() as f64),
        ("recordings", recordings as f64),
        ("frames_recorded", (recordings * base.new.len() as u64) as f64),
    ]);
    let figures = vec![by_objects(bench, &base), turning(over_waiting), three_frames(bench)?];
    Ok(Done { row: ClaimRow { numbers: facts, ran, ..with.banded(&row.about, ours, band) }, figures })
}

/// A value, the share of frames for which the old method gives more, and whether it errs both ways.
type Judged = Vec<(f64, f64, bool)>;

/// Other draws between frames.
fn over_idle(bench: &Bench<'_>, row: &BlockingPhone, waiting_w: f64) -> Result<Judged, RunError> {
    let all = row.idle_w.all(bench.form);
    let one = |&idle_w: &f64| {
        let stage = Stage::phone_idling(idle_w)?.waiting(waiting_w)?;
        let frames = stage.phone_sequence(*row.edge.get(bench.form), bench.phone_step(), bench.progress)?;
        let (share, both) = Methods::of(bench, &stage, &frames)?.judged();
        Ok((idle_w, share, both))
    };
    if all.len() < 2 { Ok(Vec::new()) } else { all.iter().map(one).collect() }
}

/// Objects of other sizes, so that frames take longer or shorter.
fn over_edge(bench: &Bench<'_>, row: &BlockingPhone, stage: &Stage) -> Result<Judged, RunError> {
    let all = row.edge.all(bench.form);
    let one = |&edge: &f64| {
        let frames = stage.phone_sequence(edge, bench.phone_step(), bench.progress)?;
        let (share, both) = Methods::of(bench, stage, &frames)?.judged();
        Ok((edge, share, both))
    };
    if all.len() < 2 { Ok(Vec::new()) } else { all.iter().map(one).collect() }
}

/// Figure 6.
fn by_objects(bench: &Bench<'_>, methods: &Methods) -> Figure {
    let drawn = |place: usize| f64::from(objects(bench.phone_step() * place as u32));
    let points = |list: &[f64]| -> Vec<(f64, f64)> {
        let mut points: Vec<_> =
            list.iter().enumerate().map(|(place, value)| (drawn(place), *value)).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    Figure::lines(
        "III_fig6",
        "Two methods on the phone (Paper III, Figure 6)",
        "energy of each frame of the synthetic sequence over its objects, mean of all repetitions",
        [("objects in the frame", ""), ENERGY],
        vec![
            Series::curve("new: start to start", points(&methods.new)),
            Series::curve("old: blocking, begin to finish", points(&methods.old)),
        ],
    )
}

/// The sweep of what the waiting processor draws.
fn turning(shares: Vec<(f64, f64)>) -> Figure {
    Figure::lines(
        "III_blocking_sweep",
        "Frames for which the old method gives more (Paper III, section 5.2)",
        "over what the waiting processor draws, which the paper does not give; the row holds between 0 and 1",
        [("power of the waiting processor", "W"), ("share of frames", "")],
        vec![line("share of the phone's frames", shares)],
    )
}

/// Figure 7: one frame when settled, just after launch, and with a blocking finish.
fn three_frames(bench: &Bench<'_>) -> Result<Figure, RunError> {
    let shown = vec![bench.frame(); 3 * FRAME];
    let curve = |circumstances| -> Result<_, RunError> {
        let run = bench.on_phone(&shown, circumstances)?;
        let frame = &run.truth.frames[FRAME];
        Ok(run.points(frame.start_s, frame.end_s))
    };
    let series = vec![
        line("settled", curve(settled(1))?),
        line("soon after launch", curve(Circumstances { launch: true, ..settled(1) })?),
        line("blocking finish", curve(blocked(1))?),
    ];
    Ok(Figure::lines(
        "III_fig7",
        "One frame in three ways (Paper III, Figure 7)",
        "a frame of the phone's sequence, recorded at 40 kHz",
        [TIME, POWER],
        series,
    ))
}

/// Energies with a blocking finish and without.
struct Both {
    with: Pooled,
    without: Pooled,
}

impl Both {
    fn of(bench: &Bench<'_>, stage: &Stage) -> Result<Self, RunError> {
        Ok(Self { with: pool(bench, stage, blocked, 1)?, without: pool(bench, stage, settled, 2000)? })
    }

    fn difference_j(&self) -> f64 {
        (self.with.mean - self.without.mean).abs()
    }

    /// As a band has it: the difference over the smaller deviation, and whether it is below 1.
    fn judged(&self) -> (f64, bool) {
        let over = self.difference_j() / self.with.deviation.min(self.without.deviation);
        (over, over < 1.0)
    }
}

/// Recordings of the PC's animation, pooled.
fn pool(
    bench: &Bench<'_>,
    stage: &Stage,
    how: fn(u64) -> Circumstances,
    first: u64,
) -> Result<Pooled, RunError> {
    let shown_frames = looped(&bench.pc_frames, bench.recorded_frames());
    let run = |seed| {
        let run = bench.on(stage, &shown_frames, how(seed))?;
        Ok(run.by_true_frame_j(&run.find(MARKED)?))
    };
    let runs = (first..first + bench.repeats()).map(run);
    let runs: Vec<Vec<Option<f64>>> = runs.collect::<Result<_, RunError>>()?;
    Ok(by_frame(&runs, bench.pc_frames.len()))
}

/// III-5: on the PC it changes nothing.
pub(super) fn pc(bench: &Bench<'_>) -> Result<Done, RunError> {
    let row_with = bench.with(|settings| &settings.iii_5);
    let (row, form) = (row_with.settings, row_with.form);
    let (waiting_w, background_w) = (*row.waiting_w.get(form), *row.background_w.get(form));
    let stage = bench.pc.clone().waiting(waiting_w)?.disturbed(background_w)?;
    let base = Both::of(bench, &stage)?;
    let mut waits = row.waiting_w.all(form).to_vec();
    waits.sort_by(f64::total_cmp);
    let at = waits.iter().map(|&other_w| {
        let other =
            (other_w != waiting_w).then(|| Both::of(bench, &stage.clone().waiting(other_w)?)).transpose()?;
        let (over, below) = other.as_ref().unwrap_or(&base).judged();
        Ok((other_w, over, below))
    });
    let mut tried = Cases::new(
        "difference of the means over the smaller deviation",
        "waiting_w and background_w one at a time about the values given",
    );
    let at: Vec<_> = at.collect::<Result<_, RunError>>()?;
    let over_waiting = at.iter().map(|(watts, over, _)| (*watts, *over)).collect();
    tried.along("waiting_w", at).with_base(waiting_w);
    if row.background_w.all(form).len() > 1 {
        let at = row.background_w.all(form).iter().map(|&other_w| {
            let other = (other_w != background_w)
                .then(|| Both::of(bench, &stage.clone().disturbed(other_w)?))
                .transpose()?;
            let (over, below) = other.as_ref().unwrap_or(&base).judged();
            Ok((other_w, over, below))
        });
        tried.along("background_w", at.collect::<Result<Vec<_>, RunError>>()?).with_base(background_w);
    }
    let full = one_at_a_time([row.waiting_w.values(), row.background_w.values()]);
    let band = tried.band(full)?;
    let Both { with, without } = &base;
    let ours = format!(
        "with {waiting_w} W waiting and {background_w} W of services: {} with, {} without, {} and {} frames",
        shown(with),
        shown(without),
        with.values,
        without.values
    );
    let facts = numbers([
        ("shortest_work_ms", work_ms(&bench.pc_frames, f64::min)),
        ("longest_work_ms", work_ms(&bench.pc_frames, f64::max)),
        ("with_mean_J", with.mean),
        ("with_pooled_deviation_J", with.deviation),
        ("without_mean_J", without.mean),
        ("without_pooled_deviation_J", without.deviation),
        ("difference_J", base.difference_j()),
    ]);
    let recordings = 2 * bench.repeats() * (band.tried as u64);
    let ran = numbers([
        ("frames_simulated", bench.pc_frames.len() as f64),
        ("recordings", recordings as f64),
        ("frames_found_with_and_without", (with.values + without.values) as f64),
    ]);
    let row = ClaimRow { numbers: facts, ran, ..row_with.banded(&row.about, ours, band) };
    Ok(Done { row, figures: vec![over_deviation(over_waiting)] })
}

/// The sweep of what the waiting processor draws.
fn over_deviation(points: Vec<(f64, f64)>) -> Figure {
    let ends = |pick: fn(f64, f64) -> f64| points.iter().map(|point| point.0).reduce(pick).unwrap_or(0.0);
    let (from, to) = (ends(f64::min), ends(f64::max));
    Figure::lines(
        "III_finish_sweep",
        "What a blocking finish changes on the PC (Paper III, section 5.2)",
        "difference of the mean energies over the smaller pooled deviation; 0.02 W was chosen because the paper finds very little difference",
        [("power of the waiting processor", "W"), ("difference over deviation", "")],
        vec![line("computed", points), level("the row holds below", from, to, 1.0)],
    )
}

/// Repetitions pooled by frame of the animation: the standard deviation is that of one frame drawn again and again.
fn by_frame(runs: &[Vec<Option<f64>>], animation: usize) -> Pooled {
    let mut groups = vec![Vec::new(); animation];
    for run in runs {
        for (place, energy) in run.iter().enumerate() {
            groups[place % animation].extend(energy);
        }
    }
    pooled(&groups).unwrap_or(Pooled { runs: 0, values: 0, mean: f64::NAN, deviation: f64::NAN })
}

fn shown(pool: &Pooled) -> String {
    format!("{:.2} ({:.2}) mJ", 1e3 * pool.mean, 1e3 * pool.deviation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_differ_within_the_animation_do_not_widen_the_pool() {
        // Two frames, of 1 J and of 5 J, each with a deviation of 0.1 J over three repetitions; one was not found.
        let runs = [[0.9, 4.9], [1.0, 5.0], [1.1, 5.1]].map(|run| run.map(Some).to_vec());
        let pool = by_frame(&runs, 2);
        assert_eq!(pool.values, 6);
        assert!((pool.mean - 3.0).abs() < 1e-12 && (pool.deviation - 0.1).abs() < 1e-12, "{pool:?}");
        let looped = by_frame(&[vec![Some(0.9), Some(4.9), Some(1.1), None]], 2);
        assert!((looped.deviation - libm::sqrt(0.02)).abs() < 1e-12 && looped.values == 3);
        assert!(by_frame(&[], 2).mean.is_nan());
    }

    #[test]
    fn means_are_taken_place_by_place() {
        assert_eq!(means(&[vec![1.0, 5.0], vec![3.0, 7.0]]), [2.0, 6.0]);
        assert!(means(&[]).is_empty());
    }
}
