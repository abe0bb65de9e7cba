//! `quintile info`.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use output::table::{Table, counted, digits, grouped};
use serde::Serialize;
use workloads::job::{JobRequest, OptionSource};
use workloads::scene::{CameraUsed, SceneInfo, SettingsInfo};
use workloads::visibility::{self, VisibilityScene};
use workloads::{Alpha, FixedSamples, catalog};

use super::{Failure, print, print_json};
use crate::cli::args::SceneArgs;

/// Arguments of `info`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile info Fox.glb\n  quintile info building.obj --camera inside --json\n\n\
    The flags change the view, as for `quintile run`. The camera is printed as RON: pass it to \
    --camera, changed or not. Unchanged, it gives the same bytes."
)]
pub struct InfoArgs {
    /// A built-in scene or a workload (see `quintile list`), a scene file as for `quintile run`, or an .m5d,
    /// .mts or .smp file
    #[arg(value_name = "SCENE|WORKLOAD|FILE")]
    pub scene: PathBuf,
    /// Changes to the scene
    #[command(flatten)]
    pub view: SceneArgs,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

pub(super) fn run(args: &InfoArgs) -> Result<(), Failure> {
    let overrides = args.view.overrides();
    let name = &*args.scene.to_string_lossy();
    if let Some(found) =
        catalog::find(name, &OptionSource::default(), &JobRequest { overrides: &overrides, seed: 1 })
    {
        let what = catalog::names().find(|(known, _)| *known == name).map_or("", |(_, what)| what);
        return print_workload(name, what, args.json, SettingsInfo::new(found?.settings()));
    }
    match ending(name).as_deref() {
        Some("m5d" | "mts") => {
            print_mesh(name, args.json, &visibility::load(&[&args.scene], args.view.camera.as_deref())?)
        }
        Some("smp") => print_samples(name, args.json, &FixedSamples::load(&args.scene)?),
        _ => {
            let scene = workloads::load(&args.scene).map_err(catalog::or_job)?.with_overrides(&overrides)?;
            let info = scene.info().map_err(run::RunError::from)?;
            if args.json { print_json(&info, true) } else { print(&scene_text(&info)) }
        }
    }
}

/// Extension of a file name in lower case, without `.gz`.
fn ending(name: &str) -> Option<String> {
    let name = name.to_ascii_lowercase();
    let bare = name.strip_suffix(".gz").unwrap_or(&name);
    bare.rsplit_once('.').map(|(_, ending)| ending.to_owned())
}

#[derive(Serialize)]
struct WorkloadInfo<'a> {
    workload: &'a str,
    what: &'a str,
    settings: SettingsInfo,
}

fn print_workload(workload: &str, what: &str, json: bool, settings: SettingsInfo) -> Result<(), Failure> {
    if json {
        return print_json(&WorkloadInfo { workload, what, settings }, true);
    }
    print(&format!("{workload}: {what}\n{}", settings_text(&settings)))
}

#[derive(Serialize)]
struct MeshFile<'a> {
    name: &'a str,
    triangles: usize,
    vertices: usize,
    objects: usize,
    /// Whether any vertex moves while the shutter is open.
    moves: bool,
    width: u32,
    height: u32,
    samples_per_pixel: u32,
    seed: u64,
    lens_radius: f32,
    focus: Option<f32>,
    near: f32,
    /// Fitted camera, if the file has none.
    camera: Option<String>,
    warnings: &'a [warnings::Warning],
}

fn print_mesh(name: &str, json: bool, scene: &VisibilityScene) -> Result<(), Failure> {
    let lens = scene.camera.lens();
    let info = MeshFile {
        name,
        triangles: scene.triangles.len(),
        vertices: scene.open.len(),
        objects: scene.objects.len(),
        moves: scene.open != scene.close,
        width: scene.viewport.width(),
        height: scene.viewport.height(),
        samples_per_pixel: scene.per_pixel,
        seed: scene.seed,
        lens_radius: lens.map_or(0.0, |lens| lens.radius()),
        focus: lens.map(|lens| lens.focus()),
        near: scene.camera.near(),
        camera: scene.fitted.as_ref().map(|camera| camera.to_ron_line()),
        warnings: &scene.warnings,
    };
    if json {
        return print_json(&info, true);
    }
    let mut lines = vec![
        format!("{}: a moving mesh for `quintile visibility`", info.name),
        format!(
            "  {} triangles, {} vertices, {}; {}",
            grouped(info.triangles as u64),
            grouped(info.vertices as u64),
            counted(info.objects, "object"),
            if info.moves { "moves" } else { "still" }
        ),
        format!(
            "  {}x{} pixels, {}, seed {}, lens radius {}, near depth {}",
            info.width,
            info.height,
            counted(info.samples_per_pixel as usize, "sample"),
            info.seed,
            info.lens_radius,
            info.near
        ),
    ];
    lines.push(match &info.camera {
        Some(camera) => format!("  camera, fitted: --camera '{camera}'"),
        None => "  camera: the file's own".to_owned(),
    });
    lines.extend(warnings_text(info.warnings));
    print(&lines.join("\n"))
}

