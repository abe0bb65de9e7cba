//! State of a draw: which samples of its triangles are stored, and how. The rules are those of Direct3D 11
//! (Functional Specification 3.0, sections 17.11 to 17.13) for depth, stencil and blending.

use glam::{BVec4A, Vec4};

use crate::geometry::Cull;
use crate::surface::MAX_TARGETS;

/// Comparison of a new value with a stored one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Compare {
    /// Fails.
    Never,
    /// New below stored.
    #[default]
    Less,
    /// Both equal.
    Equal,
    /// New at most stored.
    LessEqual,
    /// New above stored.
    Greater,
    /// Both different.
    NotEqual,
    /// New at least stored.
    GreaterEqual,
    /// Passes.
    Always,
}

impl Compare {
    /// All comparisons.
    pub const ALL: [Self; 8] = [
        Self::Never,
        Self::Less,
        Self::Equal,
        Self::LessEqual,
        Self::Greater,
        Self::NotEqual,
        Self::GreaterEqual,
        Self::Always,
    ];

    /// Whether `new` passes against `stored`.
    pub fn holds<T: PartialOrd>(self, new: T, stored: T) -> bool {
        match self {
            Self::Never => false,
            Self::Less => new < stored,
            Self::Equal => new == stored,
            Self::LessEqual => new <= stored,
            Self::Greater => new > stored,
            Self::NotEqual => new != stored,
            Self::GreaterEqual => new >= stored,
            Self::Always => true,
        }
    }

    /// Whether every new depth between `lo` and `hi` fails against all stored ones between `nearest` and `farthest`.
    pub fn never_holds(self, [lo, hi]: [f32; 2], [nearest, farthest]: [f32; 2]) -> bool {
        match self {
            Self::Never => true,
            Self::Less | Self::LessEqual => lo > farthest,
            Self::Equal => lo > farthest || hi < nearest,
            Self::Greater | Self::GreaterEqual => hi < nearest,
            Self::NotEqual | Self::Always => false,
        }
    }

    /// Whether every new depth between `lo` and `hi` passes against all stored ones between `nearest` and `farthest`.
    pub fn always_holds(self, [lo, hi]: [f32; 2], [nearest, farthest]: [f32; 2]) -> bool {
        match self {
            Self::Always => true,
            Self::Less | Self::LessEqual => hi < nearest,
            Self::Greater | Self::GreaterEqual => lo > farthest,
            Self::NotEqual => lo > farthest || hi < nearest,
            Self::Never | Self::Equal => false,
        }
    }

    /// Whether a new depth that passes is never beyond the stored one.
    fn only_lowers(self) -> bool {
        matches!(self, Self::Never | Self::Less | Self::Equal | Self::LessEqual)
    }
}

/// Depth test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DepthState {
    /// Samples that pass.
    pub test: Compare,
    /// Whether their depth is stored.
    pub write: bool,
}

impl DepthState {
    /// For passes without depths: all samples pass, and no depth is stored.
    pub const NONE: Self = Self { test: Compare::Always, write: false };
}

impl Default for DepthState {
    fn default() -> Self {
        Self { test: Compare::Less, write: true }
    }
}

/// Change of a stored stencil value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum StencilOp {
    /// None.
    #[default]
    Keep,
    /// To 0.
    Zero,
    /// To the reference.
    Replace,
    /// By 1, up to 255.
    Increment,
    /// By -1, down to 0.
    Decrement,
    /// By 1, from 255 to 0.
    IncrementWrap,
    /// By -1, from 0 to 255.
    DecrementWrap,
    /// To its complement.
    Invert,
}

impl StencilOp {
    /// All operations.
    pub const ALL: [Self; 8] = [
        Self::Keep,
        Self::Zero,
        Self::Replace,
        Self::Increment,
        Self::Decrement,
        Self::IncrementWrap,
        Self::DecrementWrap,
        Self::Invert,
    ];

