//! Paper VI, "Design and Novel Uses of Higher-Dimensional Rasterization".

mod shadows;
mod views;

use super::{Done, Effort};
use crate::output::progress::Progress;
use crate::run::RunError;

pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    Ok([shadows::rows(effort, progress)?, views::rows(effort, progress)?].into_iter().flatten().collect())
}
