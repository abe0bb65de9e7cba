//! Rows VI-6 and VI-7: caustic volumes as moving triangles. Rows VI-11 and VI-12: glossy reflection and
//! refraction, and motion-blurred soft shadows.

use activity::Event;
use glam::{DVec3, Vec3};
use output::plot::{PlotStyle, Series};
use pipeline::{FrameReport, Gpu};
use run::{GpuSpec, RunError};
use workloads::Overrides;
use workloads::caustics::generator::{Ocean, turned_beams};
use workloads::caustics::{
    Beam, BeamMethod, Coverage, Eye, Floor, LightPicture, LightQuantity, draw_on, receivers,
};
use workloads::glossy::GlossyEffect;
use workloads::job::{Drawn, Job};
use workloads::soft_shadows::{SoftShadowOptions, SoftShadows};

use super::Task;
use super::figures::{self, light, warped};
use super::settings::{Executions, Glossy, Lost, Size};
use crate::chart::caustics::measure::{DEPTH_M, SIDE_M, WAVE_M, aside_of, water};
use crate::chart::caustics::{OceanCounts, ocean};
use crate::chart::glossy::{Blur, GlossyBench, GlossyEffort, GlossyRow as Measured};
use crate::reproduce::report::line;
use crate::reproduce::row::{Band, Cases, ClaimRow, NamedValue, Verdict, numbers, one_at_a_time, ran};
use crate::reproduce::settings::Form;
use crate::reproduce::{Done, Figure};
use crate::study::{Ran, StudyError};

/// Executions of the moving triangles over those of the bounding volume with fewer.
fn over_fewer(counted: &OceanCounts) -> f64 {
    let [moving, refined, _, prism] = counted.executions;
    moving as f64 / refined.min(prism) as f64
}

/// Oceans of several slopes and depths, one varied at a time about the values given.
struct Oceans {
    base: OceanCounts,
    slopes: Vec<(f64, OceanCounts)>,
    depths: Vec<(f64, OceanCounts)>,
}

impl Oceans {
    fn new(task: &Task<'_>, row: &Executions, form: Form) -> Result<Self, RunError> {
        let (slope, depth_m) = (*row.slope.get(form), *row.depth_m.get(form));
        let size = *row.size_px.get(form);
        let count = |slope: f64, depth_m: f64| -> Result<OceanCounts, RunError> {
            Ok(ocean(*row.cells.get(form), [slope, depth_m], [size.0, size.1], task.progress)?)
        };
        let base = count(slope, depth_m)?;
        let of_slope = |at: f64| Ok((at, if at == slope { base.clone() } else { count(at, depth_m)? }));
        let of_depth = |&at: &f64| Ok((at, if at == depth_m { base.clone() } else { count(slope, at)? }));
        let mut slopes = row.slope.all(form).to_vec();
        slopes.sort_by(f64::total_cmp);
        let slopes = slopes.into_iter().map(of_slope).collect::<Result<_, RunError>>()?;
        let depths = row.depth_m.all(form).iter().map(of_depth).collect::<Result<_, RunError>>()?;
        Ok(Self { base, slopes, depths })
    }

    /// Whether the moving triangles have the fewest executions in every one.
    fn band(&self, row: &Executions, form: Form) -> Result<Band, RunError> {
        let mut tried = Cases::new(
            "executions over those of the bounding volume with fewer",
            "slope and depth_m one at a time about the values given",
        );
        let judged =
            |(at, counted): &(f64, OceanCounts)| (*at, over_fewer(counted), over_fewer(counted) < 1.0);
        tried.along("slope", self.slopes.iter().map(judged)).with_base(*row.slope.get(form));
        tried.along("depth_m", self.depths.iter().map(judged)).with_base(*row.depth_m.get(form));
        tried.band(one_at_a_time([row.slope.values(), row.depth_m.values()]))
    }

