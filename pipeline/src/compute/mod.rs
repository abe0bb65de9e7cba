//! Compute: groups of lanes that share memory and barriers, and work on buffers.
//!
//! A [`GroupShader`] is code that computes its results and counts its work as it runs: operations on a
//! [`Lane`](crate::shader::Lane), accesses to shared memory and to buffers, atomics and barriers. Lanes run one after
//! another between barriers, and the accesses of a warp are put side by side: the n-th load of a buffer by each lane is one
//! access of the warp, and so on for each kind. Where lanes leave a loop at different times this is
//! what happens; where they take different sides of a branch it is an approximation.
//!
//! What depends on order:
//!
//! - A group sees the buffers as they were before the pass. Stores and atomics of all groups take effect in the order of
//!   the groups when the pass ends. So groups run in parallel, and results are the same for any number of threads.
//! - For the same reason no atomic on a buffer returns the word before it.
//! - Caches see the lines in the order of the groups.
//!
//! Programs read surfaces through a [`SurfaceView`].

mod group;
mod warp;

use glam::Vec4;
use serde::{Deserialize, Serialize};

use crate::buffer::{Buffer, BufferBinding};
use crate::surface::{Format, Layout, SurfaceSpec};

pub use group::{Fault, Group, GroupLane};
pub(crate) use group::{GroupLog, run};
pub(crate) use warp::Touched;

/// Sizes of the hardware for groups.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComputeSpec {
    /// Lanes of a warp, 1 to 128.
    pub warp_lanes: u32,
    /// Most lanes of a group, 1 to 4096.
    pub group_lanes: u32,
    /// Most bytes of shared memory of a group, up to 1 MiB.
    pub shared_bytes: u32,
    /// Banks of a shared memory, 1 to 128; words of four bytes lie in them in turn.
    pub banks: u32,
    /// Atomic units, 1 to 128; lines belong to them in turn.
    pub atomic_units: u32,
}

impl ComputeSpec {
    /// The first invalid field, with its value and the allowed values.
    pub(crate) fn invalid(&self) -> Option<(&'static str, u32, &'static str)> {
        let few = "it has to be 1 to 128";
        let fields = [
            ("compute.warp_lanes", self.warp_lanes, 1..=128, few),
            ("compute.group_lanes", self.group_lanes, 1..=4096, "it has to be 1 to 4096"),
            ("compute.shared_bytes", self.shared_bytes, 0..=1 << 20, "it has to be 0 to 1048576"),
            ("compute.banks", self.banks, 1..=128, few),
            ("compute.atomic_units", self.atomic_units, 1..=128, few),
        ];
        let mut wrong = fields.into_iter().filter(|(_, value, range, _)| !range.contains(value));
        wrong.next().map(|(field, value, _, allowed)| (field, value, allowed))
    }
}

/// Program of a group.
pub trait GroupShader: Sync {
    /// Runs the group: lanes with [`Group::lanes`], and barriers between them.
    fn run(&self, group: &mut Group<'_>);
}

/// A dispatch of groups.
#[derive(Clone, Copy)]
pub struct ComputePass<'a> {
    /// Name in reports.
    pub name: &'a str,
    /// Groups along x, y and z, each at least 1.
    pub groups: [u32; 3],
    /// Lanes of a group, at least 1.
    pub group_size: u32,
    /// Bytes of shared memory of a group, a multiple of four.
    pub shared_bytes: u32,
    /// Buffers that it reads and writes.
    pub bindings: &'a [BufferBinding],
    /// Program.
    pub shader: &'a dyn GroupShader,
}

/// Why groups cannot run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ComputeError {
    /// The GPU has no compute unit.
    #[error("the GPU has no compute unit; choose one with `compute` in its file, such as `reference`")]
    Missing,
    /// There are no groups, or too many.
    #[error("{groups:?} groups; there have to be 1 to 16777216 of them")]
    Groups {
        /// Groups along each axis.
        groups: [u32; 3],
    },
    /// A group is empty or too large.
    #[error("a group of {lanes} lanes; the GPU runs groups of 1 to {most}")]
    Lanes {
        /// Lanes of a group.
        lanes: u32,
        /// Most lanes of a group.
        most: u32,
    },
    /// A group has too much shared memory.
    #[error("{bytes} bytes of shared memory; the GPU gives a group up to {most}, in words of 4")]
    Shared {
        /// Bytes of a group.
        bytes: u32,
        /// Most bytes of a group.
        most: u32,
    },
    /// A program did what the hardware forbids.
    #[error("group {group:?}, lane {lane}: {fault}")]
    Fault {
        /// The group.
        group: [u32; 3],
        /// Lane in the group.
        lane: u32,
        /// What it did.
        fault: Fault,
    },
}

