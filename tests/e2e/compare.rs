//! `quintile compare`: runs, images, folders of images, tables of frames.

use crate::support::{Ended, Inputs, Refusals, quintile};
use image::{Rgb, RgbImage};
use serde_json::{Value, json};

fn compare(args: &[&str]) -> Ended {
    quintile().call(["compare"].iter().chain(args))
}

fn compared(args: &[&str]) -> (String, Value) {
    let [text, json] = [compare(args), compare(&[args, &["--json"]].concat())];
    assert_eq!((text.code, json.code), (Some(0), Some(0)), "{}{}", text.stderr, json.stderr);
    (text.stdout, serde_json::from_str(&json.stdout).expect("JSON"))
}

fn png(inputs: &Inputs, name: &str, size: [u32; 2], colour: impl Fn(u32, u32) -> [u8; 3]) -> String {
    let path = inputs.path(name);
    let image = RgbImage::from_fn(size[0], size[1], |x, y| Rgb(colour(x, y)));
    image.save(&path).expect("a PNG");
    path
}

fn texture(x: u32, y: u32) -> [u8; 3] {
    [(x * 9 % 256) as u8, (y * 7 % 256) as u8, ((x * y) % 256) as u8]
}

#[test]
fn a_changed_setting_and_its_effects_are_listed() {
    let small = ["--frames", "0..2"];
    let one = quintile().run("tiny", &small);
    let other = quintile().run("tiny", &[&small[..], &["--samples", "8"]].concat());
    let [a, b] = [&one, &other].map(|run| run.folder().display().to_string());
    let (text, found) = compared(&[&a, &b]);
    let settings = found["settings"].as_array().expect("a list");
    assert!(
        settings.iter().any(|s| s["name"] == "settings.samples" && s["a"] == 4 && s["b"] == 8),
        "{settings:?}"
    );
    let values = found["values"].as_array().expect("a list");
    let named =
        |name: &str| values.iter().find(|value| value["name"] == name).unwrap_or_else(|| panic!("{name}"));
    let tested = named("samples_tested");
    assert!(tested["difference"].as_f64() > Some(0.0) && tested["ratio"].as_f64() > Some(1.5), "{tested}");
    assert_eq!(
        tested["b"],
        other.summary()["counts"]["samples_tested"].as_f64().map_or(Value::Null, Value::from)
    );
    let [first, second] = [text.find("settings that differ"), text.find("samples_tested")];
    assert!(first.is_some() && first < second, "{text}");
    assert!(text.contains("+") && !text.contains("not the same work"), "{text}");
    // A run compared with itself, by its folder and by its summary.
    let (text, found) = compared(&[&a, &one.path("summary.json").display().to_string()]);
    assert_eq!(found["settings"], json!([]));
    assert!(text.contains("settings: no difference") && text.contains("numbers are equal"), "{text}");
    let (all, _) = compared(&[&a, &a, "--all"]);
    assert!(all.contains("samples_tested") && all.lines().count() > text.lines().count() + 20, "{all}");
}

#[test]
fn runs_of_different_scenes_give_a_warning() {
    let one = quintile().run("tiny", &["--frames", "0..1"]);
    let other = quintile().run("tiny", &["--frames", "0..2", "--size", "32x24"]);
    let mut summary = other.summary();
    summary["scene"] = json!("another");
    let inputs = Inputs::new();
    let b = inputs.put("summary.json", summary.to_string());
    let (text, found) = compared(&[&one.folder().display().to_string(), &b]);
    assert_eq!(found["warnings"].as_array().map(Vec::len), Some(3), "{found}");
    for says in ["the scenes differ (tiny, another)", "different sizes", "1 and 2 frames"] {
        assert!(text.contains(says), "`{says}` is not in {text}");
    }
}

#[test]
fn tables_of_frames_are_compared() {
    let run = quintile().run("tiny", &[]);
    let table = run.path("frames.csv").display().to_string();
    let (_, found) = compared(&[&table, &table]);
    let energy = found["values"].as_array().into_iter().flatten().find(|value| value["name"] == "energy_J");
    let energy = energy.expect("the energy of a frame");
    assert_eq!((&energy["difference"], &energy["ratio"]), (&json!(0.0), &json!(1.0)));
}

