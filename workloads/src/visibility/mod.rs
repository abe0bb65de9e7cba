//! Visibility as a tool: computes the visible triangle and depth of every sample of moving triangles.
//!
//! [`load()`] reads any file format with a moving mesh into a [`VisibilityScene`]. `.m5d`, sample tables and
//! results are little endian and packed; `docs/formats.md` describes them. They are shared with a ray caster,
//! so that results can be compared sample by sample. `.mts` is read by [`load_mts`] for other workloads, too.
//!
//! A [`MovingMesh`] has linear vertex motion, and may come from two surface files.

mod camera;
mod files;

use std::ops::Range;
use std::path::Path;

use camera::{PosedCamera, fit};
use glam::{DVec3, Vec3, Vec4};
use pipeline::sampling::HashedSamples;
use pipeline::{Camera, Lane, LensShape, Shader, ShadingPoint, Viewport};
use warnings::Warning;

use crate::error::{LoadError, Source};
use crate::import::{Face, Format, Surface, reader, statements, surface};
use crate::scene::{Wrong, lens_leaves_view};

pub use crate::scene::CameraSpec;
pub use files::{load_mts, parse_m5d, parse_mts};

/// Accepted files, for messages.
const KNOWN: &str = ".m5d, .mts, and .ply, .obj, .off or .stl, alone or as a pair (each also gzipped)";

/// Formats with a mesh, or with one end of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum InputKind {
    M5d,
    Mts,
    Surface(Format),
}

impl InputKind {
    /// Format by the first bytes of the file, or else by its name.
    pub fn of(path: &Path) -> Result<Self, LoadError> {
        let head = reader::head::<8>(path)?;
        // An empty file has no known format.
        if !head.is_empty() && path.metadata().is_ok_and(|data| !data.is_file()) {
            return Err(not_a_regular_file(path));
        }
        let begins = |magic: &[u8]| head.starts_with(magic);
        if begins(files::M5D_MAGIC) {
            return Ok(Self::M5d);
        }
        if begins(files::MTS_MAGIC) {
            return Ok(Self::Mts);
        }
        if begins(b"ply\n") || begins(b"ply\r") {
            return Ok(Self::Surface(Format::Ply));
        }
        let named = Self::named(path);
        named.ok_or_else(|| LoadError::Kind { file: path.display().to_string(), known: KNOWN })
    }

    /// Format by file name.
    pub fn named(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
        let bare = name.strip_suffix(".gz").unwrap_or(&name);
        match (bare.rsplit_once('.')?.1, Format::of(path)) {
            ("m5d", _) => Some(Self::M5d),
            ("mts", _) => Some(Self::Mts),
            (_, Some(format)) if format.is_surface() => Some(Self::Surface(format)),
            _ => None,
        }
    }
}

/// Loads the moving mesh in `files`: an `.m5d` or `.mts`, a still PLY, OBJ, OFF or STL file, or two of these
/// as the two ends of the shutter. `camera` is the argument of [`CameraSpec::flag`]. Without it an `.m5d`
/// uses its own camera, and the others get a fitted one.
///
/// # Errors
/// [`LoadError`]: [`LoadError::is_usage`] for incompatible files, unknown formats and mistakes in the camera;
/// else invalid content, with its place in the file.
pub fn load(files: &[impl AsRef<Path>], camera: Option<&str>) -> Result<VisibilityScene, LoadError> {
    let spec = camera.map(parsed_camera).transpose()?;
    let files: Vec<&Path> = files.iter().map(AsRef::as_ref).collect();
    let kinds = files.iter().map(|path| InputKind::of(path)).collect::<Result<Vec<_>, _>>()?;
    let (path, objects) = match (&files[..], &kinds[..]) {
        ([file], [InputKind::M5d]) => match &spec {
            None => return files::load(file),
            Some(_) => (*file, vec![files::world(&files::load(file)?)]),
        },
        ([file], [InputKind::Mts]) => (*file, load_mts(file)?),
        ([file], [InputKind::Surface(format)]) => (*file, vec![still((file, *format))?]),
        ([start, end], [InputKind::Surface(one), InputKind::Surface(other)]) => {
            (*start, vec![moving((start, *one), (end, *other))?])
        }
        _ => return Err(wrong_number(&files, &kinds)),
    };
    VisibilityScene::from_subject(Subject { path, objects }, &spec.unwrap_or_default())
}

