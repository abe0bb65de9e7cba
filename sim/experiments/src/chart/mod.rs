//! Charts of the book, one module for each; each is a [`Study`](crate::study::Study).
//!
//! - [`anchors`]: rates beside those that others measured on parts.
//! - [`caustics`]: shader executions of caustics, by how beams are bounded.
//! - [`ccd`]: false positives of collision detection.
//! - [`compute`]: cost of programs of groups, by group size, layout and contention.
//! - [`deferred`]: deferred against forward rendering over lights, overdraw, formats and samples.
//! - [`frames`]: how well frame starts are found, by method, over rate, noise, resolution and host time.
//! - [`glossy`]: glossy reflection and refraction against brute force and accumulation.
//! - [`growth`]: time of the visibility engine over triangles, samples and blur.
//! - [`memory`]: traffic and energy over the size of the levels below the L2.
//! - [`multiview`]: stereo and multi-view in one pass against view by view and accumulation.
//! - [`occlusion`]: what occlusion queries find, and what they cost.
//! - [`points`]: quality of points over points a second.
//! - [`sampled`]: frames predicted from few against all of them.
//! - [`sampling`]: image error over samples per pixel and over host time.
//! - [`soft_shadows`]: soft shadows in one pass against accumulation buffering.
//! - [`stated_errors`]: errors of timing levels on GPUs drawn at random, and how often the stated ones hold.
//! - [`tile_tests`]: what each combination of tile tests gains over what it costs.
//! - [`timing`]: every level of timing against the reference.
//! - [`statistics`]: power laws, quantiles, errors of images.

pub mod anchors;
pub mod caustics;
pub mod ccd;
pub mod compute;
pub mod deferred;
pub mod frames;
pub mod glossy;
pub mod growth;
pub mod memory;
pub mod multiview;
pub mod occlusion;
pub mod points;
pub mod sampled;
pub mod sampling;
pub mod soft_shadows;
pub mod stated_errors;
pub mod statistics;
pub mod tile_tests;
pub mod timing;

#[cfg(test)]
mod tests {
    #[test]
    fn costs_of_other_work_over_another_reference_are_not_in_one_panel() {
        assert_ne!(super::timing::HOST_TIME, super::sampled::HOST_TIME);
    }
}
