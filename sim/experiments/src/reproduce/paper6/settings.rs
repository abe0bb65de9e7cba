//! Settings of Paper VI's rows.

use serde::{Deserialize, Serialize};
use workloads::collision::Method;

use super::super::Paper;
use super::super::settings::{About, Form, PaperSettings, Setting};

/// Width and height of an image in pixels.
pub(super) type Size = (u32, u32);
/// Coordinates, or sizes along the axes.
pub(super) type Point = (f64, f64, f64);

/// The file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Settings {
    paper: String,
    #[allow(dead_code, reason = "names what passages refer to, for readers of the file")]
    source: String,
    pub vi_1: Missed,
    pub vi_2: Dodged,
    pub vi_3: Tighter,
    pub vi_4: Rate,
    pub vi_5: Cost,
    pub vi_6: Executions,
    pub vi_7: Lost,
    pub vi_8: TorusCount,
    pub vi_9: Darts,
    pub vi_10: Noise,
    pub vi_11: Glossy,
    pub vi_12: Shadows,
    pub vi_13: Views,
    pub vi_14: Views,
    pub vi_15: Depths,
    pub vi_16: Culling,
}

/// VI-1.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Missed {
    pub about: About,
    pub methods: Setting<Vec<Method>>,
    pub resolution_px: Setting<u32>,
    pub cases_of_each_family: Setting<usize>,
    pub seed: Setting<u64>,
    pub public_scenes: Setting<Vec<PublicScene>>,
}

/// A public scene with what is known of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PublicScene {
    pub file: String,
    pub objects: usize,
    /// Pairs that collide.
    pub collide: usize,
}

/// VI-2.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Dodged {
    pub about: About,
    pub methods: Setting<Vec<Method>>,
    pub resolution_px: Setting<u32>,
    /// Names of those in `objects`.
    pub cases: Setting<String>,
    pub objects: Setting<Vec<TwoObjects>>,
}

/// Two objects that move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TwoObjects {
    pub name: String,
    /// Whether they do.
    pub collide: bool,
    pub first: Moving,
    pub second: Moving,
}

/// A shape that goes straight from one place to another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Moving {
    pub shape: Shape,
    /// About z.
    pub turned_deg: f64,
    pub from: Point,
    pub to: Point,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum Shape {
    /// Lengths along x, y and z.
    Cuboid(f64, f64, f64),
    Ball {
        radius: f64,
        segments: u32,
    },
}

/// VI-3.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Tighter {
    pub about: About,
    pub resolution_px: Setting<u32>,
    pub cases_of_each_family: Setting<usize>,
    pub seed: Setting<u64>,
}

/// VI-4.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Rate {
    pub about: About,
    pub boxes_in_t: Setting<Vec<u32>>,
    pub tile_px: Setting<u32>,
    pub motion_m: Setting<f32>,
    pub yards: Setting<u64>,
    pub asked: Setting<u32>,
    pub size_px: Setting<Size>,
    pub samples: Setting<u32>,
}

/// VI-5.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Cost {
    pub about: About,
    pub samples: Setting<Vec<u32>>,
    pub objects: Setting<Asked>,
    pub boxes_charged: Setting<f64>,
    pub far_fewer: Setting<f64>,
    pub tile_px: Setting<u32>,
    pub yards: Setting<u64>,
    pub asked: Setting<u32>,
    pub size_px: Setting<Size>,
}

/// The objects over which costs are averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Asked {
    All,
    /// Those that no sample sees.
    Hidden,
}

/// VI-6.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Executions {
    pub about: About,
    pub cells: Setting<u32>,
    pub dark_red: Setting<u32>,
    pub slope: Setting<f64>,
    pub depth_m: Setting<f64>,
    pub size_px: Setting<Size>,
}

/// VI-7.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Lost {
    pub about: About,
    pub slope: Setting<f64>,
    pub pleat: Setting<f64>,
    pub cells: Setting<u32>,
    pub size_px: Setting<Size>,
    pub turned_beams: Setting<u32>,
    pub turned_floors: Setting<Vec<f64>>,
    pub turned_px: Setting<Size>,
    pub seed: Setting<u64>,
}

