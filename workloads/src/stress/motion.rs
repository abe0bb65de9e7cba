//! Families about motion and the lens: too fast, incoherent, rotating, through the camera; a lens too large,
//! focused inside the triangle, hit by it, combined with motion.

use glam::{DMat3, DVec2, DVec3};

use super::{Family, SceneBuilder, StressError};

pub(super) const MOTION_FAMILIES: &[Family] = &[
    Family {
        name: "speed",
        what: "triangles of 8 pixels on straight ways, slow to far beyond the image",
        parameter: "way in one shutter (images)",
        values: &[0.0, 0.01, 0.1, 1.0, 10.0, 100.0],
        slow: 0,
        build: speed,
    },
    Family {
        name: "out-of-step",
        what: "triangles whose corners move in directions of their own",
        parameter: "way of each corner (pixels)",
        values: &[0.0, 1.0, 8.0, 32.0, 128.0],
        slow: 0,
        build: out_of_step,
    },
    Family {
        name: "facing",
        what: "triangles that turn about an axis in their plane, on chords, so that at half a turn they pass through it",
        parameter: "turn in one shutter (degrees)",
        values: &[0.0, 30.0, 60.0, 90.0, 120.0, 180.0],
        slow: 0,
        build: facing,
    },
    Family {
        name: "behind",
        what: "moving triangles with one corner at or behind the camera plane all the time",
        parameter: "depth of the corner (scene units)",
        values: &[4.0, 1.0, 0.3, 0.1, 0.0, -1.0, -4.0],
        slow: 0,
        build: behind,
    },
    Family {
        name: "through-camera",
        what: "triangles that fly towards the camera and past it",
        parameter: "depth at closing (scene units)",
        values: &[5.0, 2.0, 0.5, 0.0, -1.0, -5.0],
        slow: 0,
        build: through_camera,
    },
];

fn speed(builder: &mut SceneBuilder, screens: f64) -> Result<(), StressError> {
    let way_px = screens * builder.side();
    for _ in 0..builder.size.triangles {
        let (position, corners) = (builder.position(), builder.corners(8.0));
        let (w, drift, when) =
            (builder.octaves(2.0, 16.0), builder.direction() * way_px, builder.between(0.0, 1.0));
        // The triangle crosses the image at some time, not necessarily at shutter open.
        let from = position - drift * when;
        let open = corners.map(|corner| builder.at(from + corner, w));
        let close = corners.map(|corner| builder.at(from + corner + drift, w));
        builder.triangle(open, close);
    }
    Ok(())
}

fn out_of_step(builder: &mut SceneBuilder, way_px: f64) -> Result<(), StressError> {
    for _ in 0..builder.size.triangles {
        let (position, corners, w) = (builder.position(), builder.corners(12.0), builder.octaves(2.0, 16.0));
        let open = corners.map(|corner| builder.at(position + corner, w));
        let close = corners.map(|corner| {
            let (drift, deeper) =
                (builder.direction() * way_px, builder.between(-0.5, 0.5) * way_px.min(8.0) / 8.0);
            builder.at(position + corner + drift, w * (1.0 + deeper))
        });
        builder.triangle(open, close);
    }
    Ok(())
}

fn facing(builder: &mut SceneBuilder, degrees: f64) -> Result<(), StressError> {
    for _ in 0..builder.size.triangles {
        let (position, corners, axis) = (builder.position(), builder.corners(20.0), builder.direction());
        let w = builder.octaves(3.0, 12.0);
        let (middle, unit) = (builder.at(position, w), w / builder.scale());
        let turn = rotation(axis, degrees.to_radians());
        let open = corners.map(|corner| middle + (corner * unit).extend(0.0));
        let close = corners.map(|corner| middle + turn * (corner * unit).extend(0.0));
        builder.triangle(open, close);
    }
    Ok(())
}

/// Rotation by `angle` around `axis` in the image plane (Rodrigues 1840), computed with `libm`.
fn rotation(axis: DVec2, angle: f64) -> DMat3 {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let k = DMat3::from_cols(
        DVec3::new(0.0, 0.0, -axis.y),
        DVec3::new(0.0, 0.0, axis.x),
        DVec3::new(axis.y, -axis.x, 0.0),
    );
    DMat3::IDENTITY + k * sin + k * k * (1.0 - cos)
}

fn behind(builder: &mut SceneBuilder, depth: f64) -> Result<(), StressError> {
    for _ in 0..builder.size.triangles {
        let (position, corners, w) = (builder.position(), builder.corners(16.0), builder.octaves(2.0, 8.0));
        let drift = builder.direction() * 4.0;
        let aside = builder.position() / builder.scale();
        let ends = [DVec2::ZERO, drift].map(|drift| {
            let front = [0, 1].map(|k| builder.at(position + corners[k] + drift, w));
            [front[0], front[1], (aside + drift / builder.scale()).extend(depth)]
        });
        builder.triangle(ends[0], ends[1]);
    }
    Ok(())
}

