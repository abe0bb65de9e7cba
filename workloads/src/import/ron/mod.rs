//! RON scene files: what is in them ([`spec`]), and the scene and its objects made from that.

mod spec;

use std::path::Path;
use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};
use pipeline::{Wrap, linear_to_srgb8};
use spec::{
    LightSpec, MaterialSpec, ObjectSpec, SceneSpec, SettingsSpec, ShapeSpec, TextureSpec, VisibleSpec,
};
use warnings::{Code, Warning};

use crate::error::{LoadError, Source};
use crate::import::{Format, bare, gltf, reader, soup};
use crate::material::{Alpha, Light, Material};
use crate::scene::{
    CameraSpec, Interpolation, Local, Mesh, MorphTarget, Node, Parts, Rig, SceneCamera, SceneSettings, Spin,
    Track, Trs, rotation,
};
use crate::shapes::checker;
use crate::{import, shapes};

/// Reads the scene at `path`.
pub(super) fn import(path: &Path) -> Result<Parts, LoadError> {
    // A folder and a file that is not text have different remedies.
    if path.is_dir() {
        return Err(Source { path }.unreadable(std::io::ErrorKind::IsADirectory.into()));
    }
    let spec: SceneSpec = activity::spec::load(path)?;
    build(spec, path)
}

/// Parses `text` as the scene at `path`.
pub(crate) fn parse(text: &str, path: &Path) -> Result<Parts, LoadError> {
    build(activity::spec::parse(text, &path.display().to_string())?, path)
}

/// A scene file being turned into a scene.
#[derive(Clone, Copy)]
struct Context<'a> {
    path: &'a Path,
}

impl Context<'_> {
    fn wrong(self, place: impl Into<String>, message: impl Into<String>) -> LoadError {
        let file = self.path.display().to_string();
        LoadError::Description { file, place: place.into(), message: message.into() }
    }

    /// A sample table: a name stays one, a file is relative to the scene.
    fn table(self, name: &str) -> String {
        if Path::new(name).extension().is_none() {
            name.to_owned()
        } else {
            self.beside(name).display().to_string()
        }
    }

    /// A file named in the scene, relative to it.
    fn beside(self, name: &str) -> std::path::PathBuf {
        self.path.parent().map_or_else(|| Path::new(name).to_path_buf(), |folder| folder.join(name))
    }

    /// An error of a file that the scene names as `name`: one that cannot be read is reported where it is named.
    fn named(self, name: &str, error: LoadError) -> LoadError {
        let LoadError::Read { file, source } = error else { return error };
        let text = activity::spec::read(self.path).unwrap_or_default();
        let quoted = format!("\"{name}\"");
        let at = text.lines().enumerate().find_map(|(line, text)| Some((line, text.find(&quoted)?)));
        let place = at.map_or(String::new(), |(line, column)| format!(":{}:{}", line + 1, column + 1));
        LoadError::Read { file: format!("{}{place}: {file}", self.path.display()), source }
    }
}

fn build(spec: SceneSpec, path: &Path) -> Result<Parts, LoadError> {
    let context = Context { path };
    let mut parts = Parts::new(spec.name.unwrap_or_else(|| path.display().to_string()));
    parts.settings = settings(context, &spec.settings);
    if let Some(camera) = &spec.camera {
        take_lens(context, camera, &spec.settings, &mut parts.settings)?;
    }
    // The settings are checked with the scene, but an object's default timing needs a rate that makes sense.
    parts.settings.check().map_err(|error| context.wrong("settings", error.to_string()))?;
    if let Some(background) = spec.background {
        parts.background = color(context, "background", background)?;
    }
    if let Some(light) = &spec.light {
        parts.light = lamp(context, light)?;
    }
    if spec.objects.is_empty() {
        return Err(context.wrong("objects", "there are none: add a `file` or a `shape`"));
    }
    for (index, object) in spec.objects.iter().enumerate() {
        add(context, &mut parts, index, object)?;
    }
    if let Some(camera) = &spec.camera {
        parts.camera = looking(context, camera, &parts.settings)?;
    }
    if matches!(parts.camera.rig, Rig::Fitted(_)) && parts.settings.focus.is_some() {
        let message = "`focus` is a depth from a camera that is placed by itself: give the scene a `camera` to be sure of it";
        parts.warnings.push(Warning::new(Code::FocusOfFittedCamera, message));
    }
    Ok(parts)
}