/// Parses the camera for a moving mesh.
fn parsed_camera(text: &str) -> Result<CameraSpec, LoadError> {
    let (spec, file) = CameraSpec::flag(text)?;
    spec.check_for_meshes().map_err(|wrong| CameraSpec::wrong(&file, wrong))?;
    Ok(spec)
}

/// Loads a still mesh from a PLY, OBJ, OFF or STL file.
///
/// # Errors
/// As [`load`].
pub fn load_surface(path: &Path) -> Result<MovingMesh, LoadError> {
    match InputKind::of(path)? {
        InputKind::Surface(format) => still((path, format)),
        _ => Err(LoadError::Kind {
            file: path.display().to_string(),
            known: ".ply, .obj, .off and .stl (also gzipped)",
        }),
    }
}

/// Error for a pipe: the bytes read for the format would be missing from the content.
fn not_a_regular_file(path: &Path) -> LoadError {
    let message =
        format!("{} is a pipe or a device, and it is read twice: write it to a file first", path.display());
    LoadError::Setting { setting: "files", message }
}

fn wrong_number(files: &[&Path], kinds: &[InputKind]) -> LoadError {
    let whole = files.iter().zip(kinds).find(|(_, kind)| !matches!(kind, InputKind::Surface(_)));
    let message = match whole {
        Some((file, _)) if files.len() > 1 => {
            format!("{} holds both ends of the shutter: give it alone", file.display())
        }
        _ => format!(
            "{} were given: give one, or two PLY, OBJ, OFF or STL files as the ends of the shutter",
            files.len()
        ),
    };
    LoadError::Setting { setting: "files", message }
}

/// Moving triangles in camera space (x right, y up, z forward), with camera and sampling.
#[derive(Clone, Debug)]
pub struct VisibilityScene {
    /// Size of the image.
    pub viewport: Viewport,
    /// Samples per pixel.
    pub per_pixel: u32,
    /// Seed of hashed samples.
    pub seed: u64,
    /// The camera at the origin of its own space; a pinhole if the lens radius is zero.
    pub camera: Camera,
    /// Shape of the aperture.
    pub shape: LensShape,
    /// Vertices at shutter open.
    pub open: Vec<Vec3>,
    /// Vertices at shutter close.
    pub close: Vec<Vec3>,
    /// Vertex indices of each triangle, all in range.
    pub triangles: Vec<[u32; 3]>,
    /// Triangle range of each object, in order; one object for formats without objects.
    pub objects: Vec<Range<u32>>,
    /// The fitted camera, if none was given.
    pub fitted: Option<CameraSpec>,
    /// Warnings about the scene.
    pub warnings: Vec<Warning>,
}

/// Meshes with the file that messages name.
struct Subject<'a> {
    /// File of the meshes.
    pub path: &'a Path,
    /// The objects.
    pub objects: Vec<MovingMesh>,
}

impl VisibilityScene {
    /// Hashed samples with the scene's seed; `None` if their number is out of range.
    pub fn hashed_samples(&self) -> Option<HashedSamples> {
        HashedSamples::new(self.seed, self.viewport.width(), self.per_pixel, self.shape)
    }

    /// `subject` in a camera's space; the camera is fitted if it has no pose.
    fn from_subject(subject: Subject<'_>, spec: &CameraSpec) -> Result<Self, LoadError> {
        let source = Source { path: subject.path };
        let (mesh, objects) =
            joined(subject.objects).map_err(|message| source.broken("triangles", message))?;
        let (placed, warnings) = if spec.is_placed() {
            (spec.completed(), Vec::new())
        } else {
            let message = "there are no triangles of usable size to fit a camera to: give one with --camera";
            let (placed, holds_lens) = fit(spec, &mesh).ok_or_else(|| source.broken("triangles", message))?;
            (placed, if holds_lens { Vec::new() } else { vec![lens_leaves_view()] })
        };
        let unusable = |(place, message): Wrong| source.broken(format!("camera: {place}"), message);
        let view = placed.stands_and_image().map_err(unusable)?;
        let [open, close] =
            in_camera_space(&view, &mesh).map_err(|message| source.broken("vertices", message))?;
        Ok(Self {
            viewport: view.viewport,
            per_pixel: placed.samples_per_pixel(),
            seed: placed.sample_seed(),
            camera: view.camera,
            shape: placed.shape(),
            open,
            close,
            triangles: mesh.triangles,
            objects,
            fitted: (!spec.is_placed()).then_some(placed),
            warnings,
        })
    }
}

