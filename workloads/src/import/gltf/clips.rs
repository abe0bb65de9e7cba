//! Animation clips and skins.

use glam::{DAffine3, DMat3, DVec3};
use gltf::json::accessor::Type;
use gltf::json::animation::{
    Animation, Channel, Interpolation as JsonInterpolation, Property as JsonProperty,
};
use gltf::json::validation::Checked;

use super::document::Document;
use super::nodes::Tree;
use crate::error::LoadError;
use crate::scene::{Clip, Interpolation, Property, Skin, Track};

pub(super) fn clips(document: &Document, tree: &Tree) -> Result<Vec<Clip>, LoadError> {
    let mut clips = Vec::new();
    for (index, animation) in document.root.animations.iter().enumerate() {
        let mut tracks = Vec::new();
        for number in 0..animation.channels.len() {
            tracks.push(channel(document, tree, [index, number], animation)?);
        }
        let duration_s = tracks.iter().map(|(.., track)| track.end_s()).fold(0.0, f64::max);
        let name = animation.name.clone().unwrap_or_else(|| format!("clip {index}"));
        clips.push(Clip { name, duration_s, tracks });
    }
    Ok(clips)
}

fn channel(
    document: &Document,
    tree: &Tree,
    [clip, number]: [usize; 2],
    animation: &Animation,
) -> Result<(usize, Property, Track), LoadError> {
    let place = format!("animations[{clip}].channels[{number}]");
    let fail = |message: &str| document.source.broken(place.clone(), format!("{message}: export it again"));
    let channel: &Channel = &animation.channels[number];
    let node = *tree.place.get(channel.target.node.value()).ok_or_else(|| fail("there is no such node"))?;
    let sampler =
        animation.samplers.get(channel.sampler.value()).ok_or_else(|| fail("there is no such sampler"))?;
    let Checked::Valid(path) = channel.target.path else { return Err(fail("it drives an unknown property")) };
    let (property, kind) = match path {
        JsonProperty::Translation => (Property::Translation, Type::Vec3),
        JsonProperty::Rotation => (Property::Rotation, Type::Vec4),
        JsonProperty::Scale => (Property::Scale, Type::Vec3),
        JsonProperty::MorphTargetWeights => (Property::Weights, Type::Scalar),
    };
    let interpolation = match sampler.interpolation {
        Checked::Valid(JsonInterpolation::Step) => Interpolation::Step,
        Checked::Valid(JsonInterpolation::CubicSpline) => Interpolation::CubicSpline,
        Checked::Valid(JsonInterpolation::Linear) => Interpolation::Linear,
        Checked::Invalid => return Err(fail("its interpolation is not known")),
    };
    let times = document.values(sampler.input.value(), &[Type::Scalar], &format!("{place} input"))?;
    let values = document.values(sampler.output.value(), &[kind], &format!("{place} output"))?;
    let parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let width = match property {
        // One weight for each target and key, in one long list.
        Property::Weights => values.numbers.len() / (times.count() * parts).max(1),
        _ => values.width,
    };
    let track =
        Track::new(times.numbers, values.numbers, width, interpolation).map_err(|what| fail(&what))?;
    Ok((node, property, track))
}

pub(super) fn skins(document: &Document, tree: &Tree) -> Result<Vec<Skin>, LoadError> {
    let mut skins = Vec::new();
    for (index, skin) in document.root.skins.iter().enumerate() {
        let place = format!("skins[{index}]");
        let fail =
            |message: String| document.source.broken(place.clone(), format!("{message}: export it again"));
        let joints: Vec<usize> = skin.joints.iter().map(|joint| tree.place[joint.value()]).collect();
        let inverse_bind = match skin.inverse_bind_matrices {
            Some(accessor) => {
                let values = document.values(
                    accessor.value(),
                    &[Type::Mat4],
                    &format!("{place} inverse bind matrices"),
                )?;
                values.elements().map(affine).collect()
            }
            None => vec![DAffine3::IDENTITY; joints.len()],
        };
        if inverse_bind.len() < joints.len() {
            return Err(fail(format!(
                "{} inverse bind matrices for {} joints",
                inverse_bind.len(),
                joints.len()
            )));
        }
        if let Some(bad) = inverse_bind.iter().position(|matrix| !matrix.is_finite()) {
            return Err(fail(format!("inverse bind matrix {bad} has a value that is NaN or infinite")));
        }
        skins.push(Skin { joints, inverse_bind });
    }
    Ok(skins)
}

/// A column-major 4x4 matrix whose last row is known to be 0, 0, 0, 1 (glTF 2.0, 3.7.3.1).
fn affine(columns: &[f64]) -> DAffine3 {
    let number = |at: usize| columns.get(at).copied().unwrap_or(0.0);
    let column = |at: usize| DVec3::new(number(4 * at), number(4 * at + 1), number(4 * at + 2));
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
}
