//! Unfinished files of this process, which an interrupt removes.
//!
//! A signal handler has no arguments, so it finds them in a list of the whole process.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Mutex, MutexGuard, PoisonError};

type Remove = Box<dyn FnOnce() + Send>;

/// How to remove each, by its number.
#[derive(Default)]
pub struct List {
    last: u64,
    removers: BTreeMap<u64, Remove>,
}

static LIST: Mutex<List> = Mutex::new(List { last: 0, removers: BTreeMap::new() });

/// Something that is removed when this is dropped, or when the process is interrupted, unless it was finished
/// before.
pub struct Unfinished {
    number: u64,
}

impl Unfinished {
    /// Something that `remove` removes. `remove` must not make or drop another [`Unfinished`].
    pub fn new(remove: impl FnOnce() + Send + 'static) -> Self {
        let mut list = list();
        list.last += 1;
        let number = list.last;
        list.removers.insert(number, Box::new(remove));
        Self { number }
    }

    /// It is finished and stays.
    pub fn finish(self) {
        list().removers.remove(&self.number);
    }
}

impl fmt::Debug for Unfinished {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Unfinished").field("number", &self.number).finish()
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let remove = list().removers.remove(&self.number);
        if let Some(remove) = remove {
            remove();
        }
    }
}

fn list() -> MutexGuard<'static, List> {
    LIST.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does `work` while an interrupt waits: makes a file that belongs to something unfinished, or takes steps
/// that belong together. `work` must not make or drop an [`Unfinished`].
pub fn uninterrupted<T>(work: impl FnOnce() -> T) -> T {
    let _held = list();
    work()
}

/// Removes everything unfinished. While the result is held, nothing new is begun: hold it until the process
/// ends.
pub fn remove_all() -> MutexGuard<'static, List> {
    let mut list = list();
    std::mem::take(&mut list.removers).into_values().for_each(|remove| remove());
    list
}
