//! The files of the chart.

use super::{CollisionChart, Row, Set};
use output::dir::BoxError;
use output::plot::{Chart, ChartPanel, Look, Scale, Series};
use output::table::Table;
use output::{Claim, OutDir, OutputError};

/// The files of the chart.
pub fn claim() -> Claim {
    Claim::new("chart collision")
        .plots(["collision", "collision_failures"])
        .files(["collision.csv", "collision.json"])
}

/// Writes pictures and numbers; `collision.json` comes last.
pub(super) fn write(chart: &CollisionChart, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
    let subject = subject(&chart.pairs);
    let title = "Pairs kept in vain by collision detection";
    Chart::new(title, &subject, chart.panels()).picture(look).write(dir, "collision")?;
    let (title, subject) = (
        "Where collision detection fails: grazing contact",
        "plates of 72 triangles that slide along each other without touching, any way round, looked at closer: in how many ways to lie they are kept in vain. \
         Marked: nine in ten and more at every resolution, where a run warns (collision-near-everywhere)",
    );
    Chart::new(title, subject, vec![chart.failures()]).picture(look).write(dir, "collision_failures")?;
    dir.write_file("collision.csv", |out| chart.csv(out))?;
    dir.write_json("collision.json", chart)?;
    Ok(())
}

/// What shares are of.
fn subject([[two_hit, two], [many_hit, many]]: &[[usize; 2]; 2]) -> String {
    format!(
        "shares of pairs that do not collide: {two} of two objects (beside {two_hit} that do), {many} of many ({many_hit})"
    )
}

/// The share from which on a run warns.
const NEARLY_ALWAYS: f64 = 0.9;

impl CollisionChart {
    /// What is printed: a row for each way.
    pub fn text(&self) -> String {
        let [families, yardsticks] = [Set::Families, Set::LikeYardsticks].map(|set| self.table(set));
        let mut slides = Table::new(["plates that slide: gap", "px", "kept in vain"]);
        for slide in &self.slides {
            let (gap, kept) = (format!("{:e}", slide.gap), format!("{:.2}", slide.kept));
            slides.row([gap, slide.resolution.to_string(), kept]);
        }
        let [of_families, of_yardsticks] = [self.pairs, self.yardstick_pairs].map(|pairs| subject(&pairs));
        format!(
            "{families}{of_families}\n\n{yardsticks}{of_yardsticks}, cases like those of the yardsticks\n\n{slides}"
        )
    }

    fn table(&self, set: Set) -> Table {
        let mut table = Table::new(["", "px", "two objects", "many", "missed", "ms a pair"]);
        for row in self.rows.iter().filter(|row| row.cases == set) {
            table.row([
                row.way.clone(),
                if row.resolution == 0 { "-".to_owned() } else { row.resolution.to_string() },
                format!("{:.3}", row.two),
                format!("{:.4}", row.many),
                row.missed.to_string(),
                format!("{:.3}", 1e3 * row.pair_s),
            ]);
        }
        table
    }

    /// Two objects and many over resolution, and over time.
    fn panels(&self) -> Vec<ChartPanel> {
        let mut names: Vec<&str> = Vec::new();
        let in_images = || self.rows.iter().filter(|row| row.cases == Set::Families && row.resolution > 0);
        for row in in_images() {
            if !names.contains(&row.way.as_str()) {
                names.push(&row.way);
            }
        }
        let curves = |point: &dyn Fn(&Row) -> (f64, f64)| -> Vec<Series> {
            let of = |name: &&str| {
                let rows = in_images().filter(|row| row.way == *name);
                Series::curve(*name, rows.map(point))
            };
            names.iter().map(of).collect()
        };
        let panel = |title: &str, across: &str, scale, point: &dyn Fn(&Row) -> (f64, f64)| {
            ChartPanel::new(title, [across, "share kept in vain"], curves(point)).on(scale, Scale::Even)
        };
        let pixels = |row: &Row| f64::from(row.resolution);
        vec![
            panel("two objects", "pixels across", Scale::Doublings, &|row| (pixels(row), row.two)),
            panel("many objects", "pixels across", Scale::Doublings, &|row| (pixels(row), row.many)),
            panel("many objects", "CPU time of a pair (ms)", Scale::Decades, &|row| {
                (1e3 * row.pair_s, row.many)
            }),
        ]
    }

    fn failures(&self) -> ChartPanel {
        let curve = |&resolution: &u32| {
            let of = self.slides.iter().filter(|slide| slide.resolution == resolution);
            Series::curve(format!("{resolution} px"), of.map(|slide| (slide.gap, slide.kept)))
        };
        let curves = self.effort.resolutions.iter().map(curve).collect();
        ChartPanel::new("share kept in vain", ["gap (lengths of a plate)", "share of ways to lie"], curves)
            .on(Scale::Decades, Scale::Even)
            .failing(self.failing_gap().map(|gap| 0.0..gap), "fails")
    }

    /// The widest gap at which, as at all below, plates are kept nearly always whatever the resolution.
    fn failing_gap(&self) -> Option<f64> {
        let kept =
            |gap: f64| self.slides.iter().filter(move |slide| slide.gap == gap).map(|slide| slide.kept);
        let mut gaps = self.effort.gaps.to_vec();
        gaps.sort_by(f64::total_cmp);
        gaps.into_iter().take_while(|&gap| kept(gap).all(|kept| kept >= NEARLY_ALWAYS)).last()
    }

    fn csv(&self, out: &mut (dyn std::io::Write + Send)) -> Result<(), BoxError> {
        let mut table = csv::Writer::from_writer(out);
        self.rows.iter().try_for_each(|row| table.serialize(row))?;
        Ok(table.flush()?)
    }
}
