//! Trouble by motion: too fast, out of step, turning over, through the camera.

use glam::{DMat3, DVec2, DVec3};

use super::easel::Easel;
use super::{Family, StressError};

pub(super) const FAMILIES: &[Family] = &[
    Family {
        name: "speed",
        what: "triangles of 8 pixels on straight ways, slow to far beyond the image",
        parameter: "way in one shutter (images)",
        values: &[0.0, 0.01, 0.1, 1.0, 10.0, 100.0],
        slow: 0,
        paint: speed,
    },
    Family {
        name: "out-of-step",
        what: "triangles whose corners move in directions of their own",
        parameter: "way of each corner (pixels)",
        values: &[0.0, 1.0, 8.0, 32.0, 128.0],
        slow: 0,
        paint: out_of_step,
    },
    Family {
        name: "facing",
        what: "triangles that turn about an axis in their plane, on chords, so that at half a turn they pass through it",
        parameter: "turn in one shutter (degrees)",
        values: &[0.0, 30.0, 60.0, 90.0, 120.0, 180.0],
        slow: 0,
        paint: facing,
    },
    Family {
        name: "behind",
        what: "moving triangles with one corner at or behind the camera plane all the time",
        parameter: "depth of the corner (scene units)",
        values: &[4.0, 1.0, 0.3, 0.1, 0.0, -1.0, -4.0],
        slow: 0,
        paint: behind,
    },
    Family {
        name: "through-camera",
        what: "triangles that fly towards the camera and past it",
        parameter: "depth at closing (scene units)",
        values: &[5.0, 2.0, 0.5, 0.0, -1.0, -5.0],
        slow: 0,
        paint: through_camera,
    },
];

fn speed(easel: &mut Easel, screens: f64) -> Result<(), StressError> {
    let way_px = screens * easel.side();
    for _ in 0..easel.size.triangles {
        let (spot, corners) = (easel.spot(), easel.corners(8.0));
        let (w, drift, when) = (easel.octaves(2.0, 16.0), easel.heading() * way_px, easel.between(0.0, 1.0));
        // It is on the image at some time, not always at the opening.
        let from = spot - drift * when;
        let open = corners.map(|corner| easel.at(from + corner, w));
        let close = corners.map(|corner| easel.at(from + corner + drift, w));
        easel.triangle(open, close);
    }
    Ok(())
}

fn out_of_step(easel: &mut Easel, way_px: f64) -> Result<(), StressError> {
    for _ in 0..easel.size.triangles {
        let (spot, corners, w) = (easel.spot(), easel.corners(12.0), easel.octaves(2.0, 16.0));
        let open = corners.map(|corner| easel.at(spot + corner, w));
        let close = corners.map(|corner| {
            let (drift, deeper) =
                (easel.heading() * way_px, easel.between(-0.5, 0.5) * way_px.min(8.0) / 8.0);
            easel.at(spot + corner + drift, w * (1.0 + deeper))
        });
        easel.triangle(open, close);
    }
    Ok(())
}

fn facing(easel: &mut Easel, degrees: f64) -> Result<(), StressError> {
    for _ in 0..easel.size.triangles {
        let (spot, corners, axis) = (easel.spot(), easel.corners(20.0), easel.heading());
        let w = easel.octaves(3.0, 12.0);
        let (middle, unit) = (easel.at(spot, w), w / easel.scale());
        let turn = rotation(axis, degrees.to_radians());
        let open = corners.map(|corner| middle + (corner * unit).extend(0.0));
        let close = corners.map(|corner| middle + turn * (corner * unit).extend(0.0));
        easel.triangle(open, close);
    }
    Ok(())
}

/// A turn by `angle` about `axis` in the image plane (Rodrigues 1840), through `libm`.
fn rotation(axis: DVec2, angle: f64) -> DMat3 {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let k = DMat3::from_cols(
        DVec3::new(0.0, 0.0, -axis.y),
        DVec3::new(0.0, 0.0, axis.x),
        DVec3::new(axis.y, -axis.x, 0.0),
    );
    DMat3::IDENTITY + k * sin + k * k * (1.0 - cos)
}

fn behind(easel: &mut Easel, depth: f64) -> Result<(), StressError> {
    for _ in 0..easel.size.triangles {
        let (spot, corners, w) = (easel.spot(), easel.corners(16.0), easel.octaves(2.0, 8.0));
        let drift = easel.heading() * 4.0;
        let aside = easel.spot() / easel.scale();
        let ends = [DVec2::ZERO, drift].map(|drift| {
            let front = [0, 1].map(|k| easel.at(spot + corners[k] + drift, w));
            [front[0], front[1], (aside + drift / easel.scale()).extend(depth)]
        });
        easel.triangle(ends[0], ends[1]);
    }
    Ok(())
}

fn through_camera(easel: &mut Easel, depth: f64) -> Result<(), StressError> {
    for _ in 0..easel.size.triangles {
        let (spot, corners) = (easel.spot() * 0.25, easel.corners(12.0));
        let (w, late) = (easel.between(6.0, 10.0), easel.between(-0.5, 0.5));
        let middle = easel.at(spot, w);
        let open = corners.map(|corner| middle + (corner * (6.0 / easel.scale())).extend(0.0));
        let way = DVec3::new(0.0, 0.0, depth + late - w);
        easel.triangle(open, open.map(|corner| corner + way));
    }
    Ok(())
}
