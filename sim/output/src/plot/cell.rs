//! A panel of a chart in its place: heading, axes, series and legend.

use super::axis::{Axis, Extent, Scale, Way};
use super::chart_panel::ChartPanel;
use super::legend::{LEGEND_LINE, legend_column};
use super::palette::MUTED;
use super::panel::{BELOW, Panel, aside};
use super::picture::{Picture, Text, text};
use super::text::{shortened, wrapped};

/// Line height of a panel's title.
const LINE: f64 = 18.0;
/// Free space right of a panel.
pub(super) const RIGHT: f64 = 18.0;
/// Distance of small panels.
pub(super) const SMALL_GAP: f64 = 16.0;
/// Largest height of a panel with equal axes.
const MOST_HIGH: f64 = 640.0;

/// Position of a panel, and what it shares with others.
pub(super) struct Cell<'a> {
    pub panel: &'a ChartPanel,
    pub left: f64,
    pub width: f64,
    /// Height of the panel itself.
    pub height: f64,
    pub extents: Option<[Extent; 2]>,
    /// Whether its horizontal and its vertical axis are labelled.
    pub labelled: [bool; 2],
    /// Whether it is a small panel.
    pub small: bool,
    /// Whether it has its own legend.
    pub legend: bool,
}

/// Draws panels side by side at the bottom of the picture, and increases its height.
pub(super) fn draw_row(picture: &mut Picture, cells: &[Cell<'_>]) {
    let titles = cells.iter().map(|cell| cell.heading().len()).max().unwrap_or(0);
    let top = picture.height + 8.0 + LINE * titles as f64;
    let mut bottom = picture.height;
    for cell in cells {
        bottom = cell.draw(picture, top).max(bottom);
    }
    picture.height = bottom;
}

impl Cell<'_> {
    fn heading(&self) -> Vec<String> {
        let room = self.area(0.0).map_or(self.width - 24.0, |area| self.left + self.width - area.left);
        if self.small {
            return vec![shortened(&self.panel.title, 1.1 * self.heading_px(), room)];
        }
        wrapped(&self.panel.title, self.heading_px(), true, room)
    }

    fn heading_px(&self) -> f64 {
        if self.small { 11.0 } else { 13.0 }
    }

    /// Draws the panel whose area begins at `top`. Returns the bottom of its labels and legend.
    fn draw(&self, picture: &mut Picture, top: f64) -> f64 {
        let Some(area) = self.area(top) else {
            let at = (self.left + 20.0, top + 0.5 * self.height);
            picture.text(Text { colour: MUTED, ..text("nothing to show", at) });
            self.write_heading(picture, self.left + 20.0, top);
            return top + self.height + BELOW;
        };
        self.write_heading(picture, area.left, top);
        let marked = self.panel.mark(picture, &area);
        area.grid(picture);
        if area.x.is_logarithmic() || matches!(self.panel.axes[0].scale, Scale::Listed(_)) {
            area.grid_up(picture);
        }
        marked.into_iter().for_each(|name| picture.text(name));
        for (index, series) in self.panel.series.iter().enumerate() {
            let above = if self.small { &[] } else { &self.panel.series[index + 1..] };
            series.mark.draw(&area, series.style(index), above, picture);
        }
        self.axes(picture, &area);
        self.panel.write_names(picture, &area);
        self.panel.write_notes(picture, &area);
        let below = match (self.small, self.labelled[0]) {
            (true, true) => 30.0,
            (true, false) => 8.0,
            _ => BELOW,
        };
        area.bottom + below + self.own_legend(picture, &area)
    }

    fn write_heading(&self, picture: &mut Picture, left: f64, top: f64) {
        for (line, row) in self.heading().iter().rev().enumerate() {
            let size = self.heading_px();
            picture.text(Text { bold: true, size, ..text(row, (left, top - 12.0 - LINE * line as f64)) });
        }
    }

    /// Area of the panel with its axes; `None` without data.
    pub fn area(&self, top: f64) -> Option<Panel> {
        let [across, up] = self.extents?;
        let y = self.panel.axes[1].axis(up, (Way::Up, self.height));
        let left = self.left + if self.small { 0.0 } else { aside(&y) };
        let right = self.left + self.width - if self.small { SMALL_GAP } else { RIGHT };
        if !self.panel.equal {
            let x = self.panel.axes[0].axis(across, (Way::Across, right - left));
            return Some(Panel { left, top, right, bottom: top + self.height, x, y });
        }
        let (wide, high) = (across.high - across.low, up.high - up.low);
        let px = ((right - left) / wide).min(MOST_HIGH / high);
        let [x, y]: [Axis; 2] = [(0, across, Way::Across, px * wide), (1, up, Way::Up, px * high)]
            .map(|(axis, extent, way, length)| self.panel.axes[axis].axis(extent, (way, length)));
        Some(Panel { left, top, right: left + px * wide, bottom: top + px * high, x, y })
    }

    fn axes(&self, picture: &mut Picture, area: &Panel) {
        let mut area = area.clone();
        if self.small {
            // Once for all of them.
            area.x.label.clear();
            area.y.label.clear();
        }
        for (axis, labelled) in [&mut area.x, &mut area.y].into_iter().zip(self.labelled) {
            if !labelled {
                axis.ticks.iter_mut().for_each(|tick| tick.label.clear());
            }
        }
        area.axis_across(picture, 0.0);
        area.axis_up(picture);
    }

    /// Draws a legend below the panel. Returns its height.
    fn own_legend(&self, picture: &mut Picture, area: &Panel) -> f64 {
        if !self.legend {
            return 0.0;
        }
        let entries: Vec<_> =
            self.panel.named().map(|(key, series)| (key, series.name.clone(), String::new())).collect();
        let height = LEGEND_LINE * entries.len() as f64;
        let from = (area.left.min(self.left + 8.0), area.bottom + BELOW + 8.0);
        legend_column(picture, from, (self.left + self.width, height), &entries);
        height + 4.0
    }
}
