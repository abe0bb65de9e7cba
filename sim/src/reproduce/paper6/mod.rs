//! Paper VI, "Design and Novel Uses of Higher-Dimensional Rasterization".

mod glossy;
mod shadows;
mod views;

use super::{Done, Effort};
use crate::output::progress::Progress;
use crate::run::RunError;

pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    let rows =
        [glossy::rows(effort, progress)?, shadows::rows(effort, progress)?, views::rows(effort, progress)?];
    Ok(rows.into_iter().flatten().collect())
}