/// VI-8.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TorusCount {
    pub about: About,
    pub seed: Setting<u64>,
    pub ring: Setting<f64>,
    pub tube: Setting<f64>,
    pub side_px: Setting<u32>,
    pub samples: Setting<u32>,
    pub standard_errors: Setting<f64>,
    pub least_samples: Setting<f64>,
}

/// VI-9.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Darts {
    pub about: About,
    pub radius_2d: Setting<f64>,
    pub radius_3d: Setting<f64>,
    pub rounds: Setting<u32>,
    pub side_px: Setting<u32>,
    pub samples: Setting<u32>,
    pub places: Setting<u64>,
    pub seed: Setting<u64>,
}

/// VI-10.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Noise {
    pub about: About,
    pub sets: Setting<u64>,
    pub points: Setting<usize>,
    pub cells: Setting<(u64, u64, u64, u64)>,
    pub fits: Setting<(f64, f64)>,
}

/// VI-11.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Glossy {
    pub about: About,
    pub samples: Setting<(u32, u32)>,
    pub lens_radius: Setting<f64>,
    pub index: Setting<f64>,
    pub texels: Setting<u32>,
    pub reference_tables: Setting<u32>,
    pub blur_off: Setting<(f64, f64)>,
}

/// VI-12.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Shadows {
    pub about: About,
    pub places: Setting<u32>,
    pub size_px: Setting<Size>,
    pub frame: Setting<u32>,
}

/// VI-13 and VI-14.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Views {
    pub about: About,
    pub increase_percent: Setting<f64>,
    pub within_points: Setting<f64>,
    pub entries: Setting<u32>,
    pub samples: Setting<u32>,
    pub eyes: Setting<f64>,
    pub size_px: Setting<Size>,
    pub lens_over_eyes: Setting<f64>,
    pub shutter: Setting<f64>,
    /// Name and frame.
    pub scene: Setting<(String, u32)>,
    pub quads: Setting<u32>,
    pub ways: Setting<u32>,
    pub policy: Setting<Policy>,
    pub overlap: Setting<u32>,
    pub views: Setting<u32>,
    pub curve_entries: Setting<Vec<u32>>,
}

/// Which entry of a full set makes room.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Policy {
    Lru,
    Fifo,
}

impl Policy {
    /// As the file has it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lru => "lru",
            Self::Fifo => "fifo",
        }
    }
}

/// VI-15.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Depths {
    pub about: About,
    pub mode: Setting<Mode>,
    pub triangles: Setting<Triangles>,
    pub planes: Setting<Planes>,
    pub tile_px: Setting<u32>,
    pub conservative_tile_px: Setting<u32>,
    pub points: Setting<u32>,
    pub random_triangles: Setting<u32>,
    pub values_of_each_family: Setting<usize>,
    pub of_each_scene: Setting<usize>,
    pub side_px: Setting<u32>,
    pub seed: Setting<u64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Mode {
    Standard,
    Conservative,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Triangles {
    /// Of the failure catalogue.
    Catalogue,
    /// One half with both ends anywhere, the other drifting.
    Random,
}

/// Where the moving planes go through the triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Planes {
    /// At the ends of the shutter.
    Shutter,
    /// At the ends of the tile's own time.
    Tile,
}

/// VI-16.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Culling {
    pub about: About,
    pub hardware: Setting<Vec<Hardware>>,
    pub values_of_each_family: Setting<usize>,
    pub side_px: Setting<u32>,
    pub triangles: Setting<u32>,
    pub seed: Setting<u64>,
}

/// What is switched on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Hardware {
    pub name: String,
    pub auto: bool,
    pub bound: Bound,
    pub boxes: (u32, u32, u32),
    pub z_min: bool,
}

/// As `pipeline::depth::DepthBound`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Bound {
    Vertices,
    VerticesInTime,
    Planes,
    LocalPlanes,
}

/// Sizes that an image may have.
fn image(size: &Size) -> bool {
    [size.0, size.1].iter().all(|side| (8..=4096).contains(side))
}

const IMAGE: &str = "8 to 4096 pixels across and down";

impl PaperSettings for Settings {
    const PAPER: Paper = Paper::Six;
    const FILE: &str = "sim/experiments/papers/paper6.ron";
    const TEXT: &str = include_str!("../../../papers/paper6.ron");

