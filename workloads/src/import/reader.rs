//! Readers: files that may be gzipped, textures, and packed binary data, with limits on sizes; triangles of
//! PLY, OBJ, OFF and STL files.

use std::io::{BufRead, BufReader, Cursor, ErrorKind, Read};
use std::path::Path;

use activity::inputs;
use flate2::read::MultiGzDecoder;
use glam::{DVec3, Vec2, Vec3};
use image::{ImageFormat, ImageReader, Limits};
use pipeline::{Texture, Wrap};
use warnings::Warning;

use crate::error::{LoadError, Source};
use crate::material::Material;
use crate::scene::Bounds;
use crate::scene::{Mesh, Normals};

/// First bytes of gzipped files (RFC 1952, 2.3.1).
const GZIP: &[u8] = &[0x1f, 0x8b];

/// Byte order mark at the start of some text files.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Largest number of elements of one kind in a file.
pub(super) const MAX_ELEMENTS: usize = 100_000_000;

/// Most bytes of an unpacked file.
const MAX_UNPACKED: u64 = 2 << 30;

/// The contents of `path` after a byte order mark, unpacked where they begin as gzip does, whatever the name.
pub(crate) fn open(path: &Path) -> Result<Box<dyn BufRead>, LoadError> {
    let source = Source { path };
    let file = inputs::open(path).map_err(|error| source.unreadable(error))?;
    // Opening a folder succeeds on Unix; only reading it fails.
    if file.metadata().is_ok_and(|data| data.is_dir()) {
        return Err(source.unreadable(ErrorKind::IsADirectory.into()));
    }
    let mut file = BufReader::new(file);
    let zipped = file.fill_buf().map_err(|error| source.unreadable(error))?.starts_with(GZIP);
    let mut contents: Box<dyn BufRead> = if zipped {
        Box::new(BufReader::new(Limited { inner: MultiGzDecoder::new(file), left: MAX_UNPACKED }))
    } else {
        Box::new(file)
    };
    if contents.fill_buf().is_ok_and(|begin| begin.starts_with(BYTE_ORDER_MARK)) {
        contents.consume(BYTE_ORDER_MARK.len());
    }
    Ok(contents)
}

/// Reader that fails beyond a limit, so that a large file is not truncated silently.
struct Limited<R> {
    inner: R,
    left: u64,
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let count = self.inner.read(into)?;
        self.left = self.left.checked_sub(count as u64).ok_or_else(|| {
            std::io::Error::other("it unpacks to more than 2 GiB; unpack it first if that is its real size")
        })?;
        Ok(count)
    }
}

/// All bytes of a file named by another file. Devices and folders are refused, as they may have no end.
pub(super) fn named(path: &Path) -> std::io::Result<Vec<u8>> {
    check_named(path)?;
    inputs::read(path)
}

/// Fails for a folder or a device.
pub(super) fn check_named(path: &Path) -> std::io::Result<()> {
    inputs::note(path);
    if std::fs::metadata(path)?.is_file() { Ok(()) } else { Err(std::io::Error::other("not a regular file")) }
}

/// All bytes of `path`, unpacked where they are gzipped.
pub(crate) fn contents(path: &Path) -> Result<Vec<u8>, LoadError> {
    let mut data = Vec::new();
    open(path)?.read_to_end(&mut data).map_err(|error| damaged(path, &error))?;
    Ok(data)
}

/// The first bytes of `path`, unpacked where they are gzipped, `N` of them or as many as there are.
pub(crate) fn head<const N: usize>(path: &Path) -> Result<Vec<u8>, LoadError> {
    let mut data = Vec::with_capacity(N);
    open(path)?.take(N as u64).read_to_end(&mut data).map_err(|error| damaged(path, &error))?;
    Ok(data)
}

pub(super) fn damaged(path: &Path, error: &std::io::Error) -> LoadError {
    Source { path }
        .broken("contents", format!("reading stops here: {error}; the file may be damaged: get it again"))
}