/// Joins all objects to one mesh, with the triangle range of each.
fn joined(objects: Vec<MovingMesh>) -> Result<(MovingMesh, Vec<Range<u32>>), String> {
    let mut ranges = Vec::with_capacity(objects.len());
    let count = |length: usize| {
        u32::try_from(length)
            .map_err(|_| "there are more than 2^32 in all objects; make fewer of them".to_owned())
    };
    let mut whole = MovingMesh::default();
    for object in objects {
        let (first, start) = (count(whole.open.len())?, count(whole.triangles.len())?);
        count(whole.open.len() + object.open.len())?;
        whole.open.extend(object.open);
        whole.close.extend(object.close);
        whole.triangles.extend(object.triangles.iter().map(|corners| corners.map(|vertex| first + vertex)));
        ranges.push(start..count(whole.triangles.len())?);
    }
    Ok((whole, ranges))
}

/// Vertices in camera space at both ends, rounded once. A still vertex and a still camera stay exactly still.
fn in_camera_space(view: &PosedCamera, mesh: &MovingMesh) -> Result<[Vec<Vec3>; 2], String> {
    let [open, close] = &view.stands;
    let see = |(stand, points): (&crate::scene::camera::CameraFrame, &[DVec3])| {
        let seen = points.iter().enumerate().map(|(vertex, point)| {
            let seen = stand.view(*point).as_vec3();
            let far =
                || format!("vertex {vertex} at {point} is out of the range of numbers here: scale the mesh");
            if seen.is_finite() { Ok(seen) } else { Err(far()) }
        });
        seen.collect::<Result<Vec<_>, _>>()
    };
    Ok([see((open, &mesh.open))?, see((close, &mesh.close))?])
}

/// A shader without cost, for visibility alone.
#[derive(Clone, Copy, Debug)]
pub struct Unshaded;

impl Shader for Unshaded {
    fn shade(&self, _lane: &Lane, _at: &ShadingPoint, _texel: Vec4) -> Vec4 {
        Vec4::ZERO
    }
}

/// A mesh at both ends of the shutter (or of a simulation step), in the precision of its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MovingMesh {
    /// Vertices at time 0, shutter open.
    pub open: Vec<DVec3>,
    /// Vertices at time 1, shutter close.
    pub close: Vec<DVec3>,
    /// Vertex indices of each triangle, all in range.
    pub triangles: Vec<[u32; 3]>,
}

impl MovingMesh {
    /// Positions of every triangle corner at both ends.
    fn corners(&self) -> impl Iterator<Item = [DVec3; 2]> {
        self.triangles
            .as_flattened()
            .iter()
            .map(|&vertex| [&self.open, &self.close].map(|end| end[vertex as usize]))
    }
}

/// Remedy for incompatible files.
const REMEDY: &str = "both ends of the shutter need equal topology: export both from the same mesh";

/// A file and its format.
type File<'a> = (&'a Path, Format);

/// The still mesh of one file.
fn still((path, format): File<'_>) -> Result<MovingMesh, LoadError> {
    let Surface { positions, triangles } = surface(path, format)?;
    Ok(MovingMesh { close: positions.clone(), open: positions, triangles })
}

/// The mesh of one file, which must have triangles.
fn with_triangles((path, format): File<'_>) -> Result<Surface, LoadError> {
    let mesh = surface(path, format)?;
    if mesh.triangles.is_empty() {
        let message = "it has none, so there is nothing that could move; export it with its faces";
        return Err(Source { path }.broken("triangles", message));
    }
    Ok(mesh)
}

