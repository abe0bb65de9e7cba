//! Contacts in exact arithmetic. Corners are integers times a power of two. Contacts lie at eighths of the
//! time and quarters of a triangle, so both triangles share a point exactly. There is no allowance for
//! rounding.

use pipeline::random::SplitMix;
use rayon::prelude::*;
use workloads::collision::{CollisionMethod, Object, PairSearch};

use super::{mix, objects_may_collide};

type Point = [i64; 3];
/// Corners at both times, multiples of [`UNIT`].
type Triangle = [[Point; 3]; 2];

/// Eighths of the time times quarters of a triangle.
const UNIT: i64 = 32;

/// Sequence of random integers.
struct Rng(SplitMix);

impl Rng {
    fn below(&mut self, end: u64) -> u64 {
        self.0.next_word() % end
    }

    fn one_in(&mut self, count: u64) -> bool {
        self.below(count) == 0
    }

    fn around_zero(&mut self, reach: i64) -> i64 {
        self.below(2 * reach as u64 + 1) as i64 - reach
    }

    fn point(&mut self, reach: i64) -> Point {
        [(); 3].map(|()| UNIT * self.around_zero(reach))
    }

    /// Barycentric weights in quarters: a corner, the middle of an edge, or any point.
    fn weights(&mut self) -> [i64; 3] {
        let first = self.below(5) as i64;
        let second = self.below((5 - first) as u64) as i64;
        let mut weights = match self.below(4) {
            0 => [4, 0, 0],
            1 => [2, 2, 0],
            _ => [first, second, 4 - first - second],
        };
        weights.rotate_left(self.below(3) as usize);
        weights
    }
}

fn sum(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn middle(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|axis| (a[axis] / UNIT + b[axis] / UNIT) / 2 * UNIT)
}

/// Makers of triangles within `reach` of the origin.
const KINDS: [fn(&mut Rng, i64) -> Triangle; 10] =
    [free, flat, sliver, segment, point, gliding, tunnelling, turning, still, small];

fn free(rng: &mut Rng, reach: i64) -> Triangle {
    [(); 2].map(|()| [(); 3].map(|()| rng.point(reach)))
}

/// A triangle that stays in one plane.
fn flat(rng: &mut Rng, reach: i64) -> Triangle {
    free(rng, reach).map(|end| end.map(|[x, y, _]| [x, y, 0]))
}

fn sliver(rng: &mut Rng, reach: i64) -> Triangle {
    free(rng, reach).map(|[a, b, _]| [a, b, sum(middle(a, b), rng.point(1))])
}

fn segment(rng: &mut Rng, reach: i64) -> Triangle {
    free(rng, reach).map(|[a, b, _]| [a, b, b])
}

fn point(rng: &mut Rng, reach: i64) -> Triangle {
    free(rng, reach).map(|[a, ..]| [a; 3])
}

/// A translated triangle.
fn gliding(rng: &mut Rng, reach: i64) -> Triangle {
    let ([open, _], way) = (free(rng, reach), rng.point(reach));
    [open, open.map(|corner| sum(corner, way))]
}

/// A triangle translated by a thousand times its size.
fn tunnelling(rng: &mut Rng, reach: i64) -> Triangle {
    let ([open, _], way) = (free(rng, reach), rng.point(1024 * reach));
    [open, open.map(|corner| sum(corner, way))]
}

/// A sliver rotated by 90 degrees.
fn turning(rng: &mut Rng, reach: i64) -> Triangle {
    let [open, _] = sliver(rng, reach);
    [open, open.map(|[x, y, z]| [-y, x, z])]
}

fn still(rng: &mut Rng, reach: i64) -> Triangle {
    let [open, _] = free(rng, reach);
    [open; 2]
}

/// A triangle far smaller than its translation.
fn small(rng: &mut Rng, reach: i64) -> Triangle {
    free(rng, reach).map(|[a, ..]| [a, sum(a, rng.point(2)), sum(a, rng.point(2))])
}

/// Two triangles of the same or different kinds, which may exchange positions or be near copies.
fn pair(rng: &mut Rng, reach: i64) -> [Triangle; 2] {
    let mut kind = || KINDS[rng.below(KINDS.len() as u64) as usize];
    let (one, other) = (kind(), kind());
    let first = one(rng, reach);
    match rng.below(12) {
        0 => [first, [first[1], first[0]]],
        1 => [first, [first[0], first[1].map(|corner| sum(corner, [UNIT, -UNIT, 0]))]],
        2..7 => [first, one(rng, reach)],
        _ => [first, other(rng, reach)],
    }
}

/// Point of a triangle at barycentric `weights` and a time in eighths. It is exact, as corners are multiples
/// of [`UNIT`].
fn place(triangle: &Triangle, eighths: i64, weights: [i64; 3]) -> Point {
    let [open, close] = triangle;
    [0, 1, 2].map(|axis| {
        let corner = |k: usize| (8 - eighths) * open[k][axis] + eighths * close[k][axis];
        (0..3).map(|k| weights[k] * corner(k)).sum::<i64>() / UNIT
    })
}

/// Moves the second triangle so that both share a point.
fn made_to_touch(rng: &mut Rng, [first, second]: [Triangle; 2]) -> [Triangle; 2] {
    let eighths = [0, 8, 4, rng.below(9) as i64][rng.below(4) as usize];
    let to = place(&first, eighths, rng.weights());
    let from = place(&second, eighths, rng.weights());
    let way = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
    [first, second.map(|end| end.map(|corner| sum(corner, way)))]
}