/// Largest side of a texture in texels.
const MAX_TEXELS: u32 = 16_384;

/// Most memory of an image decoder, in bytes.
const MAX_BYTES: u64 = 512 << 20;

/// A PNG or JPEG image as a texture, or in words why it is none.
pub(super) fn decode_texture(bytes: &[u8], wrap: [Wrap; 2]) -> Result<Texture, String> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    texture(reader, wrap)
}

fn texture(mut reader: ImageReader<Cursor<&[u8]>>, wrap: [Wrap; 2]) -> Result<Texture, String> {
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_TEXELS);
    limits.max_image_height = Some(MAX_TEXELS);
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let image = reader.decode().map_err(|error| error.to_string())?.into_rgba8();
    let (width, height) = image.dimensions();
    let texels = image.pixels().map(|pixel| pixel.0).collect();
    Texture::from_srgb8(width, height, texels, wrap).map_err(|error| error.to_string())
}

/// The image file at `path` as a texture, or in words why it is none. TGA files do not begin in a way of
/// their own, so what does not is what its ending says.
pub(super) fn load_texture(path: &Path, wrap: [Wrap; 2]) -> Result<Texture, String> {
    let bytes = named(path).map_err(|error| error.to_string())?;
    let named = ImageFormat::from_path(path).ok().filter(|_| ::image::guess_format(&bytes).is_err());
    match named {
        Some(format) => texture(ImageReader::with_format(Cursor::new(&bytes), format), wrap),
        None => decode_texture(&bytes, wrap),
    }
}

/// A file and the current read position.
pub(crate) struct Bytes<'a> {
    source: Source<'a>,
    data: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    /// Starts reading a file that begins with `magic`.
    pub fn new<const N: usize>(path: &'a Path, data: &'a [u8], magic: &[u8; N]) -> Result<Self, LoadError> {
        let mut bytes = Self { source: Source { path }, data, at: 0 };
        if bytes.take::<N>()? != *magic {
            let name = String::from_utf8_lossy(magic).trim_end_matches('\0').to_owned();
            return Err(bytes.wrong(format!("it does not start with `{name}`; is it another kind of file?")));
        }
        Ok(bytes)
    }

    /// The next `N` bytes.
    pub fn take<const N: usize>(&mut self) -> Result<[u8; N], LoadError> {
        let found = self.data.get(self.at..).and_then(|rest| rest.first_chunk());
        let found = found.ok_or_else(|| {
            self.wrong("the file ends here; it is truncated: get the file again".to_owned())
        })?;
        self.at += N;
        Ok(*found)
    }

    pub fn u32(&mut self) -> Result<u32, LoadError> {
        self.take().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Result<u64, LoadError> {
        self.take().map(u64::from_le_bytes)
    }

    pub fn f64(&mut self) -> Result<f64, LoadError> {
        self.take().map(f64::from_le_bytes)
    }

    /// The next number, which must be finite.
    pub fn f32(&mut self) -> Result<f32, LoadError> {
        let value = self.take().map(f32::from_le_bytes)?;
        if value.is_finite() { Ok(value) } else { Err(self.wrong(format!("{value} is not a finite number"))) }
    }

    /// Number of remaining bytes.
    pub fn remaining(&self) -> u64 {
        (self.data.len() - self.at) as u64
    }

    /// Checks that exactly `count` records of `size` bytes remain.
    pub fn expect_records(&self, count: u64, size: u64) -> Result<(), LoadError> {
        let remaining = self.remaining();
        match count.checked_mul(size) {
            Some(needed) if needed == remaining => Ok(()),
            _ => Err(self.wrong(format!(
                "{count} records of {size} bytes are announced, but {remaining} bytes follow"
            ))),
        }
    }

    /// An error at the current position.
    pub fn wrong(&self, message: String) -> LoadError {
        self.wrong_in(format!("byte {}", self.at), message)
    }

    /// An error in a named part.
    pub fn wrong_in(&self, place: impl Into<String>, message: String) -> LoadError {
        self.source.broken(place, message)
    }
}