/// The mesh of one file at shutter open and of the other at shutter close.
pub(crate) fn moving(start: File<'_>, end: File<'_>) -> Result<MovingMesh, LoadError> {
    let [open, close] = [with_triangles(start)?, with_triangles(end)?];
    let pair = Pair { paths: [start.0, end.0], open: &open, close: &close };
    let close = match (start.1, end.1) {
        (Format::Ply, Format::Ply) | (Format::Off, Format::Off) => pair.by_index()?,
        both => {
            let close = pair.by_corner()?;
            if both == (Format::Obj, Format::Obj) {
                pair.same_faces()?;
            }
            close
        }
    };
    Ok(MovingMesh { open: open.positions, close, triangles: open.triangles })
}

/// Two meshes to be matched.
struct Pair<'a> {
    paths: [&'a Path; 2],
    open: &'a Surface,
    close: &'a Surface,
}

impl Pair<'_> {
    /// End positions of the first mesh's vertices, if both files use the same indices.
    fn by_index(&self) -> Result<Vec<DVec3>, LoadError> {
        self.same_count("triangles", self.open.triangles.len(), self.close.triangles.len())?;
        self.same_count("vertices", self.open.positions.len(), self.close.positions.len())?;
        let both = self.open.triangles.iter().zip(self.close.triangles.iter());
        match both.enumerate().find(|(_, (from, to))| from != to) {
            None => Ok(self.close.positions.clone()),
            Some((triangle, (from, to))) => {
                let start = self.paths[0].display();
                let message = format!("its corners are {to:?}, those in {start} are {from:?}; {REMEDY}");
                Err(self.wrong(format!("triangle {triangle}"), message))
            }
        }
    }

    /// Checks that two OBJ files have the same number of positions and the same faces; triangles may match by
    /// chance.
    fn same_faces(&self) -> Result<(), LoadError> {
        let [open, close] = [statements(self.paths[0])?, statements(self.paths[1])?];
        self.same_count("vertices", open.positions.len(), close.positions.len())?;
        // One-based, as in the file.
        let numbers = |face: &Face| face.corners.map(|corner| corner.position + 1);
        match open.faces.iter().zip(&close.faces).find(|(from, to)| numbers(from) != numbers(to)) {
            None => Ok(()),
            Some((from, to)) => {
                let message = format!(
                    "it joins vertices {:?}, but line {} of {} joins {:?}; {REMEDY}",
                    numbers(to),
                    from.line,
                    self.paths[0].display(),
                    numbers(from)
                );
                Err(self.wrong(format!("line {}", to.line), message))
            }
        }
    }

    /// End positions of the first mesh's vertices, matched by triangle corners. Vertex indices of OBJ files
    /// do not match: importers split vertices with different normals, and the normals change with the motion.
    fn by_corner(&self) -> Result<Vec<DVec3>, LoadError> {
        self.same_count("triangles", self.open.triangles.len(), self.close.triangles.len())?;
        self.matched([self.close, self.open], 1)?;
        self.matched([self.open, self.close], 0)
    }

    /// Position in `to` of each vertex of `from`, which must be unique; `which` of the paths is that of
    /// `from`.
    fn matched(&self, [from, to]: [&Surface; 2], which: usize) -> Result<Vec<DVec3>, LoadError> {
        let mut places: Vec<Option<DVec3>> = vec![None; from.positions.len()];
        let corners = from.triangles.as_flattened().iter().zip(to.triangles.as_flattened());
        for (corner, (vertex, goal)) in corners.enumerate() {
            let place = to.positions[*goal as usize];
            let known = places[*vertex as usize].get_or_insert(place);
            if *known != place {
                let message = format!(
                    "one vertex of {} is at {known} and at {place} of {}; {REMEDY}",
                    self.paths[which].display(),
                    self.paths[1 - which].display()
                );
                return Err(self.wrong(format!("triangle {}", corner / 3), message));
            }
        }
        // Unused vertices stay in place.
        Ok(places.iter().zip(&from.positions).map(|(place, own)| place.unwrap_or(*own)).collect())
    }

    fn same_count(&self, what: &str, open: usize, close: usize) -> Result<(), LoadError> {
        if open == close {
            return Ok(());
        }
        let message = format!("it has {close} {what}, but {} has {open}; {REMEDY}", self.paths[0].display());
        Err(self.wrong(what, message))
    }

    fn wrong(&self, place: impl Into<String>, message: String) -> LoadError {
        Source { path: self.paths[1] }.broken(place, message)
    }
}