    fn apply(self, stored: u8, reference: u8) -> u8 {
        match self {
            Self::Keep => stored,
            Self::Zero => 0,
            Self::Replace => reference,
            Self::Increment => stored.saturating_add(1),
            Self::Decrement => stored.saturating_sub(1),
            Self::IncrementWrap => stored.wrapping_add(1),
            Self::DecrementWrap => stored.wrapping_sub(1),
            Self::Invert => !stored,
        }
    }
}

/// Stencil test of one face. The test compares the reference with the stored value, both masked by `read_mask`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StencilFace {
    /// Samples that pass.
    pub test: Compare,
    /// Value compared with the stored one, and stored by [`StencilOp::Replace`].
    pub reference: u8,
    /// Bits compared.
    pub read_mask: u8,
    /// Bits changed.
    pub write_mask: u8,
    /// If the stencil test fails.
    pub fail: StencilOp,
    /// If the stencil test passes and the depth test fails.
    pub depth_fail: StencilOp,
    /// If both pass.
    pub pass: StencilOp,
}

impl Default for StencilFace {
    /// Passes and changes nothing.
    fn default() -> Self {
        let (test, keep) = (Compare::Always, StencilOp::Keep);
        Self { test, reference: 0, read_mask: 255, write_mask: 255, fail: keep, depth_fail: keep, pass: keep }
    }
}

impl StencilFace {
    /// Whether the test passes against `stored`.
    fn holds(&self, stored: u8) -> bool {
        self.test.holds(self.reference & self.read_mask, stored & self.read_mask)
    }

    fn changed(&self, op: StencilOp, stored: u8) -> u8 {
        stored & !self.write_mask | op.apply(stored, self.reference) & self.write_mask
    }

    /// Whether samples that fail either test leave the stencil as it is.
    fn fails_without_effect(&self) -> bool {
        self.fail == StencilOp::Keep && self.depth_fail == StencilOp::Keep
    }
}

/// Stencil test. Faces are those on the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stencil {
    /// Of faces that appear counter-clockwise.
    pub front: StencilFace,
    /// Of faces that appear clockwise.
    pub back: StencilFace,
}

/// Combination of a new colour with the stored one, in linear RGBA.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Blend {
    /// The new one.
    #[default]
    Replace,
    /// The new one over the stored one, by the opacity of the new one (Porter and Duff 1984).
    Over,
    /// Sum.
    Add,
    /// Product.
    Multiply,
    /// Smaller of both.
    Min,
    /// Larger of both.
    Max,
}

impl Blend {
    /// All combinations.
    pub const ALL: [Self; 6] = [Self::Replace, Self::Over, Self::Add, Self::Multiply, Self::Min, Self::Max];

    /// `new` combined with `stored`.
    pub fn mix(self, new: Vec4, stored: Vec4) -> Vec4 {
        match self {
            Self::Replace => new,
            Self::Over => {
                let weighted = (new.truncate() * new.w).extend(new.w);
                weighted + stored * (1.0 - new.w)
            }
            Self::Add => new + stored,
            Self::Multiply => new * stored,
            Self::Min => new.min(stored),
            Self::Max => new.max(stored),
        }
    }
}

/// Blending and masks of a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColourState {
    /// Combination with stored colours.
    pub blend: Blend,
    /// Whether red, green, blue and opacity are stored.
    pub mask: [bool; 4],
}

impl ColourState {
    /// Whether storing a colour needs the one before.
    pub(crate) fn reads(&self) -> bool {
        self.blend != Blend::Replace || ![[true; 4], [false; 4]].contains(&self.mask)
    }

    /// Whether colours are stored.
    pub(crate) fn writes(&self) -> bool {
        self.mask != [false; 4]
    }

    /// Whether nothing is left of the colour before.
    pub(crate) fn replaces(&self) -> bool {
        self.blend == Blend::Replace && self.mask == [true; 4]
    }

    /// Colour stored where `new` is drawn over `stored`.
    pub(crate) fn colour(&self, new: Vec4, stored: Vec4) -> Vec4 {
        Vec4::select(BVec4A::from(self.mask), self.blend.mix(new, stored), stored)
    }
}

