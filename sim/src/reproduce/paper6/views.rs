//! VI-13 and VI-14: shader runs of stereo and of seven views.

use workloads::multiview::Layout;

use crate::chart::ChartError;
use crate::chart::views::{Bench, Cached, POLICIES, line, stereo};
use crate::output::plot::Curve;
use crate::output::progress::Progress;
use crate::reproduce::figure::over_doublings;
use crate::reproduce::row::{Kind, Row, Verdict, numbers};
use crate::reproduce::{Done, Effort};
use crate::run::RunError;

/// Entries of the cache (thesis, Paper VI, section 8).
const ENTRIES: u32 = 1024;
/// Others, for the figures.
const SIZES: [u32; 5] = [64, 256, ENTRIES, 4096, 16_384];
const FEW_SIZES: [u32; 3] = [64, ENTRIES, 16_384];

pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    // The scene's own size, or half of it: with fewer pixels triangles are nearly as small as these, and their borders shade more.
    let quick = effort == Effort::QUICK;
    let (size, sizes) = if quick { ([640, 360], &FEW_SIZES[..]) } else { ([1280, 720], &SIZES[..]) };
    let bar = progress.bar("views", 2 * sizes.len() as u64);
    let sweep = |layout: Layout| -> Result<Vec<Cached>, ChartError> {
        let bench = Bench::new(("default", 18), size)?;
        let cached = |&entries: &u32| {
            bar.inc();
            bench.cached(layout, POLICIES[0], entries)
        };
        sizes.iter().map(cached).collect()
    };
    let (two, seven) =
        (sweep(stereo()).map_err(RunError::setting)?, sweep(line(7)).map_err(RunError::setting)?);
    Ok(vec![
        done(
            "VI-13",
            "stereo with 8 samples a view",
            "+10 % shader invocations over one view",
            (10.0, 5.0),
            &two,
        ),
        done("VI-14", "seven views, overlapping box filters", "+15 % in total", (15.0, 7.0), &seven),
    ])
}

fn done(
    id: &'static str,
    claim: &'static str,
    paper: &'static str,
    (expected, off): (f64, f64),
    sweep: &[Cached],
) -> Done {
    let at = |entries: u32| sweep.iter().find(|cached| cached.entries == entries);
    let percent = |entries| at(entries).map_or(f64::NAN, |cached| 100.0 * cached.increase);
    let ours = percent(ENTRIES);
    let row = Row {
        id,
        kind: Kind::Number,
        claim,
        paper,
        ours: format!(
            "{ours:+.1} % with {ENTRIES} entries, {:+.1} % with 64, {:+.1} % with 16384",
            percent(64),
            percent(16_384)
        ),
        verdict: Verdict::of((ours - expected).abs() <= off),
        note: format!(
            "holds within {off} points. The scene is ours (their Figure 17 is not to be had), with eyes 65 mm apart; lanes of helpers are \
             counted on both sides. Deviation 72 tells what farther eyes and fewer pixels do"
        ),
        numbers: numbers([
            ("increase_percent", ours),
            ("increase_at_64_entries_percent", percent(64)),
            ("increase_at_16384_entries_percent", percent(16_384)),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    let name = if id == "VI-13" { "VI_fig17_stereo" } else { "VI_fig17_seven" };
    let over = |of: fn(&Cached) -> f64| {
        sweep.iter().map(|cached| (f64::from(cached.entries), of(cached))).collect::<Vec<_>>()
    };
    let figure = over_doublings(
        name,
        ["Pixel shader lanes for each pixel over the shading cache (Paper VI, section 8)", claim],
        ["entries of the shading cache", "lanes a pixel"],
        vec![
            Curve::new("all views in one pass", over(|cached| cached.invocations_per_pixel)),
            Curve::new("one view alone", over(|cached| cached.one_view_per_pixel)),
        ],
    );
    Done { row, figures: vec![figure] }
}
