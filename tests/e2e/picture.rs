//! Images whose content is known in closed form: upright, not mirrored, blurred along the motion and by the lens.

use crate::support::{Inputs, lit_bounds, mean_where, quintile};
use image::RgbImage;

/// The camera stands 5 in front of the origin with a field of view of 40 degrees; 160 x 120 pixels, black around.
const VIEW: &str = "camera: (position: (0, 0, 5), target: (0, 0, 0), fov_deg: 40), background: (0, 0, 0)";
const SETTINGS: &str = "width: 160, height: 120, samples: 64, frames: (0, 1)";

fn sphere(place: &str, colour: &str) -> String {
    format!("(shape: Sphere(radius: 0.5, segments: 64), material: (color: {colour}, unlit: true), {place})")
}

fn picture(settings: &str, objects: &[String]) -> RgbImage {
    let inputs = Inputs::new();
    let objects = objects.join(", ");
    let text = format!("(settings: ({SETTINGS}, {settings}), {VIEW}, objects: [{objects}])");
    quintile().run(&inputs.put("scene.ron", text), &[]).image(0)
}

fn lit(pixel: &image::Rgb<u8>) -> bool {
    pixel.0.iter().any(|part| *part > 12)
}

/// Pixels for a tangent of the angle from the axis.
fn pixels(tangent: f64) -> f64 {
    60.0 * tangent / 20.0f64.to_radians().tan()
}

/// Pixels across the sphere at the origin: its outline touches the cone of half-angle asin(r / d).
fn diameter_px() -> f64 {
    2.0 * pixels((0.5f64 / 5.0).asin().tan())
}

fn assert_near(found: u32, expected: f64, within: f64, what: &str) {
    assert!((f64::from(found) - expected).abs() <= within, "{what}: {found} px, {expected:.1} px expected");
}

#[test]
fn a_still_sphere_is_a_disk_of_its_size_in_the_middle() {
    let picture = picture("", &[sphere("", "(1, 1, 1)")]);
    let bounds = lit_bounds(&picture, lit).expect("the sphere is seen");
    assert_near(bounds.width(), diameter_px(), 2.0, "width");
    assert_near(bounds.height(), diameter_px(), 2.0, "height");
    let [x, y] = mean_where(&picture, lit).expect("the sphere is seen");
    assert!((x - 79.5).abs() < 0.3 && (y - 59.5).abs() < 0.3, "its middle is at {x}, {y}");
}

#[test]
fn up_is_up_and_right_is_right() {
    let above = sphere("position: (0, 1, 0)", "(1, 0, 0)");
    let right = sphere("position: (1, 0, 0)", "(0, 1, 0)");
    let picture = picture("", &[above, right]);
    let [x, y] = mean_where(&picture, |pixel| pixel.0[0] > 12).expect("red is seen");
    assert!((x - 79.5).abs() < 1.0 && (y - (59.5 - pixels(0.2))).abs() < 1.0, "red is at {x}, {y}");
    let [x, y] = mean_where(&picture, |pixel| pixel.0[1] > 12).expect("green is seen");
    assert!((x - (79.5 + pixels(0.2))).abs() < 1.0 && (y - 59.5).abs() < 1.0, "green is at {x}, {y}");
}

/// One unit along x in one shutter, on either side of the middle.
#[test]
fn motion_blurs_along_the_path_and_nowhere_else() {
    let thrown = |velocity: &str| sphere(&format!("position: (0, 0, 0), velocity: {velocity}"), "(1, 1, 1)");
    let across = lit_bounds(&picture("shutter: 1", &[thrown("(60, 0, 0)")]), lit).expect("it is seen");
    assert_near(across.height(), diameter_px(), 2.0, "height");
    assert_near(across.x[0], 79.5 - diameter_px() / 2.0, 2.0, "where it starts");
    // The far side of a sphere one unit off the axis: its direction's angle and half the angle it fills.
    let far = (1.0f64 / 5.0).atan() + (0.5 / 26.0f64.sqrt()).asin();
    assert_near(across.x[1], 80.0 + pixels(far.tan()), 2.0, "where it ends");
    let down = lit_bounds(&picture("shutter: 1", &[thrown("(0, -60, 0)")]), lit).expect("it is seen");
    assert_near(down.width(), diameter_px(), 2.0, "width");
    assert!(down.y[1] > 90 && down.y[0] > 40, "downwards is down: {down:?}");
    let frozen = lit_bounds(&picture("shutter: 0", &[thrown("(60, 0, 0)")]), lit).expect("it is seen");
    assert_near(frozen.width(), diameter_px(), 2.0, "width without shutter");
}

/// A sphere that is in one place for half of the time is half as bright there (linear light).
#[test]
fn blur_is_the_share_of_time_spent() {
    let fast = sphere("position: (-1, 0, 0), velocity: (120, 0, 0)", "(1, 1, 1)");
    let picture = picture("shutter: 1", &[fast]);
    // It covers the middle of the picture while its centre is within 0.5 of it: half of its path of 2.
    let byte = f64::from(picture.get_pixel(80, 60).0[0]) / 255.0;
    let linear = ((byte + 0.055) / 1.055).powf(2.4);
    assert!((linear - 0.5).abs() < 0.05, "{linear}");
}

/// The circle of confusion of a lens of radius R focused at F has, at depth w, the radius R |1/F - 1/w| in tangents.
#[test]
fn a_lens_blurs_what_is_out_of_focus_by_the_circle_of_confusion() {
    let white = || [sphere("", "(1, 1, 1)")];
    let sharp = lit_bounds(&picture("lens_radius: 0.3, focus: 5", &white()), lit).expect("it is seen");
    assert_near(sharp.width(), diameter_px(), 3.0, "in focus");
    let blurred = lit_bounds(&picture("lens_radius: 0.3, focus: 2.5", &white()), lit).expect("it is seen");
    let expected = diameter_px() + 2.0 * pixels(0.3 * (1.0 / 2.5 - 1.0 / 5.0));
    assert_near(blurred.width(), expected, 4.0, "out of focus");
    assert_near(blurred.height(), expected, 4.0, "out of focus");
}