fn settings(context: Context, spec: &SettingsSpec) -> SceneSettings {
    let plain = SceneSettings::default();
    let (start, end) = spec.frames.unwrap_or((0, 12));
    SceneSettings {
        width: spec.width.unwrap_or(plain.width),
        height: spec.height.unwrap_or(plain.height),
        samples: spec.samples.unwrap_or(plain.samples),
        frame_rate_hz: spec.frame_rate_hz.unwrap_or(plain.frame_rate_hz),
        shutter: spec.shutter.unwrap_or(plain.shutter),
        frames: start..end,
        lens_radius: spec.lens_radius.unwrap_or(plain.lens_radius),
        focus: spec.focus,
        table: spec.table.as_ref().map_or(plain.table, |table| context.table(table)),
    }
}

/// A linear RGB value that is finite and not below zero.
fn color(context: Context, place: &str, value: [f32; 3]) -> Result<Vec3, LoadError> {
    let usable = value.iter().all(|part| part.is_finite() && *part >= 0.0);
    let message = "a colour is linear RGB: three finite numbers from zero upwards";
    if usable { Ok(Vec3::from_array(value)) } else { Err(context.wrong(place, message)) }
}

/// Three finite numbers.
fn vector(context: Context, place: &str, value: [f64; 3]) -> Result<DVec3, LoadError> {
    let value = DVec3::from_array(value);
    if value.is_finite() {
        Ok(value)
    } else {
        Err(context.wrong(place, "it has a value that is NaN or infinite: give three finite numbers"))
    }
}

fn lamp(context: Context, spec: &LightSpec) -> Result<Light, LoadError> {
    let plain = Light::default();
    let shade = |place: &str, value: Option<[f32; 3]>, otherwise: Vec3| {
        value.map_or(Ok(otherwise), |value| color(context, place, value))
    };
    let toward = match spec.toward {
        Some(toward) => {
            let toward = vector(context, "light.toward", toward)?;
            let length = toward.length();
            if !(length.is_finite() && length > 0.0) {
                return Err(
                    context.wrong("light.toward", "it has no length: point it from the scene to the lamp")
                );
            }
            Some((toward / length).as_vec3())
        }
        None => None,
    };
    Ok(Light {
        toward,
        color: shade("light.color", spec.color, plain.color)?,
        sky: shade("light.sky", spec.sky, plain.sky)?,
        ground: shade("light.ground", spec.ground, plain.ground)?,
    })
}

/// The lens may stand beside the camera or in the settings, not in both.
fn take_lens(
    context: Context,
    camera: &CameraSpec,
    given: &SettingsSpec,
    settings: &mut SceneSettings,
) -> Result<(), LoadError> {
    let image = [
        ("width", camera.width.is_some()),
        ("height", camera.height.is_some()),
        ("samples", camera.samples.is_some()),
    ];
    if let Some((field, _)) = image.into_iter().find(|(_, given)| *given) {
        return Err(context
            .wrong(format!("camera.{field}"), format!("it belongs in `settings`: put `{field}` there")));
    }
    let twice = [
        ("lens_radius", camera.lens_radius.is_some() && given.lens_radius.is_some()),
        ("focus", camera.focus.is_some() && given.focus.is_some()),
    ];
    if let Some((field, _)) = twice.into_iter().find(|(_, twice)| *twice) {
        return Err(context.wrong(format!("camera.{field}"), "`settings` has one, too: remove one of them"));
    }
    settings.lens_radius = camera.lens_radius.unwrap_or(settings.lens_radius);
    // A camera that says it is a pinhole may say where a lens would be sharp.
    let focus = camera.focus.filter(|_| camera.lens_radius != Some(0.0));
    settings.focus = focus.or(settings.focus);
    Ok(())
}