#[derive(Serialize)]
struct SamplesFile<'a> {
    name: &'a str,
    width: u32,
    height: u32,
    samples_per_pixel: u32,
}

fn print_samples(name: &str, json: bool, samples: &FixedSamples) -> Result<(), Failure> {
    use pipeline::sampling::SampleSource;
    let [width, height] = samples.size();
    let info = SamplesFile { name, width, height, samples_per_pixel: samples.per_pixel() };
    if json {
        return print_json(&info, true);
    }
    print(&format!(
        "{}: a sample table of {width}x{height} pixels, {} in each",
        info.name,
        counted(info.samples_per_pixel as usize, "sample")
    ))
}

/// Point or size as text, each coordinate to four digits.
fn point(values: [f64; 3]) -> String {
    format!("({})", values.map(digits).join(", "))
}

fn settings_text(settings: &SettingsInfo) -> String {
    let [first, end] = settings.frames;
    format!(
        "  image     {}x{} pixels, {} in a pixel of table `{}`\n  time      frames {first}..{end} at {} Hz, shutter open for {} of a frame",
        settings.width,
        settings.height,
        counted(settings.samples as usize, "sample"),
        settings.table,
        settings.frame_rate_hz,
        settings.shutter
    )
}

fn scene_text(info: &SceneInfo) -> String {
    let skinned = info.meshes.iter().filter(|mesh| mesh.skinned).count();
    let targets: usize = info.meshes.iter().map(|mesh| mesh.morph_targets).sum();
    let moving = info.meshes.iter().filter(|mesh| mesh.moves).count();
    let mut text = format!(
        "{}\n  triangles {}, vertices {}, in {}",
        info.name,
        grouped(info.triangles as u64),
        grouped(info.vertices as u64),
        counted(info.meshes.len(), "mesh").replace("meshs", "meshes"),
    );
    let mut line = |name: &str, value: String| {
        let _ = write!(text, "\n  {name:<9} {value}");
    };
    line(
        "bounds",
        format!("{} to {}, extent {}", point(info.bounds[0]), point(info.bounds[1]), point(info.extent)),
    );
    let motion = [
        (moving, format!("{moving} of {} meshes move", info.meshes.len())),
        (skinned, format!("{skinned} skinned, skins of {:?} joints", info.skins)),
        (targets, counted(targets, "morph target")),
    ];
    let motion: Vec<String> =
        motion.into_iter().filter(|(count, _)| *count > 0).map(|(_, text)| text).collect();
    line(
        "motion",
        if motion.is_empty() { "none: all meshes are still".to_owned() } else { motion.join("; ") },
    );
    line("light", light_text(info));
    text += &format!("\n{}\n", settings_text(&info.settings));
    for table in [clips(info), cameras(info), meshes(info), materials(info)] {
        text += &table;
    }
    text += &camera_text(info);
    for line in warnings_text(&info.warnings) {
        text += &format!("{line}\n");
    }
    text
}

fn light_text(info: &SceneInfo) -> String {
    match info.light.toward {
        Some(toward) => format!("one lamp at infinity, toward {}", point(toward.map(f64::from))),
        None => "one lamp at infinity, over the camera's right shoulder".to_owned(),
    }
}

fn section(title: &str, table: &Table) -> String {
    let lines: Vec<String> = table.to_string().lines().map(|line| format!("  {line}\n")).collect();
    format!("{title}:\n{}", lines.concat())
}

