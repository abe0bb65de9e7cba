//! What stored depths leave of a triangle in a tile.

use super::super::tile_tests::Left;
use super::Worker;
use crate::depth::{Bounder, Visible, interval_madds, set_up_madds};
use crate::sample_test;
use crate::setup::Triangle;
use crate::traversal::{Box5, TileRect};

impl Worker<'_, '_> {
    /// Where the depths stored in the tile leave the triangle to be seen, and whether none of them has to be read for it.
    pub(super) fn in_sight(
        &mut self,
        triangle: &Triangle,
        rect: &TileRect,
        within: &Box5,
        place: usize,
    ) -> Option<(Box5, bool)> {
        let (features, depth) = (&self.pass.settings.spec.features, &self.pass.settings.spec.depth);
        if !features.z_max && !depth.z_min {
            return Some((*within, false));
        }
        if !self.wants_depth(triangle, within, place) {
            return Some((*within, false));
        }
        self.prepare(triangle);
        let mut visible = Visible::unknown(within);
        if let (Some((_, bounder)), Some(tile)) = (&self.bounder, &mut self.bin.tiles[place]) {
            self.tests.z_updates += if features.z_max { tile.renew() } else { 0 };
            visible = tile.boxes.look(within, |part| bounder.over(rect, part));
        }
        self.tests.z_tests += visible.compared;
        self.tests.interval_madds +=
            visible.compared * interval_madds(depth.bound, triangle.moving, within.lens);
        if features.auto {
            self.learn_depth(triangle, within, &visible);
        }
        if !features.z_max {
            return Some((*within, visible.in_front && visible.behind == 0));
        }
        self.tests.boxes_culled += visible.behind;
        self.tests.z_culled += u32::from(visible.within.is_none());
        // The sample test takes a still triangle at all times.
        let time = |rest: Box5| Box5 { t: if triangle.moving { rest.t } else { within.t }, ..rest };
        let front = depth.z_min && visible.in_front && (triangle.moving || visible.behind == 0);
        visible.within.map(|rest| (time(rest), front))
    }

    /// Whether stored depths are likely to hide more than looking at them costs.
    fn wants_depth(&mut self, triangle: &Triangle, within: &Box5, place: usize) -> bool {
        let (features, depth) = (&self.pass.settings.spec.features, &self.pass.settings.spec.depth);
        if !features.auto || depth.z_min {
            return true;
        }
        if self.bin.tiles[place].is_none() {
            return false;
        }
        let samples = f64::from(self.samples_of_a_tile()) * Left::all(*within).volume(triangle.moving);
        let judge = &mut self.bin.judge;
        let known = self.bounder.as_ref().is_some_and(|(id, _)| *id == triangle.id);
        let set_up = if known { 0 } else { set_up_madds(depth.bound, triangle.moving) };
        let price = interval_madds(depth.bound, triangle.moving, within.lens) + set_up;
        let full = f64::from(sample_test::madds(triangle.moving, within.lens));
        let stake = samples * judge.sample_madds(full);
        judge.wants_depth(f64::from(price), stake)
    }

    fn learn_depth(&mut self, triangle: &Triangle, within: &Box5, visible: &Visible) {
        let before = Left::all(*within).volume(triangle.moving);
        let rest = visible.within.map_or(0.0, |rest| Left::all(rest).volume(triangle.moving) / before);
        let share = if rest.is_finite() { 1.0 - rest } else { 0.0 };
        self.bin.judge.learn_depth(share, f64::from(self.samples_of_a_tile()) * before);
    }

    /// Finds what is known of the depth of a triangle, once in a bin.
    fn prepare(&mut self, triangle: &Triangle) {
        if self.bounder.as_ref().is_none_or(|(id, _)| *id != triangle.id) {
            let bound = self.pass.settings.spec.depth.bound;
            self.tests.interval_madds += set_up_madds(bound, triangle.moving);
            self.bounder = Some((triangle.id, Bounder::new(triangle, &self.pass.projection.shear, bound)));
        }
    }
}
