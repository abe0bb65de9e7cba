//! A folder of results with a table and a number in it: `cargo run -p output --example results_folder [-- FOLDER]`.

use std::error::Error;
use std::path::PathBuf;

use output::table::{Table, si};
use output::{Claim, Destination};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).map_or_else(
        || std::env::temp_dir().join(format!("quintile-example-{}", std::process::id())),
        PathBuf::from,
    );
    let mut table = Table::new(["frame", "energy"]);
    let energies_j = [0.01234, 0.0119, 0.0127];
    for (index, joules) in energies_j.iter().enumerate() {
        table.row([index.to_string(), si(*joules, "J")]);
    }
    let mut results =
        Destination::new(&folder).open([Claim::new("example").files(["sums.json", "frames.txt"])])?;
    results.write_json("sums.json", &energies_j.iter().sum::<f64>())?;
    results.write_file("frames.txt", |out| Ok(write!(out, "{table}")?))?;
    // Until here the folder has none of the new files.
    for name in results.publish()? {
        println!("{}", folder.join(name).display());
    }
    print!("{table}");
    Ok(())
}
