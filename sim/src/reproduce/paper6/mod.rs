//! Paper VI, "Design and Novel Uses of Higher-Dimensional Rasterization".

mod caustics;
mod occlusion;

use super::{Done, Effort};
use crate::output::progress::Progress;
use crate::run::RunError;

pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    let mut rows = occlusion::rows(effort, progress)?;
    rows.extend(caustics::rows(effort, progress)?);
    Ok(rows)
}
