//! What threads work in, from the first piece of a file to the last.

use super::screen::Buffers;
use std::sync::{Mutex, PoisonError};

/// What a thread works in: the signal and the profile of one task.
#[derive(Default)]
pub(super) struct Workspace {
    pub signal: Vec<f32>,
    pub profile: Vec<f32>,
    /// Powers about one offset, W.
    pub power_w: Vec<f64>,
    pub buffers: Buffers,
}

/// One for each thread, not made anew for each piece.
pub(super) struct Workspaces(Vec<Mutex<Workspace>>);

impl Workspaces {
    pub fn new() -> Self {
        Self((0..rayon::current_num_threads()).map(|_| Mutex::default()).collect())
    }

    /// Does something in that of the thread it is called by.
    pub fn with<T>(&self, work: impl FnOnce(&mut Workspace) -> T) -> T {
        let thread = rayon::current_thread_index().unwrap_or(0);
        work(&mut self.0[thread % self.0.len()].lock().unwrap_or_else(PoisonError::into_inner))
    }
}