    /// Work on the host. The ocean of the values given is in both sweeps and was drawn once.
    fn ran(&self, depth_m: f64) -> Vec<NamedValue> {
        let others = self.depths.iter().filter(|(at, _)| *at != depth_m).chain(&self.slopes);
        let drawn: Vec<&OceanCounts> = others.map(|(_, counted)| counted).collect();
        let draws: u64 = drawn.iter().map(|counted| counted.draws).sum();
        let fragments: u64 = drawn.iter().flat_map(|counted| counted.executions).sum();
        numbers([
            ("draws_on_the_host", draws as f64),
            ("fragments_on_the_host", fragments as f64),
            ("volumes", self.base.volumes as f64),
            ("oceans_on_the_host", drawn.len() as f64),
        ])
    }
}

/// VI-6: shader executions by method on an ocean of 130,050 volumes.
pub(super) fn executions(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_6);
    let (row, form) = (with.settings, with.form);
    let oceans = Oceans::new(task, row, form)?;
    let band = oceans.band(row, form)?;
    let base = &oceans.base;
    let (size, slope, depth_m) = (*row.size_px.get(form), *row.slope.get(form), *row.depth_m.get(form));
    let [moving, refined, hull, prism] = base.executions;
    let part = |total: u64| total as f64 / prism as f64;
    let ours = format!(
        "{} volumes, slope {slope}: {moving} executions, refined bound {refined}, hull {hull}, prism {prism} ({:.3}, {:.3} and {:.3} of the \
         prism's); the most of a pixel is {} (Figure 8: {})",
        base.volumes,
        part(moving),
        part(refined),
        part(hull),
        base.most[3],
        row.dark_red.get(form)
    );
    let facts = numbers([
        ("moving", moving as f64),
        ("refined", refined as f64),
        ("hull", hull as f64),
        ("prism", prism as f64),
        ("most_of_a_pixel_moving", f64::from(base.most[0])),
        ("most_of_a_pixel_prism", f64::from(base.most[3])),
    ]);
    let (there, on_hardware) = base_on_hardware(*row.cells.get(form), [slope, depth_m], [size.0, size.1])?;
    let same = if on_hardware == base.executions { "the same" } else { "others" };
    let ours = format!("{ours}; the modelled hardware counts {same} by all methods");
    let mut ran = ran(&there);
    ran.extend(oceans.ran(depth_m));
    let row = ClaimRow { numbers: facts, ran, ..with.banded(&row.about, ours, band) };
    Ok(Done { row, figures: figures(base, &oceans.slopes, form)? })
}

/// Work and executions of the modelled hardware on the ocean of the values given, by method as in [`BeamMethod::ALL`].
fn base_on_hardware(
    cells: u32,
    [slope, depth_m]: [f64; 2],
    size: [u32; 2],
) -> Result<(Ran, [u64; 4]), RunError> {
    let water = Ocean { depth_m, ..water(cells, slope) };
    let eye = aside_of(depth_m, size)?;
    let (beams, mut work) = (water.beams(0.0), Ran::default());
    let mut executions = [0; 4];
    for (method, executions) in BeamMethod::ALL.into_iter().zip(&mut executions) {
        let (picture, of_method) = on_hardware(&beams, &eye, method, LightQuantity::Volume)?;
        work += of_method;
        *executions = picture.total_runs();
    }
    Ok((work, executions))
}

/// What the modelled hardware draws of beams.
fn on_hardware(
    beams: &[Beam],
    eye: &Eye,
    method: BeamMethod,
    light: LightQuantity,
) -> Result<(LightPicture, Ran), RunError> {
    let spec = GpuSpec::load("reference")?.pipeline;
    let mut gpu = Gpu::without_packets(&spec)?;
    let (picture, _) = draw_on(&mut gpu, beams, eye, method, light)?;
    Ok((picture, Ran::of(&gpu.finish())))
}

