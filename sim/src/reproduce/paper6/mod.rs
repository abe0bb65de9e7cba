//! Paper VI, "Design and Novel Uses of Higher-Dimensional Rasterization".

mod sampling;

use super::{Done, Effort};
use crate::output::progress::Progress;
use crate::run::RunError;

pub(super) fn rows(effort: Effort, progress: &Progress) -> Result<Vec<Done>, RunError> {
    sampling::rows(effort, progress)
}
