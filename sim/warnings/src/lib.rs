//! Warnings: results are there, but a method is weak for this input, or something that a file requests was ignored.
//!
//! A [`Warning`] has a [`Code`] that never changes its meaning, and a message for people. All codes are
//! declared in one place, with what they mean and the section of the book that explains them.
//!
//! ```
//! use warnings::{Code, Warning};
//!
//! let light = |node| {
//!     let what = "ignored: only one directional light is used";
//!     Warning::about(Code::LightIgnored, "point light", what, format!("node {node}"))
//! };
//! let folded = Warning::fold([light(4), light(7)]);
//! assert_eq!(folded[0].message, "2 point lights ignored: only one directional light is used");
//! assert_eq!(folded[0].code.name(), "light-ignored");
//! ```

use std::collections::BTreeMap;
use std::fmt;

use serde::{Serialize, Serializer};

/// Where a warning comes from: a section of the book's chapter on warnings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Section {
    /// A run of the simulator.
    Simulator,
    /// A workload.
    Workload,
    /// The analysis of a power trace.
    Trace,
    /// A scene file.
    Scene,
    /// The command `quintile visibility`.
    Visibility,
}

impl Section {
    /// Heading of the section in the book.
    pub const fn heading(self) -> &'static str {
        match self {
            Self::Simulator => "From the simulator",
            Self::Workload => "From workloads",
            Self::Trace => "From the analysis of the trace",
            Self::Scene => "From loading a scene",
            Self::Visibility => "From `quintile visibility`",
        }
    }
}

