//! The files of a sweep.

use super::picture;
use super::report::Report;
use output::dir::SUMMARY;
use output::plot::Look;
use output::{Claim, OutDir, OutputError};

/// The files of the catalogue.
pub fn claim() -> Claim {
    let endings = || picture::MEASURES.iter().map(|measure| measure.stem).chain(["_intervals"]);
    let families = workloads::stress::families()
        .flat_map(|family| endings().map(move |ending| format!("{}{ending}", stem(family.name))));
    Claim::new("stress").plots(families.chain(["matrix", "auto"].map(stem))).files([
        "stress.csv",
        "auto.csv",
        SUMMARY,
    ])
}

/// The path of a picture without its ending.
fn stem(name: &str) -> String {
    format!("plots/stress_{}", name.replace('-', "_"))
}

impl Report {
    /// Writes the pictures, `stress.csv`, `auto.csv` and `summary.json`.
    ///
    /// # Errors
    /// [`OutputError`] with the file and the cause.
    pub fn write(&self, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
        if self.families.len() > 1 {
            picture::matrix(self, look).write(dir, &stem("matrix"))?;
            picture::auto(&self.auto, look).write(dir, &stem("auto"))?;
        }
        for family in &self.families {
            let stem = stem(family.name);
            for measure in &picture::MEASURES {
                let stem = format!("{stem}{}", measure.stem);
                picture::family(self, family, measure, look).write(dir, &stem)?;
            }
            picture::intervals(self, family, look).write(dir, &format!("{stem}_intervals"))?;
        }
        dir.write_file("stress.csv", |out| self.csv(out))?;
        dir.write_file("auto.csv", |out| {
            let mut csv = csv::Writer::from_writer(out);
            let choices = self.auto.families.iter().chain(&self.auto.values);
            choices.into_iter().try_for_each(|choice| csv.serialize(choice))?;
            Ok(csv.flush()?)
        })?;
        dir.write_json(SUMMARY, &self.summary())
    }

    fn csv(&self, out: &mut (dyn std::io::Write + Send)) -> Result<(), output::dir::BoxError> {
        let mut csv = csv::WriterBuilder::new().has_headers(false).from_writer(out);
        csv.write_record([
            "family",
            "value",
            "method",
            "triangles",
            "samples_lost",
            "held_against",
            "samples_tested",
            "samples_hit",
            "tile_madds",
            "sample_madds",
            "over_best",
            "truth",
            "pairs",
            "pairs_touching",
            "pairs_kept",
            "pairs_wrong",
            "u_width",
            "v_width",
            "t_width",
            "u_true",
            "v_true",
            "t_true",
            "tightness",
        ])?;
        // Nested structs flatten into the columns above, in the order of their fields.
        self.rows.iter().try_for_each(|row| csv.serialize(row))?;
        Ok(csv.flush()?)
    }
}
