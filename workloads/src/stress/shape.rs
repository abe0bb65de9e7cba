//! Trouble by shape: too thin, too small, too large, turned away, without area.

use glam::DVec3;

use super::easel::Easel;
use super::{Family, StressError};

pub(super) const FAMILIES: &[Family] = &[
    Family {
        name: "slivers",
        what: "triangles 40 pixels long and ever thinner, in slow motion",
        parameter: "length over width",
        values: &[1.0, 10.0, 100.0, 1e3, 1e4, 1e6],
        slow: 0,
        paint: slivers,
    },
    Family {
        name: "diagonals",
        what: "still triangles a pixel wide and ever longer, in every direction",
        parameter: "length (pixels)",
        values: &[2.0, 8.0, 32.0, 128.0, 512.0],
        slow: 0,
        paint: diagonals,
    },
    Family {
        name: "huge",
        what: "moving triangles of which the image shows an ever smaller part",
        parameter: "size (pixels)",
        values: &[10.0, 100.0, 1e3, 1e4, 1e6, 1e8],
        slow: 0,
        paint: huge,
    },
    Family {
        name: "micro",
        what: "triangles smaller than the spacing of samples, moving and out of focus",
        parameter: "triangles per pixel",
        values: &[0.01, 0.1, 1.0, 10.0, 64.0],
        slow: 2,
        paint: micro,
    },
    Family {
        name: "scale",
        what: "moving, defocused triangles with all coordinates multiplied by one factor",
        parameter: "factor of coordinates",
        values: &[1.0, 1e3, 1e6, 1e9, 1e-3, 1e-6, 1e-9],
        slow: 0,
        paint: scale,
    },
    Family {
        name: "edge-on",
        what: "triangles seen under a small angle from the centre of the lens, and under others from elsewhere on it",
        parameter: "angle to the line of sight (degrees)",
        values: &[90.0, 30.0, 10.0, 1.0, 0.1, 0.0],
        slow: 0,
        paint: edge_on,
    },
    Family {
        name: "zero-area",
        what: "moving triangles whose corners are on one line at one instant",
        parameter: "instant (shutter intervals from opening)",
        values: &[-2.0, -0.5, -0.1, 0.0, 0.1, 0.5],
        slow: 0,
        paint: zero_area,
    },
    Family {
        name: "collapse",
        what: "moving triangles that shrink to a point while the shutter is open",
        parameter: "size at closing over size at opening",
        values: &[1.0, 0.3, 0.1, 1e-3, 1e-6, 0.0],
        slow: 0,
        paint: collapse,
    },
];

fn slivers(easel: &mut Easel, aspect: f64) -> Result<(), StressError> {
    for _ in 0..easel.size.triangles {
        let (spot, along, w) = (easel.spot(), easel.heading(), easel.octaves(2.0, 16.0));
        let (drift, deeper) = (easel.heading() * 4.0, easel.between(0.9, 1.1));
        let places = [along * -20.0, along * 20.0, along.perp() * (40.0 / aspect)].map(|place| spot + place);
        let open = places.map(|place| easel.at(place, w));
        let close = places.map(|place| easel.at(place + drift, w * deeper));
        easel.triangle(open, close);
    }
    Ok(())
}

fn diagonals(easel: &mut Easel, length_px: f64) -> Result<(), StressError> {
    for _ in 0..easel.size.triangles {
        let (spot, along, w) = (easel.spot(), easel.heading() * (0.5 * length_px), easel.octaves(2.0, 16.0));
        let places = [-along, along, along.perp().normalize()];
        let still = places.map(|place| easel.at(spot + place, w));
        easel.triangle(still, still);
    }
    Ok(())
}