fn figures(base: &OceanCounts, slopes: &[(f64, OceanCounts)], form: Form) -> Result<Vec<Figure>, RunError> {
    let maps = [
        ("VI_fig8_moving", BeamMethod::Moving),
        ("VI_fig8_refined", BeamMethod::Refined),
        ("VI_fig8_prism", BeamMethod::Prism),
    ];
    let mut figures = vec![warped()?, over_slopes(slopes)];
    figures
        .extend(maps.map(|(name, method)| Figure { name, picture: base.map(method, &PlotStyle::default()) }));
    figures.extend(light(form)?);
    Ok(figures)
}

/// The sweep of slopes: executions over those of the prism.
fn over_slopes(slopes: &[(f64, OceanCounts)]) -> Figure {
    let of = |(place, method): (usize, BeamMethod)| -> Series {
        let part = |counted: &OceanCounts| counted.executions[place] as f64 / counted.executions[3] as f64;
        line(method.name(), slopes.iter().map(|(slope, counted)| (*slope, part(counted))).collect())
    };
    Figure::lines(
        "VI_caustics_slopes",
        "Shader executions over the slope of the waves (Paper VI, section 4)",
        "over those of the prism; the paper does not give the slope of its ocean",
        [("root mean square slope", ""), ("executions over the prism's", "")],
        BeamMethod::ALL.into_iter().enumerate().map(of).collect(),
    )
}

/// Beams that go on below the floor, so that it does not lie at their ends.
const OVERSHOOT: f64 = 0.25;

/// VI-7: every point of a floor that a beam lights is covered by it.
pub(super) fn no_light_is_lost(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_7);
    let (row, form) = (with.settings, with.form);
    let mut tried = Cases::new(
        "pairs of a pixel and a beam that are missed",
        "slope and pleat jointly, and floors of turned beams",
    );
    let (mut all, mut there) = (Coverage::default(), Ran::default());
    for &pleat in row.pleat.all(form) {
        let mut at = Vec::new();
        for &slope in row.slope.all(form) {
            let (found, drawn) = in_ocean(row, form, [slope, pleat])?;
            all = all.and(&found);
            there += drawn;
            at.push((slope, found.missed as f64, found.missed == 0));
        }
        tried.along(&format!("slope (pleat {pleat})"), at);
    }
    let mut at = Vec::new();
    for &height_m in row.turned_floors.get(form) {
        let (found, drawn) = turned(row, form, height_m)?;
        all = all.and(&found);
        there += drawn;
        at.push((height_m, found.missed as f64, found.missed == 0));
    }
    tried.along("floor of turned beams", at);
    let full = row.slope.values() * row.pleat.values() + row.turned_floors.get(Form::Full).len();
    let band = tried.band(full)?;
    let [once, twice, thrice] = all.by_hits;
    let ours = format!(
        "{} missed of {} pairs of a pixel and a beam; {once} of them are hit once, {twice} twice and {thrice} three times",
        all.missed, all.lit
    );
    let facts = numbers([
        ("missed", all.missed as f64),
        ("largest_of_band", band.max),
        ("pairs_hit_once", once as f64),
    ]);
    // Without beams that fold the claim would not be put to the test.
    let pairs = [
        ("pairs", all.lit as f64),
        ("pairs_hit_twice", twice as f64),
        ("pairs_hit_three_times", thrice as f64),
    ];
    let mut ran = ran(&there);
    ran.extend(numbers([
        ("draws_on_the_host", all.draws as f64),
        ("fragments_on_the_host", all.fragments as f64),
    ]));
    ran.extend(numbers(pairs));
    Ok(Done::bare(ClaimRow { numbers: facts, ran, ..with.banded(&row.about, ours, band) }))
}

fn eye(place: [DVec3; 3], half_height: f64, size: &Size) -> Result<Eye, RunError> {
    let eye = Eye::new(place, half_height, [size.0, size.1]);
    eye.ok_or_else(|| RunError::setting("VI-7: a view without extent"))
}

