//! Shaders: code that a lane of a warp runs, and that counts its operations as it runs.

use std::cell::{Cell, RefCell};
use std::ops::{Add, Mul, Sub};

use glam::{DAffine3, DVec3, Mat4, Vec2, Vec3, Vec4};

use crate::buffer::{Buffer, Word};
use crate::surface::{BoundSlot, MAX_TARGETS};
use crate::tally::Costs;
use crate::texture::Texture;

/// Shader input, interpolated over the triangle at the reference lens position and time. Interpolators and the
/// normalization of both directions are fixed functions, which are not counted as operations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingPoint {
    /// World position.
    pub position: Vec3,
    /// Unit normal in world space, facing the camera.
    pub normal: Vec3,
    /// Unit vector from the point to the camera.
    pub to_camera: Vec3,
    /// Texture coordinate; zero for draws without any.
    pub uv: Vec2,
    /// Vertex colour in linear RGB, each channel 0 to 1; white for draws without any.
    pub color: Vec3,
    /// Pixel, or cell of the shading grid, from the top left of the image.
    pub pixel: [i32; 2],
    /// Index of the sample in its pixel; 0 for cells.
    pub sample: u32,
    /// Number of the triangle in its draw.
    pub triangle: u32,
}

impl ShadingPoint {
    /// A point at the origin that faces the camera along `z`.
    pub const FACING: Self = Self {
        position: Vec3::ZERO,
        normal: Vec3::Z,
        to_camera: Vec3::Z,
        uv: Vec2::ZERO,
        color: Vec3::ONE,
        pixel: [0; 2],
        sample: 0,
        triangle: 0,
    };
}

/// Colours of a sample, one for each target.
pub type Outputs = [Vec4; MAX_TARGETS];

/// Shader of vertices and surface points. Results have to depend on the arguments alone: workers shade in any order,
/// and the shading cache may return one result to many samples. Its operations are counted from the code as it runs
/// on a [`Lane`].
pub trait Shader: Sync {
    /// Texture sampled at the point's texture coordinate before the shader runs, if any. Its fetches go
    /// through the texture unit and its cache.
    fn texture(&self) -> Option<&Texture> {
        None
    }

    /// Work on a vertex in world space besides moving it to the image plane, which the pipeline does with
    /// every vertex.
    fn vertex(&self, _lane: &Lane, _position: Vec3) {}

    /// Linear RGB radiance and opacity. `texel` is the filtered texel in linear RGBA, or white without a texture.
    fn shade(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Vec4;

    /// Colours for all targets of the pass. A shader of one colour leaves it at that: zeros go to the others.
    fn outputs(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Outputs {
        let mut outputs = [Vec4::ZERO; MAX_TARGETS];
        outputs[0] = self.shade(lane, at, texel);
        outputs
    }

    /// Whether [`Lane::discard_below`] may be called. Then samples are shaded before they are stored; a
    /// shader without it discards nothing.
    fn may_discard(&self) -> bool {
        false
    }
}

/// A value in registers: every component is one operation.
pub trait Operand: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// Components.
    const COMPONENTS: u32;
    /// Larger of both, by component.
    fn larger(self, other: Self) -> Self;
    /// Smaller of both, by component.
    fn smaller(self, other: Self) -> Self;
}

/// A value of three components.
pub trait Vector: Operand {
    /// One component.
    type Part: Operand;
    /// `self . other`.
    fn inner(self, other: Self) -> Self::Part;
    /// Divided by its length; zero for zero.
    fn unit(self) -> Self;
}

macro_rules! vectors {
    ($($value:ty: $part:ty),*) => {
        $(impl Vector for $value {
            type Part = $part;
            fn inner(self, other: Self) -> $part {
                self.dot(other)
            }
            fn unit(self) -> Self {
                self.normalize_or_zero()
            }
        })*
    };
}
vectors!(Vec3: f32, DVec3: f64);

macro_rules! operands {
    ($($value:ty: $components:literal),*) => {
        $(impl Operand for $value {
            const COMPONENTS: u32 = $components;
            fn larger(self, other: Self) -> Self {
                self.max(other)
            }
            fn smaller(self, other: Self) -> Self {
                self.min(other)
            }
        })*
    };
}
operands!(u32: 1, f32: 1, f64: 1, Vec2: 2, Vec3: 3, Vec4: 4, DVec3: 3);

/// Addresses of lines that the lanes of a quad read.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    /// By fetches, in order.
    fetched: Vec<u64>,
    /// By loads, each with how many loads its lane made before.
    loaded: Vec<(u32, u64)>,
}