#[test]
fn equal_images_are_equal_and_a_known_difference_is_measured() {
    let inputs = Inputs::new();
    let a = png(&inputs, "a.png", [40, 30], texture);
    let b = png(&inputs, "b.png", [40, 30], |x, y| {
        let [r, g, b] = texture(x, y);
        if x < 20 { [r, g, b ^ 0x80] } else { [r, g, b] }
    });
    let (text, found) = compared(&[&a, &a]);
    assert_eq!((&found["mse"], &found["psnr_db"], &found["ssim"]), (&json!(0.0), &Value::Null, &json!(1.0)));
    assert!(text.contains("infinite"), "{text}");
    let out = inputs.path("difference.png");
    let (text, found) = compared(&[&a, &b, "--out", &out]);
    // Half of the pixels differ by 128 of 255 in one of three channels.
    let expected = (128.0_f64 / 255.0).powi(2) / 6.0;
    let mse = found["mse"].as_f64().expect("a number");
    assert!((mse - expected).abs() < 1e-12, "{mse} {expected}");
    let psnr = found["psnr_db"].as_f64().expect("a number");
    assert!((psnr + 10.0 * expected.log10()).abs() < 1e-9, "{psnr}");
    assert_eq!(found["pixels_that_differ"], 600);
    assert!(found["ssim"].as_f64() < Some(0.999), "{found}");
    assert!(text.contains("difference.png"), "{text}");
    let difference = image::open(&out).expect("the difference").into_rgb8();
    assert_eq!((difference.get_pixel(0, 0).0, difference.get_pixel(30, 0).0), ([0, 0, 255], [0, 0, 0]));
}

#[test]
fn exr_images_are_compared_in_linear_light() {
    let one = quintile().run("tiny", &["--frames", "0..1", "--exr"]);
    let other = quintile().run("tiny", &["--frames", "0..1", "--exr", "--seed", "2"]);
    let [a, b] = [&one, &other].map(|run| run.path("images/frame_0000.exr").display().to_string());
    let inputs = Inputs::new();
    let out = inputs.path("difference.exr");
    let (_, found) = compared(&[&a, &b, "--out", &out]);
    assert_eq!(found["linear"], true);
    let read = |path: &str| image::open(path).expect("an EXR").into_rgb32f();
    let (before, after, difference) = (read(&a), read(&b), read(&out));
    let squares = before.iter().zip(after.iter()).map(|(a, b)| f64::from(b - a).powi(2));
    let mse = squares.sum::<f64>() / before.len() as f64;
    assert!((found["mse"].as_f64().unwrap_or(0.0) / mse - 1.0).abs() < 1e-6, "{found} {mse}");
    let sums = before.iter().zip(difference.iter()).map(|(a, d)| a + d);
    assert!(sums.zip(after.iter()).all(|(sum, b)| (sum - b).abs() < 1e-5));
}

#[test]
fn folders_of_images_are_compared_by_name() {
    let one = quintile().run("tiny", &["--frames", "0..3"]);
    let other = quintile().run("tiny", &["--frames", "1..4", "--seed", "2"]);
    let [a, b] = [&one, &other].map(|run| run.path("images").display().to_string());
    let (text, found) = compared(&[&a, &b]);
    assert_eq!(found["images"].as_array().map(Vec::len), Some(2));
    assert_eq!(
        (&found["only_in_a"], &found["only_in_b"]),
        (&json!(["frame_0000.png"]), &json!(["frame_0003.png"]))
    );
    assert!(text.contains("only in A: frame_0000.png") && text.contains("0 of 2 pairs are equal"), "{text}");
}

#[test]
fn results_of_different_kinds_are_refused() {
    let inputs = Inputs::new();
    let a = png(&inputs, "a.png", [40, 30], texture);
    let wide = png(&inputs, "wide.png", [41, 30], texture);
    let broken = inputs.put("broken.png", "\u{89}PNG");
    let number = inputs.put("number.json", "7");
    let text = inputs.put("text.txt", "hello");
    let gone = inputs.path("gone.png");
    let mut refusals = Refusals::default();
    for (args, code, says, remedy) in [
        (vec![&a, &wide], 2, vec!["a.png has 40x30 pixels", "wide.png 41x30"], "give images of one size"),
        (
            vec![&a, &broken],
            2,
            vec!["broken.png", "cannot be decoded"],
            "give a PNG or an EXR file that is whole",
        ),
        (vec![&a, &number], 2, vec!["is an image and", "a run"], "give two of a kind"),
        (
            vec![&number, &number],
            2,
            vec!["number.json", "not the summary of `quintile run`"],
            "give the folder of a run",
        ),
        (vec![&text, &text], 2, vec!["text.txt", "it is neither a run"], "give one of these"),
        (vec![&a, &gone], 2, vec!["gone.png: cannot read it"], "check the path"),
    ] {
        let args: Vec<&str> = args.into_iter().map(String::as_str).collect();
        refusals.check(&compare(&args), code, &says, remedy);
    }
    refusals.check(
        &compare(&[&a, &a, "--out", &a]),
        2,
        &["--out", "a.png is what is read"],
        "name another file",
    );
    let other = inputs.path("d.tif");
    refusals.check(
        &compare(&[&a, &a, "--out", &other]),
        2,
        &["d.tif"],
        "give a name that ends in .png or .exr",
    );
    refusals.done();
}
