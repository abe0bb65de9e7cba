//! Cost of each test in multiply-adds, the same for perspective and orthographic views. The kernels are
//! generic over [`Number`](super::Number). The tests below run them with counting numbers and compare the
//! counts with these constants.

/// Solving one quadratic for its roots.
pub const ROOT: u32 = 8;

/// Converting a time to its position in the interval of a box.
pub const PHASE: u32 = 3;

/// Finding the zero of a distance to a side, and mapping it to a range.
pub const SIDE_ROOT: u32 = 4;

/// Testing a triangle against one side of a tile, without roots.
pub const fn side_madds(moving: bool, lens: bool, behind: bool) -> u32 {
    by(moving, lens, [6, 24, 18, 48]) * if behind { 2 } else { 1 }
}

/// Testing a triangle against the near depth, without roots.
pub const fn near_madds(moving: bool) -> u32 {
    by(moving, false, [4, 13, 0, 0])
}

/// Select by dimensions in use: 2D, with time, with lens, both.
const fn by(moving: bool, lens: bool, madds: [u32; 4]) -> u32 {
    madds[moving as usize + 2 * lens as usize]
}

/// Finding the dual-space lines of a triangle.
pub const fn lens_line_setup_madds(moving: bool) -> u32 {
    by(moving, true, [0, 0, 74, 152])
}

/// Testing the lines against a tile, with `crossings` computed.
pub const fn lens_line_madds(crossings: u32) -> u32 {
    8 + 3 * crossings
}

/// Transforming a triangle's vertices and edges to a box.
pub const fn edge_madds(moving: bool, lens: bool) -> u32 {
    by(moving, lens, [39, 141, 79, 217])
}

/// Bounding the determinant over a box, with `bisections` of the time.
pub const fn facing_madds(moving: bool, lens: bool, bisections: u32) -> u32 {
    by(moving, lens, [10, 33, 26, 69]) + bisections * 27
}

/// Bounding the edges over a box, without roots and phases.
pub const fn edge_bound_madds(moving: bool, lens: bool) -> u32 {
    by(moving, lens, [12, 30, 28, 64])
}

/// Linearizing the edges over a box; a part of its time costs more than the whole.
pub const fn screen_setup_madds(moving: bool, lens: bool, whole: bool) -> u32 {
    by(moving, lens, [8, 86, 30, 162]) + if whole { 0 } else { by(moving, lens, [0, 132, 0, 228]) }
}

#[cfg(test)]
mod tests {
    use super::super::number::counted::{Counted, count};
    use super::super::*;
    use super::*;
    use crate::geometry::{Cull, MovingVertex, Shear};
    use crate::setup::{SetupResult, Triangle, set_up};

    const SHEAR: Shear = Shear::new([90.0, -90.0], [15.0, -15.0]);

