//! Heat maps: counts of an event over the image, or the energy of all events, as files.

use std::collections::BTreeSet;

use activity::Event;
use glam::Vec3;
use pipeline::frame::{HeatMap, TileHeat};
use pipeline::texture::LUMINANCE;
use pipeline::{FrameReport, Gpu, Viewport};

use super::{HeatQuantity, HeatRequest, Plan, RunError};
use output::OutDir;
use output::dir::BoxError;
use output::image::LinearImage;
use output::plot::{HeatMapPlot, HeatScale, HeatTile, Picture};
use output::table::{grouped, si};

/// Heat map of the report.
pub struct HeatPicture {
    /// What the map shows.
    pub request: HeatRequest,
    /// Number of the frame.
    pub frame: u32,
    /// Share of the quantity that has a place in the image; 0 where there is none at all.
    pub placed: f64,
    /// Contents of a PNG file.
    pub png: Vec<u8>,
}

/// The GPU with the maps that `requests` need.
pub(super) fn with_maps<'g>(mut gpu: Gpu<'g>, requests: &[HeatRequest], viewport: Viewport) -> Gpu<'g> {
    let mut passes: Vec<_> = requests.iter().map(|request| request.pass.as_deref()).collect();
    passes.sort_unstable();
    passes.dedup();
    for pass in passes {
        let events =
            events(requests.iter().filter(|of| of.pass.as_deref() == pass).map(|request| request.quantity));
        gpu = match pass {
            Some(pass) => gpu.with_heat_of_pass(pass, &events, viewport),
            None => gpu.with_heat(&events, viewport),
        };
    }
    gpu
}

/// Events that have to be counted by place. Energy needs all of them.
fn events(quantities: impl Iterator<Item = HeatQuantity>) -> Vec<Event> {
    let needed: Vec<Event> = quantities
        .flat_map(|quantity| match quantity {
            HeatQuantity::Event(event) => vec![event],
            HeatQuantity::Joules => Event::ALL.to_vec(),
        })
        .collect();
    Event::ALL.into_iter().filter(|event| needed.contains(event)).collect()
}

/// Checks that a frame has the passes that `requests` name.
///
/// # Errors
/// [`RunError::Setting`] with the names of its passes.
pub(super) fn check_passes(
    requests: &[HeatRequest],
    frame: u32,
    report: &FrameReport,
) -> Result<(), RunError> {
    let names: BTreeSet<&str> = report.passes.iter().map(|pass| &*pass.name).collect();
    let missing = requests.iter().find(|of| of.pass.as_deref().is_some_and(|pass| !names.contains(pass)));
    let Some(missing) = missing else { return Ok(()) };
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    let why = format!("`{missing}`: frame {frame} has no such pass; it has {}", quoted.join(", "));
    Err(RunError::invalid("heat", why))
}

/// Writes the heat maps of a frame, made of the `maps` of its events: as PNG, as EXR (values of pixels) and
/// as CSV (values of tiles). The brightness of `image`, the frame's image, shades the PNG.
pub(super) fn write_all(
    plan: &Plan,
    dir: &OutDir,
    frame: u32,
    maps: &[HeatMap],
    image: &[Vec3],
) -> Result<Vec<HeatPicture>, RunError> {
    let brightness = if plan.options.heat.is_empty() { Vec::new() } else { brightness(image) };
    let write = |request: &HeatRequest| {
        let maps = maps.iter().filter(|map| map.pass == request.pass);
        let weighted: Vec<_> = match request.quantity {
            HeatQuantity::Event(event) => {
                maps.filter(|map| map.event == event).map(|map| (map, 1.0)).collect()
            }
            HeatQuantity::Joules => maps.map(|map| (map, plan.model.event_j(map.event))).collect(),
        };
        Heat::new(request.clone(), &weighted).write(plan, dir, frame, &brightness)
    };
    plan.options.heat.iter().map(write).collect()
}

