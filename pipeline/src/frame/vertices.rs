//! Front end: draws, vertex fetch, vertex shading and set-up of one batch.

use std::ops::Range;

use activity::{Event, LineAccess, Packet, PacketKind};
use rayon::prelude::*;

use super::Features;
use super::pass::{Draw, Pass, Staged};
use super::replay::Replay;
use crate::setup::{PixelRect, SetupResult, Triangle, bounds, is_flat, madds, set_up};
use crate::traversal::{self, Box5, LensLines, thresholds};

/// A triangle for traversal, with the pixels it may touch.
pub(super) struct Ready {
    pub triangle: Triangle,
    pub pixels: PixelRect,
    /// Part of lens and shutter between the clip planes; says whether the lens shears the triangle.
    pub within: Box5,
    /// Bounds over lens and image, if enabled.
    pub lines: Option<LensLines>,
}

impl Ready {
    fn line_madds(&self) -> u32 {
        if self.lines.is_some() { traversal::lens_line_setup_madds(self.triangle.moving) } else { 0 }
    }
}

/// Triangles per packet of vertices.
const PACKET_TRIANGLES: u32 = 32;

/// Set up the triangles of a batch and emit the packets of their vertices.
pub(super) fn front_end(
    pass: &Pass<'_>,
    batch: Range<u32>,
    replay: &mut Replay<'_>,
    emit: &mut impl FnMut(&Packet, &[LineAccess]),
) -> Vec<Ready> {
    let outcomes: Vec<_> =
        batch.clone().into_par_iter().with_min_len(256).map(|id| outcome(pass, id)).collect();
    let new = |kind| Packet {
        batch: batch.start / pass.settings.spec.batch_triangles,
        ..Packet::new(kind, pass.number)
    };
    let mut first = batch.start;
    while first < batch.end {
        let (draw, index) = pass.locate(first);
        if index == 0 {
            let mut start = Packet { draw: draw as u32, triangle: first, ..new(PacketKind::Draw) };
            start.counts[Event::Draws] = 1;
            emit(&start, &[]);
        }
        let end = batch.end.min(first + PACKET_TRIANGLES).min(pass.triangles_of(draw).end);
        let at = |id: u32| (id - batch.start) as usize;
        let vertices = Packet { draw: draw as u32, triangle: first, ..new(PacketKind::Vertices) };
        emit_packet(pass, vertices, &outcomes[at(first)..at(end)], replay, emit);
        first = end;
    }
    outcomes.into_iter().filter_map(|(_, ready)| ready).collect()
}

/// Result of a triangle as an event, and the triangle if it is kept.
fn outcome(pass: &Pass<'_>, id: u32) -> (Event, Option<Ready>) {
    let viewport = pass.settings.viewport;
    let Draw { geometry, state, .. } = &pass.draws[pass.locate(id).0];
    let (Staged { vertices, lens }, near) = (pass.staged(id), pass.projection.near);
    let shear = pass.projection.shear;
    let shear = if lens { shear } else { shear.sharp() };
    let within = Box5::whole(lens).clipped(&pass.clip).clipped(&geometry.clip());
    if within.is_empty() {
        return (Event::TrianglesOutside, None);
    }
    match set_up(id, vertices.each_ref(), state.cull, &shear, near, viewport.half_px()) {
        SetupResult::Degenerate => (Event::TrianglesDegenerate, None),
        SetupResult::Outside => (Event::TrianglesOutside, None),
        SetupResult::FaceCulled => (Event::TrianglesFaceCulled, None),
        SetupResult::Ready(triangle) => {
            let pixels = bounds(&triangle, &shear, viewport);
            let wanted = lens && pass.settings.spec.features.lens_lines;
            let lines = wanted.then(|| LensLines::new(&triangle, &shear, near));
            if pixels.is_empty() {
                (Event::TrianglesOutside, None)
            } else {
                (Event::TrianglesSetUp, Some(Ready { triangle, pixels, within, lines }))
            }
        }
    }
}

fn emit_packet(
    pass: &Pass<'_>,
    mut packet: Packet,
    outcomes: &[(Event, Option<Ready>)],
    replay: &mut Replay<'_>,
    emit: &mut impl FnMut(&Packet, &[LineAccess]),
) {
    let draw = packet.draw as usize;
    let Features { still_px, in_focus_px, .. } = pass.settings.spec.features;
    for ((event, ready), id) in outcomes.iter().zip(packet.triangle..) {
        let corners = pass.images(id);
        packet.counts[*event] += 1;
        packet.counts[Event::TrianglesFlat] +=
            u32::from(*event != Event::TrianglesDegenerate && is_flat(corners));
        packet.counts[Event::TrianglesIn] += 1;
        packet.counts[Event::Indices] += 3;
        packet.counts[Event::SetupMadds] +=
            madds(corners.iter().any(|v| !v.is_still()), pass.draws[draw].state.cull);
        packet.counts[Event::SetupMadds] += if still_px > 0.0 { thresholds::MOTION_MADDS } else { 0 }
            + if in_focus_px > 0.0 { thresholds::BLUR_MADDS } else { 0 }
            + ready.as_ref().map_or(0, Ready::line_madds);
        replay.vertices(draw, id, &mut packet.counts);
    }
    replay.emit(&packet, emit);
}
