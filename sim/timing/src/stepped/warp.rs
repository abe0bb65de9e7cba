//! Warps and the core they are on.

use std::collections::VecDeque;

use crate::clock::Time;
use crate::job::{Job, share};

/// Threads that go through a shader together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Warp {
    pub job: u32,
    /// Which of the warps of its packet.
    pub part: u32,
    pub parts: u32,
    /// 0 for vertices, 1 for pixels.
    pub kind: usize,
    /// The number of its packet among those of its kind.
    pub number: u64,
    pub threads: u32,
    /// Operations left.
    pub left: u32,
    pub core: usize,
}

impl Warp {
    /// Its fetches and lines of the texture cache.
    pub fn texels(&self, job: &Job) -> [u32; 2] {
        job.texels.map(|whole| share(whole, self.part, self.parts).len() as u32)
    }
}

#[derive(Clone, Debug)]
pub(super) struct Core {
    pub slots: u32,
    /// The next free lane, counted through all cycles: `lanes` in each.
    pub lane: u64,
    pub ready: VecDeque<u32>,
    /// Just sent, back from the texture units, and between two operations; each in the order of time.
    pub fresh: VecDeque<(Time, u32)>,
    pub textured: VecDeque<(Time, u32)>,
    pub cooling: VecDeque<(Time, u32)>,
}

impl Core {
    pub fn is_empty(&self) -> bool {
        self.ready.is_empty() && self.fresh.is_empty() && self.textured.is_empty() && self.cooling.is_empty()
    }
}

pub(super) fn due(queue: &mut VecDeque<(Time, u32)>, now: Time) -> Option<u32> {
    let (at, id) = *queue.front()?;
    (at <= now).then(|| {
        queue.pop_front();
        id
    })
}
