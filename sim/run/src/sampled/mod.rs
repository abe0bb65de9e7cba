//! Long animations: a preview of every frame, a few simulated whole, the others predicted.
//!
//! ```text
//! Preview -> Glimpse of every frame -> a pilot simulated -> Signatures -> Design -> representatives simulated -> Forecast
//! ```
//!
//! The mathematics is in [`timing::sampled`].

mod forecast;
mod frames;
mod preview;
mod signature;
mod summary;

use std::collections::{BTreeMap, BTreeSet};

use pipeline::random::mix;
use rayon::prelude::*;
use timing::sampled::Design;

use super::frame::{Stage, Whole};
use super::{Plan, RunError, RunFrame, Simulated, Taken};
use output::progress::Progress;

pub use forecast::Forecast;
pub use preview::{Glimpse, Preview};
pub use signature::Signatures;

/// Every frame at a glance, and one of them whole.
pub struct Scout {
    /// The preview they were seen at.
    pub preview: Preview,
    /// The frames at a glance.
    pub glimpses: Vec<Glimpse>,
    /// The place of the frame that previews are scaled by.
    pub pilot: usize,
}

impl Scout {
    /// Previews the frames called `numbers`.
    pub fn look(plan: &Plan, numbers: &[u32], progress: &Progress) -> Result<Self, RunError> {
        let preview = Preview::new(plan)?;
        let bar = progress.bar("previews", numbers.len() as u64);
        let glimpse = |&number: &u32| {
            bar.inc();
            preview.frame(plan, number)
        };
        let glimpses: Vec<Glimpse> = numbers.par_iter().map(glimpse).collect::<Result<_, _>>()?;
        let pilot = signature::median(&glimpses);
        Ok(Self { preview, glimpses, pilot })
    }

    /// The same previews for a run in which frame `place` is drawn as the frame at `groups[place]` of those previewed.
    fn spread(self, groups: &[usize]) -> Self {
        let glimpses: Vec<Glimpse> = groups.iter().map(|&group| self.glimpses[group]).collect();
        Self { pilot: signature::median(&glimpses), glimpses, ..self }
    }

    /// Chooses `count` frames, the pilot among them.
    pub fn design(&self, signatures: &Signatures, count: usize, seed: u64) -> Design {
        let word = |frame: u64| mix(mix(seed.wrapping_add(0x73A3_7D1E)) ^ frame);
        Design::draw(&signatures.cycles, Some(self.pilot), count, word)
    }
}

/// Simulates as many frames as the plan asks for and predicts the others.
pub(super) fn simulate(stage: &Stage<'_>, progress: &Progress) -> Result<Simulated, RunError> {
    let (plan, groups) = (stage.plan, stage.distinct.groups());
    let scout = Scout::look(plan, stage.distinct.numbers(), progress)?.spread(groups);
    let pilot = groups[scout.pilot];
    let mut whole = BTreeMap::from([(pilot, stage.whole(pilot, true)?)]);
    let signatures = Signatures::new(&scout.glimpses, scout.pilot, &whole[&pilot].frame, &plan.model);
    let mut count = plan.options.sampling.first(groups.len());
    let forecast = loop {
        let design = scout.design(&signatures, count, plan.options.seed);
        represent(stage, &design, &mut whole, progress)?;
        let forecast = Forecast::new(design, &signatures, |place| taken(&whole[&groups[place]].frame));
        match plan.options.sampling.next(count, groups.len(), forecast.relative()) {
            Some(more) => count = more,
            None => break forecast,
        }
    };
    Ok(frames::all(plan, stage.distinct, &scout, &forecast, whole))
}

/// What a frame took, as estimates have it.
pub fn taken(frame: &RunFrame) -> Taken {
    Taken { cycles: frame.cycles as f64, energy_j: frame.power.energy().total_j() }
}

/// Simulates the groups of the chosen frames that are not yet known. Pictures are kept of the first and the last of the first
/// ones.
fn represent(
    stage: &Stage<'_>,
    design: &Design,
    whole: &mut BTreeMap<usize, Whole>,
    progress: &Progress,
) -> Result<(), RunError> {
    let chosen: BTreeSet<usize> =
        design.chosen().into_iter().map(|place| stage.distinct.groups()[place]).collect();
    let ends = if whole.len() == 1 { [chosen.first(), chosen.last()] } else { [None; 2] };
    let missing: Vec<usize> = chosen.iter().copied().filter(|group| !whole.contains_key(group)).collect();
    let bar = progress.bar("frames", missing.len() as u64);
    let simulate = |&group: &usize| {
        let done = stage.whole(group, ends.contains(&Some(&group)))?;
        bar.inc();
        Ok((group, done))
    };
    whole.extend(missing.par_iter().map(simulate).collect::<Result<Vec<_>, RunError>>()?);
    Ok(())
}
