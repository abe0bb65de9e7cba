//! Files of formats that are not read, and what to do about them.

use std::path::Path;

/// Endings of formats that others use for scenes and shapes, and their names.
const FORMATS: &[(&[&str], &str)] = &[
    (&["3dm"], "a Rhino"),
    (&["3ds"], "a 3DS"),
    (&["3mf"], "a 3MF"),
    (&["abc"], "an Alembic"),
    (&["blend"], "a Blender"),
    (&["c4d"], "a Cinema 4D"),
    (&["dae"], "a COLLADA"),
    (&["dwg", "dxf"], "an AutoCAD"),
    (&["fbx"], "an FBX"),
    (&["ifc"], "an IFC"),
    (&["igs", "iges"], "an IGES"),
    (&["lwo", "lws"], "a LightWave"),
    (&["ma", "mb"], "a Maya"),
    (&["max"], "a 3ds Max"),
    (&["pbrt"], "a PBRT"),
    (&["skp"], "a SketchUp"),
    (&["step", "stp"], "a STEP"),
    (&["usd", "usda", "usdc", "usdz"], "a USD"),
    (&["vtk", "vtp", "vtu"], "a VTK"),
    (&["wrl", "vrml"], "a VRML"),
    (&["x3d", "x3dv"], "an X3D"),
];

/// What to say of the file at `path`, if its ending is that of a format that is known and not read.
pub(crate) fn foreign(path: &Path) -> Option<String> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    let (_, name) = FORMATS.iter().find(|(endings, _)| endings.contains(&ending.as_str()))?;
    let convert = "convert it to glTF, for example with Blender: File > Export > glTF 2.0";
    Some(format!("it is {name} file, which is not read; {convert}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_named_with_the_way_out() {
        let text = foreign(Path::new("dir/Car.FBX")).unwrap();
        assert!(text.contains("an FBX file, which is not read") && text.contains("glTF 2.0"), "{text}");
        for known in ["a.obj", "a.gltf", "fbx", "a.txt", ""] {
            assert_eq!(foreign(Path::new(known)), None, "{known}");
        }
    }
}