impl Lines {
    /// The lines as the texture cache sees them: those of fetches, then those of loads. The n-th loads of the
    /// lanes are one access, which reads a line once.
    pub fn accessed(mut self) -> impl Iterator<Item = u64> {
        // The loads of each lane are sorted already, and a stable sort merges such runs.
        self.loaded.sort();
        self.loaded.dedup();
        self.fetched.into_iter().chain(self.loaded.into_iter().map(|(_, line)| line))
    }
}

/// A lane of a warp. It computes what a shader requests and counts the operations: a multiply-add, or
/// anything simpler, of one component is one operation; so are a comparison, a reciprocal and a square root,
/// as in the shader cores of the GPU files. Constants and the choice between programs that is the same for a
/// whole draw are free.
#[derive(Debug, Default)]
pub struct Lane<'a> {
    ops: Cell<u32>,
    branches: Cell<u32>,
    discarded: Cell<bool>,
    /// What the draw binds, by slot.
    bound: &'a [BoundSlot<'a>],
    fetches: Cell<u32>,
    loads: Cell<u32>,
    /// Lines that were read, if they are of interest.
    lines: Option<&'a RefCell<Lines>>,
    /// Costs of kernels, if they are known from other lanes.
    costs: Option<&'a Costs>,
}

impl<'a> Lane<'a> {
    /// A lane that reads what a draw binds.
    pub(crate) fn reading(bound: &'a [BoundSlot<'a>]) -> Self {
        Self { bound, ..Self::default() }
    }

    /// A lane that knows the costs of kernels.
    pub(crate) fn knowing(costs: &'a Costs) -> Self {
        Self { costs: Some(costs), ..Self::default() }
    }

    /// A lane that reads what a draw binds, and notes the lines it reads.
    pub(crate) fn noting(bound: &'a [BoundSlot<'a>], lines: &'a RefCell<Lines>) -> Self {
        Self { bound, lines: Some(lines), ..Self::default() }
    }

    fn note(&self, line: u64) {
        if let Some(lines) = self.lines {
            lines.borrow_mut().fetched.push(line);
        }
    }

    /// Filtered texel at `uv` of the texture or surface bound to `slot`, in linear RGBA, at a level of detail
    /// (0 for the finest; a surface that is bound by one level has no others). An unbound slot reads as zero.
    /// The texture unit does the work: a fetch is no operation of the lane.
    pub fn fetch(&self, slot: usize, uv: Vec2, lod: f32) -> Vec4 {
        let Some(bound) = self.bound.get(slot) else { return Vec4::ZERO };
        let (texel, fetches) = bound.fetch(uv, lod, |line| self.note(line));
        self.fetches.set(self.fetches.get() + fetches);
        texel
    }

    /// Value of a sample of a pixel of what is bound to `slot`, as it is stored: one fetch of the texture
    /// unit. An unbound slot reads as zero.
    pub fn load_sample(&self, slot: usize, pixel: [i32; 2], sample: u32) -> Vec4 {
        let Some(bound) = self.bound.get(slot) else { return Vec4::ZERO };
        self.fetches.set(self.fetches.get() + 1);
        bound.load(pixel, sample, |line| self.note(line))
    }

    /// The value at `index` of a buffer that the draw binds. It is an operation, as a load of a group is, and
    /// a fetch of the texture unit, through whose cache it reads: the n-th loads of the lanes of a quad read
    /// each line once. A buffer that is not bound reads as zero, and so does an index beyond it, which helper
    /// lanes may have; no line is read then.
    pub fn load<T: Word>(&self, buffer: Buffer<T>, index: u32) -> T {
        self.count(1);
        self.fetches.set(self.fetches.get() + 1);
        let nth = self.loads.replace(self.loads.get() + 1);
        let found = self.bound.iter().find_map(|bound| bound.word(buffer.number(), index));
        if let (Some((_, line)), Some(lines)) = (found, self.lines) {
            lines.borrow_mut().loaded.push((nth, line));
        }
        T::of(found.map_or(0, |(word, _)| word))
    }

    /// Fetches so far.
    pub fn fetches(&self) -> u32 {
        self.fetches.get()
    }

    /// Operations so far.
    pub fn ops(&self) -> u32 {
        self.ops.get()
    }

    /// Whether the lane chose a path by its data. A program that never does has the same cost for all data.
    pub fn has_branched(&self) -> bool {
        self.branches.get() > 0
    }

    /// Whether the samples are discarded.
    pub fn is_discarded(&self) -> bool {
        self.discarded.get()
    }

    #[inline(always)]
    pub(crate) fn count(&self, ops: u32) {
        self.ops.set(self.ops.get() + ops);
    }

    /// `a + b`.
    #[inline(always)]
    pub fn add<T: Operand>(&self, a: T, b: T) -> T {
        self.count(T::COMPONENTS);
        a + b
    }

    /// `a - b`.
    #[inline(always)]
    pub fn sub<T: Operand>(&self, a: T, b: T) -> T {
        self.count(T::COMPONENTS);
        a - b
    }

    /// `a b`, by component.
    #[inline(always)]
    pub fn mul<T: Operand>(&self, a: T, b: T) -> T {
        self.count(T::COMPONENTS);
        a * b
    }

    /// `a b + c`, by component, rounded after each operation.
    #[inline(always)]
    pub fn madd<T: Operand>(&self, a: T, b: T, c: T) -> T {
        self.count(T::COMPONENTS);
        a * b + c
    }

    /// `a b + c`, rounded once, as the sample test rounds.
    #[inline(always)]
    pub fn fused(&self, a: f32, b: f32, c: f32) -> f32 {
        self.count(1);
        a.mul_add(b, c)
    }

    /// `a` with every component multiplied by `factor`.
    #[inline(always)]
    pub fn scale<T: Operand + Mul<f32, Output = T>>(&self, a: T, factor: f32) -> T {
        self.count(T::COMPONENTS);
        a * factor
    }

    /// Larger of both, by component.
    #[inline(always)]
    pub fn max<T: Operand>(&self, a: T, b: T) -> T {
        self.count(T::COMPONENTS);
        a.larger(b)
    }

    /// Smaller of both, by component.
    #[inline(always)]
    pub fn min<T: Operand>(&self, a: T, b: T) -> T {
        self.count(T::COMPONENTS);
        a.smaller(b)
    }

    /// `a` limited to 0 to 1, one operation as the result modifier of GPUs.
    #[inline(always)]
    pub fn saturate(&self, a: f32) -> f32 {
        self.count(1);
        a.clamp(0.0, 1.0)
    }

    /// `a` without its lowest `bits`, divided by two to their power.
    #[inline(always)]
    pub fn shift_right(&self, a: u32, bits: u32) -> u32 {
        self.count(1);
        a >> bits
    }

    /// Bits that are set in both `a` and `b`.
    #[inline(always)]
    pub fn and(&self, a: u32, b: u32) -> u32 {
        self.count(1);
        a & b
    }

    /// Bits that differ in `a` and `b`.
    #[inline(always)]
    pub fn xor(&self, a: u32, b: u32) -> u32 {
        self.count(1);
        a ^ b
    }

    /// Lower 32 bits of `a b`.
    #[inline(always)]
    pub fn mul_low(&self, a: u32, b: u32) -> u32 {
        self.count(1);
        a.wrapping_mul(b)
    }

    /// Largest integer not above `a`.
    #[inline(always)]
    pub fn floor(&self, a: f64) -> f64 {
        self.count(1);
        libm::floor(a)
    }

    /// Smallest integer not below `a`.
    #[inline(always)]
    pub fn ceil(&self, a: f64) -> f64 {
        self.count(1);
        libm::ceil(a)
    }

    /// `a` as a number in double precision.
    #[inline(always)]
    pub fn number(&self, a: u32) -> f64 {
        self.count(1);
        f64::from(a)
    }

    /// `a` rounded toward zero, as an integer; the nearest integer of 32 bits beyond their range, and 0 for NaN.
    #[inline(always)]
    pub fn truncate(&self, a: f32) -> u32 {
        self.count(1);
        a as u32
    }

    /// `a . b`: three multiply-adds.
    #[inline(always)]
    pub fn dot<T: Vector>(&self, a: T, b: T) -> T::Part {
        self.count(3);
        a.inner(b)
    }

    /// `a / b`: a reciprocal and a product.
    #[inline(always)]
    pub fn div(&self, a: f64, b: f64) -> f64 {
        self.count(2);
        a / b
    }

    /// `1 / a`.
    #[inline(always)]
    pub fn recip(&self, a: f32) -> f32 {
        self.count(1);
        1.0 / a
    }

    /// Square root.
    #[inline(always)]
    pub fn sqrt(&self, a: f32) -> f32 {
        self.count(1);
        a.sqrt()
    }

    /// Square root in double precision.
    #[inline(always)]
    pub fn root(&self, a: f64) -> f64 {
        self.count(1);
        libm::sqrt(a)
    }

    /// Natural logarithm: one to the base of two, and a product.
    #[inline(always)]
    pub fn ln(&self, a: f64) -> f64 {
        self.count(2);
        libm::log(a)
    }

    /// `e` to the power of `a`: a product, and two to its power.
    #[inline(always)]
    pub fn exp(&self, a: f64) -> f64 {
        self.count(2);
        libm::exp(a)
    }

    /// Cosine of an angle: a product that makes it revolutions, and the cosine of those.
    #[inline(always)]
    pub fn cos(&self, a: f64) -> f64 {
        self.count(2);
        libm::cos(a)
    }

    /// Sine of an angle, as [`Lane::cos`].
    #[inline(always)]
    pub fn sin(&self, a: f64) -> f64 {
        self.count(2);
        libm::sin(a)
    }

    /// Angle of a vector: a quotient, a polynomial of six terms in its square, and a selection for each octant.
    #[inline(always)]
    pub fn atan2(&self, y: f64, x: f64) -> f64 {
        self.count(12);
        libm::atan2(y, x)
    }

    /// `a x b`: three products and three multiply-adds.
    #[inline(always)]
    pub fn cross(&self, a: DVec3, b: DVec3) -> DVec3 {
        self.count(6);
        a.cross(b)
    }

    /// Runs a kernel that returns its multiply-adds with its result, as operations of the lane.
    pub fn tallied<T>(&self, kernel: impl FnOnce(&Costs) -> (T, u32)) -> T {
        let (result, madds) = match self.costs {
            Some(costs) => kernel(costs),
            None => kernel(&Costs::default()),
        };
        self.count(madds);
        result
    }

    /// Base-2 logarithm.
    #[inline(always)]
    pub fn log2(&self, a: f32) -> f32 {
        self.count(1);
        libm::log2f(a)
    }

    /// Two to the power of `a`.
    #[inline(always)]
    pub fn exp2(&self, a: f32) -> f32 {
        self.count(1);
        libm::exp2f(a)
    }

    /// `a` divided by its length, zero for zero: a dot product, a square root, a reciprocal and the products.
    #[inline(always)]
    pub fn normalize<T: Vector>(&self, a: T) -> T {
        self.count(8);
        a.unit()
    }

    /// `point` moved by `pose`: nine multiply-adds. Double precision stands for the fixed-point arithmetic of
    /// the hardware.
    #[inline(always)]
    pub(crate) fn transform_f64(&self, pose: &DAffine3, point: DVec3) -> DVec3 {
        self.count(9);
        pose.transform_point3(point)
    }

    /// `matrix` times `vector`: sixteen multiply-adds.
    #[inline(always)]
    pub fn transform4(&self, matrix: &Mat4, vector: Vec4) -> Vec4 {
        self.count(16);
        *matrix * vector
    }

    /// `a` if `a > b`, a test without a branch: `then` or `otherwise`.
    #[inline(always)]
    pub fn select_greater<N: PartialOrd, T>(&self, [a, b]: [N; 2], then: T, otherwise: T) -> T {
        self.count(1);
        if a > b { then } else { otherwise }
    }

    /// Compares and branches: lanes of a quad that differ take both paths. One operation.
    #[inline(always)]
    pub fn branch(&self, condition: bool) -> bool {
        self.count(1);
        self.branches.set(self.branches.get() + 1);
        condition
    }

    /// Discards the samples that this lane shades if `a < b`, and if the shader says that it
    /// [may](Shader::may_discard). A test without a branch: the lane runs on.
    #[inline(always)]
    pub fn discard_below(&self, a: f32, b: f32) {
        self.count(1);
        self.discarded.set(self.discarded.get() || a < b);
    }
}

