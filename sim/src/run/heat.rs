//! Heat maps: where in a frame a counter counted, as files.

use activity::Event;
use pipeline::frame::{HeatMap, TileHeat};

use super::{Plan, RunError};
use crate::output::OutDir;
use crate::output::dir::BoxError;
use crate::output::image::LinearImage;
use crate::output::plot::{HeatMapPlot, HeatTile};
use crate::output::table::grouped;

/// A heat map of the report.
pub struct HeatPicture {
    /// The counter.
    pub event: Event,
    /// The frame.
    pub frame: u32,
    /// The bytes of a PNG file.
    pub png: Vec<u8>,
}

/// The name of the files of a heat map without their endings.
pub(super) fn heat_name(event: Event, frame: u32) -> String {
    format!("heat/{}_{frame:04}", event.name())
}

/// Writes picture, values of the pixels and counts of the tiles; returns the picture.
pub(super) fn write(plan: &Plan, dir: &OutDir, frame: u32, map: &HeatMap) -> Result<HeatPicture, RunError> {
    let name = heat_name(map.event, frame);
    let png = picture(plan, frame, map)?;
    dir.write_atomic(&format!("{name}.png"), |out| Ok(out.write_all(&png)?))?;
    let pixels: Vec<[f32; 3]> = map.pixels().into_iter().map(|value| [value; 3]).collect();
    LinearImage::new(plan.viewport.width(), plan.viewport.height(), &pixels)?
        .write_exr(dir, &format!("{name}.exr"))?;
    dir.write_atomic(&format!("{name}.csv"), |out| table(map, out))?;
    Ok(HeatPicture { event: map.event, frame, png })
}

fn picture(plan: &Plan, frame: u32, map: &HeatMap) -> Result<Vec<u8>, RunError> {
    let side = plan.gpu.pipeline.tile_px;
    let by_pixel = side == 1 || is_drawn_by_pixel(map);
    let spread =
        if by_pixel { String::new() } else { format!(", the mean over tiles of {side}x{side} pixels") };
    let elsewhere = match map.elsewhere {
        0 => String::new(),
        count => format!(", of which {} happened nowhere in the image", grouped(count)),
    };
    let plot = HeatMapPlot {
        title: &format!("{} per pixel, frame {frame}{spread}", map.event.name()),
        subject: &format!(
            "{} on {}: {} in all{elsewhere}",
            plan.scene.name(),
            plan.gpu.name,
            grouped(map.total())
        ),
        label: "events per pixel",
        size: [plan.viewport.width(), plan.viewport.height()],
        tiles: &if is_drawn_by_pixel(map) { pixels(plan, map) } else { tiles(plan, map) },
    };
    Ok(plot.picture().png()?)
}

/// The most pixels that are drawn one by one; larger pictures would show no more of them.
const MOST_PIXELS: usize = 1 << 19;

/// Whether the event has a place in pixels, and few enough for each to be drawn.
fn is_drawn_by_pixel(map: &HeatMap) -> bool {
    (1..=MOST_PIXELS).contains(&map.samples.len())
}

/// Every pixel as a tile of its own.
fn pixels(plan: &Plan, map: &HeatMap) -> Vec<HeatTile> {
    let width = plan.viewport.width();
    let place = |at: u32| [at % width, at / width];
    let tile = |(at, &count)| HeatTile { origin: place(at), size: [1, 1], value: f64::from(count) };
    (0..).zip(&map.samples).map(tile).collect()
}

/// The fine tiles, each with its own events and its share of those of the coarse tile it is in.
fn tiles(plan: &Plan, map: &HeatMap) -> Vec<HeatTile> {
    let side = plan.gpu.pipeline.coarse_tile_px;
    let across = plan.viewport.width().div_ceil(side);
    let tile = |tile: &TileHeat| {
        let coarse = tile.origin[1] / side * across + tile.origin[0] / side;
        let value = tile.per_pixel() + map.coarse[coarse as usize].per_pixel();
        HeatTile { origin: tile.origin, size: tile.size, value }
    };
    map.tiles.iter().map(tile).collect()
}

/// Every tile with its count, fine ones first; coarse ones where something is counted for them as a whole.
fn table(map: &HeatMap, out: &mut dyn std::io::Write) -> Result<(), BoxError> {
    let mut table = csv::Writer::from_writer(out);
    table.write_record(["x_px", "y_px", "width_px", "height_px", "count"])?;
    let coarse = map.coarse.iter().filter(|tile| tile.count > 0);
    for TileHeat { origin: [x, y], size: [width, height], count } in map.tiles.iter().chain(coarse) {
        table.serialize((x, y, width, height, count))?;
    }
    Ok(table.flush()?)
}
