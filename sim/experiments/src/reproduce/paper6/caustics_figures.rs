//! Figure 7, the area of one warped beam by each method, and images of the light of an ocean.

use glam::{DVec3, dvec3};
use workloads::caustics::generator::Ocean;
use workloads::caustics::{Beam, Eye, Floor, Light, Method, Picture, draw};

use super::super::Figure;
use crate::chart::caustics::view;
use crate::reproduce::settings::Form;
use output::plot::{HeatMapPlot, HeatTile, Look, Shading};
use run::RunError;

/// Pixels across and down of the view of one method.
const PANEL_PX: [u32; 2] = [120, 160];

/// Figure 7: which pixels each method shades for one warped beam, and in which of them there is light.
pub(super) fn warped() -> Result<Figure, RunError> {
    let eye = beside().ok_or_else(|| RunError::setting("a view without extent"))?;
    let pictures = Method::ALL.map(|method| draw(&[twisted()], &eye, method, Some(Light::Volume)));
    let tiles: Vec<HeatTile> =
        (0..).zip(&pictures).flat_map(|(panel, picture)| areas_of(panel, picture)).collect();
    let areas = Method::ALL.iter().zip(&pictures);
    let areas: Vec<String> = areas
        .map(|(method, picture)| {
            format!("{} {}", method.name(), picture.runs.iter().filter(|runs| **runs > 0).count())
        })
        .collect();
    let map = HeatMapPlot {
        title: "The pixels of one warped beam (Paper VI, Figure 7)",
        subject: &format!("from left to right, with pixels that are shaded: {}", areas.join(", ")),
        label: "",
        size: [4 * PANEL_PX[0], PANEL_PX[1]],
        tiles: &tiles,
        shading: Shading::Classes(&["not shaded", "shaded without light", "shaded with light"]),
        brightness: &[],
    };
    Ok(Figure { name: "VI_fig7", picture: map.picture(&Look::default()) })
}

/// The view of the beam.
fn beside() -> Option<Eye> {
    Eye::new([dvec3(1.2, 1.6, 8.0), dvec3(0.2, -1.0, 0.0), DVec3::Y], 2.2, PANEL_PX)
}

/// Runs of equal pixels in a row: 0 not shaded, 1 wasted, 2 with light.
fn areas_of(panel: u32, picture: &Picture) -> Vec<HeatTile> {
    let width = PANEL_PX[0];
    let kinds = picture.runs.iter().zip(&picture.light);
    let kinds: Vec<u32> = kinds.map(|(runs, light)| u32::from(*runs > 0) + u32::from(*light > 0.0)).collect();
    let mut tiles = Vec::new();
    for (y, row) in (0..).zip(kinds.chunks(width as usize)) {
        let mut x = panel * width;
        for equal in row.chunk_by(|a, b| a == b) {
            let size = [equal.len() as u32, 1];
            tiles.push(HeatTile { origin: [x, y], size, value: f64::from(equal[0]) });
            x += size[0];
        }
    }
    tiles
}

/// A beam that turns by a radian and narrows on its way.
fn twisted() -> Beam {
    let open = [dvec3(-0.8, 0.3, -0.5), dvec3(0.9, 0.4, -0.4), dvec3(0.0, 0.2, 0.9)];
    let (sin, cos) = libm::sincos(1.0);
    let close = open
        .map(|p| dvec3(0.8 * (cos * p.x + sin * p.z) + 0.2, p.y - 2.6, 0.8 * (cos * p.z - sin * p.x) + 0.1));
    Beam { open, close, flux_w: 1.0 }
}

/// The light of the ocean in the water from the side, and on its floor from above.
pub(super) fn light(form: Form) -> Result<[Figure; 2], RunError> {
    let (cells, [width, height]) = if form == Form::Quick { (48, [128, 72]) } else { (128, [256, 144]) };
    let water = Ocean { overshoot: 0.02, ..view::water(cells, view::SLOPE) };
    let beams = water.beams(0.0);
    let aside = view::aside([width, height]).map_err(RunError::setting)?;
    let above = view::above(height).map_err(RunError::setting)?;
    let floor = Light::Floor(Floor { height_m: -view::DEPTH_M });
    let image = |name, what: &str, label: &str, eye: &Eye, light| {
        let picture = draw(&beams, eye, Method::Moving, Some(light));
        let subject =
            format!("{} beams as moving triangles, waves of slope {}; {what}", beams.len(), view::SLOPE);
        let size = [eye.viewport().width(), eye.viewport().height()];
        let title = "Caustics under waves (Paper VI, section 4)";
        let tiles = &tiles(&picture.light, size[0]);
        // Next to a focus light has no bound.
        let shading = Shading::Clipped;
        let map = HeatMapPlot { title, subject: &subject, label, size, tiles, shading, brightness: &[] };
        Figure { name, picture: map.picture(&Look::default()) }
    };
    Ok([
        image("VI_caustics_volume", "in the water, from the side", "W/m", &aside, Light::Volume),
        image("VI_caustics_floor", "on the floor, from above", "W/m2", &above, floor),
    ])
}

/// Pixels of light in rows of `width`.
fn tiles(light: &[f64], width: u32) -> Vec<HeatTile> {
    let tile = |(place, light): (u32, &f64)| HeatTile {
        origin: [place % width, place / width],
        size: [1, 1],
        value: *light,
    };
    (0..).zip(light).map(tile).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_body_has_more_pixels_than_the_beam() {
        let eye = Eye::new([dvec3(1.2, 1.6, 8.0), dvec3(0.0, -1.0, 0.0), DVec3::Y], 1.7, PANEL_PX).unwrap();
        let area = |method| draw(&[twisted()], &eye, method, None).total_runs();
        let [moving, refined, hull, prism] = Method::ALL.map(area);
        assert!(moving < refined && refined <= hull && hull < prism, "{moving} {refined} {hull} {prism}");
    }
}
