//! `quintile compare`.

use std::path::{Path, PathBuf};

use clap::Args;
use output::table::{Table, count_or_digits, digits, grouped, si};
use run::compare::{
    Comparison, FolderComparison, ImageComparison, RunComparison, ValueChange, compare, shown,
};

use super::{Failure, may_hold_results, print, print_json};

/// Arguments of `compare`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile compare out/before out/after\n  quintile compare before.png after.png --out difference.png\n  \
    quintile compare before/images after/images --json\n\n\
    Differences are B minus A, ratios B over A. The exit code is 0 with or without differences; 2 if \
    the two cannot be compared: images of different sizes, a run with an image, or a file that is missing or broken."
)]
pub struct CompareArgs {
    /// The folder or summary.json of a run, a frames.csv, a .png or .exr image, or a folder of images
    #[arg(value_name = "A")]
    pub a: PathBuf,
    /// The result to compare with, of the same kind
    #[arg(value_name = "B")]
    pub b: PathBuf,
    /// File for the difference of two images: .png, scaled to be seen, or .exr, B minus A in linear light
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Print every value, including equal ones
    #[arg(long)]
    pub all: bool,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

pub(super) fn run(args: &CompareArgs) -> Result<(), Failure> {
    let inputs = [&args.a, &args.b].map(PathBuf::as_path);
    may_hold_results("--out", args.out.as_deref(), inputs)?;
    let compared = compare(&args.a, &args.b, args.out.as_deref())?;
    if args.json {
        return print_json(&compared, true);
    }
    print(&match &compared {
        Comparison::Runs(runs) => runs_text(runs, args.all),
        Comparison::Frames(frames) => {
            format!("{}{}", files_text(&frames.files), changes_text(&frames.values, args.all))
        }
        Comparison::Images(image) => {
            format!("{}{}", files_text(&image.files), image_text(image, args.out.as_deref()))
        }
        Comparison::Folders(folders) => format!("{}{}", files_text(&folders.files), folders_text(folders)),
    })
}

fn files_text([a, b]: &[String; 2]) -> String {
    format!("A: {a}\nB: {b}\n")
}

fn runs_text(runs: &RunComparison, all: bool) -> String {
    let mut text = files_text(&runs.files);
    for warning in &runs.warnings {
        text += &format!("not the same work: {warning}\n");
    }
    for quantity in &runs.undecided {
        text += &format!("undecided: {quantity}\n");
    }
    if runs.settings.is_empty() {
        text += "settings: no difference\n";
    } else {
        let mut table = Table::new(["settings that differ", "A", "B"]);
        for setting in &runs.settings {
            table.row([setting.name.clone(), shown(&setting.a), shown(&setting.b)]);
        }
        text += &table.to_string();
    }
    text + &changes_text(&runs.values, all)
}

/// Table of the numbers that differ, or of all.
fn changes_text(changes: &[ValueChange], all: bool) -> String {
    let differ = changes.iter().filter(|change| all || !change.is_equal());
    let mut table = Table::new(["", "A", "B", "B - A", "B / A"]);
    let mut group = "";
    for change in differ {
        if change.group != group {
            group = &change.group;
            table.row([group]);
        }
        let value = |value: Option<f64>| value.map_or("-".to_owned(), |value| quantity(value, &change.unit));
        let difference = change.difference.map_or("-".to_owned(), |value| signed(value, &change.unit));
        let ratio = change.ratio.map_or("-".to_owned(), |ratio| format!("{ratio:.4}"));
        table.row([format!("  {}", change.name), value(change.a), value(change.b), difference, ratio]);
    }
    let equal = changes.iter().filter(|change| change.is_equal()).count();
    let rows = if equal == changes.len() && !all { String::new() } else { table.to_string() };
    let note = if all { "" } else { " (--all shows them)" };
    format!("{rows}{equal} of {} numbers are equal{note}\n", changes.len())
}

/// Units that take a prefix.
const SI: [&str; 4] = ["s", "J", "W", "Hz"];

fn quantity(value: f64, unit: &str) -> String {
    if SI.contains(&unit) {
        return si(value, unit);
    }
    format!("{} {unit}", count_or_digits(value)).trim_end().to_owned()
}

fn signed(value: f64, unit: &str) -> String {
    let text = quantity(value, unit);
    if value > 0.0 { format!("+{text}") } else { text }
}

fn decibels(image: &ImageComparison) -> String {
    image.psnr_db.map_or("infinite".to_owned(), |psnr| format!("{psnr:.2} dB"))
}

fn image_text(image: &ImageComparison, out: Option<&Path>) -> String {
    let pixels = u64::from(image.width) * u64::from(image.height);
    let space = if image.linear { "linear light" } else { "sRGB values from 0 to 1" };
    let mut table = Table::new([format!("{}x{} pixels, in {space}", image.width, image.height).as_str(), ""]);
    let share = 100.0 * image.pixels_that_differ as f64 / pixels as f64;
    table
        .row(["mean squared error".to_owned(), format!("{:.4e}", image.mse)])
        .row(["PSNR, peak 1".to_owned(), decibels(image)])
        .row(["SSIM of luma".to_owned(), image.ssim.map_or("-".to_owned(), |ssim| format!("{ssim:.5}"))])
        .row(["mean difference".to_owned(), digits(image.mean_difference)])
        .row(["largest difference".to_owned(), digits(image.largest_difference)])
        .row([
            "pixels that differ".to_owned(),
            format!("{} ({share:.2} %)", grouped(image.pixels_that_differ)),
        ]);
    if image.pixels_not_finite > 0 {
        table.row(["pixels left out, not finite".to_owned(), grouped(image.pixels_not_finite)]);
    }
    let written = out.map_or(String::new(), |out| {
        let scale = image.scale.map_or(String::new(), |scale| format!(", {} times brighter", digits(scale)));
        format!("difference: {}{scale}\n", out.display())
    });
    format!("{table}{written}")
}

fn folders_text(folders: &FolderComparison) -> String {
    let mut table = Table::new(["image", "mean squared error", "PSNR", "SSIM", "pixels that differ"]);
    for image in &folders.images {
        let compared = &image.comparison;
        table.row([
            image.name.clone(),
            format!("{:.4e}", compared.mse),
            decibels(compared),
            compared.ssim.map_or("-".to_owned(), |ssim| format!("{ssim:.5}")),
            grouped(compared.pixels_that_differ),
        ]);
    }
    let mut text = table.to_string();
    text += &format!("{} of {} pairs are equal\n", folders.equal, folders.images.len());
    for (which, names) in [("A", &folders.only_in_a), ("B", &folders.only_in_b)] {
        if !names.is_empty() {
            text += &format!("only in {which}: {}\n", names.join(", "));
        }
    }
    text
}
