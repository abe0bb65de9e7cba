//! Previews of charts: `cargo run --release -p experiments --example preview [-- STUDY FOLDER]`; without
//! arguments the studies are listed.

use std::error::Error;
use std::path::Path;

use experiments::all;
use experiments::study::StudyRequest;
use output::OutDir;
use output::plot::PlotStyle;
use output::terminal::Progress;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [name, folder] = &words[..] else {
        for study in all() {
            println!("{:16} {}", study.name, study.about);
        }
        return Ok(());
    };
    let study = all().find(|study| study.name == name).ok_or("unknown study")?;
    let (plot_style, progress) = (PlotStyle::default(), Progress::new(true));
    let done = OutDir::with(Path::new(folder), study.claim(), |dir| {
        let plot_style = &plot_style;
        study.run(&StudyRequest {
            quick: true,
            scenes: &[],
            seed: None,
            dir,
            plot_style,
            progress: &progress,
        })
    })??;
    print!("{}", done.text);
    println!("{} points between speed and accuracy", done.tradeoff.len());
    Ok(())
}