fn looking(context: Context, spec: &CameraSpec, settings: &SceneSettings) -> Result<SceneCamera, LoadError> {
    let place = |field: &str| if field == "camera" { field.to_owned() } else { format!("camera.{field}") };
    spec.check()
        .and_then(|()| spec.scene_camera(settings))
        .map_err(|(field, message)| context.wrong(place(field), message))
}

/// Errors in a file that a scene names point at that file.
fn broken(path: &Path, place: &str, message: String) -> LoadError {
    Source { path }.broken(place, message)
}

/// Adds `object`, number `index` of the file, to `parts`.
fn add(context: Context, parts: &mut Parts, index: usize, object: &ObjectSpec) -> Result<(), LoadError> {
    let place =
        object.name.as_ref().map_or_else(|| format!("objects[{index}]"), |name| format!("object `{name}`"));
    let node = node(context, &place, object)?;
    let node = parts.graph.push_node(node);
    let first = parts.graph.instances.len();
    add_meshes(context, parts, &place, (object, node))?;
    if let Some(clip) = object.visible.as_ref().and_then(VisibleSpec::clip) {
        parts.graph.instances[first..].iter_mut().for_each(|instance| instance.clip = clip);
    }
    Ok(())
}

fn add_meshes(
    context: Context,
    parts: &mut Parts,
    place: &str,
    (object, node): (&ObjectSpec, usize),
) -> Result<(), LoadError> {
    match (&object.file, &object.shape) {
        (Some(file), None) => {
            add_file(context, parts, place, object, (file, node)).map_err(|error| context.named(file, error))
        }
        (None, Some(shape)) => {
            if object.end.is_some() || object.clip.is_some() {
                return Err(context.wrong(place, "`end` and `clip` go with a `file`, not with a `shape`"));
            }
            let material = material(context, parts, place, object.material.as_ref())?;
            let mesh = solid(shape, material);
            parts.graph.attach(
                Mesh { name: object.name.clone().unwrap_or_else(|| mesh.name.clone()), ..mesh },
                node,
            );
            Ok(())
        }
        _ => Err(context.wrong(place, "give it either a `file` or a `shape`")),
    }
}

fn add_file(
    context: Context,
    parts: &mut Parts,
    place: &str,
    object: &ObjectSpec,
    (file, node): (&str, usize),
) -> Result<(), LoadError> {
    let path = context.beside(file);
    match Format::of(&path) {
        Some(Format::Gltf) if object.end.is_some() => {
            let message = format!("`end` goes with {SURFACES} files; glTF files bring their own animation");
            Err(context.wrong(place, message))
        }
        Some(Format::Gltf) => add_gltf(context, parts, place, object, (&path, node)),
        Some(_) if object.clip.is_some() => Err(context.wrong(place, "`clip` goes with glTF files")),
        Some(format) if format.is_surface() => {
            add_surface(context, parts, place, object, ((&path, format), node))
        }
        _ => {
            let known =
                import::foreign(&path).unwrap_or_else(|| format!("it is no .gltf, .glb or {SURFACES} file"));
            Err(context.wrong(place, format!("`{file}`: {known}")))
        }
    }
}

/// Formats that hold one surface, for messages.
const SURFACES: &str = ".obj, .ply, .off or .stl";

