//! Paper VI, "Design and Novel Uses of Higher-Dimensional Rasterization": a module for each use.

mod caustics;
mod caustics_figures;
mod collision;
mod glossy;
mod occlusion;
mod pipeline;
mod sampling;
mod shadows;
mod views;

use super::{Done, Effort};
use crate::output::progress::Progress;
use crate::run::RunError;

pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    let uses = [
        occlusion::rows,
        collision::rows,
        caustics::rows,
        glossy::rows,
        sampling::rows,
        shadows::rows,
        views::rows,
        pipeline::rows,
    ];
    let mut rows = Vec::new();
    for rows_of in uses {
        rows.extend(rows_of(effort, progress)?);
    }
    rows.sort_by_key(|done| done.row.id.rsplit('-').next().and_then(|n| n.parse::<u32>().ok()));
    Ok(rows)
}