/// Operations of a shader on one lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Program {
    /// Operations for a surface point; `None` if they depend on the point.
    pub pixel_ops: Option<u32>,
    /// Operations for a vertex at one end of the shutter, without moving it to the image plane.
    pub vertex_ops: u32,
}

impl Program {
    /// Runs `shader` once, as in a pass with so many colour targets. Without branches its cost is the same
    /// for all points.
    pub fn of(shader: &dyn Shader, targets: usize) -> Self {
        let [pixel, vertex] = [Lane::default(), Lane::default()];
        if targets > 1 {
            shader.outputs(&pixel, &ShadingPoint::FACING, Vec4::ONE);
        } else {
            shader.shade(&pixel, &ShadingPoint::FACING, Vec4::ONE);
        }
        shader.vertex(&vertex, Vec3::ZERO);
        let pixel_ops = (!pixel.has_branched()).then(|| pixel.ops());
        Self { pixel_ops, vertex_ops: vertex.ops() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_component_is_an_operation() {
        let lane = Lane::default();
        assert_eq!(lane.madd(Vec3::splat(2.0), Vec3::X, Vec3::ONE), Vec3::new(3.0, 1.0, 1.0));
        assert_eq!(lane.ops(), 3);
        assert!((lane.normalize(Vec3::new(3.0, 0.0, 4.0)) - Vec3::new(0.6, 0.0, 0.8)).length() < 1e-6);
        assert_eq!(lane.ops(), 3 + 8);
        assert_eq!(lane.scale(Vec4::ONE, 2.0), Vec4::splat(2.0));
        assert_eq!(lane.ops(), 11 + 4);
        assert!(!lane.has_branched());
    }

    struct Loop;

    impl Shader for Loop {
        fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
            let mut sum = 0.0;
            while lane.branch(sum < at.position.x) {
                sum = lane.add(sum, 1.0);
            }
            Vec4::splat(sum)
        }
    }

    struct TwoTargets;

    impl Shader for TwoTargets {
        fn shade(&self, lane: &Lane, _: &ShadingPoint, texel: Vec4) -> Vec4 {
            lane.scale(texel, 2.0)
        }

        fn outputs(&self, lane: &Lane, at: &ShadingPoint, texel: Vec4) -> Outputs {
            let mut outputs = [self.shade(lane, at, texel); MAX_TARGETS];
            outputs[1] = lane.scale(lane.scale(texel, 3.0), 4.0);
            outputs
        }
    }

    #[test]
    fn a_program_costs_what_it_computes_for_the_targets_of_the_pass() {
        let ops = |targets| Program::of(&TwoTargets, targets).pixel_ops;
        assert_eq!([ops(1), ops(2)], [Some(4), Some(12)]);
    }

    #[test]
    fn a_program_that_branches_has_no_single_cost() {
        assert_eq!(Program::of(&Loop, 1).pixel_ops, None);
        let ops = |x: f32| {
            let lane = Lane::default();
            Loop.shade(&lane, &ShadingPoint { position: Vec3::X * x, ..ShadingPoint::FACING }, Vec4::ONE);
            lane.ops()
        };
        assert_eq!([ops(0.0), ops(1.0), ops(5.0)], [1, 3, 11]);
    }
}