macro_rules! codes {
    ($($(#[doc = $line:literal])+ $code:ident = $name:literal in $section:ident,)+) => {
        /// Subject of a warning. A code never changes its meaning.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Code {
            $($(#[doc = $line])+ $code,)+
        }

        impl Code {
            /// Every code.
            pub const ALL: &[Self] = &[$(Self::$code),+];

            /// The code as files and messages have it, for example `missing-image`.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$code => $name,)+ }
            }

            /// When it is reported, in a sentence.
            pub const fn meaning(self) -> &'static str {
                match self { $(Self::$code => concat!($($line),+).trim_ascii_start(),)+ }
            }

            /// Where the book explains it.
            pub const fn section(self) -> Section {
                match self { $(Self::$code => Section::$section,)+ }
            }
        }
    };
}

codes! {
    /// A triangle has no area at any time.
    DegenerateTriangle = "degenerate-triangle" in Simulator,
    /// No sample of a frame hits anything.
    EmptyFrame = "empty-frame" in Simulator,
    /// Less than a tenth of the quantity of a heat map has a place in the image.
    HeatOutsideImage = "heat-outside-image" in Simulator,
    /// A frame is busy for less than two samples of the trace.
    ShortFrame = "short-frame" in Simulator,
    /// A true frame start was not found, or a false one was.
    FramesMissed = "frames-missed" in Simulator,
    /// The GPU file names another platform or energy table than those in use, or none.
    PlatformMismatch = "platform-mismatch" in Simulator,
    /// A found frame start is off by more than half of the time that its frame is busy for.
    StartError = "start-error" in Simulator,
    /// A platform draws more power idle than busy.
    IdleAboveBusy = "idle-above-busy" in Simulator,
    /// Power exceeds the recorder's range.
    ClippedSamples = "clipped-samples" in Simulator,
    /// The recorder lost packets, as `--packet-loss` requests.
    PacketsLost = "packets-lost" in Simulator,
    /// A tenth or more of the triangles in view reach behind the camera.
    BehindCamera = "behind-camera" in Simulator,
    /// Half or more of the triangles in view are smaller than the sample spacing.
    SubSampleTriangles = "sub-sample-triangles" in Simulator,
    /// A quarter or more of the triangles in view are a hundred times as long as high.
    SliverTriangles = "sliver-triangles" in Simulator,
    /// A tenth or more of the triangles in view move by more than the longer image side in one shutter.
    FastMotion = "fast-motion" in Simulator,
    /// A quarter or more of the triangles in view have blur larger than the longer image side.
    BlurBeyondImage = "blur-beyond-image" in Simulator,
    /// Products of a triangle's coordinates leave the range of 32-bit floats (lengths beyond about 1e10 or
    /// below 1e-12 scene units).
    CoordinatesOutOfRange = "coordinates-out-of-range" in Simulator,
    /// A corner in view has coordinates whose 32-bit step is larger than a quarter of a pixel there.
    CoordinatesCoarse = "coordinates-coarse" in Simulator,
    /// Triangles in view and in front of the camera are nearer than its near plane, as a whole or in part.
    NearPlaneCuts = "near-plane-cuts" in Simulator,
    /// The timing level is 8 % or more off `stepped` on parts of a frame.
    TimingInaccurate = "timing-inaccurate" in Simulator,
    /// `--verify` finds a larger error than the run states.
    StatedErrorExceeded = "stated-error-exceeded" in Simulator,
    /// An interval of `--timing sampled` is wider than 5 % of its value either way.
    WidePredictionInterval = "wide-prediction-interval" in Simulator,
    /// A preview of `--timing sampled` takes half of a frame's cycles or more.
    CostlyPreview = "costly-preview" in Simulator,
    /// The expected error of the choice exceeds the requested accuracy.
    AccuracyMissed = "accuracy-missed" in Simulator,
    /// Even the cheapest choice was expected to exceed `--budget`.
    BudgetMissed = "budget-missed" in Simulator,
    /// A frame takes longer than a display period.
    MissedVsync = "missed-vsync" in Simulator,
    /// All samples of a pixel have one time while something moves, or one lens position behind a lens.
    SamplesWithoutBlur = "samples-without-blur" in Simulator,
    /// The shortest wave is under four squares of generator triangles long.
    CausticsCoarse = "caustics-coarse" in Workload,
    /// The sides of light volumes cross for more than a tenth of their length on average.
    CausticsCrossed = "caustics-crossed" in Workload,
    /// The host makes the beams of `caustics`, as the GPU has no compute unit.
    CausticsFromHost = "caustics-from-host" in Workload,
    /// Nine in ten pairs with touching swept boxes may collide.
    CollisionNearEverywhere = "collision-near-everywhere" in Workload,
    /// A quarter or more of the tiles are covered for most of their samples, but not all.
    OcclusionSmallOccluders = "occlusion-small-occluders" in Workload,
    /// An access of a reduction of `compute` to shared memory takes two cycles or more on average.
    BankConflicts = "bank-conflicts" in Workload,
    /// An atomic of a histogram of `compute` waits for seven others or more on average.
    AtomicContention = "atomic-contention" in Workload,
    /// A tile of `compute` has more lights than its list takes.
    LightListsFull = "light-lists-full" in Workload,
    /// The mip chain of `compute` leaves out a row or column of the image.
    MipChainOdd = "mip-chain-odd" in Workload,
    /// `quintile sample poisson`: more than one uncovered region per 100 points is thinner than the float
    /// spacing.
    PointsThinRegions = "points-thin-regions" in Workload,
    /// `sampling`: less than 90 % of the darts' points come from passes.
    PointsFromHost = "points-from-host" in Workload,
    /// `sampling`: noise takes more than 20 candidates for a point.
    PointsRejected = "points-rejected" in Workload,
    /// `soft-shadows` has fewer than 16 distinct light samples.
    ShadowBanding = "shadow-banding" in Workload,
    /// The bias is below half a texel of the map or above eight.
    ShadowBias = "shadow-bias" in Workload,
    /// `soft-shadows` draws textured, cut-out, blended or vertex-coloured surfaces, as opaque ones of their
    /// base colour.
    MaterialsSimplified = "materials-simplified" in Workload,
    /// The shader of `multiview` runs a quarter more often than with an unlimited cache.
    ShadingCacheSmall = "shading-cache-small" in Workload,
    /// The outermost views are more than 6 degrees apart and materials have highlights.
    ViewDependentShading = "view-dependent-shading" in Workload,
    /// The lens of `glossy` is wider than half the receiver's shorter side.
    LensWiderThanReceiver = "lens-wider-than-receiver" in Workload,
    /// A deferred renderer lights one sample of a pixel for all of them.
    DeferredOneSurface = "deferred-one-surface" in Workload,
    /// The camera of a deferred renderer moves while the shutter is open.
    DeferredMovingCamera = "deferred-moving-camera" in Workload,
    /// The marked window reaches beyond the trace.
    WindowCut = "window-cut" in Trace,
    /// Power around a mark varies no more than noise.
    FlatMark = "flat-mark" in Trace,
    /// Nothing resembles the marked frame.
    OnlyMark = "only-mark" in Trace,
    /// Matches and other minima are poorly separated.
    WeakSeparation = "weak-separation" in Trace,
    /// More than a tenth of the frames have a confidence below one half.
    LowConfidence = "low-confidence" in Trace,
    /// Too many frames are longer than 1.5 or shorter than 0.5 median durations.
    IrregularSpacing = "irregular-spacing" in Trace,
    /// The window is longer than the median frame.
    WindowLongerThanFrame = "window-longer-than-frame" in Trace,
    /// Work of at least three frames lies before the first start or after the last frame (tracking).
    Uncovered = "uncovered" in Trace,
    /// The median frame has fewer than 50 samples.
    FewSamples = "few-samples" in Trace,
    /// Several rails are added up and one of them is the sum of the others.
    RailCountedTwice = "rail-counted-twice" in Trace,
    /// A column of power that is not read differs by more than 2 % from voltage times current.
    PowerDiffers = "power-differs" in Trace,
    /// The anchors of an alignment contradict the stamps or the trace.
    AnchorsOff = "anchors-off" in Trace,
    /// Without anchors, another pairing of stamps and frames fits about as well, or may do so by chance.
    AmbiguousAlignment = "ambiguous-alignment" in Trace,
    /// Frames or pixels per joule are computed, which cannot be averaged.
    InverseUnits = "inverse-units" in Trace,
    /// Some frames end before a pass begins.
    PassBeyond = "pass-beyond" in Trace,
    /// The runs of a plot differ in their number of frames.
    UnevenRuns = "uneven-runs" in Trace,
    /// Currents or voltages exceed the range of the device.
    Clipped = "clipped" in Trace,
    /// The largest current uses less than 5 % of the range of the device.
    RangeUnused = "range-unused" in Trace,
    /// The idle segment overlaps frames, or idle power is above the mean power of frames.
    IdleBusy = "idle-busy" in Trace,
    /// Power is negative on average.
    NegativePower = "negative-power" in Trace,
    /// The device changes the energy by more than 3 %.
    EnergyChanged = "energy-changed" in Trace,
    /// A texture file cannot be read.
    MissingImage = "missing-image" in Scene,
    /// A `.mtl` file cannot be read, or lacks a material of an OBJ file.
    MissingMaterial = "missing-material" in Scene,
    /// A surface lacks the coordinates that its texture needs.
    MissingTexcoord = "missing-texcoord" in Scene,
    /// A material has an opacity in a place that is not read.
    AlphaIgnored = "alpha-ignored" in Scene,
    /// A material has a normal or bump map.
    NormalMapIgnored = "normal-map-ignored" in Scene,
    /// A material is metallic, or has a metallic-roughness map.
    MetallicIgnored = "metallic-ignored" in Scene,
    /// A material has a highlight, a roughness or reflections of its own.
    ReflectionIgnored = "reflection-ignored" in Scene,
    /// A material has a displacement map.
    DisplacementIgnored = "displacement-ignored" in Scene,
    /// A material emits light.
    EmissiveIgnored = "emissive-ignored" in Scene,
    /// A material has an occlusion map.
    OcclusionMapIgnored = "occlusion-map-ignored" in Scene,
    /// A texture requests no filtering under magnification.
    TextureFilterIgnored = "texture-filter-ignored" in Scene,
    /// A PLY file names a texture in a comment.
    TextureIgnored = "texture-ignored" in Scene,
    /// Faces of a PLY, OFF or STL file have colours.
    FaceColorsIgnored = "face-colors-ignored" in Scene,
    /// A glTF file uses an unsupported extension that changes the picture.
    ExtensionIgnored = "extension-ignored" in Scene,
    /// Points, lines, curves, or a primitive without positions.
    PrimitiveDropped = "primitive-dropped" in Scene,
    /// A camera has no usable numbers.
    CameraIgnored = "camera-ignored" in Scene,
    /// A light that emits is not the one directional light in use.
    LightIgnored = "light-ignored" in Scene,
    /// A scene lies more than 100 times its size from its origin.
    CoordinatesRecentred = "coordinates-recentred" in Scene,
    /// A file with 32-bit positions is so far from its origin that fewer than 4096 distinct positions lie along
    /// a surface's longest side.
    CoordinatesFarFromOrigin = "coordinates-far-from-origin" in Scene,
    /// Most of the scene's surface is enclosed by the rest.
    CameraInside = "camera-inside" in Scene,
    /// A RON scene has a `focus` but no `camera`.
    FocusOfFittedCamera = "focus-of-fitted-camera" in Scene,
    /// `--frames` goes beyond the scene's own frames, and parts leave the view there.
    LeavesFittedView = "leaves-fitted-view" in Scene,
    /// The lens is too large for its focus depth.
    LensLeavesView = "lens-leaves-view" in Scene,
    /// The camera is orthographic and no `--tests` are given.
    OrthographicView = "orthographic-view" in Visibility,
}

impl PartialOrd for Code {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Code {
    /// By name, which is the order in which warnings are reported.
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.name().cmp(other.name())
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Code {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl PartialEq<&str> for Code {
    fn eq(&self, name: &&str) -> bool {
        self.name() == *name
    }
}

/// A run has entered a regime its methods are known to be bad at, or has gone on without something its input
/// requests.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Warning {
    /// Subject of the warning.
    pub code: Code,
    /// The event, the number of things it concerns, and its effect on the results; one line.
    pub message: String,
    /// How many things it concerns (materials, primitives, frames); 1 where it is about the run as a whole.
    pub count: usize,
    /// Which things these are, the first [`Warning::MAX_DETAILS`] of them; none where the message says it all.
    pub details: Vec<String>,
    #[serde(skip)]
    kind: Option<Kind>,
}

/// Parts of a counted message: "3 point lights ignored: only one directional light is used".
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Kind {
    thing: &'static str,
    what: &'static str,
}

impl Warning {
    /// The most details that a warning keeps.
    pub const MAX_DETAILS: usize = 256;

    /// A warning about the run as a whole, or one whose message has all numbers.
    pub fn new(code: Code, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), count: 1, details: Vec::new(), kind: None }
    }

    /// A warning about one `thing`, a noun whose plural ends in `s`; `what` goes on after the noun, and
    /// `detail` says which thing it is. [`Warning::fold`] makes one warning of all that are about the same
    /// kind of thing.
    pub fn about(code: Code, thing: &'static str, what: &'static str, detail: impl Into<String>) -> Self {
        let kind = Kind { thing, what };
        Self { code, message: kind.message(1), count: 1, details: vec![detail.into()], kind: Some(kind) }
    }

    /// The same about as many things as there are `details`, of which only the first are computed.
    pub fn about_all(
        code: Code,
        thing: &'static str,
        what: &'static str,
        details: impl ExactSizeIterator<Item = String>,
    ) -> Option<Self> {
        let (kind, count) = (Kind { thing, what }, details.len());
        let details = details.take(Self::MAX_DETAILS).collect();
        (count > 0).then(|| Self { code, message: kind.message(count), count, details, kind: Some(kind) })
    }

    /// The same with a number of things it concerns, and which these are.
    #[must_use]
    pub fn with_details(mut self, count: usize, details: impl IntoIterator<Item = String>) -> Self {
        self.count = count;
        self.details = details.into_iter().take(Self::MAX_DETAILS).collect();
        self
    }

    /// The warnings in order of their codes, those about the same kind of thing as one with a count, and
    /// equal ones once.
    pub fn fold(all: impl IntoIterator<Item = Self>) -> Vec<Self> {
        let mut counted: BTreeMap<(Code, Kind), Self> = BTreeMap::new();
        let mut folded = Vec::new();
        for warning in all {
            match warning.kind {
                Some(kind) => match counted.get_mut(&(warning.code, kind)) {
                    Some(known) => known.join(warning, kind),
                    None => drop(counted.insert((warning.code, kind), warning)),
                },
                None => folded.push(warning),
            }
        }
        folded.extend(counted.into_values());
        folded.sort();
        folded.dedup();
        folded
    }

    fn join(&mut self, other: Self, kind: Kind) {
        self.count += other.count;
        self.message = kind.message(self.count);
        let room = Self::MAX_DETAILS - self.details.len().min(Self::MAX_DETAILS);
        self.details.extend(other.details.into_iter().take(room));
    }

    /// The message with the first thing that it concerns and how many more there are.
    pub fn line(&self) -> String {
        let message = &self.message;
        match (self.details.first(), self.count) {
            (None, _) => message.clone(),
            (Some(first), 0 | 1) => format!("{message} ({first})"),
            (Some(first), count) => format!("{message} ({first}, and {} more)", count - 1),
        }
    }

    /// How many of the things it concerns are not in its details.
    pub fn omitted(&self) -> usize {
        if self.details.is_empty() { 0 } else { self.count.saturating_sub(self.details.len()) }
    }
}

impl Kind {
    fn message(self, count: usize) -> String {
        let Self { thing, what } = self;
        format!("{count} {thing}{} {what}", if count == 1 { "" } else { "s" })
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{}] {}", self.code, self.line())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(node: usize) -> Warning {
        let what = "ignored: only one directional light is used";
        Warning::about(Code::LightIgnored, "point light", what, format!("node {node}"))
    }

    #[test]
    fn warnings_about_one_kind_of_thing_become_one_with_a_count() {
        let whole = Warning::new(Code::EmptyFrame, "nothing is seen");
        let folded = Warning::fold([light(4), whole.clone(), light(7), whole.clone(), light(9)]);
        assert_eq!(folded.len(), 2);
        assert_eq!(folded[0], whole);
        assert_eq!(folded[1].message, "3 point lights ignored: only one directional light is used");
        assert_eq!((folded[1].count, folded[1].details.len()), (3, 3));
        let head = "[light-ignored] 3 point lights ignored: only one directional light is used";
        assert_eq!(folded[1].to_string(), format!("{head} (node 4, and 2 more)"));
        assert_eq!(folded[0].to_string(), "[empty-frame] nothing is seen");
        assert!(Warning::fold([light(4)])[0].to_string().contains("1 point light ignored"));
    }

    #[test]
    fn folding_twice_changes_nothing() {
        let once = Warning::fold([light(4), light(7)]);
        assert_eq!(Warning::fold(once.clone()), once);
        let more = Warning::fold(once.into_iter().chain([light(9)]));
        assert_eq!((more[0].count, more[0].message.starts_with("3 point lights")), (3, true));
    }

    #[test]
    fn the_number_of_details_is_limited_and_the_count_is_not() {
        let many = Warning::fold((0..1000).map(light));
        assert_eq!((many[0].count, many[0].details.len()), (1000, Warning::MAX_DETAILS));
        assert_eq!(many[0].omitted(), 744);
    }
}