/// Values of a quantity over the image: events, or joules.
struct Heat {
    request: HeatRequest,
    /// Fine tiles, and coarse tiles with what belongs to none of their fine tiles.
    tiles: Vec<ValueTile>,
    coarse: Vec<ValueTile>,
    /// Value of every pixel, row by row.
    pixels: Vec<f32>,
    /// Whether values of single pixels are known, and not only those of tiles.
    is_by_pixel: bool,
    total: f64,
    elsewhere: f64,
}

/// A tile clipped to the image, and its value.
#[derive(Clone, Copy, Debug)]
struct ValueTile {
    origin: [u32; 2],
    size: [u32; 2],
    value: f64,
}

impl ValueTile {
    fn per_pixel(&self) -> f64 {
        self.value / f64::from(self.size[0] * self.size[1])
    }
}

impl Heat {
    /// Sum of maps, each times a weight. The maps are of one image.
    fn new(request: HeatRequest, maps: &[(&HeatMap, f64)]) -> Self {
        let sum = |pick: fn(&HeatMap) -> &[TileHeat]| {
            let mut tiles: Vec<ValueTile> = Vec::new();
            for &(map, weight) in maps {
                let first = |tile: &TileHeat| ValueTile { origin: tile.origin, size: tile.size, value: 0.0 };
                if tiles.is_empty() {
                    tiles.extend(pick(map).iter().map(first));
                }
                let values = pick(map).iter().map(|tile| tile.count as f64 * weight);
                tiles.iter_mut().zip(values).for_each(|(tile, value)| tile.value += value);
            }
            tiles
        };
        let mut pixels: Vec<f64> = Vec::new();
        for (map, weight) in maps.iter().filter(|(_, weight)| *weight > 0.0) {
            let values = map.pixels();
            pixels.resize(values.len(), 0.0);
            pixels.iter_mut().zip(values).for_each(|(sum, value)| *sum += f64::from(value) * weight);
        }
        Self {
            request,
            tiles: sum(|map| &map.tiles),
            coarse: sum(|map| &map.coarse),
            pixels: pixels.into_iter().map(|value| value as f32).collect(),
            is_by_pixel: maps.iter().any(|(map, _)| !map.samples.is_empty()),
            total: maps.iter().map(|(map, weight)| map.total() as f64 * weight).sum(),
            elsewhere: maps.iter().map(|(map, weight)| map.elsewhere as f64 * weight).sum(),
        }
    }

    fn write(
        &self,
        plan: &Plan,
        dir: &OutDir,
        frame: u32,
        brightness: &[f32],
    ) -> Result<HeatPicture, RunError> {
        let name = self.request.path(frame);
        let png = self.picture(plan, frame, brightness).png()?;
        dir.write_file(&format!("{name}.png"), |out| Ok(out.write_all(&png)?))?;
        let pixels: Vec<[f32; 3]> = self.pixels.iter().map(|&value| [value; 3]).collect();
        LinearImage::new(plan.viewport.width(), plan.viewport.height(), &pixels)?
            .write_exr(dir, &format!("{name}.exr"))?;
        dir.write_file(&format!("{name}.csv"), |out| self.table(out))?;
        // A quantity that is 0 has no part outside the image.
        let placed = if self.total > 0.0 { 1.0 - self.elsewhere / self.total } else { 1.0 };
        Ok(HeatPicture { request: self.request.clone(), frame, placed, png })
    }

    /// What is shown, for titles.
    fn subject(&self) -> String {
        let name = self.request.quantity.name();
        self.request.pass.as_ref().map_or_else(|| name.to_owned(), |pass| format!("{name} of pass {pass}"))
    }

