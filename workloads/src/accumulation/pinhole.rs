//! The camera at one place on a lens.

use glam::{Affine3A, Vec2, Vec3};
use pipeline::{Camera, CameraError};

/// The pinhole at place `(u, v)` of the lens of `camera`, looking the same way with the image moved so that what is in focus stays
/// where it is: a lens of radius `R` focused at `F` sees a point at depth `w` moved by `u R (1 / F - 1 / w)` of the image at depth 1, which is
/// what moving the camera by `u R` and its image by `u R / F` does (Haeberli and Akeley 1990). A camera without a lens, or an
/// orthographic one, comes back as it is.
///
/// # Errors
/// When the lens is so large that the place is not finite.
pub fn pinhole(camera: &Camera, [u, v]: [f32; 2]) -> Result<Camera, CameraError> {
    let Some(lens) = camera.lens().filter(|_| !camera.is_orthographic()) else { return Ok(*camera) };
    let by = Vec2::new(u, v) * lens.radius();
    let moved = |pose: Affine3A| Affine3A::from_translation(Vec3::new(-by.x, -by.y, 0.0)) * pose;
    // The image is twice the tangent high, and its y points down.
    let shift = by * Vec2::new(1.0, -1.0) / (2.0 * camera.half_height() * lens.focus());
    let still = camera.with_lens(None).moving(moved(camera.open()), moved(camera.close()))?;
    still.with_shift(camera.shift() + shift)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pipeline::geometry::Projection;
    use pipeline::{Lens, Viewport};

    /// The lens formula itself, at depths before, in and behind the focus.
    #[test]
    fn a_pinhole_sees_what_its_place_on_the_lens_sees() {
        let lens = Lens::new(0.3, 4.0).unwrap();
        let camera = Camera::new(Affine3A::from_rotation_y(0.2), 0.7, 0.1).unwrap();
        let camera = camera.with_shift(Vec2::new(0.1, -0.05)).unwrap().with_lens(Some(lens));
        let viewport = Viewport::new(640, 480).unwrap();
        let wide = Projection::new(&camera, viewport);
        for [u, v] in [[0.0, 0.0], [1.0, 0.0], [-0.4, 0.9]] {
            let one = Projection::new(&pinhole(&camera, [u, v]).unwrap(), viewport);
            for point in [Vec3::new(0.2, -0.3, 2.0), Vec3::new(-1.0, 0.4, 4.0), Vec3::new(2.0, 1.0, 19.0)] {
                let [x, y, w] = wide.vertex(point, point).open.map(f64::from);
                let place = [(x, 0, u), (y, 1, v)].map(|(at, axis, place)| {
                    at / w
                        + f64::from(place)
                            * (f64::from(wide.shear.a[axis]) - f64::from(wide.shear.s[axis]) / w)
                });
                let [px, py, pw] = one.vertex(point, point).open.map(f64::from);
                let off = (place[0] - px / pw).abs().max((place[1] - py / pw).abs());
                assert!(off < 2e-4, "{off} px at {u} {v} {point}");
            }
        }
        let bare = camera.with_lens(None);
        assert_eq!(pinhole(&bare, [1.0, 1.0]).unwrap(), bare);
    }
}