/// Adds other triangles to both objects in turn.
fn crowd(rng: &mut Rng, objects: &mut [Vec<Triangle>; 2], reach: i64) {
    let count = [0, 0, 0, 3, 40, 120][rng.below(6) as usize];
    let size = if rng.one_in(2) { reach / 8 } else { reach };
    for number in 0..count {
        let at = rng.point(4 * reach);
        let one = free(rng, size.max(1)).map(|end| end.map(|corner| sum(corner, at)));
        objects[number % 2].push(one);
    }
}

/// Shears, moves and permutes the axes of both objects, exactly.
fn pose(rng: &mut Rng, objects: &mut [Vec<Triangle>; 2], reach: i64) {
    let shear = [rng.around_zero(2), rng.around_zero(2)].map(|by| if rng.one_in(2) { by } else { 0 });
    let way = if rng.one_in(3) { rng.point(8 * reach) } else { [0; 3] };
    let (near, far) = (rng.below(38), rng.one_in(2));
    let offset = [(); 3].map(|()| if far { rng.around_zero(1 << 38) >> near } else { 0 });
    let axes = rng.below(3) as usize;
    for triangle in objects.iter_mut().flatten() {
        for (end, way) in triangle.iter_mut().zip([[0; 3], way]) {
            for corner in end {
                corner[2] += shear[0] * corner[0] + shear[1] * corner[1];
                *corner = sum(sum(*corner, way), offset);
                corner.rotate_left(axes);
            }
        }
    }
}

/// Two objects that share a point, and the length of a unit, a power of two.
fn case(rng: &mut Rng) -> ([Vec<Triangle>; 2], f64) {
    let reach = [8, 100, 4096][rng.below(3) as usize];
    let touching = pair(rng, reach);
    let mut objects = made_to_touch(rng, touching).map(|one| vec![one]);
    crowd(rng, &mut objects, reach);
    pose(rng, &mut objects, reach);
    objects.rotate_left(rng.below(2) as usize);
    (objects, 2_f64.powi(rng.around_zero(22) as i32 - 17))
}

/// The objects in floating point, the second moved aside.
fn scaled([first, second]: &[Vec<Triangle>; 2], units: [f64; 3], aside: i64) -> [Object; 2] {
    [(first, 0), (second, aside)].map(|(object, by)| {
        let ends = |triangle: &Triangle| {
            triangle.map(|end| end.map(|p| [0, 1, 2].map(|axis| (p[axis] + by) as f64 * units[axis])))
        };
        Object::from_ends(object.iter().map(ends).collect(), 0.0).unwrap()
    })
}

/// A random search. Many triangles are drawn by edges in few tiles only, as that is slow.
fn search(rng: &mut Rng, triangles: usize) -> PairSearch {
    let zoom = rng.one_in(6);
    let finest = if triangles > 60 && !zoom { 8 } else { 64 };
    let method = [
        CollisionMethod::FragmentBox,
        CollisionMethod::FragmentBox,
        CollisionMethod::BoxBox,
        CollisionMethod::BoxBox,
        CollisionMethod::DepthOnly,
    ];
    let resolution = 1 + rng.below(finest) as u32;
    PairSearch { resolution, bins: 1 + rng.below(16) as u32, method: method[rng.below(5) as usize], zoom }
}

/// Checks that several searches find each contact; counts the pairs separated after one object was moved
/// aside.
fn separated_when_moved(seeds: std::ops::Range<u64>, searches: usize) -> usize {
    let checked = |seed: u64| {
        let mut rng = Rng(SplitMix::new(mix(seed)));
        let (exact, unit) = case(&mut rng);
        let objects = scaled(&exact, [unit; 3], 0);
        for _ in 0..searches {
            let search = search(&mut rng, objects[0].len() + objects[1].len());
            assert!(objects_may_collide(&objects, &search), "{seed} is missed by {search:?}");
        }
        let closer = PairSearch { resolution: 64, ..PairSearch::default() };
        seed.is_multiple_of(20) && !objects_may_collide(&scaled(&exact, [unit; 3], 20 * UNIT), &closer)
    };
    seeds.into_par_iter().map(|seed| usize::from(checked(seed))).sum()
}

#[test]
fn no_exact_contact_is_missed() {
    let apart = separated_when_moved(0..200, 2);
    println!("moved aside, {apart} of 10 are separated");
    assert!(apart >= 3);
}

/// Products of coordinates may underflow along some axes.
#[test]
fn no_exact_contact_is_missed_with_any_units_per_axis() {
    (0..1500_u64).into_par_iter().for_each(|seed| {
        let mut rng = Rng(SplitMix::new(mix(seed ^ 0x5EED)));
        let (exact, _) = case(&mut rng);
        let unit = |rng: &mut Rng| {
            let exponent = rng.below(1170) as i32 - 1070;
            2_f64.powi(exponent / 2) * 2_f64.powi(exponent - exponent / 2)
        };
        let units = [(); 3].map(|()| unit(&mut rng));
        let objects = scaled(&exact, units, 0);
        let search = search(&mut rng, objects[0].len() + objects[1].len());
        assert!(
            objects_may_collide(&objects, &search),
            "{seed} in units of {units:?} is missed by {search:?}"
        );
    });
}

/// `cargo test -p workloads --release --test suite exact -- --ignored --nocapture`.
#[test]
#[ignore = "minutes to an hour: 80,000 searches"]
fn none_of_twenty_thousand_is_missed() {
    let mut apart = 0;
    for start in (0..20_000).step_by(1000) {
        apart += separated_when_moved(start..start + 1000, 4);
        println!(
            "{} contacts, none missed; moved aside, {apart} of {} separated",
            start + 1000,
            start / 20 + 50
        );
    }
}
