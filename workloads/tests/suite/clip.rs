//! Clip planes of scene files: what is between them is drawn as without them, and nothing else.

use glam::Vec3;
use workloads::{LoadError, Overrides, Scene, load};

use crate::common::Files;
use crate::lens::{SIZE, first_image};

/// A moving sphere behind a lens, with `more` fields.
fn sphere(more: &str) -> Result<Scene, LoadError> {
    let text = format!("(objects: [(shape: Sphere(radius: 1), velocity: (20, 0, 0){more})])");
    let files = Files::new();
    let overrides =
        Overrides { size: Some(SIZE), lens_radius: Some(0.2), shutter: Some(0.5), ..Overrides::default() };
    Ok(load(files.put("s.ron", text))?.with_overrides(&overrides).unwrap())
}

fn image(more: &str) -> Vec<[u32; 3]> {
    let pixels = first_image(&sphere(more).unwrap());
    pixels.iter().map(|pixel: &Vec3| pixel.to_array().map(f32::to_bits)).collect()
}

#[test]
fn planes_across_the_image_leave_a_part_of_it_bit_for_bit() {
    let whole = image("");
    let drawn = |pixels: &[[u32; 3]]| pixels.iter().filter(|pixel| **pixel != [0; 3]).count();
    assert_eq!(image(", visible: (x: (0, 1), y: (0, 1))"), whole);
    // 96 x 54 pixels: planes at borders of pixels.
    for (more, x, y) in [
        ("x: (0.25, 0.5)", [24, 48], [0, 54]),
        ("y: (0.5, 1)", [0, 96], [27, 54]),
        ("x: (0.25, 1), y: (0, 0.5)", [24, 96], [0, 27]),
    ] {
        let part = image(&format!(", visible: ({more})"));
        let inside = |at: usize| (x[0]..x[1]).contains(&(at % 96)) && (y[0]..y[1]).contains(&(at / 96));
        let expected: Vec<[u32; 3]> =
            whole.iter().enumerate().map(|(at, pixel)| if inside(at) { *pixel } else { [0; 3] }).collect();
        assert!(part == expected, "{more}");
        assert!(drawn(&part) > 50 && drawn(&part) < drawn(&whole), "{more}");
    }
}

#[test]
fn planes_beyond_the_image_or_in_the_wrong_order_are_refused() {
    for axis in ["x", "y"] {
        for range in ["(0.5, 0.25)", "(-0.1, 1)", "(0, 1.5)", "(0.5, 0.5)"] {
            let error = sphere(&format!(", visible: ({axis}: {range})")).unwrap_err().to_string();
            assert!(error.contains("a range within 0 and 1, the lower end first"), "{error}");
        }
    }
}
