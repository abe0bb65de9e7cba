//! Images survive the way through their files.

use image::GenericImageView;
use output::image::{ImageError, LinearImage};
use output::{Claim, Destination};

fn ramp() -> Vec<[f32; 3]> {
    (0..12).map(|i| [i as f32 / 11.0, 1.0 - i as f32 / 11.0, 2.5]).collect()
}

#[test]
fn png_holds_srgb_and_exr_the_very_values() {
    let temp = tempfile::tempdir().unwrap();
    let claim = Claim::new("test").files(["images/a.png", "images/a.exr"]);
    let mut dir = Destination::new(temp.path()).open([claim]).unwrap();
    let pixels = ramp();
    let picture = LinearImage::new(4, 3, &pixels).unwrap();
    picture.write_png(&dir, "images/a.png").unwrap();
    picture.write_exr(&dir, "images/a.exr").unwrap();
    dir.publish().unwrap();
    let png = image::open(temp.path().join("images/a.png")).unwrap();
    assert_eq!(png.dimensions(), (4, 3));
    assert_eq!(png.to_rgb8().get_pixel(0, 0).0, [0, 255, 255]);
    assert_eq!(png.to_rgb8().get_pixel(3, 2).0, [255, 0, 255]);
    let exr = image::open(temp.path().join("images/a.exr")).unwrap().to_rgb32f();
    let values: Vec<[f32; 3]> = exr.pixels().map(|pixel| pixel.0).collect();
    assert_eq!(values, pixels);
}

#[test]
fn half_of_linear_light_is_188_in_srgb() {
    let pixels = [[0.5; 3]];
    let png = LinearImage::new(1, 1, &pixels).unwrap().png().unwrap();
    assert_eq!(image::load_from_memory(&png).unwrap().to_rgb8().get_pixel(0, 0).0, [188; 3]);
}

#[test]
fn a_thumbnail_averages_light_and_never_grows() {
    let pixels: Vec<[f32; 3]> = (0..8).map(|i| [(i % 2) as f32; 3]).collect();
    let picture = LinearImage::new(4, 2, &pixels).unwrap();
    let small = image::load_from_memory(&picture.thumbnail_png(2).unwrap()).unwrap().to_rgb8();
    assert_eq!(small.dimensions(), (2, 1));
    assert!(small.pixels().all(|pixel| pixel.0 == [188; 3]));
    let same = image::load_from_memory(&picture.thumbnail_png(100).unwrap()).unwrap();
    assert_eq!(same.dimensions(), (4, 2));
}

#[test]
fn no_area_and_wrong_length_are_refused() {
    assert!(matches!(LinearImage::new(0, 5, &[]), Err(ImageError::NoArea { .. })));
    assert!(matches!(LinearImage::new(5, 0, &[]), Err(ImageError::NoArea { .. })));
    assert!(matches!(LinearImage::new(2, 2, &[[0.0; 3]]), Err(ImageError::Length { .. })));
    assert!(LinearImage::new(u32::MAX, u32::MAX, &[]).is_err());
}
