//! Settings of Paper VI's rows.

use serde::{Deserialize, Serialize};
use workloads::collision::CollisionMethod;

use super::super::Paper;
use super::super::settings::{About, Form, RowSetting, paper_settings, row_settings};

/// Width and height of an image in pixels.
pub(super) type Size = (u32, u32);
/// Coordinates, or sizes along the axes.
pub(super) type Point = (f64, f64, f64);

paper_settings!(Paper::Six, "paper6.ron" {
    vi_1: Missed,
    vi_2: Dodged [check_cases],
    vi_3: Tighter,
    vi_4: Rate,
    vi_5: Cost,
    vi_6: Executions,
    vi_7: Lost,
    vi_8: TorusCount,
    vi_9: Darts,
    vi_10: Noise,
    vi_11: Glossy,
    vi_12: Shadows,
    vi_13: Views [check_quads],
    vi_14: Views [check_quads],
    vi_15: Depths,
    vi_16: Culling,
});

row_settings! {
    /// VI-1.
    Missed {
        methods: Vec<CollisionMethod>, must(|methods| !methods.is_empty(), "a list of one or more");
        resolution_px: u32, within(1..=1024);
        cases_of_each_family: usize, within(1..=1000);
        seed: u64, within(0..=u64::MAX);
        public_scenes: Vec<PublicScene>, must(|_| true, "a list");
    }

    /// VI-2; `cases` are names of those in `objects`.
    Dodged {
        methods: Vec<CollisionMethod>, must(|methods| !methods.is_empty(), "a list of one or more");
        resolution_px: u32, within(1..=1024);
        objects: Vec<TwoObjects>, must(
            |objects| objects.iter().all(TwoObjects::is_possible),
            "shapes above 0 at places and turns that are numbers"
        );
        cases: String, must(|name| !name.is_empty(), "the name of one of `objects`");
    }

    /// VI-3.
    Tighter {
        resolution_px: u32, within(1..=1024);
        cases_of_each_family: usize, within(1..=1000);
        seed: u64, within(0..=u64::MAX);
    }

    /// VI-4.
    Rate {
        boxes_in_t: Vec<u32>, must(|list| list.len() > 1 && counts(list, 16), "two counts or more, each 1 to 16");
        tile_px: u32, must(tile, TILE);
        motion_m: f32, within(0.0..=100.0);
        yards: u64, within(1..=100);
        asked: u32, within(1..=10_000);
        size_px: Size, must(image, IMAGE);
        samples: u32, within(1..=256);
    }

    /// VI-5.
    Cost {
        samples: Vec<u32>, must(|list| !list.is_empty() && counts(list, 256), "counts of 1 to 256");
        objects: QueriedObjects, must(|_| true, "all or hidden");
        boxes_charged: f64, within(0.0..=1.0);
        far_fewer: f64, within(1.0..=1e6);
        tile_px: u32, must(tile, TILE);
        rival_tile_px: u32, must(|side: &u32| [1, 2, 4, 8].contains(side), "1, 2, 4 or 8");
        yards: u64, within(1..=100);
        asked: u32, within(1..=10_000);
        size_px: Size, must(image, IMAGE);
    }

    /// VI-6.
    Executions {
        cells: u32, within(1..=1000);
        dark_red: u32, within(1..=1_000_000);
        slope: f64, within(0.0..=2.0);
        depth_m: f64, within(0.1..=100.0);
        size_px: Size, must(image, IMAGE);
    }

    /// VI-7.
    Lost {
        slope: f64, within(0.0..=2.0);
        pleat: f64, within(0.0..=0.9);
        cells: u32, within(1..=200);
        size_px: Size, must(image, IMAGE);
        turned_beams: u32, within(1..=100_000);
        turned_floors: Vec<f64>, must(|list| list.iter().all(|height| height.abs() <= 1.0), "heights of -1 to 1");
        turned_px: Size, must(image, IMAGE);
        seed: u64, within(0..=u64::MAX);
    }

    /// VI-8.
    TorusCount {
        seed: u64, within(0..=u64::MAX);
        ring: f64, within(0.1..=0.4);
        tube: f64, within(0.01..=0.1 + 0.05);
        side_px: u32, within(8..=4096);
        samples: u32, within(1..=256);
        standard_errors: f64, within(0.0..=100.0);
        least_samples: f64, within(0.0..=1e12);
    }

    /// VI-9.
    Darts {
        radius_2d: f64, within(0.005..=0.5);
        radius_3d: f64, within(0.01..=0.5);
        rounds: u32, within(1..=8);
        side_px: u32, within(8..=4096);
        samples: u32, within(1..=256);
        places: u64, within(1..=1_000_000_000);
        seed: u64, within(0..=u64::MAX);
    }

    /// VI-10.
    Noise {
        sets: u64, within(1..=1000);
        points: usize, within(100..=100_000_000);
        cells: (u64, u64, u64, u64), must(
            |(a, b, c, d)| [a, b, c, d].iter().all(|count| (2..=64).contains(*count)),
            "2 to 64 each"
        );
        fits: (f64, f64), must(
            |(low, high)| 0.0 <= *low && low < high && *high <= 1.0,
            "two shares, in order"
        );
    }

    /// VI-11.
    Glossy {
        samples: (u32, u32), must(
            |(few, many)| 0 < *few && few < many && *many <= 256,
            "two counts up to 256, in order"
        );
        lens_radius: f64, within(0.001..=10.0);
        index: f64, within(1.0..=3.0);
        texels: u32, within(4..=512);
        reference_tables: u32, within(1..=256);
        blur_off: (f64, f64), must(|(part, units)| *part >= 0.0 && *units >= 0.0, "two numbers from 0 on");
    }

    /// VI-12.
    Shadows {
        places: u32, within(1..=256);
        size_px: Size, must(image, IMAGE);
        frame: u32, within(0..=1000);
    }

    /// VI-13 and VI-14; `scene` has a name and a frame.
    Views {
        increase_percent: f64, within(0.0..=1e4);
        within_points: f64, within(0.0..=1e4);
        entries: u32, within(1..=1 << 20);
        samples: u32, must(|count| [2, 4, 8, 16, 32].contains(count), "2, 4, 8, 16 or 32");
        eyes: f64, within(1e-4..=10.0);
        size_px: Size, must(image, IMAGE);
        lens_over_eyes: f64, within(0.001..=0.5);
        shutter: f64, within(0.0..=1.0);
        scene: (String, u32), must(|(scene, _)| !scene.is_empty(), "a name and a frame");
        quads: u32, must(entries, ENTRIES);
        ways: u32, must(|ways| ways.is_power_of_two() && *ways <= 16, "a power of two up to 16");
        policy: Policy, must(|_| true, "lru or fifo");
        overlap: u32, within(0..=2);
        views: u32, within(2..=16);
        curve_entries: Vec<u32>, must(
            |list| !list.is_empty() && list.iter().all(entries),
            "powers of two from 16 to 1048576"
        );
    }

    /// VI-15.
    Depths {
        mode: Mode, must(|_| true, "standard or conservative");
        triangles: Triangles, must(|_| true, "catalogue or random");
        planes: Planes, must(|_| true, "shutter or tile");
        tile_px: u32, must(|side| tile(side) && *side >= 2, "a power of two from 2 to 32");
        conservative_tile_px: u32, must(tile, TILE);
        points: u32, within(10..=1_000_000);
        random_triangles: u32, within(2..=1_000_000);
        values_of_each_family: usize, within(1..=100);
        of_each_scene: usize, within(1..=1000);
        side_px: u32, must(|side| [16, 32, 64, 128].contains(side), "16, 32, 64 or 128");
        seed: u64, within(0..=u64::MAX);
    }

    /// VI-16.
    Culling {
        hardware: Vec<Hardware>, must(
            |list| !list.is_empty() && list.iter().all(Hardware::is_possible),
            "one or more, with 1 to 16 boxes along u, v and t"
        );
        values_of_each_family: usize, within(1..=100);
        side_px: u32, must(|side| [16, 32, 64, 128].contains(side), "16, 32, 64 or 128");
        triangles: u32, within(1..=10_000);
        seed: u64, within(0..=u64::MAX);
    }
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

/// The objects over which costs are averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum QueriedObjects {
    All,
    /// Objects that no sample sees.
    Hidden,
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

/// Features that are switched on.
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

impl TwoObjects {
    /// Whether both are somewhere and have a size.
    fn is_possible(&self) -> bool {
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
        good(&self.first) && good(&self.second)
    }
}

impl Hardware {
    fn is_possible(&self) -> bool {
        let (u, v, t) = self.boxes;
        counts(&[u, v, t], 16)
    }
}

impl Dodged {
    /// Checks that every case is one of the objects.
    fn check_cases(&self, row: &str) -> Result<(), String> {
        let known = |name: &String| self.objects.get(Form::Full).iter().any(|two| two.name == *name);
        self.cases.must(&format!("{row}.cases"), known, "the name of one of `objects`")
    }
}

impl Views {
    /// Checks that entries of a quad and entries of a result agree.
    fn check_quads(&self, row: &str) -> Result<(), String> {
        let stated = *self.entries.get(Form::Full);
        let of_entries = |quads: &u32| entries(quads) && (*quads == stated || 4 * quads == stated);
        self.quads.must(&format!("{row}.quads"), of_entries, ENTRIES)
    }
}

/// Whether all counts are 1 to `most`.
fn counts(list: &[u32], most: u32) -> bool {
    list.iter().all(|count| (1..=most).contains(count))
}

/// Entries that a shading cache may have.
fn entries(count: &u32) -> bool {
    count.is_power_of_two() && (16..=1 << 20).contains(count)
}

const ENTRIES: &str =
    "a power of two: `entries`, or a quarter of them where an entry is one result of a quad";

/// Sides of tiles that the hardware takes.
fn tile(side: &u32) -> bool {
    side.is_power_of_two() && *side <= 32
}

const TILE: &str = "a power of two from 1 to 32";

/// Sizes that an image may have.
fn image(size: &Size) -> bool {
    [size.0, size.1].iter().all(|side| (8..=4096).contains(side))
}

const IMAGE: &str = "8 to 4096 pixels across and down";