fn add_surface(
    context: Context,
    parts: &mut Parts,
    place: &str,
    object: &ObjectSpec,
    ((path, format), node): ((&Path, Format), usize),
) -> Result<(), LoadError> {
    let mut start = if object.material.is_some() { bare(path, format)? } else { soup(path, format)? };
    parts.warnings.append(&mut start.warnings);
    let looks = std::mem::take(&mut start.looks);
    let origin = start.origin();
    let mut whole = start.into_mesh(path, origin)?;
    // The file's own origin may be far from the surface, and is what the object's transform is about.
    let middle = Trs { translation: origin, ..Trs::default() };
    let hook = match origin == DVec3::ZERO {
        true => node,
        false => parts.graph.push_node(Node::new("middle", Some(node), Local::Trs(middle))),
    };
    if let Some(end) = &object.end {
        let arrival_s = object.end_s.unwrap_or(1.0 / parts.settings.frame_rate_hz);
        whole.targets =
            vec![to_end(&whole, &context.beside(end), origin).map_err(|error| context.named(end, error))?];
        let track = Track::new(vec![0.0, arrival_s], vec![0.0, 1.0], 1, Interpolation::Linear);
        parts.graph.nodes[hook].channels.weights = Some(track.map_err(|what| context.wrong(place, what))?);
    }
    let first = parts.graph.materials.len();
    let (meshes, materials) = match &object.material {
        None => looks.split(whole, first),
        Some(own) => {
            let material = make_material(context, &mut parts.warnings, place, own)?;
            (vec![Mesh { material: first, ..whole }], vec![material])
        }
    };
    parts.graph.materials.extend(materials);
    meshes.into_iter().for_each(|mesh| parts.graph.attach(mesh, hook));
    Ok(())
}

fn add_gltf(
    context: Context,
    parts: &mut Parts,
    place: &str,
    object: &ObjectSpec,
    (path, node): (&Path, usize),
) -> Result<(), LoadError> {
    let looks =
        if object.material.is_some() { gltf::MaterialSource::Replaced } else { gltf::MaterialSource::Own };
    let asset = gltf::import(path, object.clip.as_deref(), looks);
    let mut asset = asset.map_err(|error| match error {
        LoadError::Setting { message, .. } => context.wrong(format!("{place}.clip"), message),
        error => error,
    })?;
    if let Some(own) = &object.material {
        let material = make_material(context, &mut parts.warnings, place, own)?;
        asset.graph.materials = vec![material];
        for mesh in &mut asset.graph.meshes {
            (mesh.material, mesh.colors) = (0, [].into());
        }
    }
    parts.warnings.append(&mut asset.warnings);
    parts.graph.adopt(asset.graph, node);
    Ok(())
}

/// What takes `mesh`, positions relative to `origin`, to the vertices in the file at `end`, as a morph target.
fn to_end(mesh: &Mesh, end: &Path, origin: DVec3) -> Result<MorphTarget, LoadError> {
    let format = Format::of(end).filter(|format| format.is_surface());
    let format = format.ok_or_else(|| broken(end, "end", format!("it has to be a {SURFACES} file")))?;
    let other = bare(end, format)?.into_mesh(end, origin)?;
    let same = other.positions.len() == mesh.positions.len() && other.triangles == mesh.triangles;
    if !same {
        let message = format!(
            "its {} vertices and {} triangles are not those of {} ({} and {}): both ends need equal topology",
            other.positions.len(),
            other.triangles.len(),
            mesh.name,
            mesh.positions.len(),
            mesh.triangles.len()
        );
        return Err(broken(end, "end", message));
    }
    let positions = mesh.positions.iter().zip(&other.positions).map(|(from, to)| *to - *from).collect();
    Ok(MorphTarget { positions, normals: Vec::new() })
}

fn solid(shape: &ShapeSpec, material: usize) -> Mesh {
    match *shape {
        ShapeSpec::Sphere { radius, segments } => shapes::sphere(radius, segments, material),
        ShapeSpec::Box { size } => shapes::cuboid(DVec3::from_array(size).as_vec3(), material),
        ShapeSpec::Plane { size, cells, tiles } => shapes::plane(size, cells, tiles, material),
        ShapeSpec::Torus { ring, tube, segments } => shapes::torus(ring, tube, segments, material),
        ShapeSpec::Gear { teeth, radius, thickness } => shapes::gear(teeth, radius, thickness, material),
        ShapeSpec::Propeller { blades, radius } => shapes::propeller(blades, radius, material),
    }
}

fn material(
    context: Context,
    parts: &mut Parts,
    place: &str,
    spec: Option<&MaterialSpec>,
) -> Result<usize, LoadError> {
    let made = match spec {
        Some(spec) => make_material(context, &mut parts.warnings, place, spec)?,
        None => reader::grey(),
    };
    Ok(parts.graph.push_material(made))
}

