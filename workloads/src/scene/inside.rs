//! Whether a scene is a room, and where in it a camera stands.
//!
//! A point of a surface is *enclosed* in a direction if a ray from its front side meets the front side of
//! another. An object has most of its surface open to the outside: its rays escape. A room has most of it
//! enclosed. A solid turned inside out cannot be distinguished from a room.
//!
//! Candidates for the camera stand over the floors that vertical lines cross, at eye height below the
//! ceiling. From each, rays go out in all directions; the camera takes the place and the level direction in
//! which its view is deepest on average. Where the front sides of a scene enclose no place, as those of a
//! room modelled from outside, both sides count.

use std::f64::consts::TAU;

use glam::DVec3;

use super::camera::{CameraFrame, Fit, Frustum, tan_half};
use super::rays::{Hit, Rays, normal};

/// Points of the surface whose rays decide.
const SURFACE_POINTS: usize = 512;

/// Directions of rays, evenly over the sphere.
const DIRECTIONS: usize = 256;

/// Every so many of these directions are tried from a point of the surface.
const SURFACE_STRIDE: usize = 8;

/// The share of a scene's surface that is enclosed from which on the scene is a room.
const MIN_ENCLOSED_SHARE: f64 = 0.6;

/// The least share of the directions from a camera that end on front sides, and the largest that end on back
/// sides, where a camera is placed by default.
const SEEN_SHARES: [f64; 2] = [0.6, 0.1];

/// The least mean depth of the view of a camera that is placed by default, in lengths of the diagonal of the scene.
const MIN_DEPTH_SHARE: f64 = 0.05;

/// Vertical lines on each side of the grid that crosses the floors.
const LINES_PER_AXIS: usize = 16;

/// Floors that a line crosses at most.
const FLOORS: usize = 16;

/// Eye height, in heights of the room.
const EYE_HEIGHT_SHARE: f64 = 0.45;

/// What is demanded of a camera's place.
#[derive(Clone, Copy, Debug)]
struct Demands {
    /// Whether both sides of a surface are seen. The place must be outside of all closed parts in the room then.
    two_sided: bool,
    /// Room to every side, in lengths of the diagonal of the scene.
    clearance: f64,
    /// Room in view, in the same lengths; floors and ceilings do not count.
    ahead: f64,
}

/// Demands in their order: the first that any place meets decide.
const DEMANDS: [Demands; 4] = [
    Demands { two_sided: false, clearance: 0.01, ahead: 0.04 },
    Demands { two_sided: false, clearance: 0.01, ahead: 0.0 },
    Demands { two_sided: true, clearance: 0.03, ahead: 0.08 },
    Demands { two_sided: true, clearance: 0.01, ahead: 0.0 },
];

/// Surfaces stand upright whose normal rises less.
const MAX_WALL_NORMAL_Y: f64 = 0.7;

/// How many of these are tried where a camera is placed by default.
const DEMANDS_BY_DEFAULT: usize = 2;

/// Level rays that decide whether a place is in a closed part, and surfaces that each crosses at most.
const CROSSING_RAYS: usize = 15;
const MAX_CROSSINGS: usize = 64;

/// Level directions in which a camera may look.
const TURNS: usize = 32;

/// Cosine of the largest angle between the middle of the view and the rays that count for its depth.
const VIEW_CONE_COS: f64 = 0.85;

/// How much a camera inside sees.
pub(super) fn view() -> Frustum {
    Frustum::Perspective { tan_half_height: tan_half(Inside::FOV_DEG) }
}

/// A place inside, and whether the scene is a room, so that a camera is placed there by default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Inside {
    pub fit: Fit,
    /// The share of the surface that is enclosed.
    pub enclosed: f64,
    pub is_room: bool,
}

/// Surroundings of a point.
struct Around {
    eye: DVec3,
    hits: Vec<Option<Hit>>,
}

impl Inside {
    /// Vertical field of view inside, in degrees.
    pub const FOV_DEG: f64 = 60.0;

