//! `quintile chart`.

use super::Failure;
use super::args::{ChartArgs, ChartName};
use super::terminal::{print, print_json};
use crate::chart::tile_tests::tile_tests;
use crate::output::OutDir;
use crate::output::progress::Progress;
use crate::run::RunError;

pub(super) fn run(args: &ChartArgs) -> Result<(), Failure> {
    let pool = super::threads(args.threads)?;
    let progress = Progress::new(args.json);
    match args.name {
        ChartName::TileTests => {
            let chart = pool.install(|| tile_tests(&args.scene, args.quick, &progress))?;
            if args.json {
                print_json(&chart, true)?
            } else {
                print(&chart.text())?
            }
            let dir = OutDir::create(&args.out).map_err(RunError::from)?;
            chart.write(dir).map_err(RunError::from)?;
            let lost = chart.samples_lost();
            let message = format!("{lost} samples were lost: a test is not conservative; please report it");
            if lost == 0 { Ok(()) } else { Err(Failure { message, code: 1 }) }
        }
    }
}