fn make_material(
    context: Context,
    warnings: &mut Vec<Warning>,
    place: &str,
    spec: &MaterialSpec,
) -> Result<Material, LoadError> {
    let plain = reader::grey();
    let otherwise = if spec.texture.is_some() { Vec3::ONE } else { plain.base_color };
    let shade = |value| color(context, &format!("{place}.material.color"), value);
    let base_color = spec.color.map_or(Ok(otherwise), shade)?;
    let texture = match &spec.texture {
        Some(TextureSpec::Checker { colors, texels }) => {
            checker(*texels, colors.map(|color| color.map(linear_to_srgb8))).map(Arc::new)
        }
        Some(TextureSpec::Image { file }) => {
            match reader::load_texture(&context.beside(file), [Wrap::Repeat; 2]) {
                Ok(texture) => Some(Arc::new(texture)),
                Err(why) => {
                    warnings.push(import::texture(place, &format!("`{file}`: {why}")));
                    None
                }
            }
        }
        None => None,
    };
    let (name, opacity) = (place.to_owned(), spec.opacity.unwrap_or(1.0));
    let alpha = spec.alpha.unwrap_or(if opacity < 1.0 { Alpha::Blended } else { Alpha::Opaque });
    let (double_sided, unlit) = (spec.double_sided, spec.unlit);
    Ok(Material { name, base_color, opacity, alpha, texture, double_sided, unlit }.simplified())
}

fn node(context: Context, place: &str, object: &ObjectSpec) -> Result<Node, LoadError> {
    let part = |name: &str| format!("{place}.{name}");
    let rest = Trs {
        translation: vector(context, &part("position"), object.position)?,
        rotation: turned(object.rotation_deg),
        scale: vector(context, &part("scale"), object.scale.unwrap_or([1.0; 3]))?,
    };
    vector(context, &part("rotation_deg"), object.rotation_deg)?;
    let mut node = Node::new(place, None, Local::Trs(rest));
    node.motion.velocity = vector(context, &part("velocity"), object.velocity)?;
    if let Some(spin) = &object.spin {
        let made = Spin::new(DVec3::from_array(spin.axis), spin.rate_hz);
        let message = "the axis needs a length, and the rate has to be finite";
        node.motion.spin = Some(made.ok_or_else(|| context.wrong(part("spin"), message))?);
    }
    keyframes(object, &rest, &mut node).map_err(|what| context.wrong(part("keyframes"), what))?;
    Ok(node)
}

/// About x, then y, then z, in degrees.
fn turned(degrees: [f64; 3]) -> DQuat {
    let [x, y, z] = degrees.map(|angle| angle / 360.0);
    rotation(DVec3::Z, z) * rotation(DVec3::Y, y) * rotation(DVec3::X, x)
}

fn keyframes(object: &ObjectSpec, rest: &Trs, node: &mut Node) -> Result<(), String> {
    let keys = &object.keyframes;
    let Some(last) = keys.last() else { return Ok(()) };
    let track = |width: usize, numbers: Vec<f64>| {
        let times = keys.iter().map(|key| key.time_s).collect();
        let track = Track::new(times, numbers, width, object.interpolation.into())?;
        Ok::<_, String>(if object.repeat { track.looping(last.time_s) } else { track })
    };
    if keys.iter().any(|key| key.position.is_some()) {
        let of = |key: &spec::ObjectKey| key.position.unwrap_or(rest.translation.to_array());
        node.channels.translation = Some(track(3, keys.iter().flat_map(of).collect())?);
    }
    if keys.iter().any(|key| key.rotation_deg.is_some()) {
        let of = |key: &spec::ObjectKey| key.rotation_deg.map_or(rest.rotation, turned).to_array();
        node.channels.rotation = Some(track(4, keys.iter().flat_map(of).collect())?);
    }
    if keys.iter().any(|key| key.scale.is_some()) {
        let of = |key: &spec::ObjectKey| key.scale.unwrap_or(rest.scale.to_array());
        node.channels.scale = Some(track(3, keys.iter().flat_map(of).collect())?);
    }
    Ok(())
}