    /// The best place inside `triangles`. Where nothing decides, and it is not wanted `anyway`, `None`.
    pub fn find(triangles: Vec<[DVec3; 3]>, anyway: bool) -> Option<Self> {
        let rays = Rays::new(triangles);
        let [low, high] = rays.bounds();
        let diagonal = (high - low).length();
        if !(diagonal.is_finite() && diagonal > 0.0) {
            return None;
        }
        let directions = directions();
        let enclosed = enclosed(&rays, &directions, 1e-6 * diagonal);
        if enclosed < MIN_ENCLOSED_SHARE && !anyway {
            return None;
        }
        let demands = &DEMANDS[..if anyway { DEMANDS.len() } else { DEMANDS_BY_DEFAULT }];
        let best = Best::find(&rays, &directions, demands, diagonal);
        let (eye, direction) = match &best {
            Some(best) => (best.eye, level(best.turn)),
            None if !anyway => return None,
            None => (
                low + DVec3::new(0.5, EYE_HEIGHT_SHARE, 0.5) * (high - low),
                along_the_longer_side(high - low),
            ),
        };
        let ahead = rays.first(eye, direction, 0.0).map_or(0.5 * diagonal, |hit| hit.distance);
        let fit = fit(eye, direction, ahead.max(1e-3 * diagonal))?;
        let is_room = enclosed >= MIN_ENCLOSED_SHARE
            && best.is_some_and(|best| best.is_enclosed && best.depth >= MIN_DEPTH_SHARE * diagonal);
        (is_room || anyway).then_some(Self { fit, enclosed, is_room })
    }
}

/// The place from which the view is deepest.
#[derive(Clone, Copy)]
struct Best {
    eye: DVec3,
    turn: usize,
    depth: f64,
    is_enclosed: bool,
}

impl Best {
    /// The best place by the first of `demands` that any place meets.
    fn find(rays: &Rays, directions: &[DVec3], demands: &[Demands], diagonal: f64) -> Option<Self> {
        let mut best = vec![None; demands.len()];
        let any_side = demands.iter().any(|demands| demands.two_sided);
        for (eye, over_a_front) in candidates(rays).into_iter().filter(|(_, front)| *front || any_side) {
            let around = Around::new(rays, eye, directions);
            for (demands, best) in demands.iter().zip(&mut best) {
                if demands.two_sided || over_a_front {
                    around.improve(best, rays, directions, demands, diagonal);
                }
            }
        }
        best.into_iter().flatten().next()
    }
}

fn fit(eye: DVec3, direction: DVec3, focus: f64) -> Option<Fit> {
    let stand = CameraFrame::new(eye, direction, DVec3::Y)?;
    Some(Fit { stand, direction, near: 1e-3 * focus, focus, holds_lens: true })
}

fn along_the_longer_side(size: DVec3) -> DVec3 {
    if size.x > size.z { DVec3::X } else { DVec3::NEG_Z }
}

/// Level direction number `turn`.
fn level(turn: usize) -> DVec3 {
    let angle = TAU * turn as f64 / TURNS as f64;
    DVec3::new(libm::sin(angle), 0.0, -libm::cos(angle))
}

/// Directions evenly over the sphere, on a spiral.
fn directions() -> Vec<DVec3> {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let direction = |index: usize| {
        let height = 1.0 - (2.0 * index as f64 + 1.0) / DIRECTIONS as f64;
        let (across, angle) = ((1.0 - height * height).sqrt(), TAU * libm::fmod(golden * index as f64, 1.0));
        DVec3::new(across * libm::cos(angle), height, across * libm::sin(angle))
    };
    (0..DIRECTIONS).map(direction).collect()
}

