//! Families about shape: too thin, too small, too large, edge-on, without area; and about neighbours: shared
//! edges on samples, closed surfaces around the camera, layers at nearly equal depth.

use glam::{DVec2, DVec3};
use pipeline::SampleTable;
use pipeline::sampling::Sample;

use super::{Family, NEAR, PER_PIXEL, SceneBuilder, StressError};

pub(super) const SHAPE_FAMILIES: &[Family] = &[
    Family {
        name: "slivers",
        what: "triangles 40 pixels long and ever thinner, in slow motion",
        parameter: "length over width",
        values: &[1.0, 10.0, 100.0, 1e3, 1e4, 1e6],
        slow: 0,
        build: slivers,
    },
    Family {
        name: "diagonals",
        what: "still triangles a pixel wide and ever longer, in every direction",
        parameter: "length (pixels)",
        values: &[2.0, 8.0, 32.0, 128.0, 512.0],
        slow: 0,
        build: diagonals,
    },
    Family {
        name: "huge",
        what: "moving triangles of which the image shows an ever smaller part",
        parameter: "size (pixels)",
        values: &[10.0, 100.0, 1e3, 1e4, 1e6, 1e8],
        slow: 0,
        build: huge,
    },
    Family {
        name: "micro",
        what: "triangles smaller than the spacing of samples, moving and out of focus",
        parameter: "triangles per pixel",
        values: &[0.01, 0.1, 1.0, 10.0, 64.0],
        slow: 2,
        build: micro,
    },
    Family {
        name: "scale",
        what: "moving, defocused triangles with all coordinates multiplied by one factor",
        parameter: "factor of coordinates",
        values: &[1.0, 1e3, 1e6, 1e9, 1e-3, 1e-6, 1e-9],
        slow: 0,
        build: scale,
    },
    Family {
        name: "edge-on",
        what: "triangles seen under a small angle from the centre of the lens, and under others from elsewhere on it",
        parameter: "angle to the line of sight (degrees)",
        values: &[90.0, 30.0, 10.0, 1.0, 0.1, 0.0],
        slow: 0,
        build: edge_on,
    },
    Family {
        name: "zero-area",
        what: "moving triangles whose corners are on one line at one instant",
        parameter: "instant (shutter intervals from opening)",
        values: &[-2.0, -0.5, -0.1, 0.0, 0.1, 0.5],
        slow: 0,
        build: zero_area,
    },
    Family {
        name: "collapse",
        what: "moving triangles that shrink to a point while the shutter is open",
        parameter: "size at closing over size at opening",
        values: &[1.0, 0.3, 0.1, 1e-3, 1e-6, 0.0],
        slow: 0,
        build: collapse,
    },
];

fn slivers(builder: &mut SceneBuilder, aspect: f64) -> Result<(), StressError> {
    for _ in 0..builder.size.triangles {
        let (position, along, w) = (builder.position(), builder.direction(), builder.octaves(2.0, 16.0));
        let (drift, deeper) = (builder.direction() * 4.0, builder.between(0.9, 1.1));
        let places =
            [along * -20.0, along * 20.0, along.perp() * (40.0 / aspect)].map(|place| position + place);
        let open = places.map(|place| builder.at(place, w));
        let close = places.map(|place| builder.at(place + drift, w * deeper));
        builder.triangle(open, close);
    }
    Ok(())
}

fn diagonals(builder: &mut SceneBuilder, length_px: f64) -> Result<(), StressError> {
    for _ in 0..builder.size.triangles {
        let (position, along, w) =
            (builder.position(), builder.direction() * (0.5 * length_px), builder.octaves(2.0, 16.0));
        let places = [-along, along, along.perp().normalize()];
        let still = places.map(|place| builder.at(position + place, w));
        builder.triangle(still, still);
    }
    Ok(())
}

fn huge(builder: &mut SceneBuilder, size_px: f64) -> Result<(), StressError> {
    for _ in 0..builder.size.triangles {
        let (position, corners) = (builder.position(), builder.corners(size_px));
        let (w, drift) = (builder.octaves(2.0, 16.0), builder.direction() * 4.0);
        // The image shows the region around one of the edges, so that there is something to decide.
        let middle = position - 0.5 * (corners[0] + corners[1]);
        let open = corners.map(|corner| builder.at(middle + corner, w));
        let close = corners.map(|corner| builder.at(middle + corner + drift, w));
        builder.triangle(open, close);
    }
    Ok(())
}

fn micro(builder: &mut SceneBuilder, per_pixel: f64) -> Result<(), StressError> {
    builder.lens(2.0, 6.0)?;
    let size_px = libm::sqrt(1.0 / per_pixel).min(4.0);
    for _ in 0..(per_pixel * builder.side() * builder.side()) as u32 {
        let (position, corners) = (builder.position(), builder.corners(size_px));
        let (w, drift) = (builder.octaves(3.0, 12.0), builder.direction() * 2.0);
        let open = corners.map(|corner| builder.at(position + corner, w));
        let close = corners.map(|corner| builder.at(position + corner + drift, w));
        builder.triangle(open, close);
    }
    Ok(())
}

