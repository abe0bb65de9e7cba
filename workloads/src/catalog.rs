//! Catalogue of all jobs by name.

use crate::error::LoadError;
use crate::job::{Flags, Job, OptionSource, Request};

type Maker = fn(&OptionSource, &Request<'_>) -> Result<Box<dyn Job>, LoadError>;

/// Entry of a job.
struct Entry {
    name: &'static str,
    /// Description in a line.
    what: &'static str,
    /// Flags that it uses.
    flags: Flags,
    make: Maker,
}

/// All jobs.
const JOBS: &[Entry] = &[
    Entry {
        name: "caustics",
        what: "light refracted by waves: light volumes drawn as moving triangles, or within bounding volumes",
        flags: crate::caustics::FLAGS,
        make: crate::caustics::job,
    },
    Entry {
        name: "ccd",
        what: "continuous collision detection: moving objects drawn along three axes into boxes of time and depth",
        flags: crate::collision::FLAGS,
        make: crate::collision::job,
    },
    Entry {
        name: "glossy",
        what: "glossy reflection or refraction on a planar receiver, pre-filtered by the lens of one pass",
        flags: crate::glossy::FLAGS,
        make: crate::glossy::job,
    },
    Entry {
        name: "multiview",
        what: "stereo and multi-view images with motion and defocus in one pass, optionally interlaced for a panel",
        flags: crate::multiview::FLAGS,
        make: crate::multiview::job,
    },
    Entry {
        name: "occlusion",
        what: "occlusion queries: moving boxes behind moving walls, queried by intervals of lens, time and depth",
        flags: crate::occlusion::FLAGS,
        make: crate::occlusion::job,
    },
    Entry {
        name: "sampling",
        what: "maximal Poisson-disk points: darts thrown at rasterized uncovered regions",
        flags: crate::points::job::FLAGS,
        make: crate::points::job::job,
    },
    Entry {
        name: "soft-shadows",
        what: "motion-blurred soft shadows of an area light, by a shadow map over a fixed set of (u, v, t)",
        flags: crate::soft_shadows::FLAGS,
        make: crate::soft_shadows::job,
    },
];

/// Names of the jobs, each with a description in a line.
pub fn names() -> impl Iterator<Item = (&'static str, &'static str)> {
    JOBS.iter().map(|job| (job.name, job.what))
}

/// Extends the error for an unknown scene with the names of jobs; other errors are unchanged.
#[must_use]
pub fn or_job(error: LoadError) -> LoadError {
    match error {
        LoadError::Unknown { name, .. } => {
            crate::load::unknown(&name, &names().map(|(name, _)| name).collect::<Vec<_>>())
        }
        error => error,
    }
}

/// Makes the job with a name, if it exists.
///
/// # Errors
/// [`LoadError`] for invalid options or settings, or flags that it does not use.
pub fn find(
    name: &str,
    options: &OptionSource,
    request: &Request<'_>,
) -> Option<Result<Box<dyn Job>, LoadError>> {
    let job = JOBS.iter().find(|job| job.name == name)?;
    Some(job.flags.check(name, request.overrides).and_then(|()| (job.make)(options, request)))
}

/// Makes the job with a name at another size of its image, by `--size` or by the option that stands for it. A
/// run's expected time is scaled up from small images.
///
/// # Errors
/// As [`find`]; [`LoadError::Setting`] if the size cannot be changed.
pub fn at_size(
    name: &str,
    options: &OptionSource,
    request: &Request<'_>,
    size: [u32; 2],
) -> Option<Result<Box<dyn Job>, LoadError>> {
    let job = JOBS.iter().find(|job| job.name == name)?;
    let mut options = options.clone();
    let mut overrides = request.overrides.clone();
    match job.flags.instead_of_size() {
        Some(option) => options.set.push((option.to_owned(), size[1].to_string())),
        None => overrides.size = Some((size[0], size[1])),
    }
    find(name, &options, &Request { overrides: &overrides, ..*request })
}