/// State of a draw. The default stores the nearest opaque sample of front and back faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawState {
    /// Culled faces.
    pub cull: Cull,
    /// Depth test.
    pub depth: DepthState,
    /// Stencil test, if any.
    pub stencil: Option<Stencil>,
    /// Combination with stored colours.
    pub blend: Blend,
    /// Whether red, green, blue and opacity are stored.
    pub colour_mask: [bool; 4],
    /// State of the second to the last colour target; those without one have that of the first.
    pub others: [Option<ColourState>; MAX_TARGETS - 1],
    /// Whether a pixel whose middle the triangle does not cover is shaded at the centroid of the samples that
    /// it covers, in place of the middle, where attributes are beyond those of the vertices. It serves still
    /// triangles through a pinhole and without clip planes across the shutter; others are shaded as without
    /// it.
    pub centroid: bool,
}

impl Default for DrawState {
    fn default() -> Self {
        Self::new(Cull::None)
    }
}

/// Stored values before the first draw of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clear {
    /// Depth.
    pub depth: f32,
    /// Stencil value.
    pub stencil: u8,
}

impl Default for Clear {
    /// Infinitely far, 0.
    fn default() -> Self {
        Self { depth: f32::INFINITY, stencil: 0 }
    }
}

/// Result of the depth and stencil tests of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DepthStencilResult {
    /// Whether depth and colour are stored.
    pub passes: bool,
    /// Stencil afterwards.
    pub stencil: u8,
}

impl DrawState {
    /// Opaque triangles, the nearest of which is stored.
    pub fn new(cull: Cull) -> Self {
        let (depth, blend) = (DepthState::default(), Blend::Replace);
        let others = [None; MAX_TARGETS - 1];
        Self { cull, depth, stencil: None, blend, colour_mask: [true; 4], others, centroid: false }
    }

    /// Whether the nearest sample and its colour are stored, as the sample test does without further state.
    pub(crate) fn keeps_nearest(&self) -> bool {
        let plain = self.blend == Blend::Replace && self.colour_mask == [true; 4];
        plain && self.depth == DepthState::default() && self.stencil.is_none()
    }

    /// Blending and masks of target `number`.
    pub fn target(&self, number: usize) -> ColourState {
        let first = ColourState { blend: self.blend, mask: self.colour_mask };
        number.checked_sub(1).and_then(|other| *self.others.get(other)?).unwrap_or(first)
    }

    /// Whether samples that fail the depth test have no effect, so that tiles in which all fail may be culled.
    pub(crate) fn fails_without_effect(&self) -> bool {
        self.stencil
            .is_none_or(|stencil| stencil.front.fails_without_effect() && stencil.back.fails_without_effect())
    }

    /// Whether stored words of depth and stencil are read.
    pub(crate) fn reads_depth(&self) -> bool {
        self.stencil.is_some() || !matches!(self.depth.test, Compare::Always | Compare::Never)
    }

    /// Whether they need not be read where the bounds of a tile show that all samples pass.
    pub(crate) fn may_skip_reads(&self) -> bool {
        self.stencil.is_none()
    }

    /// Whether a stored depth may become larger.
    pub(crate) fn may_raise_depth(&self) -> bool {
        self.depth.write && !self.depth.test.only_lowers()
    }