/// The share of rays from the front of the surface that meet a front again; points are spread over the
/// surface by area.
fn enclosed(rays: &Rays, directions: &[DVec3], gap: f64) -> f64 {
    let areas: Vec<f64> = rays.triangles().iter().map(|triangle| normal(triangle).length()).collect();
    let total: f64 = areas.iter().sum();
    let (mut below, mut triangle, mut counts) = (0.0, 0, [0.0, 0.0]);
    for point in 0..SURFACE_POINTS {
        let at = (point as f64 + 0.5) / SURFACE_POINTS as f64 * total;
        while triangle + 1 < areas.len() && below + areas[triangle] < at {
            below += areas[triangle];
            triangle += 1;
        }
        let [a, b, c] = rays.triangles()[triangle];
        let facing = normal(&[a, b, c]).normalize_or_zero();
        let from = within([a, b, c], point) + gap * facing;
        let ahead = directions.iter().skip(point % SURFACE_STRIDE).step_by(SURFACE_STRIDE);
        for along in ahead.filter(|along| along.dot(facing) > 0.0) {
            let hit = rays.first(from, *along, 0.0);
            counts[0] += f64::from(u8::from(hit.is_some_and(|hit| hit.front)));
            counts[1] += 1.0;
        }
    }
    if counts[1] > 0.0 { counts[0] / counts[1] } else { 0.0 }
}

/// Point number `point` of a sequence that fills a triangle evenly.
fn within([a, b, c]: [DVec3; 3], point: usize) -> DVec3 {
    // The additive recurrence of the plastic number, folded from a parallelogram into its half.
    let [u, v] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2]
        .map(|step| libm::fmod(0.5 + step * point as f64, 1.0));
    let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
    a + u * (b - a) + v * (c - a)
}

/// Eyes over the floors, and whether a floor shows its front.
fn candidates(rays: &Rays) -> Vec<(DVec3, bool)> {
    let [low, high] = rays.bounds();
    let place = |line: usize, axis: usize| {
        low[axis] + (line as f64 + 0.5) / LINES_PER_AXIS as f64 * (high[axis] - low[axis])
    };
    let lines = (0..LINES_PER_AXIS * LINES_PER_AXIS)
        .map(|line| [place(line % LINES_PER_AXIS, 0), place(line / LINES_PER_AXIS, 2)]);
    lines.flat_map(|[x, z]| over_the_floors(rays, x, z)).collect()
}

/// Eyes over each floor that the vertical line through `x` and `z` crosses: level surfaces with room above,
/// and whether they look up.
fn over_the_floors(rays: &Rays, x: f64, z: f64) -> Vec<(DVec3, bool)> {
    let [low, high] = rays.bounds();
    let (height, mut ceiling) = (high.y - low.y, high.y);
    let (mut eyes, mut from) = (Vec::new(), high.y + 0.01 * height);
    for _ in 0..FLOORS {
        let Some(hit) = rays.first(DVec3::new(x, from, z), DVec3::NEG_Y, 1e-9 * height) else { break };
        let at = from - hit.distance;
        if hit.normal.y.abs() > 0.5 && ceiling - at > 0.02 * height {
            eyes.push((DVec3::new(x, at + EYE_HEIGHT_SHARE * (ceiling - at), z), hit.front));
        }
        (from, ceiling) = (at, at);
    }
    eyes
}

impl Around {
    fn new(rays: &Rays, eye: DVec3, directions: &[DVec3]) -> Self {
        Self { eye, hits: directions.iter().map(|along| rays.first(eye, *along, 0.0)).collect() }
    }

    /// Takes the place and its deepest direction as the best if the view is deeper and `demands` are met.
    fn improve(
        &self,
        best: &mut Option<Best>,
        rays: &Rays,
        directions: &[DVec3],
        demands: &Demands,
        diagonal: f64,
    ) {
        let clearance = demands.clearance * diagonal;
        if self.hits.iter().flatten().any(|hit| hit.distance < clearance) {
            return;
        }
        let limit = best.map_or(0.0, |best| best.depth);
        let ahead = demands.ahead * diagonal;
        let is_blocked =
            |turn| rays.first(self.eye, level(turn), 0.0).is_some_and(|hit| hit.distance < ahead);
        let (mut turn, mut depth) = (0, limit);
        for new in 0..TURNS {
            let seen = self.depth(level(new), directions, demands.two_sided, ahead);
            if seen > depth && !is_blocked(new) {
                (turn, depth) = (new, seen);
            }
        }
        if depth > limit
            && rays.is_clear(self.eye, clearance)
            && !(demands.two_sided && is_in_a_part(rays, self.eye))
        {
            *best = Some(Best { eye: self.eye, turn, depth, is_enclosed: self.is_enclosed() });
        }
    }