    fn picture(&self, plan: &Plan, frame: u32, brightness: &[f32]) -> Picture {
        let side = if self.is_by_pixel { block_px(self.pixels.len()) } else { plan.gpu.pipeline.tile_px };
        let spread = if side == 1 { String::new() } else { format!(", the mean over {side}x{side} pixels") };
        let shown = |value: f64| match self.request.quantity {
            HeatQuantity::Event(_) => grouped(value as u64),
            HeatQuantity::Joules => si(value, "J"),
        };
        let elsewhere = match self.elsewhere {
            0.0 => String::new(),
            value => format!(", of which {} happened nowhere in the image", shown(value)),
        };
        let plot = HeatMapPlot {
            title: &format!("{} per pixel, frame {frame}{spread}", self.subject()),
            subject: &format!("{} on {}: {} in all{elsewhere}", plan.name, plan.gpu.name, shown(self.total)),
            label: match self.request.quantity {
                HeatQuantity::Event(_) => "events per pixel",
                HeatQuantity::Joules => "joules per pixel",
            },
            size: [plan.viewport.width(), plan.viewport.height()],
            tiles: &if self.is_by_pixel { self.blocks(plan, side) } else { self.fine_tiles(plan) },
            shading: HeatScale::Clipped,
            brightness,
        };
        plot.picture(&plan.options.plot_style)
    }

    /// Blocks of `side` pixels, clipped to the image, each with the mean of its pixels.
    fn blocks(&self, plan: &Plan, side: u32) -> Vec<HeatTile> {
        let [width, height] = [plan.viewport.width(), plan.viewport.height()];
        let across = width.div_ceil(side);
        let block = |number: u32| {
            let origin = [number % across * side, number / across * side];
            let size = [side.min(width - origin[0]), side.min(height - origin[1])];
            let row = |y: u32| {
                let first = (y * width + origin[0]) as usize;
                self.pixels[first..first + size[0] as usize]
                    .iter()
                    .map(|&value| f64::from(value))
                    .sum::<f64>()
            };
            let sum: f64 = (origin[1]..origin[1] + size[1]).map(row).sum();
            HeatTile { origin, size, value: sum / f64::from(size[0] * size[1]) }
        };
        (0..across * height.div_ceil(side)).map(block).collect()
    }

    /// Fine tiles, each with its own value and its share of that of its coarse tile.
    fn fine_tiles(&self, plan: &Plan) -> Vec<HeatTile> {
        let side = plan.gpu.pipeline.coarse_tile_px;
        let across = plan.viewport.width().div_ceil(side);
        let tile = |tile: &ValueTile| {
            let coarse = tile.origin[1] / side * across + tile.origin[0] / side;
            let value = tile.per_pixel() + self.coarse[coarse as usize].per_pixel();
            HeatTile { origin: tile.origin, size: tile.size, value }
        };
        self.tiles.iter().map(tile).collect()
    }

    /// Writes the value of each fine tile, then of each coarse tile that has events of its own.
    fn table(&self, out: &mut dyn std::io::Write) -> Result<(), BoxError> {
        let mut table = csv::Writer::from_writer(out);
        let column = if self.request.quantity == HeatQuantity::Joules { "energy_J" } else { "count" };
        table.write_record(["x_px", "y_px", "width_px", "height_px", column])?;
        let coarse = self.coarse.iter().filter(|tile| tile.value > 0.0);
        for ValueTile { origin: [x, y], size: [width, height], value } in self.tiles.iter().chain(coarse) {
            match self.request.quantity {
                HeatQuantity::Event(_) => table.serialize((x, y, width, height, *value as u64))?,
                HeatQuantity::Joules => table.serialize((x, y, width, height, value))?,
            }
        }
        Ok(table.flush()?)
    }
}

/// Displayed brightness of each pixel, 0 to 1.
fn brightness(image: &[Vec3]) -> Vec<f32> {
    let luminance = |pixel: &Vec3| pixel.dot(LUMINANCE).clamp(0.0, 1.0);
    image.iter().map(|pixel| libm::powf(luminance(pixel), 1.0 / 2.2)).collect()
}

/// Largest number of blocks in a picture.
const MAX_BLOCKS: usize = 1 << 19;

/// Side in pixels of the blocks that are drawn as one, of an image of so many pixels.
fn block_px(pixels: usize) -> u32 {
    (1..).find(|side| pixels / (side * side) as usize <= MAX_BLOCKS).unwrap_or(1)
}
