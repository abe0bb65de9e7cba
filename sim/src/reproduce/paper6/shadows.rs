//! VI-12: motion-blurred soft shadows.

use activity::Event;
use glam::Vec3;
use workloads::Overrides;
use workloads::job::{Drawn, Job};
use workloads::soft_shadows::{Options, SoftShadows};

use crate::gpu::GpuSpec;
use crate::output::progress::Progress;
use crate::reproduce::row::{Kind, Row, Verdict, numbers};
use crate::reproduce::{Done, Effort};
use crate::run::RunError;

/// Places on the light and in time (thesis, Paper VI, Figure 1).
const PLACES: u32 = 64;

pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    let bar = progress.bar("soft shadows", 2);
    let size = if effort == Effort::QUICK { (96, 54) } else { (320, 180) };
    let draw = |accumulate| -> Result<Drawn, RunError> {
        let overrides = Overrides { size: Some(size), samples: Some(PLACES), ..Overrides::default() };
        let job = SoftShadows::new(Options { accumulate, ..Options::default() }, &overrides, 1)?;
        let drawn = job.frame(1, &GpuSpec::load("reference")?.pipeline, &mut |_, _| ())?;
        bar.inc();
        Ok(drawn)
    };
    let (one, many) = (draw(false)?, draw(true)?);
    let bits = |pixel: &Vec3| pixel.to_array().map(f32::to_bits);
    let differ = one.image.iter().zip(&many.image).filter(|(a, b)| bits(a) != bits(b)).count();
    let vertices = [&one, &many].map(|drawn| drawn.counts[Event::VertexInvocations] as f64);
    let tested = [&one, &many].map(|drawn| drawn.counts[Event::SamplesTested] as f64);
    let row = Row {
        id: "VI-12",
        kind: Kind::Equality,
        claim: "soft shadows in one 5D pass equal accumulation buffering",
        paper: "equivalent results over 64 fixed (u, v, t), in a single pass",
        ours: format!(
            "{differ} of {} pixels differ in any bit; vertex shader runs {:.0} against {:.0}, samples tested {:.3e} against {:.3e}",
            one.image.len(),
            vertices[0],
            vertices[1],
            tested[0],
            tested[1]
        ),
        verdict: Verdict::of(differ == 0),
        note: "holds if no pixel differs. Accumulation renders still geometry through a pinhole, 64 times for the map and 64 times for \
               the image, with vertices placed as the sample test places them"
            .to_owned(),
        numbers: numbers([
            ("pixels", one.image.len() as f64),
            ("pixels_that_differ", differ as f64),
            ("vertices_one_pass", vertices[0]),
            ("vertices_accumulation", vertices[1]),
            ("samples_tested_one_pass", tested[0]),
            ("samples_tested_accumulation", tested[1]),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    Ok(vec![Done { row, figures: Vec::new() }])
}
