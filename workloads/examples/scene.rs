//! Loads a scene by name or path, and prints the size and motion of its frames:
//! `cargo run -p workloads --example scene -- tiny`.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).unwrap_or_else(|| "tiny".to_owned());
    let scene = workloads::load(&name)?;
    for index in scene.settings().frames.clone() {
        let frame = scene.frame(index)?;
        println!("frame {index}: {} triangles, moving: {}", frame.triangle_count(), frame.is_moving());
    }
    Ok(())
}
