//! The files of the chart.

use workloads::occlusion::HALF_COVERED;

use super::{Kind, OcclusionChart, Row, measure};
use output::dir::BoxError;
use output::plot::{Chart, ChartPanel, Look, Picture, Scale, Series};
use output::table::Table;
use output::{Claim, OutDir, OutputError};

/// The files of the chart.
pub fn claim() -> Claim {
    Claim::new("chart occlusion")
        .plots(["occlusion", "occlusion_failures"])
        .files(["occlusion.csv", "occlusion.json"])
}

/// Writes picture and numbers; `occlusion.json` comes last.
pub(super) fn write(chart: &OcclusionChart, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
    chart.picture(look).write(dir, "occlusion")?;
    chart.failures(look).write(dir, "occlusion_failures")?;
    dir.write_file("occlusion.csv", |out| chart.csv(out))?;
    dir.write_json("occlusion.json", chart)?;
    Ok(())
}

const HEADER: [&str; 10] =
    ["blur", "slats", "samples", "tile", "boxes", "hidden", "found", "tests", "bytes", "multiply-adds"];

impl Row {
    fn way(&self) -> String {
        self.boxes.map_or("samples".to_owned(), |[u, v, t]| format!("{u}x{v}x{t}"))
    }

    fn cells(&self) -> [String; 10] {
        [
            self.kind.name().to_owned(),
            self.slats.to_string(),
            self.samples.to_string(),
            self.tile_px.map_or("-".to_owned(), |px| px.to_string()),
            self.way(),
            format!("{} of {}", self.hidden, self.objects),
            format!("{} ({:.3})", self.found, self.rate()),
            format!("{:.0}", self.tests),
            format!("{:.0}", self.bytes),
            format!("{:.0}", self.madds),
        ]
    }
}

impl OcclusionChart {
    fn rows(&self) -> impl Iterator<Item = &Row> {
        self.intervals.iter().chain(&self.samples).chain(&self.failing)
    }

    /// What is printed.
    pub fn text(&self) -> String {
        let mut table = Table::new(HEADER);
        self.rows().for_each(|row| {
            table.row(row.cells());
        });
        format!(
            "{table}\ncosts are means over all objects; a query by intervals ends where an object is seen to be visible\n"
        )
    }

    /// Whether anything that a sample sees was called hidden.
    pub fn fault(&self) -> Option<String> {
        let wrong: u64 = self.rows().map(|row| row.wrong).sum();
        (wrong > 0).then(|| format!("{wrong} objects that are seen were called hidden; please report it"))
    }

    fn picture(&self, look: &Look) -> Picture {
        let panels = Kind::ALL.map(|kind| self.rates(kind)).into();
        let subject = format!(
            "share of hidden boxes that are found, over bytes of stored depth read for each box that is asked for; {} samples a pixel, sampled queries 16 to 64; \
             dots of a tile from few boxes of lens and time to many",
            self.effort.samples[0]
        );
        Chart::new("Occlusion queries: by intervals and by samples", &subject, panels).picture(look)
    }

    fn rates(&self, kind: Kind) -> ChartPanel {
        let of_tile = |&tile: &u32| {
            let rows = self.intervals.iter().filter(|row| row.kind == kind && row.tile_px == Some(tile));
            let mut points: Vec<_> = rows.map(|row| (row.bytes, row.rate())).collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            Series::curve(format!("{tile}-pixel tiles"), points)
        };
        let mut curves: Vec<Series> = self.effort.tiles.iter().map(of_tile).collect();
        let sampled = self.samples.iter().filter(|row| row.kind == kind && row.boxes.is_none());
        curves.push(Series::curve("sampled queries", sampled.map(|row| (row.bytes, row.rate()))));
        ChartPanel::new(kind.name(), ["bytes of depth read for a box", "share found"], curves)
            .on(Scale::Decades, Scale::Even)
    }

    /// Walls of more and more slats: what is found, and why not more is.
    fn failures(&self, look: &Look) -> Picture {
        let panel = |title: &str, up: &str, of: fn(&Row) -> f64, ways: &[Option<u32>]| {
            let curve = |tile_px: &Option<u32>| {
                let rows = self.failing.iter().filter(|row| row.tile_px == *tile_px);
                let name = tile_px.map_or("sampled queries".to_owned(), |px| format!("{px}-pixel tiles"));
                Series::curve(name, rows.map(|row| (f64::from(row.slats), of(row))))
            };
            ChartPanel::new(title, ["slats of a wall", up], ways.iter().map(curve).collect())
                .on(Scale::Doublings, Scale::Even)
                .failing(self.warned().map(|slats| slats..f64::INFINITY), "a run warns")
        };
        let [small, large] = measure::FAILING_TILES.map(Some);
        let panels = vec![
            panel("what is found", "share of hidden boxes found", Row::rate, &[small, large, None]),
            panel(
                "tiles that most samples but not all find covered",
                "share of tiles",
                |row| row.half_covered,
                &[small, large],
            ),
        ];
        let subject = format!(
            "walls of more and narrower slats, {:.0} % of a wall being gaps; motion, {} samples a pixel, 8 boxes of time. Marked: where a \
             run with {}-pixel tiles warns (occlusion-small-occluders)",
            100.0 * measure::GAPS,
            self.effort.samples[0],
            measure::FAILING_TILES[0]
        );
        Chart::new("Where occlusion queries fail: many small occluders", &subject, panels).picture(look)
    }

    /// The number of slats from which on a run with the smaller tiles warns.
    fn warned(&self) -> Option<f64> {
        let small = Some(measure::FAILING_TILES[0]);
        let warned = |row: &&Row| row.tile_px == small && row.half_covered > HALF_COVERED;
        self.failing.iter().find(warned).map(|row| f64::from(row.slats))
    }

    fn csv(&self, out: &mut (dyn std::io::Write + Send)) -> Result<(), BoxError> {
        let mut table = csv::WriterBuilder::new().has_headers(false).from_writer(out);
        table.write_record([
            "kind",
            "slats",
            "samples",
            "tile_px",
            "boxes",
            "objects",
            "hidden",
            "found",
            "wrong",
            "half_covered",
            "tests",
            "bytes",
            "madds",
        ])?;
        for row in self.rows() {
            table.serialize((
                row.kind,
                row.slats,
                row.samples,
                row.tile_px,
                row.way(),
                row.objects,
                row.hidden,
                row.found,
                row.wrong,
                row.half_covered,
                row.tests,
                row.bytes,
                row.madds,
            ))?;
        }
        Ok(table.flush()?)
    }
}