    fn paper(&self) -> &str {
        &self.paper
    }

    fn check(&self) -> Result<(), String> {
        self.vi_1.check()?;
        self.vi_2.check()?;
        self.vi_3.check()?;
        self.vi_4.check()?;
        self.vi_5.check()?;
        self.vi_6.check()?;
        self.vi_7.check()?;
        self.vi_8.check()?;
        self.vi_9.check()?;
        self.vi_10.check()?;
        self.vi_11.check()?;
        self.vi_12.check()?;
        self.vi_13.check("vi_13")?;
        self.vi_14.check("vi_14")?;
        self.vi_15.check()?;
        self.vi_16.check()
    }
}

impl Missed {
    fn check(&self) -> Result<(), String> {
        self.methods.must("vi_1.methods", |methods| !methods.is_empty(), "a list of one or more")?;
        self.resolution_px.within("vi_1.resolution_px", 1..=1024)?;
        self.cases_of_each_family.within("vi_1.cases_of_each_family", 1..=1000)?;
        self.seed.within("vi_1.seed", 0..=u64::MAX)?;
        self.public_scenes.must("vi_1.public_scenes", |_| true, "a list")
    }
}

impl Dodged {
    fn check(&self) -> Result<(), String> {
        self.methods.must("vi_2.methods", |methods| !methods.is_empty(), "a list of one or more")?;
        self.resolution_px.within("vi_2.resolution_px", 1..=1024)?;
        let finite = |(x, y, z): &Point| [x, y, z].iter().all(|at| at.abs() <= 1e6);
        let fits = |shape: &Shape| match shape {
            Shape::Cuboid(x, y, z) => [x, y, z].iter().all(|side| **side > 0.0 && **side <= 1e6),
            Shape::Ball { radius, segments } => {
                *radius > 0.0 && *radius <= 1e6 && (3..=256).contains(segments)
            }
        };
        let good = |one: &Moving| {
            finite(&one.from) && finite(&one.to) && one.turned_deg.abs() <= 360.0 && fits(&one.shape)
        };
        let both = |two: &TwoObjects| good(&two.first) && good(&two.second);
        self.objects.must(
            "vi_2.objects",
            |objects| objects.iter().all(both),
            "shapes above 0 at places and turns that are numbers",
        )?;
        let known = |name: &String| self.objects.get(Form::Full).iter().any(|two| two.name == *name);
        self.cases.must("vi_2.cases", known, "the name of one of `objects`")
    }
}

impl Tighter {
    fn check(&self) -> Result<(), String> {
        self.resolution_px.within("vi_3.resolution_px", 1..=1024)?;
        self.cases_of_each_family.within("vi_3.cases_of_each_family", 1..=1000)?;
        self.seed.within("vi_3.seed", 0..=u64::MAX)
    }
}

/// Sides of tiles that the hardware takes.
fn tile(side: &u32) -> bool {
    side.is_power_of_two() && *side <= 32
}

const TILE: &str = "a power of two from 1 to 32";

impl Rate {
    fn check(&self) -> Result<(), String> {
        let counts = |list: &Vec<u32>| list.len() > 1 && list.iter().all(|count| (1..=16).contains(count));
        self.boxes_in_t.must("vi_4.boxes_in_t", counts, "two counts or more, each 1 to 16")?;
        self.tile_px.must("vi_4.tile_px", tile, TILE)?;
        self.motion_m.within("vi_4.motion_m", 0.0..=100.0)?;
        self.yards.within("vi_4.yards", 1..=100)?;
        self.asked.within("vi_4.asked", 1..=10_000)?;
        self.size_px.must("vi_4.size_px", image, IMAGE)?;
        self.samples.within("vi_4.samples", 1..=256)
    }
}

impl Cost {
    fn check(&self) -> Result<(), String> {
        let counts = |list: &Vec<u32>| !list.is_empty() && list.iter().all(|count| (1..=256).contains(count));
        self.samples.must("vi_5.samples", counts, "counts of 1 to 256")?;
        self.objects.must("vi_5.objects", |_| true, "all or hidden")?;
        self.boxes_charged.within("vi_5.boxes_charged", 0.0..=1.0)?;
        self.far_fewer.within("vi_5.far_fewer", 1.0..=1e6)?;
        self.tile_px.must("vi_5.tile_px", tile, TILE)?;
        self.yards.within("vi_5.yards", 1..=100)?;
        self.asked.within("vi_5.asked", 1..=10_000)?;
        self.size_px.must("vi_5.size_px", image, IMAGE)
    }
}