fn through_camera(builder: &mut SceneBuilder, depth: f64) -> Result<(), StressError> {
    for _ in 0..builder.size.triangles {
        let (position, corners) = (builder.position() * 0.25, builder.corners(12.0));
        let (w, late) = (builder.between(6.0, 10.0), builder.between(-0.5, 0.5));
        let middle = builder.at(position, w);
        let open = corners.map(|corner| middle + (corner * (6.0 / builder.scale())).extend(0.0));
        let way = DVec3::new(0.0, 0.0, depth + late - w);
        builder.triangle(open, open.map(|corner| corner + way));
    }
    Ok(())
}

pub(super) const LENS_FAMILIES: &[Family] = &[
    Family {
        name: "defocus",
        what: "still triangles ever more out of focus",
        parameter: "radius of the blur at infinity (pixels)",
        values: &[0.0, 1.0, 4.0, 16.0, 64.0],
        slow: 0,
        build: defocus,
    },
    Family {
        name: "focus-inside",
        what: "still triangles that reach from before the focus to behind it",
        parameter: "extent in depth over focus depth",
        values: &[0.0, 0.1, 0.5, 1.0, 1.8],
        slow: 0,
        build: focus_inside,
    },
    Family {
        name: "large-lens",
        what: "moving triangles before a lens ever larger than the scene, which is 8 units wide",
        parameter: "radius of the lens (scene units)",
        values: &[0.01, 0.1, 1.0, 10.0, 100.0, 1e4],
        slow: 0,
        build: large_lens,
    },
    Family {
        name: "lens-and-motion",
        what: "triangles in focus at opening that recede or come near, so that blur changes while they move",
        parameter: "depth at closing over depth at opening",
        values: &[1.0, 1.2, 2.0, 8.0, 0.5, 0.1],
        slow: 0,
        build: lens_and_motion,
    },
    Family {
        name: "through-lens",
        what: "triangles that fly through the lens itself, which has a radius of 2 units",
        parameter: "depth at closing (scene units)",
        values: &[5.0, 2.0, 0.5, 0.0, -1.0, -5.0],
        slow: 0,
        build: through_lens,
    },
];

fn defocus(builder: &mut SceneBuilder, blur_px: f64) -> Result<(), StressError> {
    builder.lens(blur_px, 6.0)?;
    for _ in 0..builder.size.triangles {
        let (position, corners, w) = (builder.position(), builder.corners(8.0), builder.octaves(2.0, 16.0));
        let still = corners.map(|corner| builder.at(position + corner, w));
        builder.triangle(still, still);
    }
    Ok(())
}

fn focus_inside(builder: &mut SceneBuilder, extent: f64) -> Result<(), StressError> {
    const FOCUS: f64 = 8.0;
    builder.lens(12.0, FOCUS)?;
    for _ in 0..builder.size.triangles {
        let (position, corners) = (builder.position(), builder.corners(24.0));
        let shift = builder.between(-0.05, 0.05);
        let depths = [1.0 - 0.5 * extent, 1.0 + 0.5 * extent, 1.0 + shift];
        let still = [0, 1, 2].map(|k| builder.at(position + corners[k], FOCUS * depths[k]));
        builder.triangle(still, still);
    }
    Ok(())
}

fn large_lens(builder: &mut SceneBuilder, radius: f64) -> Result<(), StressError> {
    builder.lens_of(radius, 6.0)?;
    for _ in 0..builder.size.triangles {
        let (position, corners) = (builder.position(), builder.corners(12.0));
        let (w, drift) = (builder.between(4.0, 9.0), builder.direction() * 4.0);
        let open = corners.map(|corner| builder.at(position + corner, w));
        let close = corners.map(|corner| builder.at(position + corner + drift, w));
        builder.triangle(open, close);
    }
    Ok(())
}

fn lens_and_motion(builder: &mut SceneBuilder, ratio: f64) -> Result<(), StressError> {
    const FOCUS: f64 = 6.0;
    builder.lens(10.0, FOCUS)?;
    for _ in 0..builder.size.triangles {
        let (position, corners) = (builder.position(), builder.corners(10.0));
        let (w, drift) = (FOCUS * builder.between(0.9, 1.1), builder.direction() * 6.0);
        let open = corners.map(|corner| builder.at(position + corner, w));
        let close = corners.map(|corner| builder.at(position + corner + drift, w * ratio));
        builder.triangle(open, close);
    }
    Ok(())
}

fn through_lens(builder: &mut SceneBuilder, depth: f64) -> Result<(), StressError> {
    builder.lens_of(2.0, 6.0)?;
    for _ in 0..builder.size.triangles {
        let (position, corners) = (builder.position() * 0.25, builder.corners(12.0));
        let (w, late) = (builder.between(5.0, 8.0), builder.between(-0.5, 0.5));
        let middle = builder.at(position, w);
        let open = corners.map(|corner| middle + (corner * (6.0 / builder.scale())).extend(0.0));
        let way = DVec3::new(0.0, 0.0, depth + late - w);
        builder.triangle(open, open.map(|corner| corner + way));
    }
    Ok(())
}