/// Vertices and triangles of one file.
#[derive(Clone, Debug, Default)]
pub(super) struct Soup {
    /// Positions in the precision of the file.
    pub positions: Vec<DVec3>,
    /// One for each vertex, or none.
    pub normals: Vec<Vec3>,
    /// One for each vertex, (0, 0) at the first row of a texture; or none.
    pub uvs: Vec<Vec2>,
    /// Linear RGB, one for each vertex, or none.
    pub colors: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    /// Whether faces are flat where the file gives no normals.
    pub flat: bool,
    pub looks: TriangleMaterials,
    pub warnings: Vec<Warning>,
}

/// Materials of a file's triangles; without materials they are grey, or have their vertex colours.
#[derive(Clone, Debug, Default)]
pub(super) struct TriangleMaterials {
    pub materials: Vec<Paint>,
    /// The material of each triangle, where there are materials.
    pub of_triangle: Vec<u32>,
}

/// A material, and the transform of its texture coordinates.
#[derive(Clone, Debug)]
pub(super) struct Paint {
    pub material: Material,
    /// Texture coordinates are multiplied by this.
    pub scale: Vec2,
    /// And then this is added.
    pub offset: Vec2,
}

/// Material of files without materials. It is double-sided, because scans often have holes.
pub(super) fn grey() -> Material {
    Material { double_sided: true, ..Material::colored("grey", Vec3::splat(0.55)) }
}

/// Material of files with vertex colours and without materials.
pub(super) fn white() -> Material {
    Material { double_sided: true, ..Material::colored("white", Vec3::ONE) }
}

/// A colour as it is shown on a screen, each channel 0 to 1 in sRGB, as linear RGB.
pub(super) fn linear(shown: [f32; 3]) -> Vec3 {
    Vec3::from_array(shown.map(|channel| {
        let channel = f64::from(channel.clamp(0.0, 1.0));
        let linear =
            if channel <= 0.04045 { channel / 12.92 } else { libm::pow((channel + 0.055) / 1.055, 2.4) };
        linear as f32
    }))
}

impl Soup {
    /// Adds a polygon as a fan; fewer than three corners are no face.
    pub fn polygon(&mut self, corners: &[u32]) {
        if let [first, rest @ ..] = corners {
            self.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        }
    }

    /// Warns where f32, as which the file stores positions, is too coarse for its shape.
    pub fn warn_if_rounded(&mut self, path: &Path) {
        let bounds = Bounds::of(self.positions.iter().copied());
        self.warnings.extend(bounds.rounded(&path.display().to_string()));
    }

    /// What has to be subtracted from positions before they are rounded to f32, so that the shape survives:
    /// zero, unless the file is far from its origin for its size.
    pub fn origin(&self) -> DVec3 {
        Bounds::of(self.positions.iter().copied()).origin()
    }

    /// All of it as one mesh, whose material is still to be chosen, positions relative to `origin`.
    pub fn into_mesh(self, path: &Path, origin: DVec3) -> Result<Mesh, LoadError> {
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let source = Source { path };
        let broken = |message: String| source.broken("geometry", format!("{message}; fix the file"));
        let finite = self.normals.iter().chain(&self.colors).all(|v| v.is_finite());
        if !finite || self.uvs.iter().any(|uv| !uv.is_finite()) {
            return Err(broken("a normal, colour or texture coordinate is NaN or infinite".to_owned()));
        }
        let positions: Vec<Vec3> = self.positions.iter().map(|p| (*p - origin).as_vec3()).collect();
        let count = positions.len();
        let mut mesh = Mesh::new(name, positions, self.triangles, 0).map_err(broken)?;
        mesh.normals = match self.normals.len() == count {
            true => Normals::Given(self.normals),
            false if self.flat => Normals::Flat,
            false => Normals::Smooth,
        };
        if self.uvs.len() == count {
            mesh.uvs = self.uvs.into();
        }
        if self.colors.len() == count {
            mesh.colors = self.colors.into();
        }
        Ok(mesh)
    }
}