    /// Result of the tests for a sample of a counter-clockwise or clockwise face.
    pub(crate) fn test(&self, counter_clockwise: bool, depth: [f32; 2], stencil: u8) -> DepthStencilResult {
        let [new, stored] = depth;
        let nearer = self.depth.test.holds(new, stored);
        let Some(both) = &self.stencil else { return DepthStencilResult { passes: nearer, stencil } };
        let face = if counter_clockwise { &both.front } else { &both.back };
        let inside = face.holds(stencil);
        let op = match (inside, nearer) {
            (false, _) => face.fail,
            (true, false) => face.depth_fail,
            (true, true) => face.pass,
        };
        DepthStencilResult { passes: inside && nearer, stencil: face.changed(op, stencil) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bounds decide nothing that a single pair of depths contradicts.
    #[test]
    fn bounds_agree_with_all_depths_between_them() {
        let steps = || (0..6_u8).map(f32::from);
        for test in Compare::ALL {
            for [lo, hi, nearest, farthest] in steps()
                .flat_map(|a| steps().flat_map(move |b| steps().map(move |c| [a, b, c])))
                .flat_map(|[a, b, c]| steps().map(move |d| [a.min(b), a.max(b), c.min(d), c.max(d)]))
            {
                let within = |lo: f32, hi: f32| steps().filter(move |step| (lo..=hi).contains(step));
                let pairs =
                    || within(lo, hi).flat_map(|new| within(nearest, farthest).map(move |s| (new, s)));
                if test.never_holds([lo, hi], [nearest, farthest]) {
                    assert!(pairs().all(|(new, stored)| !test.holds(new, stored)), "{test:?}");
                }
                if test.always_holds([lo, hi], [nearest, farthest]) {
                    assert!(pairs().all(|(new, stored)| test.holds(new, stored)), "{test:?}");
                }
                let lowers = pairs().all(|(new, stored)| !test.holds(new, stored) || new <= stored);
                assert!(lowers || !test.only_lowers(), "{test:?}");
            }
        }
    }

    #[test]
    fn stencils_saturate_or_wrap() {
        let all = |stored| StencilOp::ALL.map(|op| op.apply(stored, 7));
        assert_eq!(all(255), [255, 0, 7, 255, 254, 0, 254, 0]);
        assert_eq!(all(0), [0, 0, 7, 1, 0, 1, 255, 255]);
    }

    #[test]
    fn masks_protect_bits_and_channels() {
        let face = StencilFace { write_mask: 0x0F, reference: 0x5A, ..StencilFace::default() };
        assert_eq!(face.changed(StencilOp::Replace, 0xF0), 0xFA);
        let high = StencilFace { test: Compare::Equal, reference: 0x5A, read_mask: 0xF0, ..face };
        assert!(high.holds(0x51) && !high.holds(0x6A));
        let red = DrawState { colour_mask: [true, false, false, true], ..DrawState::default() };
        assert_eq!(red.target(0).colour(Vec4::ONE, Vec4::ZERO), Vec4::new(1.0, 0.0, 0.0, 1.0));
        let second = ColourState { blend: Blend::Add, mask: [true; 4] };
        let both = DrawState { others: [Some(second), None, None], ..red };
        assert_eq!([0, 1, 2].map(|number| both.target(number)), [red.target(0), second, red.target(0)]);
    }

    #[test]
    fn colours_are_combined() {
        let (new, stored) = (Vec4::new(1.0, 0.5, 0.0, 0.25), Vec4::new(0.5, 0.25, 1.0, 1.0));
        let mixed = Blend::ALL.map(|blend| blend.mix(new, stored));
        assert_eq!(mixed[0], new);
        assert_eq!(mixed[1], Vec4::new(0.625, 0.3125, 0.75, 1.0));
        assert_eq!(mixed[2], Vec4::new(1.5, 0.75, 1.0, 1.25));
        assert_eq!(mixed[3], Vec4::new(0.5, 0.125, 0.0, 0.25));
        assert_eq!([mixed[4], mixed[5]], [Vec4::new(0.5, 0.25, 0.0, 0.25), Vec4::new(1.0, 0.5, 1.0, 1.0)]);
    }

    /// A shadow volume counted where depth fails (Everitt and Kilgard 2002): back faces add, front faces subtract.
    #[test]
    fn faces_change_the_stencil_by_themselves() {
        let op = |depth_fail| StencilFace { depth_fail, ..StencilFace::default() };
        let stencil = Stencil { front: op(StencilOp::DecrementWrap), back: op(StencilOp::IncrementWrap) };
        let state = DrawState { stencil: Some(stencil), ..DrawState::default() };
        assert_eq!(state.test(false, [2.0, 1.0], 0), DepthStencilResult { passes: false, stencil: 1 });
        assert_eq!(state.test(true, [2.0, 1.0], 1), DepthStencilResult { passes: false, stencil: 0 });
        assert_eq!(state.test(true, [0.5, 1.0], 1), DepthStencilResult { passes: true, stencil: 1 });
        assert!(!state.fails_without_effect() && state.reads_depth());
    }
}
