//! Rows VI-11 and VI-12: glossy reflection and refraction, and motion-blurred soft shadows.

use activity::Event;
use glam::Vec3;
use pipeline::{FrameReport, Gpu};
use run::{GpuSpec, RunError};
use workloads::Overrides;
use workloads::glossy::Effect;
use workloads::job::{Drawn, Job};
use workloads::soft_shadows::{SoftShadowOptions, SoftShadows};

use super::settings::Glossy;
use super::{Task, figures};
use crate::chart::glossy::{Bench, Blur, GlossyEffort as Size, GlossyRow as Measured};
use crate::reproduce::band::{Cases, Verdict, one_at_a_time};
use crate::reproduce::report::line;
use crate::reproduce::row::{Row, numbers, ran};
use crate::reproduce::settings::Form;
use crate::reproduce::{Done, Figure};
use crate::study::{Ran, StudyError};

/// Errors of the map by few and by many samples, of reflection and of refraction, and blurs by height.
struct Found {
    errors: [[Measured; 2]; 2],
    blurs: Vec<Blur>,
}

impl Found {
    fn new(row: &Glossy, form: Form, [radius, index]: [f64; 2]) -> Result<Self, StudyError> {
        let (few, many) = *row.samples.get(form);
        let size = Size {
            texels: *row.texels.get(form),
            most_samples: many,
            reference_tables: *row.reference_tables.get(form),
        };
        let bench = |effect| Bench::new(effect, size).map(|bench| bench.with_radius(radius));
        let errors = |effect| -> Result<[Measured; 2], StudyError> {
            let bench = bench(effect)?;
            let reference = bench.reference(radius)?;
            Ok([bench.row(few, &reference)?, bench.row(many, &reference)?])
        };
        let reflection = ("reflection", Effect::Reflection);
        let errors = [errors(reflection)?, errors(("refraction", Effect::Refraction(index)))?];
        Ok(Self { errors, blurs: bench(reflection)?.blurs()? })
    }

    fn falls(&self) -> bool {
        self.errors.iter().all(|[few, many]| many.rmse < few.rmse)
    }

    /// The error of many samples over that of few, in the worse effect.
    fn ratio(&self) -> f64 {
        self.errors.iter().map(|[few, many]| many.rmse / few.rmse).fold(0.0, f64::max)
    }

    /// Whether contact hardens and every blur is as wide as geometry has it.
    fn hardens(&self, (part, units): (f64, f64)) -> bool {
        let close = |blur: &Blur| (blur.width - blur.expected).abs() <= part * blur.expected + units;
        self.blurs.windows(2).all(|pair| pair[0].width < pair[1].width) && self.blurs.iter().all(close)
    }
}

pub(super) fn glossy_row(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_11);
    let (row, form) = (with.settings, with.form);
    let found = |settings| Found::new(row, form, settings).map_err(RunError::setting);
    let (radius, index) = (*row.lens_radius.get(form), *row.index.get(form));
    let mut tried = Cases::new(
        "error of many samples over that of few",
        "lens_radius and index one at a time about the values given",
    );
    let off = *row.blur_off.get(form);
    let base = found([radius, index])?;
    let (mut at, mut widest, mut runs) = (Vec::new(), Vec::new(), 1);
    let mut radii = row.lens_radius.all(form).to_vec();
    radii.sort_by(f64::total_cmp);
    for one in radii {
        let other = (one != radius).then(|| found([one, index])).transpose()?;
        runs += u32::from(other.is_some());
        let found = other.as_ref().unwrap_or(&base);
        at.push((one, found.ratio(), found.falls() && found.hardens(off)));
        widest.push(found.blurs.last().map_or(f64::NAN, |blur| blur.width));
    }
    // The lens sets the roughness: a wider one blurs more.
    let rougher = widest.is_sorted_by(|a, b| a < b);
    let at = at.into_iter().map(|(one, ratio, holds)| (one, ratio, holds && rougher));
    tried.along("lens_radius", at).with_base(radius);
    let mut at = Vec::new();
    for &one in row.index.all(form) {
        let other = (one != index).then(|| found([radius, one])).transpose()?;
        runs += u32::from(other.is_some());
        let found = other.as_ref().unwrap_or(&base);
        at.push((one, found.ratio(), found.falls() && found.hardens(off)));
    }
    tried.along("index", at).with_base(index);
    let full = one_at_a_time([row.lens_radius.values(), row.index.values()]);
    let band = tried.band(full)?;
    let [reflected, refracted] = base.errors.map(|both| both.map(|row| row.rmse));
    let (first, last) = (&base.blurs[0], &base.blurs[base.blurs.len() - 1]);
    let ours = format!(
        "RMSE against {} rays {:.4} and {:.4} (reflection), {:.4} and {:.4} (refraction); blur {:.3} at height {} to {:.3} at {}",
        256 * row.reference_tables.get(form),
        reflected[0],
        reflected[1],
        refracted[0],
        refracted[1],
        first.width,
        first.height,
        last.width,
        last.height
    );
    let facts = numbers([
        ("reflection_rmse_few", reflected[0]),
        ("reflection_rmse_many", reflected[1]),
        ("refraction_rmse_few", refracted[0]),
        ("refraction_rmse_many", refracted[1]),
    ]);
    let measured = || base.errors.iter().flatten();
    let mut ran = ran(&measured().map(|row| row.ran).sum());
    ran.extend(numbers([
        ("settings_drawn", f64::from(runs)),
        ("vertices", measured().map(|row| row.vertices as f64).sum()),
        ("samples_tested", measured().map(|row| row.samples_tested as f64).sum()),
    ]));
    let pictures = figures::glossy(*row.texels.get(form), radius, index, *row.samples.get(form))?;
    Ok(Done {
        row: Row { numbers: facts, ran, ..with.banded(&row.about, ours, band) },
        figures: vec![contact(&base.blurs), pictures],
    })
}

fn contact(blurs: &[Blur]) -> Figure {
    let points = |of: fn(&Blur) -> f64| blurs.iter().map(|blur| (blur.height, of(blur))).collect();
    Figure::lines(
        "VI_fig14_contact",
        "Blur of an edge over its height above the receiver (Paper VI, section 6)",
        "square lens, 64 samples a texel",
        [("height in scene units", ""), ("width on the plane in scene units", "")],
        vec![
            line("found in the map", points(|blur| blur.width)),
            line("geometry", points(|blur| blur.expected)),
        ],
    )
}

pub(super) fn shadow_row(task: &Task<'_>) -> Result<Done, RunError> {
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
