//! The front end: draws, vertex fetch, vertex shading and set-up of one batch.

use std::ops::Range;

use activity::{Event, Packet, PacketKind};
use rayon::prelude::*;

use super::pass::Pass;
use super::replay::Replay;
use crate::setup::{Outcome, PixelRect, Triangle, bounds, is_flat, madds, set_up};

/// A triangle that traversal has to visit, with the pixels it may touch.
pub(super) struct Ready {
    pub triangle: Triangle,
    pub pixels: PixelRect,
}

/// Triangles whose vertices travel in one packet.
const PACKET_TRIANGLES: u32 = 32;

/// Sets up the triangles of a batch and emits the packets of their vertices.
pub(super) fn front_end(
    pass: &Pass<'_>,
    batch: Range<u32>,
    replay: &mut Replay<'_>,
    emit: &mut impl FnMut(&Packet),
) -> Vec<Ready> {
    let outcomes: Vec<_> =
        batch.clone().into_par_iter().with_min_len(256).map(|id| outcome(pass, id)).collect();
    for chunk in outcomes.chunks(PACKET_TRIANGLES as usize).zip(0..) {
        let first = batch.start + chunk.1 * PACKET_TRIANGLES;
        emit_packet(pass, first, chunk.0, replay, emit);
    }
    outcomes.into_iter().filter_map(|(_, ready)| ready).collect()
}

/// What became of a triangle as an event, and what goes on.
fn outcome(pass: &Pass<'_>, id: u32) -> (Event, Option<Ready>) {
    let viewport = pass.settings.viewport;
    let cull = pass.draws[pass.locate(id).0].cull;
    let half_px = [viewport.width(), viewport.height()].map(|side| 0.5 * side as f32);
    let shear = &pass.projection.shear;
    match set_up(id, pass.images(id), cull, shear, pass.projection.near, half_px) {
        Outcome::Degenerate => (Event::TrianglesDegenerate, None),
        Outcome::Outside => (Event::TrianglesOutside, None),
        Outcome::FaceCulled => (Event::TrianglesFaceCulled, None),
        Outcome::Ready(triangle) => {
            let pixels = bounds(&triangle, shear, viewport);
            if pixels.is_empty() {
                (Event::TrianglesOutside, None)
            } else {
                (Event::TrianglesSetUp, Some(Ready { triangle, pixels }))
            }
        }
    }
}

fn emit_packet(
    pass: &Pass<'_>,
    first: u32,
    outcomes: &[(Event, Option<Ready>)],
    replay: &mut Replay<'_>,
    emit: &mut impl FnMut(&Packet),
) {
    let mut packet = super::packet(PacketKind::Vertices, 0, first);
    for ((event, _), id) in outcomes.iter().zip(first..) {
        let (draw, place) = pass.locate(id);
        if place == 0 {
            let mut start = super::packet(PacketKind::Draw, 0, id);
            start.counts[Event::Draws] = 1;
            emit(&start);
        }
        let corners = pass.images(id);
        packet.counts[*event] += 1;
        packet.counts[Event::TrianglesFlat] +=
            u32::from(*event != Event::TrianglesDegenerate && is_flat(corners));
        packet.counts[Event::TrianglesIn] += 1;
        packet.counts[Event::Indices] += 3;
        packet.counts[Event::SetupMadds] +=
            madds(corners.iter().any(|v| !v.is_still()), pass.draws[draw].cull);
        replay.vertices(draw, id, &mut packet.counts);
    }
    emit(&packet);
}
