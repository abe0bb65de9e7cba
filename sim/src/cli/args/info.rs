//! Arguments of `info`.

use std::path::PathBuf;

use clap::Args;

use super::SceneArgs;

/// Arguments of `info`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile info Fox.glb\n  quintile info building.obj --camera inside --json\n\n\
    The flags change the view, as for `quintile run`. The camera is printed as RON: pass it to\n\
    --camera, changed or not. Unchanged, it gives the same bytes."
)]
pub struct InfoArgs {
    /// A built-in scene or a workload (see `quintile list`), a scene file as for `quintile run`, or an .m5d, .mts or .smp file
    #[arg(value_name = "SCENE|WORKLOAD|FILE")]
    pub scene: PathBuf,
    /// Changes to the scene
    #[command(flatten)]
    pub view: SceneArgs,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}