impl Executions {
    fn check(&self) -> Result<(), String> {
        self.cells.within("vi_6.cells", 1..=1000)?;
        self.dark_red.within("vi_6.dark_red", 1..=1_000_000)?;
        self.slope.within("vi_6.slope", 0.0..=2.0)?;
        self.depth_m.within("vi_6.depth_m", 0.1..=100.0)?;
        self.size_px.must("vi_6.size_px", image, IMAGE)
    }
}

impl Lost {
    fn check(&self) -> Result<(), String> {
        self.slope.within("vi_7.slope", 0.0..=2.0)?;
        self.pleat.within("vi_7.pleat", 0.0..=0.9)?;
        self.cells.within("vi_7.cells", 1..=200)?;
        self.size_px.must("vi_7.size_px", image, IMAGE)?;
        self.turned_beams.within("vi_7.turned_beams", 1..=100_000)?;
        let low = |list: &Vec<f64>| list.iter().all(|height| (-1.0..=1.0).contains(height));
        self.turned_floors.must("vi_7.turned_floors", low, "heights of -1 to 1")?;
        self.turned_px.must("vi_7.turned_px", image, IMAGE)?;
        self.seed.within("vi_7.seed", 0..=u64::MAX)
    }
}

impl TorusCount {
    fn check(&self) -> Result<(), String> {
        self.seed.within("vi_8.seed", 0..=u64::MAX)?;
        self.ring.within("vi_8.ring", 0.1..=0.4)?;
        self.tube.within("vi_8.tube", 0.01..=0.1 + 0.05)?;
        self.side_px.within("vi_8.side_px", 8..=4096)?;
        self.samples.within("vi_8.samples", 1..=256)?;
        self.standard_errors.within("vi_8.standard_errors", 0.0..=100.0)?;
        self.least_samples.within("vi_8.least_samples", 0.0..=1e12)
    }
}

impl Darts {
    fn check(&self) -> Result<(), String> {
        self.radius_2d.within("vi_9.radius_2d", 0.005..=0.5)?;
        self.radius_3d.within("vi_9.radius_3d", 0.01..=0.5)?;
        self.rounds.within("vi_9.rounds", 1..=8)?;
        self.side_px.within("vi_9.side_px", 8..=4096)?;
        self.samples.within("vi_9.samples", 1..=256)?;
        self.places.within("vi_9.places", 1..=1_000_000_000)?;
        self.seed.within("vi_9.seed", 0..=u64::MAX)
    }
}

impl Noise {
    fn check(&self) -> Result<(), String> {
        self.sets.within("vi_10.sets", 1..=1000)?;
        self.points.within("vi_10.points", 100..=100_000_000)?;
        let cells =
            |(a, b, c, d): &(u64, u64, u64, u64)| [a, b, c, d].iter().all(|count| (2..=64).contains(*count));
        self.cells.must("vi_10.cells", cells, "2 to 64 each")?;
        self.fits.must(
            "vi_10.fits",
            |(low, high)| 0.0 <= *low && low < high && *high <= 1.0,
            "two shares, in order",
        )
    }
}

impl Glossy {
    fn check(&self) -> Result<(), String> {
        let counts = |(few, many): &(u32, u32)| 0 < *few && few < many && *many <= 256;
        self.samples.must("vi_11.samples", counts, "two counts up to 256, in order")?;
        self.lens_radius.within("vi_11.lens_radius", 0.001..=10.0)?;
        self.index.within("vi_11.index", 1.0..=3.0)?;
        self.texels.within("vi_11.texels", 4..=512)?;
        self.reference_tables.within("vi_11.reference_tables", 1..=256)?;
        self.blur_off.must(
            "vi_11.blur_off",
            |(part, units)| *part >= 0.0 && *units >= 0.0,
            "two numbers from 0 on",
        )
    }
}

