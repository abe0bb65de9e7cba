//! `quintile chart`.

use super::Failure;
use super::args::ChartArgs;

pub(super) fn run(_args: &ChartArgs) -> Result<(), Failure> {
    Ok(())
}
