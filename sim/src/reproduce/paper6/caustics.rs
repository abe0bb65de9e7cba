//! Rows VI-6 and VI-7: caustic volumes as moving triangles.

use glam::DVec3;
use workloads::caustics::generator::Ocean;
use workloads::caustics::{Eye, Floor, Found, Method, receivers};

use super::super::row::{Kind, Row, Verdict, numbers};
use super::super::{Done, Effort, Figure};
use super::caustics_figures::{light, warped};
use crate::chart::caustics::{Effort as Size, ocean};
use crate::output::progress::Progress;
use crate::run::RunError;

/// Both rows.
pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    let quick = effort == Effort::QUICK;
    Ok(vec![executions(quick, progress)?, no_light_is_lost(quick)?])
}

/// VI-6: shader executions by method on an ocean of 130,050 volumes.
fn executions(quick: bool, progress: &Progress) -> Result<Done, RunError> {
    let size = if quick { Size::QUICK } else { Size::FULL };
    let ocean = ocean(size.ocean_cells, size.ocean_px, progress).map_err(RunError::setting)?;
    let [moving, refined, hull, prism] = ocean.executions;
    let part = |total: u64| total as f64 / prism as f64;
    let row = Row {
        id: "VI-6",
        kind: Kind::Order,
        claim: "moving triangles run fewer shaders than bodies",
        paper: "fewer than the prism of Ernst et al. and the refined bound of Liktor and Dachsbacher (Fig. 7, 8; 130,000 volumes)",
        ours: format!(
            "{} volumes: {moving} executions, refined bound {refined}, hull {hull}, prism {prism} ({:.2}, {:.2} and {:.2} of the prism's)",
            ocean.volumes,
            part(moving),
            part(refined),
            part(hull)
        ),
        verdict: Verdict::of(moving < refined && moving < prism),
        note: "holds where the moving triangles run fewest in total. The bodies are our reading of papers that we could not get in full, the refined \
               one cut where beams fold; the plain hull is almost as good as it"
            .to_owned(),
        numbers: numbers([
            ("volumes", ocean.volumes as f64),
            ("moving", moving as f64),
            ("refined", refined as f64),
            ("hull", hull as f64),
            ("prism", prism as f64),
            ("most_of_a_pixel_moving", f64::from(ocean.most[0])),
            ("most_of_a_pixel_prism", f64::from(ocean.most[3])),
        ]),
        figure: None,
        figures: Vec::new(),
    };
    let maps = [
        ("VI_fig8_moving", Method::Moving),
        ("VI_fig8_refined", Method::Refined),
        ("VI_fig8_prism", Method::Prism),
    ];
    let mut figures = vec![warped()?];
    figures.extend(maps.map(|(name, method)| Figure { name, picture: ocean.map(method) }));
    figures.extend(light(quick)?);
    Ok(Done { row, figures })
}

/// VI-7: every point of the floor that a beam holds is covered by it.
fn no_light_is_lost(quick: bool) -> Result<Done, RunError> {
    let (cells, size) = if quick { (10, [64, 40]) } else { (24, [160, 96]) };
    let depth = 5.0;
    let middle = DVec3::new(0.6, -2.5, 0.3);
    let from = middle + 80.0 * DVec3::new(0.3, 0.35, 1.0).normalize();
    let eye = Eye::new([from, middle, DVec3::Y], 6.5, size);
    let eye = eye.ok_or_else(|| RunError::Setting("a view without extent".to_owned()))?;
    let floor = Floor { height_m: -depth };
    let mut all = Found::default();
    for slope in [0.15, 0.4, 0.8] {
        let water = Ocean { overshoot: 0.02, ..Ocean::new(cells, 16.0, depth, [4.0, slope], 1) };
        let found = receivers(&water.beams(0.0), &eye, Method::Moving, &floor);
        all = Found {
            lit: all.lit + found.lit,
            missed: all.missed + found.missed,
            hits: all.hits + found.hits,
        };
    }
    let row = Row {
        id: "VI-7",
        kind: Kind::Equality,
        claim: "caustic light is not lost",
        paper: "every receiver point inside the true warped volume is covered",
        ours: format!("{} missed of {} pairs of a pixel and a beam ({} hits)", all.missed, all.lit, all.hits),
        verdict: Verdict::of(all.missed == 0 && all.lit > 0),
        note: "against the cubic of the inside test for every beam at every point of the floor that a pixel sees, on waves from flat to broken"
            .to_owned(),
        numbers: numbers([("missed", all.missed as f64), ("pairs", all.lit as f64), ("hits", all.hits as f64)]),
        figure: None,
        figures: Vec::new(),
    };
    Ok(Done { row, figures: Vec::new() })
}