fn huge(easel: &mut Easel, size_px: f64) -> Result<(), StressError> {
    for _ in 0..easel.size.triangles {
        let (spot, corners) = (easel.spot(), easel.corners(size_px));
        let (w, drift) = (easel.octaves(2.0, 16.0), easel.heading() * 4.0);
        // The image shows what is about one of the edges, so that there is something to decide.
        let middle = spot - 0.5 * (corners[0] + corners[1]);
        let open = corners.map(|corner| easel.at(middle + corner, w));
        let close = corners.map(|corner| easel.at(middle + corner + drift, w));
        easel.triangle(open, close);
    }
    Ok(())
}

fn micro(easel: &mut Easel, per_pixel: f64) -> Result<(), StressError> {
    easel.lens(2.0, 6.0)?;
    let size_px = libm::sqrt(1.0 / per_pixel).min(4.0);
    for _ in 0..(per_pixel * easel.side() * easel.side()) as u32 {
        let (spot, corners) = (easel.spot(), easel.corners(size_px));
        let (w, drift) = (easel.octaves(3.0, 12.0), easel.heading() * 2.0);
        let open = corners.map(|corner| easel.at(spot + corner, w));
        let close = corners.map(|corner| easel.at(spot + corner + drift, w));
        easel.triangle(open, close);
    }
    Ok(())
}

fn scale(easel: &mut Easel, factor: f64) -> Result<(), StressError> {
    easel.lens(4.0, 6.0)?;
    for _ in 0..easel.size.triangles {
        let (spot, corners) = (easel.spot(), easel.corners(16.0));
        let (w, drift) = (easel.octaves(3.0, 12.0), easel.heading() * 8.0);
        let open = corners.map(|corner| easel.at(spot + corner, w));
        let close = corners.map(|corner| easel.at(spot + corner + drift, 1.2 * w));
        easel.triangle(open, close);
    }
    Ok(easel.enlarge(factor)?)
}

fn edge_on(easel: &mut Easel, degrees: f64) -> Result<(), StressError> {
    const FOCUS: f64 = 6.0;
    easel.lens(8.0, FOCUS)?;
    let tilt = degrees.to_radians();
    for _ in 0..easel.size.triangles {
        let (spot, across) = (easel.spot(), easel.heading().extend(0.0));
        let middle = {
            let w = easel.octaves(3.0, 12.0);
            easel.at(spot, w)
        };
        // A plane through `across` and a direction that leaves the line of sight by `tilt`.
        let sight = middle.normalize();
        let aside = sight.cross(across).normalize();
        let into = sight * libm::cos(tilt) + aside * libm::sin(tilt);
        let size = 12.0 / easel.scale() * middle.z;
        let corner = |a: f64, b: f64| middle + (across * a + into * b) * size;
        let open: [DVec3; 3] = [corner(-1.0, -0.5), corner(1.0, -0.5), corner(0.0, 1.0)];
        easel.triangle(open, open);
    }
    Ok(())
}

fn zero_area(easel: &mut Easel, instant: f64) -> Result<(), StressError> {
    for _ in 0..easel.size.triangles {
        let (spot, along, w) = (easel.spot(), easel.heading() * 12.0, easel.octaves(2.0, 16.0));
        let (speed, drift) = (easel.between(12.0, 24.0), easel.heading() * 4.0);
        let apex = |t: f64| along.perp().normalize() * (speed * (t - instant));
        let places = |t: f64| [-along, along, apex(t)].map(|place| spot + place + drift * t);
        let (open, close) = (places(0.0), places(1.0));
        let [open, close] = [open, close].map(|places| places.map(|place| easel.at(place, w)));
        easel.triangle(open, close);
    }
    Ok(())
}

fn collapse(easel: &mut Easel, left: f64) -> Result<(), StressError> {
    for _ in 0..easel.size.triangles {
        let (spot, corners) = (easel.spot(), easel.corners(24.0));
        let (w, drift) = (easel.octaves(2.0, 16.0), easel.heading() * 8.0);
        let open = corners.map(|corner| easel.at(spot + corner, w));
        let close = corners.map(|corner| easel.at(spot + corner * left + drift, w));
        easel.triangle(open, close);
    }
    Ok(())
}
