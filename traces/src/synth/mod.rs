//! Power curves with known frames, for measuring how well frames are found.
//!
//! A model made for that purpose, of no one GPU. A frame is a front end, a clear, and draws that each have a length and a power;
//! a [`Scenario`] says what makes finding its frames hard: free running or V-sync, idle gaps within the frame, changing content,
//! clock steps, a launch transient, disturbances, drifting idle power. [`Scenario::scene`] draws it, and [`Recording`] says what a
//! recorder of some rate, resolution and noise makes of that. All numbers that vary are functions of (seed, what, frame, draw), so
//! a longer scene begins like a shorter one.

mod maker;
mod recording;
mod scenario;
mod scene;

pub use recording::{Recording, SynthError};
pub use scenario::{SCENARIOS, Scenario};
pub use scene::Scene;

#[cfg(test)]
mod tests;