    fn triangle(moving: bool, shear: &Shear) -> Triangle {
        let v = [
            ([-50.0, 20.0, 3.0], [60.0, 10.0, 5.0]),
            ([30.0, -70.0, 4.0], [-20.0, 40.0, 2.5]),
            ([80.0, 90.0, 6.0], [70.0, 30.0, 7.0]),
        ]
        .map(|(open, close)| MovingVertex { open, close: if moving { close } else { open } });
        match set_up(0, [&v[0], &v[1], &v[2]], Cull::None, shear, 0.1, [64.0; 2]) {
            SetupResult::Ready(triangle) => triangle,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn every_cost_is_that_of_its_kernel() {
        for (moving, lens) in [(false, false), (true, false), (false, true), (true, true)] {
            let shear = if lens { SHEAR } else { Shear::default() };
            let triangle = triangle(moving, &shear);
            let tile = TileRect { x: [0.0, 8.0], y: [16.0, 24.0] };
            let within = Box5 { t: [0.25, 0.75], ..Box5::whole(lens) };
            let (madds, edges) =
                count(|| Edges::<Counted>::new(View::new(&triangle, &shear, &tile, &within)));
            println!("edges {moving} {lens} {madds}");
            assert_eq!(madds, edge_madds(moving, lens), "edges {moving} {lens}");
            let (madds, facing) = count(|| Facing::new(&edges));
            println!("facing {moving} {lens} {madds}");
            assert_eq!(madds, facing_madds(moving, lens, 0), "facing {moving} {lens}");
            let (madds, (_, bisections)) = count(|| facing.timeline(within.t, [true; 2], 3));
            println!("bisect {moving} {lens} {madds} {bisections}");
            assert_eq!(madds, facing_madds(moving, lens, bisections) - facing_madds(moving, lens, 0));
            let (madds, bounds) = count(|| EdgeBounds::new(&edges));
            println!("bounds {moving} {lens} {madds}");
            assert_eq!(madds, edge_bound_madds(moving, lens), "bounds {moving} {lens}");
            let times = TimePieces::one(Piece { t: within.t, faces: [true; 2] });
            let (madds, (_, more)) = count(|| bounds.timeline(&edges, &times, [true; 2]));
            println!("narrow {moving} {lens} {madds} {more}");
            assert!(madds <= more, "{madds} > {more}");
            let (madds, _) = count(|| Screen::new(&edges, within.t, [true; 2]));
            println!("screen {moving} {lens} {madds}");
            assert_eq!(madds, screen_setup_madds(moving, lens, true), "screen {moving} {lens}");
            let (madds, _) = count(|| Screen::new(&edges, [0.25, 0.5], [true; 2]));
            println!("screen part {moving} {lens} {madds}");
            assert_eq!(madds, screen_setup_madds(moving, lens, !moving), "part {moving} {lens}");
        }
    }

    /// One unit serves both views, so both have the same cost. An orthographic view needs less, or at most a
    /// tenth more.
    #[test]
    fn orthographic_views_cost_about_as_much() {
        for (moving, lens) in [(false, false), (true, false), (false, true), (true, true)] {
            let shear = Shear { parallel: true, ..if lens { SHEAR } else { Shear::default() } };
            let triangle = triangle(moving, &shear);
            let tile = TileRect { x: [0.0, 8.0], y: [16.0, 24.0] };
            let within = Box5 { t: [0.25, 0.75], ..Box5::whole(lens) };
            let (found, edges) =
                count(|| Edges::<Counted>::new(View::new(&triangle, &shear, &tile, &within)));
            let (facing, _) = count(|| Facing::new(&edges));
            let (bounds, _) = count(|| EdgeBounds::new(&edges));
            let (screen, _) = count(|| Screen::new(&edges, within.t, [true; 2]));
            let (sides, (_, madds_found)) =
                count(|| narrow_counted::<Counted>(&triangle, &shear, &tile, &within));
            println!("{moving} {lens}: {found} {facing} {bounds} {screen} {sides}");
            assert!(10 * found <= 11 * edge_madds(moving, lens) + 1, "{found}");
            assert!(10 * facing <= 11 * facing_madds(moving, lens, 0), "{facing}");
            assert!(bounds <= edge_bound_madds(moving, lens) && sides <= madds_found);
            assert!(screen <= screen_setup_madds(moving, lens, true));
        }
        for moving in [false, true] {
            let shear = Shear { parallel: true, ..SHEAR };
            let triangle = triangle(moving, &shear);
            let (madds, _) = count(|| LensLines::<Counted>::new(&triangle, &shear, 0.1));
            assert!(madds <= lens_line_setup_madds(moving));
        }
    }

    #[test]
    fn the_cost_of_side_planes_is_that_of_their_kernel() {
        for (moving, lens) in [(false, false), (true, false), (false, true), (true, true)] {
            let shear = if lens { SHEAR } else { Shear::default() };
            for behind in [false, true] {
                let triangle = Triangle { behind, ..triangle(moving, &shear) };
                for x in [-60.0, -20.0, 0.0, 40.0, 70.0, 300.0] {
                    let tile = TileRect { x: [x, x + 8.0], y: [16.0, 24.0] };
                    let within = Box5 { t: [0.25, 0.75], ..Box5::whole(lens) };
                    let (madds, (_, madds_found)) =
                        count(|| narrow_counted::<Counted>(&triangle, &shear, &tile, &within));
                    assert_eq!(madds, madds_found, "{moving} {lens} {behind} {x}");
                }
            }
        }
    }

    #[test]
    fn the_cost_of_the_near_depth_is_that_of_its_kernel() {
        for (moving, near) in
            [false, true].into_iter().flat_map(|moving| [0.1, 3.5, 5.0, 9.0].map(|near| (moving, near)))
        {
            let triangle = triangle(moving, &SHEAR);
            let mut within = Box5 { t: [0.25, 0.75], ..Box5::whole(true) };
            let (madds, (_, found)) = count(|| narrow_near::<Counted, _>(&triangle, near, 0.01, &mut within));
            assert_eq!(madds, found, "{moving} {near}");
        }
    }

    #[test]
    fn the_cost_of_lens_lines_is_that_of_their_kernel() {
        for moving in [false, true] {
            let triangle = triangle(moving, &SHEAR);
            let (madds, lines) = count(|| LensLines::<Counted>::new(&triangle, &SHEAR, 0.1));
            println!("lines {moving} {madds}");
            assert_eq!(madds, lens_line_setup_madds(moving), "set-up {moving}");
            for x in [-60.0, -20.0, 0.0, 40.0, 70.0] {
                let tile = TileRect { x: [x, x + 8.0], y: [16.0, 24.0] };
                let (madds, (left, crossings)) = count(|| lines.narrow(&tile, &Box5::whole(true)));
                let most = lens_line_madds(crossings);
                println!("line tile {moving} {madds} {most}");
                assert!(madds <= most && (left.is_none() || madds == most), "{moving} {x}: {madds} {most}");
            }
        }
    }
}