/// Most groups of a pass.
const MAX_GROUPS: u64 = 1 << 24;

impl ComputePass<'_> {
    /// Number of groups.
    pub fn count(&self) -> u64 {
        self.groups.iter().map(|&count| u64::from(count)).product()
    }

    /// Place of group `number` along x, y and z.
    pub(crate) fn group(&self, number: u64) -> [u32; 3] {
        let [x, y] = [u64::from(self.groups[0]), u64::from(self.groups[1])];
        [number % x, number / x % y, number / x / y].map(|at| at as u32)
    }

    /// Checks the sizes against the hardware.
    pub(crate) fn check(&self, spec: Option<&ComputeSpec>) -> Result<ComputeSpec, ComputeError> {
        let spec = spec.ok_or(ComputeError::Missing)?;
        if self.groups.contains(&0)
            || self.groups.iter().any(|&n| u64::from(n) > MAX_GROUPS)
            || self.count() > MAX_GROUPS
        {
            return Err(ComputeError::Groups { groups: self.groups });
        }
        if !(1..=spec.group_lanes).contains(&self.group_size) {
            return Err(ComputeError::Lanes { lanes: self.group_size, most: spec.group_lanes });
        }
        if self.shared_bytes > spec.shared_bytes || !self.shared_bytes.is_multiple_of(4) {
            return Err(ComputeError::Shared { bytes: self.shared_bytes, most: spec.shared_bytes });
        }
        Ok(*spec)
    }
}

/// A surface that a pass stored, for programs of groups. Its words are where the pass wrote them, so that caches see the same
/// lines. Fixed functions decode values, as for the typed views of Direct3D 11.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceView {
    words: Buffer<u32>,
    layout: Layout,
    format: Format,
    size: [u32; 2],
}

impl SurfaceView {
    /// A view of `words`, which are those of a surface with this layout.
    pub(crate) fn new(words: Buffer<u32>, layout: Layout, spec: &SurfaceSpec<'_>) -> Self {
        let size = [spec.viewport.width(), spec.viewport.height()];
        Self { words, layout, format: spec.format, size }
    }

    /// The surface, for a pass that reads it.
    pub fn reads(&self) -> BufferBinding {
        self.words.reads()
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Samples per pixel.
    pub fn samples(&self) -> u32 {
        self.layout.samples
    }

    /// Address of a sample of a pixel; `None` outside of the image.
    pub fn address(&self, pixel: [u32; 2], sample: u32) -> Option<u64> {
        let is_inside = self.is_inside(pixel, sample);
        is_inside.then(|| self.layout.at(pixel, sample))
    }

    fn is_inside(&self, pixel: [u32; 2], sample: u32) -> bool {
        pixel[0] < self.size[0] && pixel[1] < self.size[1] && sample < self.samples()
    }

    /// First word of a sample; beyond all words outside of the image.
    fn index(&self, pixel: [u32; 2], sample: u32) -> u32 {
        if self.is_inside(pixel, sample) { self.layout.word(pixel, sample) } else { u32::MAX - 1 }
    }
}

impl GroupLane<'_, '_> {
    /// Value of a sample of a pixel, by a load of each of its words; 0 after a fault, as outside of the image.
    pub fn texel(&self, view: &SurfaceView, pixel: [u32; 2], sample: u32) -> Vec4 {
        let first = view.index(pixel, sample);
        let mut bytes = [0; Format::MAX_BYTES];
        for (word, to) in (first..).zip(bytes.chunks_exact_mut(4)).take(view.format.words() as usize) {
            to.copy_from_slice(&self.load(view.words, word).to_le_bytes());
        }
        view.format.decode(&bytes)
    }
}
