//! Heat maps: counts of an event over the image, as files.

use activity::Event;
use glam::{Vec3, vec3};
use pipeline::frame::{HeatMap, TileHeat};

use super::{Plan, RunError};
use output::OutDir;
use output::dir::BoxError;
use output::image::LinearImage;
use output::plot::{HeatMapPlot, HeatTile, Picture, Shading};
use output::table::grouped;

/// Heat map of the report.
pub struct HeatPicture {
    /// Counter of the map.
    pub event: Event,
    /// Number of the frame.
    pub frame: u32,
    /// Contents of a PNG file.
    pub png: Vec<u8>,
}

/// Path of the files of a heat map, without extension.
pub(super) fn heat_name(event: Event, frame: u32) -> String {
    format!("heat/{}_{frame:04}", event.name())
}

/// Writes a heat map as PNG, as EXR (values of pixels) and as CSV (counts of tiles). The brightness of
/// `image`, the frame's image, shades the PNG. Returns the PNG.
pub(super) fn write(
    plan: &Plan,
    dir: &OutDir,
    frame: u32,
    map: &HeatMap,
    image: &[Vec3],
) -> Result<HeatPicture, RunError> {
    let name = heat_name(map.event, frame);
    let png = picture(plan, frame, map, &brightness(image)).png()?;
    dir.write_file(&format!("{name}.png"), |out| Ok(out.write_all(&png)?))?;
    let pixels: Vec<[f32; 3]> = map.pixels().into_iter().map(|value| [value; 3]).collect();
    LinearImage::new(plan.viewport.width(), plan.viewport.height(), &pixels)?
        .write_exr(dir, &format!("{name}.exr"))?;
    dir.write_file(&format!("{name}.csv"), |out| table(map, out))?;
    Ok(HeatPicture { event: map.event, frame, png })
}

/// Displayed brightness of each pixel, 0 to 1.
fn brightness(image: &[Vec3]) -> Vec<f32> {
    let luminance = |pixel: &Vec3| pixel.dot(vec3(0.2126, 0.7152, 0.0722)).clamp(0.0, 1.0);
    image.iter().map(|pixel| libm::powf(luminance(pixel), 1.0 / 2.2)).collect()
}

fn picture(plan: &Plan, frame: u32, map: &HeatMap, brightness: &[f32]) -> Picture {
    let side = if map.samples.is_empty() { plan.gpu.pipeline.tile_px } else { block_px(map) };
    let spread = if side == 1 { String::new() } else { format!(", the mean over {side}x{side} pixels") };
    let elsewhere = match map.elsewhere {
        0 => String::new(),
        count => format!(", of which {} happened nowhere in the image", grouped(count)),
    };
    let plot = HeatMapPlot {
        title: &format!("{} per pixel, frame {frame}{spread}", map.event.name()),
        subject: &format!(
            "{} on {}: {} in all{elsewhere}",
            plan.work.name(),
            plan.gpu.name,
            grouped(map.total())
        ),
        label: "events per pixel",
        size: [plan.viewport.width(), plan.viewport.height()],
        tiles: &if map.samples.is_empty() { tiles(plan, map) } else { blocks(plan, map, side) },
        shading: Shading::Clipped,
        brightness,
    };
    plot.picture(&plan.options.plot_style)
}

/// Largest number of blocks in a picture.
const MAX_BLOCKS: usize = 1 << 19;

/// Side in pixels of the blocks that are drawn as one.
fn block_px(map: &HeatMap) -> u32 {
    (1..).find(|side| map.samples.len() / (side * side) as usize <= MAX_BLOCKS).unwrap_or(1)
}

/// Blocks of `side` pixels, clipped to the image, each with the mean of its pixels.
fn blocks(plan: &Plan, map: &HeatMap, side: u32) -> Vec<HeatTile> {
    let [width, height] = [plan.viewport.width(), plan.viewport.height()];
    let across = width.div_ceil(side);
    let block = |number: u32| {
        let origin = [number % across * side, number / across * side];
        let size = [side.min(width - origin[0]), side.min(height - origin[1])];
        let row = |y: u32| {
            let first = (y * width + origin[0]) as usize;
            map.samples[first..first + size[0] as usize].iter().map(|&count| u64::from(count)).sum::<u64>()
        };
        let sum: u64 = (origin[1]..origin[1] + size[1]).map(row).sum();
        HeatTile { origin, size, value: sum as f64 / f64::from(size[0] * size[1]) }
    };
    (0..across * height.div_ceil(side)).map(block).collect()
}

/// Fine tiles, each with its own events and its share of the events of its coarse tile.
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

/// Writes the count of each fine tile, then of each coarse tile that has events of its own.
fn table(map: &HeatMap, out: &mut dyn std::io::Write) -> Result<(), BoxError> {
    let mut table = csv::Writer::from_writer(out);
    table.write_record(["x_px", "y_px", "width_px", "height_px", "count"])?;
    let coarse = map.coarse.iter().filter(|tile| tile.count > 0);
    for TileHeat { origin: [x, y], size: [width, height], count } in map.tiles.iter().chain(coarse) {
        table.serialize((x, y, width, height, count))?;
    }
    Ok(table.flush()?)
}
