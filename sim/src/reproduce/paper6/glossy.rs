//! VI-11: glossy reflection and refraction.

use crate::chart::ChartError;
use crate::chart::glossy::{Bench, Blur, EFFECTS, Effort as Size, ROUGHNESS, Row as Measured};
use crate::output::progress::Progress;
use crate::reproduce::figure::line;
use crate::reproduce::row::{Kind, Row, Verdict, numbers};
use crate::reproduce::{Done, Effort, Figure};
use crate::run::RunError;

/// Samples of a texel (Figure 14).
const SAMPLES: [u32; 2] = [16, 64];
/// A blur may be off by this part of its width and this many scene units, most of a texel.
const OFF: [f64; 2] = [0.05, 0.03];

pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    let size =
        if effort == Effort::QUICK { Size { reference_tables: 16, ..Size::QUICK } } else { Size::FULL };
    let bar = progress.bar("glossy", 3);
    let effect = |effect| -> Result<Vec<Measured>, ChartError> {
        let bench = Bench::new(effect, size)?;
        let reference = bench.reference(ROUGHNESS)?;
        bar.inc();
        SAMPLES.iter().map(|&samples| bench.row(samples, &reference)).collect()
    };
    let [reflected, refracted] =
        [effect(EFFECTS[0]).map_err(RunError::setting)?, effect(EFFECTS[1]).map_err(RunError::setting)?];
    let blurs = Bench::new(EFFECTS[0], size).and_then(|bench| bench.blurs()).map_err(RunError::setting)?;
    Ok(vec![done(&reflected, &refracted, &blurs)])
}

fn done(reflected: &[Measured], refracted: &[Measured], blurs: &[Blur]) -> Done {
    let falls = |rows: &[Measured]| rows[1].rmse < rows[0].rmse;
    let hardens = blurs.windows(2).all(|pair| pair[0].width < pair[1].width);
    let close = |blur: &Blur| (blur.width - blur.expected).abs() <= OFF[0] * blur.expected + OFF[1];
    let row = Row {
        id: "VI-11",
        kind: Kind::Order,
        claim: "glossy reflection and refraction, contact hardens",
        paper: "16 and 64 samples a texel (Figure 14)",
        ours: format!(
            "RMSE against 4096 rays {:.4} and {:.4} (reflection), {:.4} and {:.4} (refraction); blur {:.3} at height {} to {:.3} at {}",
            reflected[0].rmse,
            reflected[1].rmse,
            refracted[0].rmse,
            refracted[1].rmse,
            blurs[0].width,
            blurs[0].height,
            blurs[blurs.len() - 1].width,
            blurs[blurs.len() - 1].height
        ),
        verdict: Verdict::of(falls(reflected) && falls(refracted) && hardens && blurs.iter().all(close)),
        note: "holds if both errors fall, and the blur widens with height as 2 R h / (d + h) does".to_owned(),
        numbers: numbers([
            ("reflection_rmse_16", reflected[0].rmse),
            ("reflection_rmse_64", reflected[1].rmse),
            ("refraction_rmse_16", refracted[0].rmse),
            ("refraction_rmse_64", refracted[1].rmse),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    let points = |of: fn(&Blur) -> f64| blurs.iter().map(|blur| (blur.height, of(blur))).collect();
    let figure = Figure::lines(
        "VI_fig14_contact",
        "Blur of an edge over its height above the receiver (Paper VI, section 6)",
        "square lens, 64 samples a texel",
        [("height in scene units", ""), ("width on the plane in scene units", "")],
        vec![
            line("found in the map", points(|blur| blur.width)),
            line("geometry", points(|blur| blur.expected)),
        ],
    );
    Done { row, figures: vec![figure] }
}
