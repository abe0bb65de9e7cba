//! Mean luminance of an image, by a tree in the shared memory of each group and a last group for their sums.

use pipeline::{Buffer, Group, GroupLane, GroupShader, SurfaceView};

use super::block::{Blocks, Order, Slots, tree};
use super::luminance;

/// Sum of the luminance of the pixels of a group.
pub(super) struct BlockSums {
    pub image: SurfaceView,
    pub blocks: Blocks,
    pub slots: Slots,
    pub order: Order,
    /// Sum of each group.
    pub sums: Buffer<f32>,
}

impl GroupShader for BlockSums {
    fn run(&self, group: &mut Group<'_>) {
        let (id, size, groups) = (group.id(), group.size(), group.groups());
        group.lanes(|lane| {
            let mut sum = 0.0;
            self.blocks.pixels(lane, id, size, |pixel| {
                for sample in 0..self.image.samples() {
                    sum = lane.add(sum, luminance(lane, &self.image, pixel, sample));
                }
            });
            lane.set_shared(self.slots.word(lane, lane.index()), sum);
        });
        add_up(group, &self.slots, self.order);
        group.lanes(|lane| {
            if lane.branch(lane.index() == 0) {
                let number = lane.madd(id[1], groups[0], id[0]);
                lane.store(self.sums, number, lane.shared::<f32>(self.slots.first));
            }
        });
    }
}

/// Mean from the sums of groups, in one group.
pub(super) struct Mean {
    pub sums: Buffer<f32>,
    pub slots: Slots,
    pub order: Order,
    /// Number of values in all sums.
    pub count: f32,
    /// A word.
    pub mean: Buffer<f32>,
}

impl GroupShader for Mean {
    fn run(&self, group: &mut Group<'_>) {
        let size = group.size();
        group.lanes(|lane| {
            let mut sum = 0.0;
            for number in (lane.index()..self.sums.len()).step_by(size as usize) {
                sum = lane.add(sum, lane.load(self.sums, number));
            }
            lane.set_shared(self.slots.word(lane, lane.index()), sum);
        });
        add_up(group, &self.slots, self.order);
        group.lanes(|lane| {
            if lane.branch(lane.index() == 0) {
                let sum = lane.shared::<f32>(self.slots.first);
                lane.store(self.mean, 0, lane.mul(sum, 1.0 / self.count));
            }
        });
    }
}

fn add_up(group: &mut Group<'_>, slots: &Slots, order: Order) {
    tree(group, order, |lane: &GroupLane<'_, '_>, [to, from]| {
        let [to, from] = [to, from].map(|index| slots.word(lane, index));
        let sum = lane.add(lane.shared::<f32>(to), lane.shared::<f32>(from));
        lane.set_shared(to, sum);
    });
}
