//! VI-12: motion-blurred soft shadows.

use activity::Event;
use glam::Vec3;
use pipeline::{FrameReport, Gpu};
use workloads::Overrides;
use workloads::job::{Drawn, Job};
use workloads::soft_shadows::{SoftShadowOptions, SoftShadows};

use super::Task;
use crate::reproduce::Done;
use crate::reproduce::row::{Row, numbers, ran};
use crate::reproduce::verdict::Verdict;
use crate::study::Ran;
use run::GpuSpec;
use run::RunError;

pub(super) fn row(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_12);
    let (row, form) = (with.settings, with.form);
    let draw = |accumulate| -> Result<(Drawn, FrameReport), RunError> {
        let (size, samples) = (Some(*row.size_px.get(form)), Some(*row.places.get(form)));
        let overrides = Overrides { size, samples, ..Overrides::default() };
        let job = SoftShadows::new(
            SoftShadowOptions { accumulate, ..SoftShadowOptions::default() },
            &overrides,
            1,
        )?;
        let hardware = GpuSpec::load("reference")?.pipeline;
        let mut gpu = Gpu::quiet(&hardware).map_err(RunError::setting)?;
        Ok((job.frame(*row.frame.get(form), &mut gpu)?, gpu.finish()))
    };
    let [(one, one_report), (many, many_report)] = [draw(false)?, draw(true)?];
    let counts = [&one_report, &many_report].map(FrameReport::counts);
    let bits = |pixel: &Vec3| pixel.to_array().map(f32::to_bits);
    let differ = one.image.iter().zip(&many.image).filter(|(a, b)| bits(a) != bits(b)).count();
    let count = |event: Event| counts.each_ref().map(|counts| counts[event] as f64);
    let (vertices, tested) = (count(Event::VertexInvocations), count(Event::SamplesTested));
    let same = differ == 0 && one.image.len() == many.image.len();
    let ours = format!(
        "{differ} of {} pixels differ in any bit; vertex shader runs {:.0} against {:.0}, samples tested {:.3e} against {:.3e}",
        one.image.len(),
        vertices[0],
        vertices[1],
        tested[0],
        tested[1]
    );
    let facts = numbers([
        ("pixels", one.image.len() as f64),
        ("pixels_that_differ", differ as f64),
        ("vertices_one_pass", vertices[0]),
        ("vertices_accumulation", vertices[1]),
        ("samples_tested_one_pass", tested[0]),
        ("samples_tested_accumulation", tested[1]),
    ]);
    let [of_one, of_many] = [&one_report, &many_report].map(Ran::of);
    let mut ran = ran(&[of_one, of_many].into_iter().sum());
    ran.extend(numbers([
        ("passes_of_one_pass", of_one.passes as f64),
        ("passes_of_accumulation", of_many.passes as f64),
        ("fragments_of_one_pass", of_one.fragments as f64),
        ("fragments_of_accumulation", of_many.fragments as f64),
    ]));
    let made = with.row(&row.about, (ours, Verdict::of(same), String::new()));
    Ok(Done::bare(Row { numbers: facts, ran, ..made }))
}