fn clips(info: &SceneInfo) -> String {
    if info.clips.is_empty() {
        return String::new();
    }
    let mut table = Table::new(["clip", "number", "length", "tracks", "keys"]);
    for (index, clip) in info.clips.iter().enumerate() {
        let length = format!("{:.3} s", clip.duration_s);
        table.row([
            clip.name.clone(),
            index.to_string(),
            length,
            clip.tracks.to_string(),
            clip.keys.to_string(),
        ]);
    }
    section("animation (--clip)", &table)
}

fn cameras(info: &SceneInfo) -> String {
    if info.cameras.is_empty() {
        return String::new();
    }
    let mut table = Table::new(["camera", "number", "view", "moves"]);
    for (index, camera) in info.cameras.iter().enumerate() {
        let view = match (camera.fov_deg, camera.view_height) {
            (Some(fov), _) => format!("{} degrees", digits(fov)),
            (None, height) => format!("{} high", digits(height.unwrap_or(0.0))),
        };
        let moves = if camera.moves { "yes" } else { "no" };
        table.row([camera.name.clone(), index.to_string(), view, moves.to_owned()]);
    }
    section("cameras (--camera)", &table)
}

/// Largest number of rows of a table; `--json` has all.
const MAX_ROWS: usize = 20;

fn more(count: usize, section: String) -> String {
    if count > MAX_ROWS {
        format!("{section}  and {} more: --json names them\n", count - MAX_ROWS)
    } else {
        section
    }
}

fn meshes(info: &SceneInfo) -> String {
    let mut table = Table::new(["mesh", "triangles", "vertices", "material"]);
    for mesh in info.meshes.iter().take(MAX_ROWS) {
        let material = info.materials.get(mesh.material).map_or("-", |material| material.name.as_str());
        let [triangles, vertices] = [mesh.triangles, mesh.vertices].map(|count| grouped(count as u64));
        table.row([mesh.name.clone(), triangles, vertices, material.to_owned()]);
    }
    more(info.meshes.len(), section("meshes", &table))
}

fn materials(info: &SceneInfo) -> String {
    let mut table = Table::new(["material", "colour", "texture", "sides", "light", "opacity"]);
    for material in info.materials.iter().take(MAX_ROWS) {
        let texture = material.texture.and_then(|texture| info.textures.get(texture));
        table.row([
            material.name.clone(),
            material.color.map(|part| format!("{part:.2}")).join(" "),
            texture.map_or("-".to_owned(), |texture| format!("{}x{}", texture.width, texture.height)),
            if material.double_sided { "both" } else { "front" }.to_owned(),
            if material.unlit { "unlit" } else { "lit" }.to_owned(),
            match material.alpha {
                Alpha::Opaque => "opaque".to_owned(),
                Alpha::CutOut { cutoff } => format!("cut out at {}", digits(f64::from(cutoff))),
                Alpha::Blended => format!("{} blended", digits(f64::from(material.opacity))),
            },
        ]);
    }
    more(info.materials.len(), section("materials", &table))
}

fn camera_text(info: &SceneInfo) -> String {
    let CameraUsed { source, position, direction, focus, lens_radius, near, ron, .. } = &info.camera;
    let view = match (info.camera.fov_deg, info.camera.view_height) {
        (Some(fov), _) => format!("field of view {} degrees", digits(fov)),
        (None, height) => format!("orthographic, {} high", digits(height.unwrap_or(0.0))),
    };
    let lens = if *lens_radius > 0.0 {
        format!("lens radius {lens_radius}, sharp at depth {focus}")
    } else {
        format!("pinhole; a lens would be sharp at depth {focus}")
    };
    let mut text = format!(
        "camera in use: {source}\n  at {} toward {}, {view}, nothing nearer than {}\n  {lens}\n",
        point(*position),
        point(*direction),
        digits(*near)
    );
    if let Some(suggested) = info.suggested {
        text += &format!("  to begin with: --lens {} --focus {}\n", suggested.lens_radius, suggested.focus);
    }
    if !info.camera.exact {
        text += "  it moves: this is where it is when the first frame's shutter opens\n";
    }
    text + &format!("  --camera '{ron}'\n")
}

fn warnings_text(warnings: &[warnings::Warning]) -> Vec<String> {
    warnings.iter().map(|warning| format!("warning: {warning}")).collect()
}
