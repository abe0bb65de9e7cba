//! Front end: draws, vertex fetch, vertex shading and set-up of one batch.

use std::ops::Range;

use activity::{Event, LineAccess, Packet, PacketKind};
use rayon::prelude::*;

use super::Features;
use super::pass::{Draw, Pass, Staged};
use super::replay::Replay;
use crate::setup::{PixelRect, SetupResult, Triangle, bounds, is_flat, set_up_counted};
use crate::traversal::{self, Box5, LensLines, thresholds};

/// A triangle for traversal, with the pixels it may touch.
pub(super) struct Ready {
    pub triangle: Triangle,
    pub pixels: PixelRect,
    /// Part of lens and shutter between the clip planes; says whether the lens shears the triangle.
    pub within: Box5,
    /// Range of image coordinates between the clip planes, if there are any.
    pub image: Option<[[f32; 2]; 2]>,
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
    replay.begin_batch();
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
    outcomes.into_iter().filter_map(|outcome| outcome.ready).collect()
}

/// Result of set-up.
struct Outcome {
    event: Event,
    /// Multiply-adds of set-up.
    madds: u32,
    /// The triangle if it is kept.
    ready: Option<Ready>,
}

fn outcome(pass: &Pass<'_>, id: u32) -> Outcome {
    let viewport = pass.settings.viewport;
    let Draw { geometry, state, .. } = &pass.draws[pass.locate(id).0];
    let (Staged { vertices, lens }, near) = (pass.staged(id), pass.projection.near);
    let shear = pass.projection.shear;
    let shear = if lens { shear } else { shear.sharp() };
    let within = Box5::whole(lens).clipped(&pass.clip).clipped(&geometry.clip());
    if within.is_empty() {
        return Outcome { event: Event::TrianglesOutside, madds: 0, ready: None };
    }
    let (result, madds) =
        set_up_counted(id, vertices.each_ref(), state.cull, &shear, near, viewport.half_px());
    let dropped = |event| Outcome { event, madds, ready: None };
    let triangle = match result {
        SetupResult::Degenerate => return dropped(Event::TrianglesDegenerate),
        SetupResult::Outside => return dropped(Event::TrianglesOutside),
        SetupResult::FaceCulled => return dropped(Event::TrianglesFaceCulled),
        SetupResult::Ready(triangle) => triangle,
    };
    let mut pixels = bounds(&triangle, &shear, viewport);
    let both =
        |a: [[f32; 2]; 2], b: [[f32; 2]; 2]| [0, 1].map(|k| [a[k][0].max(b[k][0]), a[k][1].min(b[k][1])]);
    let image = [pass.clip, geometry.clip()].iter().filter_map(|clip| clip.in_image(viewport)).reduce(both);
    if let Some(image) = image {
        pixels = pixels.intersection(&PixelRect::around(image, viewport));
    }
    if pixels.is_empty() {
        return dropped(Event::TrianglesOutside);
    }
    let wanted = lens && pass.settings.spec.features.lens_lines;
    let lines = wanted.then(|| LensLines::new(&triangle, &shear, near));
    let ready = Some(Ready { triangle, pixels, within, image, lines });
    Outcome { event: Event::TrianglesSetUp, madds, ready }
}

fn emit_packet(
    pass: &Pass<'_>,
    mut packet: Packet,
    outcomes: &[Outcome],
    replay: &mut Replay<'_>,
    emit: &mut impl FnMut(&Packet, &[LineAccess]),
) {
    let draw = packet.draw as usize;
    let Features { still_px, in_focus_px, .. } = pass.settings.spec.features;
    let thresholds = if still_px > 0.0 { thresholds::motion_madds(pass.lens) } else { 0 }
        + if in_focus_px > 0.0 && pass.lens { thresholds::BLUR_MADDS } else { 0 };
    for (Outcome { event, madds, ready }, id) in outcomes.iter().zip(packet.triangle..) {
        let corners = pass.images(id);
        packet.counts[*event] += 1;
        packet.counts[Event::TrianglesFlat] +=
            u32::from(*event != Event::TrianglesDegenerate && is_flat(corners));
        packet.counts[Event::TrianglesIn] += 1;
        packet.counts[Event::Indices] += 3;
        packet.counts[Event::SetupMadds] += madds + thresholds + ready.as_ref().map_or(0, Ready::line_madds);
        replay.vertices(draw, id, &mut packet.counts);
        if let Some(Ready { triangle, pixels, .. }) = ready {
            replay.set_up(triangle, pixels, &mut packet.counts);
        }
    }
    replay.emit(&packet, emit);
}