    /// Whether front sides are seen in most directions, and back sides in few.
    fn is_enclosed(&self) -> bool {
        let share = |front: bool| {
            let ends = self.hits.iter().flatten().filter(|hit| hit.front == front).count();
            ends as f64 / self.hits.len() as f64
        };
        share(true) >= SEEN_SHARES[0] && share(false) <= SEEN_SHARES[1]
    }

    /// Mean depth of the view along `direction`; what is open, or a back side that does not count, has none.
    /// Zero where something upright is nearer than `ahead`.
    fn depth(&self, direction: DVec3, directions: &[DVec3], two_sided: bool, ahead: f64) -> f64 {
        let seen =
            directions.iter().zip(&self.hits).filter(|(along, _)| along.dot(direction) >= VIEW_CONE_COS);
        let (mut sum, mut count) = (0.0, 0.0);
        for (_, hit) in seen {
            if hit.is_some_and(|hit| hit.distance < ahead && hit.normal.y.abs() < MAX_WALL_NORMAL_Y) {
                return 0.0;
            }
            sum += hit.filter(|hit| hit.front || two_sided).map_or(0.0, |hit| hit.distance);
            count += 1.0;
        }
        sum / f64::max(count, 1.0)
    }
}

/// Whether a point is in a closed part of a scene whose outermost surface is the room: most level rays from
/// there cross an even number of surfaces.
fn is_in_a_part(rays: &Rays, point: DVec3) -> bool {
    let is_even = |turn: usize| {
        let angle = TAU * (turn as f64 + 0.3) / CROSSING_RAYS as f64;
        let along = DVec3::new(libm::cos(angle), 0.01, libm::sin(angle));
        let (mut beyond, mut crossed) = (0.0, 0);
        while let Some(hit) = rays.first(point, along, beyond).filter(|_| crossed < MAX_CROSSINGS) {
            (beyond, crossed) = (hit.distance * (1.0 + 1e-9), crossed + 1);
        }
        crossed % 2 == 0
    };
    2 * (0..CROSSING_RAYS).filter(|turn| is_even(*turn)).count() > CROSSING_RAYS
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sides of a box as triangles; its corners run counter-clockwise seen from outside, or from inside
    /// where `inward`.
    fn sides(low: [f64; 3], high: [f64; 3], inward: bool, open_top: bool) -> Vec<[DVec3; 3]> {
        let (low, high) = (DVec3::from(low), DVec3::from(high));
        let mut triangles = Vec::new();
        for axis in 0..3 {
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            for (side, at) in [low, high].into_iter().enumerate() {
                if open_top && axis == 1 && side == 1 {
                    continue;
                }
                let corner = |far: [bool; 2]| {
                    let mut corner = at;
                    corner[u] = if far[0] { high[u] } else { low[u] };
                    corner[v] = if far[1] { high[v] } else { low[v] };
                    corner
                };
                let [a, b, c, d] = [[false, false], [true, false], [true, true], [false, true]].map(corner);
                let outward = side == 1;
                let turned = |[a, b, c]: [DVec3; 3]| if outward == inward { [a, c, b] } else { [a, b, c] };
                triangles.extend([turned([a, b, c]), turned([a, c, d])]);
            }
        }
        triangles
    }

    const LOW: [f64; 3] = [-6.0, 0.0, -2.0];
    const HIGH: [f64; 3] = [6.0, 3.0, 2.0];

    #[test]
    fn a_room_is_seen_from_inside_along_its_length() {
        let inside = Inside::find(sides(LOW, HIGH, true, false), false).unwrap();
        assert!(inside.is_room && inside.enclosed > 0.99, "{inside:?}");
        let Fit { stand, focus, .. } = inside.fit;
        assert!(stand.eye.y > 1.0 && stand.eye.y < 2.0, "{stand:?}");
        assert!(stand.eye.x.abs() > 4.0 && stand.eye.x * stand.forward.x < 0.0, "{stand:?}");
        assert!(stand.forward.x.abs() > 0.95 && focus > 9.0, "{stand:?} {focus}");
    }

    #[test]
    fn a_solid_is_seen_from_outside() {
        assert_eq!(Inside::find(sides(LOW, HIGH, false, false), false), None);
        let found = Inside::find(sides(LOW, HIGH, false, false), true).unwrap();
        assert!(!found.is_room && found.enclosed == 0.0, "{found:?}");
    }

    #[test]
    fn a_deep_court_is_a_room_and_a_tray_is_not() {
        assert!(Inside::find(sides(LOW, HIGH, true, true), false).is_some_and(|inside| inside.is_room));
        assert_eq!(Inside::find(sides(LOW, [6.0, 0.4, 2.0], true, true), false), None);
    }

    #[test]
    fn a_building_is_a_room_once_most_of_it_is_inside() {
        let shell = sides([-6.5, -0.5, -2.5], [6.5, 3.5, 2.5], false, false);
        let empty = [shell.clone(), sides(LOW, HIGH, true, false)].concat();
        assert_eq!(Inside::find(empty.clone(), false), None);
        let shelves = (0..30).flat_map(|index| {
            let x = -5.8 + 0.39 * f64::from(index);
            sides([x, 0.01, -1.9], [x + 0.3, 2.5, -0.4], false, false)
        });
        let furnished: Vec<_> = empty.into_iter().chain(shelves).collect();
        let inside = Inside::find(furnished, false).unwrap();
        let eye = inside.fit.stand.eye;
        assert!(inside.is_room && eye.x.abs() < 6.0 && eye.z.abs() < 2.0 && eye.y > 0.0 && eye.y < 3.0);
    }

    #[test]
    fn two_stacked_rooms_have_a_camera_in_one_of_them() {
        let rooms = [sides(LOW, HIGH, true, false), sides([-9.0, 3.5, -2.0], [9.0, 6.5, 2.0], true, false)];
        let eye = Inside::find(rooms.concat(), false).unwrap().fit.stand.eye;
        assert!(eye.y > 4.5 && eye.y < 5.5, "the longer room is above: {eye}");
    }

    /// A room with a pillar to its ceiling, or with thin columns, all faces to the outside.
    #[test]
    fn a_room_modelled_from_outside_has_a_place_between_its_parts() {
        let room = sides([0.0; 3], [10.0, 3.0, 8.0], false, false);
        let pillar = sides([4.0, 0.0, 3.0], [6.0, 3.0, 5.0], false, false);
        let columns = (0..9).flat_map(|i| {
            let (x, z) = (2.5 * f64::from(i % 3 + 1), 2.0 * f64::from(i / 3 + 1));
            sides([x - 0.02, 0.0, z - 0.02], [x + 0.02, 3.0, z + 0.02], false, false)
        });
        let columns: Vec<_> = columns.collect();
        for parts in [pillar, columns] {
            let all = [room.clone(), parts.clone()].concat();
            assert_eq!(Inside::find(all.clone(), false), None, "not by default");
            let stand = Inside::find(all, true).unwrap().fit.stand;
            assert!((stand.eye.y - 0.45 * 3.0).abs() < 1e-9, "{}", stand.eye);
            let [x, z] = [stand.eye.x, stand.eye.z];
            let apart = |part: &[[DVec3; 3]]| {
                let corners = part.as_flattened();
                let [low, high] = [DVec3::min as fn(_, _) -> _, DVec3::max]
                    .map(|choose| corners.iter().copied().reduce(choose).unwrap());
                let gap = |at: f64, low: f64, high: f64| (low - at).max(at - high).max(0.0);
                gap(x, low.x, high.x).hypot(gap(z, low.z, high.z))
            };
            assert!(parts.chunks(12).all(|part| apart(part) > 0.3), "{}", stand.eye);
            let rays = Rays::new([room.clone(), parts].concat());
            let ahead = rays.first(stand.eye, stand.forward, 0.0).unwrap().distance;
            assert!(ahead > 1.0, "{} looks at something {ahead} ahead", stand.eye);
        }
    }

    #[test]
    fn nothing_at_all_has_no_inside() {
        assert_eq!(Inside::find(vec![[DVec3::ONE; 3]], false), None);
        assert_eq!(Inside::find(vec![[DVec3::ONE; 3]], true), None);
    }
}