fn scale(builder: &mut SceneBuilder, factor: f64) -> Result<(), StressError> {
    builder.lens(4.0, 6.0)?;
    for _ in 0..builder.size.triangles {
        let (position, corners) = (builder.position(), builder.corners(16.0));
        let (w, drift) = (builder.octaves(3.0, 12.0), builder.direction() * 8.0);
        let open = corners.map(|corner| builder.at(position + corner, w));
        let close = corners.map(|corner| builder.at(position + corner + drift, 1.2 * w));
        builder.triangle(open, close);
    }
    Ok(builder.enlarge(factor)?)
}

fn edge_on(builder: &mut SceneBuilder, degrees: f64) -> Result<(), StressError> {
    const FOCUS: f64 = 6.0;
    builder.lens(8.0, FOCUS)?;
    let tilt = degrees.to_radians();
    for _ in 0..builder.size.triangles {
        let (position, across) = (builder.position(), builder.direction().extend(0.0));
        let middle = {
            let w = builder.octaves(3.0, 12.0);
            builder.at(position, w)
        };
        // A plane through `across` and a direction at angle `tilt` from the line of sight.
        let sight = middle.normalize();
        let aside = sight.cross(across).normalize();
        let into = sight * libm::cos(tilt) + aside * libm::sin(tilt);
        let size = 12.0 / builder.scale() * middle.z;
        let corner = |a: f64, b: f64| middle + (across * a + into * b) * size;
        let open: [DVec3; 3] = [corner(-1.0, -0.5), corner(1.0, -0.5), corner(0.0, 1.0)];
        builder.triangle(open, open);
    }
    Ok(())
}

fn zero_area(builder: &mut SceneBuilder, instant: f64) -> Result<(), StressError> {
    for _ in 0..builder.size.triangles {
        let (position, along, w) =
            (builder.position(), builder.direction() * 12.0, builder.octaves(2.0, 16.0));
        let (speed, drift) = (builder.between(12.0, 24.0), builder.direction() * 4.0);
        let apex = |t: f64| along.perp().normalize() * (speed * (t - instant));
        let places = |t: f64| [-along, along, apex(t)].map(|place| position + place + drift * t);
        let (open, close) = (places(0.0), places(1.0));
        let [open, close] = [open, close].map(|places| places.map(|place| builder.at(place, w)));
        builder.triangle(open, close);
    }
    Ok(())
}

fn collapse(builder: &mut SceneBuilder, remaining: f64) -> Result<(), StressError> {
    for _ in 0..builder.size.triangles {
        let (position, corners) = (builder.position(), builder.corners(24.0));
        let (w, drift) = (builder.octaves(2.0, 16.0), builder.direction() * 8.0);
        let open = corners.map(|corner| builder.at(position + corner, w));
        let close = corners.map(|corner| builder.at(position + corner * remaining + drift, w));
        builder.triangle(open, close);
    }
    Ok(())
}

pub(super) const MESH_FAMILIES: &[Family] = &[
    Family {
        name: "shared-edges",
        what: "a moving, defocused grid whose vertices and edges lie exactly on samples, always and from all over the lens",
        parameter: "side of a cell (pixels)",
        values: &[16.0, 8.0, 4.0, 2.0],
        slow: 0,
        build: shared_edges,
    },
    Family {
        name: "on-samples",
        what: "still triangles whose corners are samples of the default table",
        parameter: "share of corners",
        values: &[0.0, 0.5, 1.0],
        slow: 0,
        build: vertices_on_samples,
    },
    Family {
        name: "inside-closed",
        what: "a moving, closed surface of radius 10 about the camera",
        parameter: "distance of the camera from its centre (radii)",
        values: &[0.0, 0.5, 0.8, 0.9],
        slow: 0,
        build: inside_closed,
    },
    Family {
        name: "layers",
        what: "moving walls one behind the other, the nearest drawn first",
        parameter: "gap over depth",
        values: &[1e-2, 1e-4, 1e-6, 1e-8, 0.0],
        slow: 0,
        build: layers,
    },
];

/// Samples at multiples of one half in pixel, lens and shutter.
fn on_halves() -> Result<SampleTable, StressError> {
    let pixels = SampleTable::SIDE_PX * SampleTable::SIDE_PX;
    let half = |place: u32, bit: u32| 0.5 * ((place >> bit) & 1) as f32;
    let sample = |i: u32| {
        // The pixels cycle through the combinations that the four samples of one pixel omit.
        let place = i ^ (i / PER_PIXEL * 7);
        Sample {
            x: half(place, 0),
            y: half(place, 1),
            u: 2.0 * half(place, 2) - 0.5,
            v: half(place, 3),
            t: half(place, 4),
        }
    };
    Ok(SampleTable::programmed(PER_PIXEL, 1, (0..pixels * PER_PIXEL).map(sample).collect())?)
}

