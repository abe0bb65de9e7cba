//! What happens over time.

/// What makes a recording easy or hard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scenario {
    /// Its name.
    pub name: &'static str,
    /// Frames wait for a tick of this rate, Hz; `None` lets them run on.
    pub sync_hz: Option<f64>,
    /// The GPU waits twice within a frame.
    pub phases: bool,
    /// How far lengths and powers of draws wander, as a share.
    pub content: f64,
    /// The clock steps every 0.5 to 2.5 s, within frames, too.
    pub clocks: bool,
    /// The first frames draw more power.
    pub launch: bool,
    /// The operating system works for 90 ms every 2 s.
    pub disturbed: bool,
    /// Idle power rises by a third.
    pub drift: bool,
}

const PLAIN: Scenario = Scenario {
    name: "v-sync",
    sync_hz: Some(60.0),
    phases: false,
    content: 0.05,
    clocks: false,
    launch: false,
    disturbed: false,
    drift: false,
};

/// From easy to hard.
pub const SCENARIOS: [Scenario; 8] = [
    PLAIN,
    Scenario { name: "free-running", sync_hz: None, content: 0.15, ..PLAIN },
    Scenario { name: "three-phase", phases: true, sync_hz: Some(30.0), ..PLAIN },
    Scenario { name: "launch", launch: true, drift: true, ..PLAIN },
    Scenario { name: "disturbed", disturbed: true, ..PLAIN },
    Scenario { name: "content", sync_hz: None, content: 0.35, ..PLAIN },
    Scenario { name: "clock-steps", sync_hz: None, clocks: true, content: 0.15, ..PLAIN },
    Scenario {
        name: "all",
        sync_hz: None,
        clocks: true,
        content: 0.35,
        launch: true,
        disturbed: true,
        drift: true,
        ..PLAIN
    },
];
