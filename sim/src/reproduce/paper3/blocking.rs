//! Rows III-4 and III-5: what a blocking finish at the end of each frame does to a measurement.

use power_model::{Circumstances, FramePower};
use traces::energy::{Pooled, pooled};

use super::super::figure::{ENERGY, POWER, TIME, dots, line};
use super::super::recording::MARKED;
use super::super::row::{Kind, Row, Verdict, numbers};
use super::super::{Done, Figure, scenes};
use super::{Bench, FRAME, settled};
use crate::run::RunError;

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

/// III-4: on the phone the old method gives more for some frames and less for others.
pub(super) fn phone(bench: &Bench<'_>) -> Result<Done, RunError> {
    let shown: Vec<&FramePower> = bench.phone_frames.iter().collect();
    let (mut new, mut old) = (Vec::new(), Vec::new());
    for seed in 1..=bench.effort.repeats {
        let plain = bench.on_phone(&shown, settled(seed))?;
        // The paper's phone application records its own timestamps, which its frames are cut by.
        new.push(plain.by_timestamps_j());
        old.push(bench.on_phone(&shown, blocked(seed + 1000))?.begin_to_finish_j());
    }
    let (new, old) = (means(&new), means(&old));
    let higher = new.iter().zip(&old).filter(|(new, old)| old > new).count();
    let lower = new.len() - higher;
    let gain = |pick: fn(f64, f64) -> f64| {
        new.iter().zip(&old).map(|(new, old)| 1e3 * (old - new)).reduce(pick).unwrap_or(0.0)
    };
    let (least, most) = (gain(f64::min), gain(f64::max));
    let row = Row {
        id: "III-4",
        kind: Kind::Order,
        claim: "blocking raises the phone's power and leaves out idle: the old method errs both ways",
        paper: "glFinish raises rendering power, idle is not measured: some frames higher, some lower (Figure 6, 7)",
        ours: format!(
            "of {} frames the old method gives more for {higher} and less for {lower} ({least:+.1} to {most:+.1} mJ, {} repetitions)",
            new.len(),
            bench.effort.repeats
        ),
        verdict: Verdict::of(higher > 0 && lower > 0),
        note: format!(
            "holds where both happen. The {} W of a waiting processor and the {} W of idle are assumed; a frame that works for less than \
             their share of a period comes out lower",
            bench.phone.finish()?.waiting_w.value(),
            bench.phone.platform.idle_w.value()
        ),
        numbers: numbers([
            ("shortest_work_ms", work_ms(&bench.phone_frames, f64::min)),
            ("longest_work_ms", work_ms(&bench.phone_frames, f64::max)),
            ("frames_higher", higher as f64),
            ("frames_lower", lower as f64),
            ("least_difference_mJ", least),
            ("most_difference_mJ", most),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    let objects = |place: usize| f64::from(scenes::objects(bench.effort.phone_step * place as u32));
    let points =
        |list: &[f64]| list.iter().enumerate().map(|(place, value)| (objects(place), *value)).collect();
    let methods = Figure::lines(
        "III_fig6",
        "Two methods on the phone (Paper III, Figure 6)",
        "energy of each frame of the synthetic sequence over its objects, mean of all repetitions",
        [("objects in the frame", ""), ENERGY],
        vec![dots("new: start to start", points(&new)), dots("old: blocking, begin to finish", points(&old))],
    );
    Ok(Done { row, figures: vec![methods, three_frames(bench)?] })
}

/// Figure 7: one frame when settled, just after launch, and with a blocking finish.
fn three_frames(bench: &Bench<'_>) -> Result<Figure, RunError> {
    let shown = vec![bench.frame(); 3 * FRAME];
    let curve = |circumstances| -> Result<_, RunError> {
        let recording = bench.on_phone(&shown, circumstances)?;
        let frame = &recording.truth.frames[FRAME];
        Ok(recording.points(frame.start_s, frame.end_s))
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

/// III-5: on the PC it changes nothing.
pub(super) fn pc(bench: &Bench<'_>) -> Result<Done, RunError> {
    let pacing = bench.pc.capped()?;
    let [with, without] = [(blocked as fn(u64) -> Circumstances, 1), (settled, 2000)].map(
        |(how, first)| -> Result<_, RunError> {
            let run = |seed| {
                let recording = bench.on_pc(pacing, how(seed))?;
                Ok(recording.by_true_frame_j(&recording.find(MARKED)?))
            };
            let runs = (first..first + bench.effort.repeats).map(run);
            let runs: Vec<Vec<Option<f64>>> = runs.collect::<Result<_, RunError>>()?;
            Ok(by_frame(&runs, bench.pc_frames.len()))
        },
    );
    let (with, without) = (with?, without?);
    let difference_j = (with.mean - without.mean).abs();
    let least_j = with.deviation.min(without.deviation);
    let row = Row {
        id: "III-5",
        kind: Kind::Number,
        claim: "on the HD 4000 blocking changes nothing",
        paper: "629.73 (21.07) mJ with glFinish, 630.18 (19.02) mJ without",
        ours: format!(
            "{} with, {} without, {} and {} frames",
            shown(&with),
            shown(&without),
            with.values,
            without.values
        ),
        verdict: Verdict::of(difference_j < least_j),
        note: format!(
            "holds as the difference of {:.2} mJ is below either pooled standard deviation. That a waiting processor draws {} W here, and \
             how much the operating system scatters frames, is assumed",
            1e3 * difference_j,
            bench.pc.finish()?.waiting_w.value()
        ),
        numbers: numbers([
            ("shortest_work_ms", work_ms(&bench.pc_frames, f64::min)),
            ("longest_work_ms", work_ms(&bench.pc_frames, f64::max)),
            ("with_mean_J", with.mean),
            ("with_pooled_deviation_J", with.deviation),
            ("without_mean_J", without.mean),
            ("without_pooled_deviation_J", without.deviation),
            ("difference_J", difference_j),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    Ok(Done { row, figures: Vec::new() })
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
