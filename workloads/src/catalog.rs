//! Catalogue of all jobs: workloads by name, and renderings of scenes.

use std::path::Path;

use crate::error::LoadError;
use crate::job::{FactKind, Flag, Flags, Job, JobRequest, OptionSource, Reduction};
use crate::rendering::Rendering;
use crate::scene::Overrides;

type Maker = fn(&OptionSource, &JobRequest<'_>) -> Result<Box<dyn Job>, LoadError>;

/// Entry of a workload.
struct Entry {
    name: &'static str,
    /// Description in a line.
    what: &'static str,
    /// Flags that it uses.
    flags: Flags,
    /// Its results.
    facts: &'static [FactKind],
    make: Maker,
}

/// All workloads.
const JOBS: &[Entry] = &[
    Entry {
        name: "caustics",
        what: "light refracted by waves: light volumes drawn as moving triangles, or within bounding volumes",
        flags: crate::caustics::FLAGS,
        facts: crate::caustics::FACTS,
        make: crate::caustics::job,
    },
    Entry {
        name: "ccd",
        what: "continuous collision detection: moving objects drawn along three axes into boxes of time and depth",
        flags: crate::collision::FLAGS,
        facts: crate::collision::FACTS,
        make: crate::collision::job,
    },
    Entry {
        name: "compute",
        what: "groups of lanes on what a frame drew: mean luminance, histogram, lights of tiles",
        flags: crate::compute::FLAGS,
        facts: crate::compute::FACTS,
        make: crate::compute::job,
    },
    Entry {
        name: "deferred",
        what: "deferred rendering: a G-buffer, lit by many point lights, beside forward rendering",
        flags: crate::deferred::FLAGS,
        facts: crate::deferred::FACTS,
        make: crate::deferred::job,
    },
    Entry {
        name: "glossy",
        what: "glossy reflection or refraction on a planar receiver, pre-filtered by the lens of one pass",
        flags: crate::glossy::FLAGS,
        facts: crate::glossy::FACTS,
        make: crate::glossy::job,
    },
    Entry {
        name: "multiview",
        what: "stereo and multi-view images with motion and defocus in one pass, optionally interlaced for a panel",
        flags: crate::multiview::FLAGS,
        facts: crate::multiview::FACTS,
        make: crate::multiview::job,
    },
    Entry {
        name: "occlusion",
        what: "occlusion queries: moving boxes behind moving walls, queried by intervals of lens, time and depth",
        flags: crate::occlusion::FLAGS,
        facts: crate::occlusion::FACTS,
        make: crate::occlusion::job,
    },
    Entry {
        name: "sampling",
        what: "points by rasterization: Poisson-disk darts, noise that follows a bell, samples in a volume",
        flags: crate::points::job::FLAGS,
        facts: crate::points::job::FACTS,
        make: crate::points::job::job,
    },
    Entry {
        name: "soft-shadows",
        what: "motion-blurred soft shadows of an area light, by a shadow map over a fixed set of (u, v, t)",
        flags: crate::soft_shadows::FLAGS,
        facts: crate::soft_shadows::FACTS,
        make: crate::soft_shadows::job,
    },
];

/// Names of the workloads, each with a description in a line.
pub fn names() -> impl Iterator<Item = (&'static str, &'static str)> {
    JOBS.iter().map(|job| (job.name, job.what))
}

/// The facts that the workload with this name can have; none for other names.
pub fn facts(name: &str) -> &'static [FactKind] {
    JOBS.iter().find(|job| job.name == name).map_or(&[], |job| job.facts)
}

/// Extends the error for an unknown scene with the names of workloads; other errors are unchanged.
#[must_use]
pub fn or_job(error: LoadError) -> LoadError {
    match error {
        LoadError::Unknown { name, .. } => {
            crate::import::unknown(&name, &names().map(|(name, _)| name).collect::<Vec<_>>())
        }
        error => error,
    }
}

/// Makes the workload with a name, if it exists.
///
/// # Errors
/// [`LoadError`] for invalid options or settings, or flags that it does not use.
pub fn find(
    name: &str,
    options: &OptionSource,
    request: &JobRequest<'_>,
) -> Option<Result<Box<dyn Job>, LoadError>> {
    let job = JOBS.iter().find(|job| job.name == name)?;
    Some(job.flags.check(name, request.overrides).and_then(|()| (job.make)(options, request)))
}

/// Makes the job of a name: a workload, or the rendering of the scene of that name or path. Returns the name
/// in results, too.
///
/// # Errors
/// As [`find`] and [`crate::load`]; [`LoadError::Option`] for options of a scene.
pub fn load(
    name: &Path,
    options: &OptionSource,
    request: &JobRequest<'_>,
) -> Result<(String, Box<dyn Job>), LoadError> {
    // Names of workloads are Unicode; a path that is not cannot name one.
    let text = name.to_str().unwrap_or_default();
    if let Some(job) = find(text, options, request) {
        return Ok((text.to_owned(), job?));
    }
    let scene = crate::load(name).map_err(or_job)?;
    if *options != OptionSource::default() {
        let jobs: Vec<&str> = names().map(|(name, _)| name).collect();
        let message =
            format!("`{}` is a scene; only workloads have options: {}", name.display(), jobs.join(", "));
        let option = match options.set.first() {
            Some((name, value)) => format!("--set {name}={value}"),
            None => "--options".to_owned(),
        };
        return Err(LoadError::Option { option, message });
    }
    Ok((scene.name().to_owned(), Box::new(Rendering::new(scene, request)?)))
}

