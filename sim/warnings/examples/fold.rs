//! Warnings about the same kind of thing become one: `cargo run -p warnings --example fold`.

use warnings::{Code, Warning};

fn main() {
    let light = |node: usize| {
        let what = "ignored: only one directional light is used";
        Warning::about(Code::LightIgnored, "point light", what, format!("node {node}"))
    };
    let whole = Warning::new(Code::EmptyFrame, "nothing is seen");
    for warning in Warning::fold([light(4), whole.clone(), light(7), whole, light(9)]) {
        println!("{warning}");
        println!("    explained under: {}", warning.code.section().heading());
        for detail in &warning.details {
            println!("    {detail}");
        }
    }
}
