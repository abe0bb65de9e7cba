//! Families about shape: too thin, too small, too large, edge-on, without area.

use glam::DVec3;

use super::builder::SceneBuilder;
use super::{Family, StressError};

pub(super) const FAMILIES: &[Family] = &[
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