/// Water with waves of a slope, its triangles pleated along the light.
fn in_ocean(row: &Lost, form: Form, [slope, pleat]: [f64; 2]) -> Result<(Coverage, Ran), RunError> {
    let middle = DVec3::new(0.6, -0.5 * DEPTH_M, 0.3);
    let from = middle + 80.0 * DVec3::new(0.3, 0.35, 1.0).normalize();
    let eye = eye([from, middle, DVec3::Y], 6.5, row.size_px.get(form))?;
    let (cells, seed) = (*row.cells.get(form), *row.seed.get(form));
    let water =
        Ocean { overshoot: OVERSHOOT, pleat, ..Ocean::new(cells, SIDE_M, DEPTH_M, [WAVE_M, slope], seed) };
    covered(&water.beams(0.0), &eye, Floor { height_m: -DEPTH_M })
}

/// Beams that turn about themselves, cut by a floor and seen from above.
fn turned(row: &Lost, form: Form, height_m: f64) -> Result<(Coverage, Ran), RunError> {
    let eye = eye([10.0 * DVec3::Y, DVec3::ZERO, DVec3::NEG_Z], 1.2, row.turned_px.get(form))?;
    let beams = turned_beams(*row.turned_beams.get(form), *row.seed.get(form));
    covered(&beams, &eye, Floor { height_m })
}

/// Which receivers on a floor are covered, which the host finds, and what the modelled hardware draws of the
/// same beams.
fn covered(beams: &[Beam], eye: &Eye, floor: Floor) -> Result<(Coverage, Ran), RunError> {
    let (_, drawn) = on_hardware(beams, eye, BeamMethod::Moving, LightQuantity::Floor(floor))?;
    Ok((receivers(beams, eye, BeamMethod::Moving, &floor), drawn))
}

/// Errors of the map by few and by many samples, of reflection and of refraction, and blurs by height.
struct Found {
    errors: [[Measured; 2]; 2],
    blurs: Vec<Blur>,
}

impl Found {
    fn new(row: &Glossy, form: Form, [radius, index]: [f64; 2]) -> Result<Self, StudyError> {
        let (few, many) = *row.samples.get(form);
        let size = GlossyEffort {
            texels: *row.texels.get(form),
            most_samples: many,
            reference_tables: *row.reference_tables.get(form),
        };
        let bench = |effect| GlossyBench::new(effect, size).map(|bench| bench.with_radius(radius));
        let errors = |effect| -> Result<[Measured; 2], StudyError> {
            let bench = bench(effect)?;
            let reference = bench.reference(radius)?;
            Ok([bench.row(few, &reference)?, bench.row(many, &reference)?])
        };
        let reflection = ("reflection", GlossyEffect::Reflection);
        let errors = [errors(reflection)?, errors(("refraction", GlossyEffect::Refraction(index)))?];
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

/// What is found by the values given, what by others about them, and how many settings were drawn.
fn varied(row: &Glossy, form: Form) -> Result<(Found, Band, u32), RunError> {
    let found = |settings| Found::new(row, form, settings).map_err(RunError::from);
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
    let band = tried.band(one_at_a_time([row.lens_radius.values(), row.index.values()]))?;
    Ok((base, band, runs))
}

pub(super) fn glossy_row(task: &Task<'_>) -> Result<Done, RunError> {
    let with = task.with(|settings| &settings.vi_11);
    let (row, form) = (with.settings, with.form);
    let (base, band, runs) = varied(row, form)?;
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
    let (radius, index) = (*row.lens_radius.get(form), *row.index.get(form));
    let pictures = figures::glossy(*row.texels.get(form), radius, index, *row.samples.get(form))?;
    Ok(Done {
        row: ClaimRow { numbers: facts, ran, ..with.banded(&row.about, ours, band) },
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
        let mut gpu = Gpu::without_packets(&hardware)?;
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
    Ok(Done::bare(ClaimRow { numbers: facts, ran, ..made }))
}
