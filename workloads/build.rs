//! Whether there are real scenes, and public collision data beside them: tests on them count as ignored where
//! there are none.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=QUINTILE_SCENES");
    println!("cargo:rustc-check-cfg=cfg(real_scenes, collision_data)");
    if let Some(scenes) = std::env::var_os("QUINTILE_SCENES") {
        println!("cargo:rustc-cfg=real_scenes");
        if std::path::Path::new(&scenes).join("../ccd").is_dir() {
            println!("cargo:rustc-cfg=collision_data");
        }
    }
}