impl Shadows {
    fn check(&self) -> Result<(), String> {
        self.places.within("vi_12.places", 1..=256)?;
        self.size_px.must("vi_12.size_px", image, IMAGE)?;
        self.frame.within("vi_12.frame", 0..=1000)
    }
}

impl Views {
    fn check(&self, row: &str) -> Result<(), String> {
        let name = |field: &str| format!("{row}.{field}");
        self.increase_percent.within(&name("increase_percent"), 0.0..=1e4)?;
        self.within_points.within(&name("within_points"), 0.0..=1e4)?;
        self.entries.within(&name("entries"), 1..=1 << 20)?;
        let samples = |count: &u32| [2, 4, 8, 16, 32].contains(count);
        self.samples.must(&name("samples"), samples, "2, 4, 8, 16 or 32")?;
        self.eyes.within(&name("eyes"), 1e-4..=10.0)?;
        self.size_px.must(&name("size_px"), image, IMAGE)?;
        self.lens_over_eyes.within(&name("lens_over_eyes"), 0.001..=0.5)?;
        self.shutter.within(&name("shutter"), 0.0..=1.0)?;
        self.scene.must(&name("scene"), |(scene, _)| !scene.is_empty(), "a name and a frame")?;
        let entries = |count: &u32| count.is_power_of_two() && (16..=1 << 20).contains(count);
        let stated = *self.entries.get(Form::Full);
        let of_entries = |quads: &u32| entries(quads) && (*quads == stated || 4 * quads == stated);
        let would_do =
            "a power of two: `entries`, or a quarter of them where an entry is one result of a quad";
        self.quads.must(&name("quads"), of_entries, would_do)?;
        self.ways.must(
            &name("ways"),
            |ways| ways.is_power_of_two() && *ways <= 16,
            "a power of two up to 16",
        )?;
        self.policy.must(&name("policy"), |_| true, "lru or fifo")?;
        self.overlap.within(&name("overlap"), 0..=2)?;
        self.views.within(&name("views"), 2..=16)?;
        let all = |list: &Vec<u32>| !list.is_empty() && list.iter().all(entries);
        self.curve_entries.must(&name("curve_entries"), all, "powers of two from 16 to 1048576")
    }
}

impl Depths {
    fn check(&self) -> Result<(), String> {
        self.mode.must("vi_15.mode", |_| true, "standard or conservative")?;
        self.triangles.must("vi_15.triangles", |_| true, "catalogue or random")?;
        self.planes.must("vi_15.planes", |_| true, "shutter or tile")?;
        self.tile_px.must("vi_15.tile_px", |side| tile(side) && *side >= 2, "a power of two from 2 to 32")?;
        self.conservative_tile_px.must("vi_15.conservative_tile_px", tile, TILE)?;
        self.points.within("vi_15.points", 10..=1_000_000)?;
        self.random_triangles.within("vi_15.random_triangles", 2..=1_000_000)?;
        self.values_of_each_family.within("vi_15.values_of_each_family", 1..=100)?;
        self.of_each_scene.within("vi_15.of_each_scene", 1..=1000)?;
        self.side_px.must("vi_15.side_px", |side| [16, 32, 64, 128].contains(side), "16, 32, 64 or 128")?;
        self.seed.within("vi_15.seed", 0..=u64::MAX)
    }
}

impl Culling {
    fn check(&self) -> Result<(), String> {
        let boxes = |(u, v, t): &(u32, u32, u32)| [u, v, t].iter().all(|count| (1..=16).contains(*count));
        let all = |list: &Vec<Hardware>| !list.is_empty() && list.iter().all(|one| boxes(&one.boxes));
        self.hardware.must("vi_16.hardware", all, "one or more, with 1 to 16 boxes along u, v and t")?;
        self.values_of_each_family.within("vi_16.values_of_each_family", 1..=100)?;
        self.side_px.must("vi_16.side_px", |side| [16, 32, 64, 128].contains(side), "16, 32, 64 or 128")?;
        self.triangles.within("vi_16.triangles", 1..=10_000)?;
        self.seed.within("vi_16.seed", 0..=u64::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::settings::load;
    use super::*;

    #[test]
    fn the_committed_file_is_valid() {
        let (_, origin) = load::<Settings>(None).unwrap();
        assert!(origin.committed && origin.sha256.len() == 64);
    }
}
