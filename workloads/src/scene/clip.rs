//! Animation clips: named bundles of tracks of which one at a time plays.

use super::node::{Channels, Local, Node};
use super::track::Track;
use crate::error::LoadError;

/// What a track of a clip drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Property {
    /// Translation of a node.
    Translation,
    /// Rotation of a node.
    Rotation,
    /// Scale of a node.
    Scale,
    /// Weights of the morph targets of the node's mesh.
    Weights,
}

/// Tracks that play together, over and over.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// Name; `clip 0` and so on where the file gives none.
    pub name: String,
    /// Time of the last key of any track in seconds; the clip starts over there.
    pub duration_s: f64,
    /// Node, property and track.
    pub tracks: Vec<(usize, Property, Track)>,
}

/// Index of the clip called `wanted`, or with that number.
pub(crate) fn find(clips: &[Clip], wanted: &str) -> Result<usize, LoadError> {
    let by_name = clips.iter().position(|clip| clip.name == wanted);
    let by_number = || wanted.parse().ok().filter(|index: &usize| *index < clips.len());
    by_name.or_else(by_number).ok_or_else(|| {
        let names: Vec<&str> = clips.iter().map(|clip| clip.name.as_str()).collect();
        let known = if names.is_empty() {
            "the scene has no animation clips; leave it out".to_owned()
        } else {
            activity::spec::suggestion(wanted, &names)
        };
        LoadError::Setting { setting: "clip", message: format!("there is no clip `{wanted}`: {known}") }
    })
}

/// Makes `clip` the one that drives the nodes.
pub(crate) fn play(nodes: &mut [Node], clip: &Clip) {
    nodes.iter_mut().for_each(|node| node.channels = Channels::default());
    for (node, property, track) in &clip.tracks {
        let Some(node) = nodes.get_mut(*node) else { continue };
        let track = Some(track.clone().looping(clip.duration_s));
        let fixed = matches!(node.local, Local::Matrix(_));
        match property {
            Property::Weights => node.channels.weights = track,
            _ if fixed => {}
            Property::Translation => node.channels.translation = track,
            Property::Rotation => node.channels.rotation = track,
            Property::Scale => node.channels.scale = track,
        }
    }
}