/// The job that [`load`] made of a name, with less work for each frame. A workload is made again, with the
/// size by `--size` or by the option that stands for it.
///
/// # Errors
/// As [`find`]; [`LoadError::Setting`] if the size cannot be changed.
pub fn reduced<'a>(
    job: &'a dyn Job,
    name: &Path,
    options: &OptionSource,
    request: &JobRequest<'_>,
    to: &Reduction,
) -> Result<Box<dyn Job + 'a>, LoadError> {
    match job.reduced(to) {
        Some(job) => Ok(job),
        None => remade(name.to_str().unwrap_or_default(), options, request, to),
    }
}

/// Makes the workload with a name with less work for each frame.
///
/// # Errors
/// As [`reduced`].
pub fn remade(
    name: &str,
    options: &OptionSource,
    request: &JobRequest<'_>,
    to: &Reduction,
) -> Result<Box<dyn Job>, LoadError> {
    let entry = JOBS.iter().find(|job| job.name == name);
    let entry = entry.ok_or_else(|| or_job(crate::import::unknown(name, &[])))?;
    let (mut options, mut overrides) = (options.clone(), request.overrides.clone());
    match entry.flags.instead_of_size() {
        Some(option) => options.set.push((option.to_owned(), to.size[1].to_string())),
        None => overrides.size = Some((to.size[0], to.size[1])),
    }
    let own = || (entry.make)(&options, &JobRequest { overrides: &overrides, ..*request });
    let samples = to.samples.filter(|_| entry.flags.uses.contains(&Flag::Samples));
    let Some(samples) = samples else { return own() };
    let fewer = Overrides { samples: Some(samples), ..overrides.clone() };
    (entry.make)(&options, &JobRequest { overrides: &fewer, ..*request }).or_else(|_| own())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use pipeline::Gpu;

    use super::*;
    use crate::job::testing::hardware;

    /// Options of small runs of each workload that together have all facts.
    const RUNS: &[(&str, &[&str])] = &[
        ("caustics", &["cells=4"]),
        ("ccd", &["balls=4 resolution=8"]),
        (
            "compute",
            &[
                "scene=tiny kernel=reduction",
                "scene=tiny kernel=mip_chain",
                "scene=tiny kernel=histogram",
                "scene=tiny kernel=light_culling lights=4",
            ],
        ),
        ("deferred", &["scene=tiny lights=4"]),
        ("glossy", &["scene=tiny texels=8 map_samples=1"]),
        ("multiview", &["scene=tiny views=2 check_cache=true"]),
        ("occlusion", &["objects=4"]),
        ("sampling", &["radius=0.2", "points=noise count=100", "points=volume"]),
        ("soft-shadows", &["map_px=8"]),
    ];

    /// Names of the facts of a frame, of 16 x 16 pixels where the workload takes a size.
    fn drawn(name: &str, options: &str) -> BTreeSet<&'static str> {
        let set = options.split(' ').filter_map(|option| option.split_once('='));
        let set = set.map(|(name, value)| (name.to_owned(), value.to_owned())).collect();
        let entry = JOBS.iter().find(|job| job.name == name).unwrap();
        let size = entry.flags.uses.contains(&Flag::Size).then_some((16, 16));
        let overrides = Overrides { size, ..Overrides::default() };
        let request = JobRequest { overrides: &overrides, seed: 1 };
        let job = find(name, &OptionSource { file: None, set }, &request).unwrap().unwrap();
        let hardware = hardware();
        let drawn = job.frame(0, &mut Gpu::without_packets(&hardware).unwrap()).unwrap();
        drawn.facts.iter().map(|fact| fact.name).collect()
    }

    #[test]
    fn facts_of_all_workloads_are_declared_with_unit_and_meaning() {
        assert!(RUNS.iter().map(|run| run.0).eq(JOBS.iter().map(|job| job.name)));
        for (name, runs) in RUNS {
            let declared: BTreeSet<&str> = facts(name).iter().map(|fact| fact.name).collect();
            let drawn: BTreeSet<&str> = runs.iter().flat_map(|options| drawn(name, options)).collect();
            assert_eq!(drawn, declared, "{name}");
            assert!(!facts(name).is_empty() && facts(name).len() == declared.len(), "{name}");
            for FactKind { name: fact, unit, meaning } in facts(name) {
                assert!(!unit.is_empty() && !meaning.is_empty(), "{name} {fact}");
            }
        }
    }
}
