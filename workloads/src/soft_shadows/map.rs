//! The shadow map: for each texel and each `(u, v, t)` of the set the depth of what the light sees.

use activity::Counts;
use glam::Vec3;
use pipeline::sampling::Sample;
use pipeline::{Draw, PipelineSpec, Viewport};

use super::light::AreaLight;
use super::sees::{Method, see};
use crate::accumulation::SharedSamples;
use crate::job::{Emit, JobError};

/// An array of shadow maps, one for each place on the light and in time.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowMap {
    side: u32,
    set: SharedSamples,
    /// In the order `(y side + x) n + index`, infinite where nothing is seen.
    depths: Vec<f32>,
    /// What it took to make.
    pub counts: Counts,
    /// Triangles drawn for it, in all passes.
    pub triangles: usize,
}

impl ShadowMap {
    /// The map of `side` texels squared of a light, all texels looking through their middles at the places of `set`.
    ///
    /// # Errors
    /// When the hardware cannot be built, or `side` is odd: a ray through the middle of the map has no slope that would hide what is
    /// left of a focus at infinity.
    pub fn new(
        (light, draws): (&AreaLight, &[Draw<'_>]),
        side: u32,
        set: &SharedSamples,
        (method, spec): (Method, &PipelineSpec),
        emit: Emit<'_>,
    ) -> Result<Self, JobError> {
        let viewport = Viewport::new(side, side).filter(|_| side.is_multiple_of(2));
        let refused =
            || JobError::Setting(format!("map_px {side}: a shadow map has an even number of texels"));
        let viewport = viewport.ok_or_else(refused)?;
        let set = set.centred();
        let seen = see((light.camera(), draws), viewport, &set, (method, spec), emit)?;
        let depths = seen.samples.into_iter().map(|(_, depth)| f32::from_bits(depth)).collect();
        Ok(Self { side, set, depths, counts: seen.counts, triangles: seen.triangles })
    }

    /// Texels across and down.
    pub fn side(&self) -> u32 {
        self.side
    }

    /// The places on the light and in time.
    pub fn set(&self) -> &[Sample] {
        self.set.samples()
    }

    /// All depths, for comparing maps.
    pub fn depths(&self) -> &[f32] {
        &self.depths
    }

    /// Bytes of the map.
    pub fn bytes(&self) -> u64 {
        4 * self.depths.len() as u64
    }

    /// The place in [`Self::depths`] that decides about a point at place `index` of the set, and its depth; nothing beyond the map.
    pub fn place(&self, light: &AreaLight, point: Vec3, index: usize) -> Option<(usize, f64)> {
        let Sample { u, v, .. } = self.set.samples()[index];
        let ([x, y], depth) = light.texel(point, [u, v], self.side)?;
        let texel = y as usize * self.side as usize + x as usize;
        Some((texel * self.set.samples().len() + index, depth))
    }

    /// Whether a point is lit at place `index` of the set: nothing is seen nearer than it by more than `bias` scene units.
    pub fn is_lit(&self, light: &AreaLight, point: Vec3, index: usize, bias: f64) -> bool {
        self.place(light, point, index).is_none_or(|(at, depth)| depth - bias <= f64::from(self.depths[at]))
    }
}
