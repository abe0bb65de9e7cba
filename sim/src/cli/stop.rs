//! The request of a scheduler to end, which work in steps follows between two steps.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

/// A request to end. It comes by a signal and stays.
#[derive(Clone, Debug, Default)]
pub(super) struct Stop {
    /// Number of the signal; 0 before it.
    signal: Arc<AtomicI32>,
}

impl Stop {
    /// Whether it is time to end.
    pub fn is_asked(&self) -> bool {
        self.signal.load(Ordering::Relaxed) != 0
    }

    /// Exit code of a command that ended for it: 128 plus the number of the signal, as in shells.
    pub fn code(&self) -> u8 {
        u8::try_from(128 + self.signal.load(Ordering::Relaxed)).unwrap_or(u8::MAX)
    }

    /// Asks to end because of a signal. The exit code is that of the last one.
    #[cfg(unix)]
    pub fn ask(&self, signal: i32) {
        self.signal.store(signal, Ordering::Relaxed);
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_request_stays_and_gives_the_exit_code() {
        let stop = Stop::default();
        assert!(!stop.is_asked());
        stop.clone().ask(10);
        assert!(stop.is_asked() && stop.code() == 138);
    }
}