fn shared_edges(builder: &mut SceneBuilder, cell_px: f64) -> Result<(), StressError> {
    builder.sample_with(on_halves()?);
    // At depth 4 and focus 2, half of the lens is half a pixel; all values are exact.
    builder.lens_of(4.0 / builder.scale(), 2.0)?;
    let cells = (0.75 * builder.side() / cell_px) as u32;
    let from = DVec2::splat(-0.5 * cell_px * f64::from(cells));
    let drift = DVec2::new(2.0, -2.0);
    for vertex in 0..(cells + 1) * (cells + 1) {
        let place = DVec2::new(f64::from(vertex % (cells + 1)), f64::from(vertex / (cells + 1)));
        let px = from + place * cell_px;
        builder.vertex(builder.at(px, 4.0), builder.at(px + drift, 4.0));
    }
    for cell in 0..cells * cells {
        let (column, row) = (cell % cells, cell / cells);
        let a = row * (cells + 1) + column;
        let [b, c, d] = [a + 1, a + cells + 2, a + cells + 1];
        let pair = if (column + row) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
        pair.into_iter().for_each(|corners| builder.face(corners));
    }
    Ok(())
}

fn vertices_on_samples(builder: &mut SceneBuilder, share: f64) -> Result<(), StressError> {
    let half = 0.5 * builder.side();
    for _ in 0..builder.size.triangles {
        let (position, corners) = (builder.position(), builder.corners(16.0));
        let still = corners.map(|corner| {
            let mut px = position + corner;
            let pixel = (px + half).clamp(DVec2::ZERO, DVec2::splat(builder.side() - 1.0)).floor();
            let sample = builder.samples().pixel(pixel.x as u32, pixel.y as u32)[0];
            if builder.between(0.0, 1.0) < share {
                // Rows count downwards. The position is rounded to f32 like the sample's.
                let [x, y] = [pixel.x - half, pixel.y - half].map(|c| c as f32);
                px = DVec2::new(f64::from(x + sample.x), -f64::from(y + sample.y));
            }
            builder.at(px, 4.0)
        });
        builder.triangle(still, still);
    }
    Ok(())
}

fn inside_closed(builder: &mut SceneBuilder, share: f64) -> Result<(), StressError> {
    const RADIUS: f64 = 10.0;
    const STEPS: i32 = 6;
    let towards = DVec3::new(0.3, -0.2, 0.933).normalize() * (share * RADIUS);
    let drift = DVec3::new(0.05, 0.02, 0.5 * NEAR);
    let mut known = std::collections::BTreeMap::new();
    let mut vertex = |builder: &mut SceneBuilder, place: [i32; 3]| {
        *known.entry(place).or_insert_with(|| {
            let out = DVec3::from(place.map(f64::from)).normalize() * RADIUS - towards;
            builder.vertex(out, out + drift)
        })
    };
    for octant in 0..8 {
        let sign = [0, 1, 2].map(|axis| if octant >> axis & 1 == 0 { 1 } else { -1 });
        for (i, j, up) in octahedron_face(STEPS) {
            let corner = |i: i32, j: i32| [i * sign[0], j * sign[1], (STEPS - i - j) * sign[2]];
            let places = if up {
                [corner(i, j), corner(i + 1, j), corner(i, j + 1)]
            } else {
                [corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]
            };
            let corners = places.map(|place| vertex(builder, place));
            builder.face(corners);
        }
    }
    Ok(())
}

/// Triangles of one octahedron face, divided into `steps` along each edge: position, and orientation.
fn octahedron_face(steps: i32) -> impl Iterator<Item = (i32, i32, bool)> {
    (0..steps).flat_map(move |i| {
        (0..steps - i).flat_map(move |j| {
            let down = (i + j + 1 < steps).then_some((i, j, false));
            std::iter::once((i, j, true)).chain(down)
        })
    })
}

fn layers(builder: &mut SceneBuilder, gap: f64) -> Result<(), StressError> {
    let reach = builder.side();
    for layer in 0..builder.size.triangles {
        let w = 4.0 * (1.0 + gap * f64::from(layer));
        let lift = builder.between(-0.5, 0.5);
        let places = [DVec2::new(-reach, -reach + lift), DVec2::new(reach, -reach), DVec2::new(lift, reach)];
        let open = places.map(|px| builder.at(px, w));
        let close = places.map(|px| builder.at(px + DVec2::X, w));
        builder.triangle(open, close);
    }
    Ok(())
}