impl TriangleMaterials {
    /// A mesh for each material that `whole` uses, with all materials; `first` is the number of the first of these.
    pub fn split(self, mut whole: Mesh, first: usize) -> (Vec<Mesh>, Vec<Material>) {
        if self.materials.is_empty() {
            let material = if whole.colors.is_empty() { grey() } else { white() };
            whole.material = first;
            return (vec![whole], vec![material]);
        }
        let parts = whole.split(&self.of_triangle, self.materials.len());
        let dressed = |((index, mut mesh), paint): ((usize, Mesh), &Paint)| {
            mesh.material = first + index;
            mesh.name = format!("{}: {}", whole.name, paint.material.name);
            if (paint.scale, paint.offset) != (Vec2::ONE, Vec2::ZERO) {
                mesh.uvs = mesh.uvs.iter().map(|uv| *uv * paint.scale + paint.offset).collect();
            }
            mesh
        };
        let meshes = parts.into_iter().enumerate().zip(&self.materials).map(dressed);
        let meshes = meshes.filter(|mesh| !mesh.triangles.is_empty()).collect();
        (meshes, self.materials.into_iter().map(|paint| paint.material).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_unpacks_to_more_than_the_limit_is_an_error() {
        let read = |left| {
            let mut data = Vec::new();
            Limited { inner: &[7_u8; 100][..], left }.read_to_end(&mut data).map(|_| data.len())
        };
        assert_eq!(read(100).ok(), Some(100));
        assert!(read(99).is_err_and(|error| error.to_string().contains("2 GiB")));
    }

    #[test]
    fn screen_colours_are_decoded() {
        let [mid, ends] = [linear([0.5; 3]).x, linear([0.0, 1.0, 7.0]).z];
        assert!((mid - 0.214_041_14).abs() < 1e-6 && ends == 1.0);
    }

    #[test]
    fn each_material_gets_the_vertices_it_uses() {
        let positions = [0.0, 1.0, 2.0, 3.0].map(|x| DVec3::new(x, x * x, 0.0)).to_vec();
        let paint = |scale| Paint {
            material: Material::colored("m", Vec3::ONE),
            scale: Vec2::splat(scale),
            offset: Vec2::ZERO,
        };
        let soup = Soup {
            uvs: positions.iter().map(|p| Vec2::splat(p.x as f32)).collect(),
            positions,
            triangles: vec![[0, 1, 2], [1, 3, 2], [2, 1, 0]],
            looks: TriangleMaterials {
                materials: vec![paint(1.0), paint(2.0), paint(1.0)],
                of_triangle: vec![0, 1, 0],
            },
            ..Soup::default()
        };
        let looks = soup.looks.clone();
        let (meshes, materials) = looks.split(soup.into_mesh(Path::new("a.obj"), DVec3::ZERO).unwrap(), 5);
        assert_eq!((meshes.len(), materials.len()), (2, 3));
        assert_eq!((meshes[0].material, meshes[1].material), (5, 6));
        assert_eq!(meshes[0].triangles[..], [[0, 1, 2], [2, 1, 0]]);
        // In the order in which the part uses them.
        assert_eq!(meshes[1].triangles[..], [[0, 1, 2]]);
        assert_eq!(meshes[1].positions.iter().map(|p| p.x).collect::<Vec<_>>(), [1.0, 3.0, 2.0]);
        assert_eq!(meshes[1].uvs[..], [1.0, 3.0, 2.0].map(|x| Vec2::splat(2.0 * x)));
    }
}
