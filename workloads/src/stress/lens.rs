//! Trouble by the lens: too large, focused inside the triangle, hit by it, coupled with motion.

use glam::DVec3;

use super::easel::Easel;
use super::{Family, StressError};

pub(super) const FAMILIES: &[Family] = &[
    Family {
        name: "defocus",
        what: "still triangles ever more out of focus",
        parameter: "radius of the blur at infinity (pixels)",
        values: &[0.0, 1.0, 4.0, 16.0, 64.0],
        slow: 0,
        paint: defocus,
    },
    Family {
        name: "focus-inside",
        what: "still triangles that reach from before the focus to behind it",
        parameter: "extent in depth over focus depth",
        values: &[0.0, 0.1, 0.5, 1.0, 1.8],
        slow: 0,
        paint: focus_inside,
    },
    Family {
        name: "large-lens",
        what: "moving triangles before a lens ever larger than the scene, which is 8 units wide",
        parameter: "radius of the lens (scene units)",
        values: &[0.01, 0.1, 1.0, 10.0, 100.0, 1e4],
        slow: 0,
        paint: large_lens,
    },
    Family {
        name: "lens-and-motion",
        what: "triangles in focus at opening that recede or come near, so that blur changes while they move",
        parameter: "depth at closing over depth at opening",
        values: &[1.0, 1.2, 2.0, 8.0, 0.5, 0.1],
        slow: 0,
        paint: lens_and_motion,
    },
    Family {
        name: "through-lens",
        what: "triangles that fly through the lens itself, which has a radius of 2 units",
        parameter: "depth at closing (scene units)",
        values: &[5.0, 2.0, 0.5, 0.0, -1.0, -5.0],
        slow: 0,
        paint: through_lens,
    },
];

fn defocus(easel: &mut Easel, blur_px: f64) -> Result<(), StressError> {
    easel.lens(blur_px, 6.0)?;
    for _ in 0..easel.size.triangles {
        let (spot, corners, w) = (easel.spot(), easel.corners(8.0), easel.octaves(2.0, 16.0));
        let still = corners.map(|corner| easel.at(spot + corner, w));
        easel.triangle(still, still);
    }
    Ok(())
}

fn focus_inside(easel: &mut Easel, extent: f64) -> Result<(), StressError> {
    const FOCUS: f64 = 8.0;
    easel.lens(12.0, FOCUS)?;
    for _ in 0..easel.size.triangles {
        let (spot, corners) = (easel.spot(), easel.corners(24.0));
        let shift = easel.between(-0.05, 0.05);
        let depths = [1.0 - 0.5 * extent, 1.0 + 0.5 * extent, 1.0 + shift];
        let still = [0, 1, 2].map(|k| easel.at(spot + corners[k], FOCUS * depths[k]));
        easel.triangle(still, still);
    }
    Ok(())
}

fn large_lens(easel: &mut Easel, radius: f64) -> Result<(), StressError> {
    easel.lens_of(radius, 6.0)?;
    for _ in 0..easel.size.triangles {
        let (spot, corners) = (easel.spot(), easel.corners(12.0));
        let (w, drift) = (easel.between(4.0, 9.0), easel.heading() * 4.0);
        let open = corners.map(|corner| easel.at(spot + corner, w));
        let close = corners.map(|corner| easel.at(spot + corner + drift, w));
        easel.triangle(open, close);
    }
    Ok(())
}

fn lens_and_motion(easel: &mut Easel, ratio: f64) -> Result<(), StressError> {
    const FOCUS: f64 = 6.0;
    easel.lens(10.0, FOCUS)?;
    for _ in 0..easel.size.triangles {
        let (spot, corners) = (easel.spot(), easel.corners(10.0));
        let (w, drift) = (FOCUS * easel.between(0.9, 1.1), easel.heading() * 6.0);
        let open = corners.map(|corner| easel.at(spot + corner, w));
        let close = corners.map(|corner| easel.at(spot + corner + drift, w * ratio));
        easel.triangle(open, close);
    }
    Ok(())
}

fn through_lens(easel: &mut Easel, depth: f64) -> Result<(), StressError> {
    easel.lens_of(2.0, 6.0)?;
    for _ in 0..easel.size.triangles {
        let (spot, corners) = (easel.spot() * 0.25, easel.corners(12.0));
        let (w, late) = (easel.between(5.0, 8.0), easel.between(-0.5, 0.5));
        let middle = easel.at(spot, w);
        let open = corners.map(|corner| middle + (corner * (6.0 / easel.scale())).extend(0.0));
        let way = DVec3::new(0.0, 0.0, depth + late - w);
        easel.triangle(open, open.map(|corner| corner + way));
    }
    Ok(())
}
