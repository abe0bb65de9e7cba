//! A timeline for the Perfetto viewer (<https://ui.perfetto.dev>).
//!
//! One process; below it a track of frames and their passes, a track per unit with slices of busy time, and counter tracks of
//! power. Field numbers are those of Perfetto v59's `trace_packet.proto`, `track_descriptor.proto`,
//! `track_event.proto`, `counter_descriptor.proto`, `process_descriptor.proto` and `debug_annotation.proto`
//! (Apache-2.0, google/perfetto).
//!
//! Tracks are bounded for the viewer: a counter track has at most [`MAX_POINTS`] points, including the lowest
//! and the highest of each segment; a unit's track has at most [`MAX_SLICES`] slices.

mod protobuf;
mod slices;
mod thin;

use super::{TraceChunk, TraceReader, TraceWriter, WriteError, atomic};
use protobuf::Message;
use slices::tenth;
pub use slices::{BusySlice, slices_of_bins};
use std::io::{self, Write};
use std::path::Path;
pub use thin::{Thinner, decimate};

/// Largest number of points of a counter track.
pub const MAX_POINTS: usize = 20_000;

/// Largest number of slices of a unit's track.
pub const MAX_SLICES: usize = 10_000;

/// Contents of a timeline. Times are in ns from the start of the run.
#[derive(Clone, Debug, Default)]
pub struct Timeline<'a> {
    /// Name of the process, for example `quintile default on hd7970`.
    pub process: &'a str,
    /// Frames in order.
    pub frames: Vec<FrameSpan>,
    /// Units in the order of display.
    pub units: Vec<UnitTrack<'a>>,
    /// Counters in the order of display.
    pub counters: Vec<CounterTrack<'a>>,
}

/// A frame from its start to the start of the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameSpan {
    /// The number of the frame.
    pub frame: u64,
    /// Start.
    pub start_ns: u64,
    /// End of its work, not before `start_ns`.
    pub busy_end_ns: u64,
    /// Start of the next frame, not before `busy_end_ns`.
    pub end_ns: u64,
    /// Its passes in order, without overlap.
    pub passes: Vec<PassSpan>,
    /// Numbers shown with the frame, each with a name that carries its unit, for example `energy_mJ`.
    pub numbers: Vec<(&'static str, f64)>,
}

/// A pass of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PassSpan {
    /// Its name.
    pub name: String,
    /// Start, not before that of the frame.
    pub start_ns: u64,
    /// End of its work, not after that of the frame.
    pub end_ns: u64,
}

/// Track of a unit's busy time.
#[derive(Clone, Debug, Default)]
pub struct UnitTrack<'a> {
    /// The unit.
    pub name: &'a str,
    /// Description, one sentence.
    pub doc: &'a str,
    /// Slices in order, without overlap; see [`slices_of_bins`].
    pub slices: Vec<BusySlice>,
}

/// Track of a quantity over time; each value holds until the next.
#[derive(Clone, Debug, Default)]
pub struct CounterTrack<'a> {
    /// The quantity, for example `power, total`.
    pub name: &'a str,
    /// Its unit, for example `W`.
    pub unit: &'a str,
    /// Time in ns and value, in order of time.
    pub points: Vec<(u64, f64)>,
}

/// `TrackEvent.Type` of `track_event.proto`.
#[derive(Clone, Copy)]
enum EventType {
    SliceBegin = 1,
    SliceEnd = 2,
    Counter = 4,
}

/// Number of the writer of all packets; not 0.
const SEQUENCE_ID: u64 = 1;
/// `SequenceFlags.SEQ_INCREMENTAL_STATE_CLEARED` of `trace_packet.proto`.
const INCREMENTAL_STATE_CLEARED: u64 = 1;
/// `ChildTracksOrdering.EXPLICIT` of `track_descriptor.proto`: by `sibling_order_rank`.
const EXPLICIT_ORDER: u64 = 3;
/// Process number that the viewer requires.
const PROCESS_ID: u64 = 1;
/// Identifiers of tracks: distinct, and the same in every run.
const PROCESS_UUID: u64 = 0x5175_696e_7469_6c00;
const FRAMES_UUID: u64 = PROCESS_UUID + 1;
const UNITS_UUID: u64 = PROCESS_UUID + 0x1_0000;
const COUNTERS_UUID: u64 = PROCESS_UUID + 0x2_0000;

/// Writes the timeline to `out` in the format of `.perfetto-trace` files.
///
/// # Errors
/// Those of `out`.
pub fn write(timeline: &Timeline<'_>, out: &mut dyn Write) -> io::Result<()> {
    let mut trace = Trace { out };
    trace.process(timeline.process)?;
    trace.frames(&timeline.frames)?;
    for (index, unit) in timeline.units.iter().enumerate() {
        trace.unit(index as u64, unit)?;
    }
    for (index, counter) in timeline.counters.iter().enumerate() {
        trace.counter(index as u64, counter)?;
    }
    Ok(())
}

/// Writes the power of a trace as a counter track, thinned out to [`MAX_POINTS`] points. Times count from the first sample.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save(trace: &dyn TraceReader, path: &Path) -> Result<(), WriteError> {
    let header = trace.header();
    atomic::write_trace(path, |out| {
        let mut extremes = PowerExtremes(Thinner::new(header.samples, MAX_POINTS));
        trace.read_into(&mut extremes)?;
        let start_ns = header.time_ns(0);
        let point = |(index, watts)| ((header.time_ns(index) - start_ns).unsigned_abs(), watts);
        let points = extremes.0.kept().into_iter().map(point).collect();
        let counters = vec![CounterTrack { name: "power", unit: "W", points }];
        let timeline = Timeline { process: "trace", counters, ..Timeline::default() };
        write(&timeline, out).map_err(|error| WriteError::Encode(error.to_string()))
    })
}

/// Extremes of the power of a trace.
struct PowerExtremes(Thinner);

impl TraceWriter for PowerExtremes {
    fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError> {
        chunk.powers_w().for_each(|watts| self.0.push(watts));
        Ok(())
    }
}

struct Trace<'a> {
    out: &'a mut dyn Write,
}

impl Trace<'_> {
    /// A packet is field 1 of the trace; the sequence is field 10 of the packet.
    fn packet(&mut self, packet: Message) -> io::Result<()> {
        let packet = packet.uint(10, SEQUENCE_ID);
        self.out.write_all(Message::new().message(1, &packet).bytes())
    }

    /// `TracePacket.track_descriptor` = 60.
    fn track(&mut self, descriptor: &Message) -> io::Result<()> {
        self.packet(Message::new().message(60, descriptor))
    }

    /// `TracePacket`: `timestamp` = 8, `track_event` = 11.
    fn event(&mut self, time_ns: u64, event: &Message) -> io::Result<()> {
        self.packet(Message::new().uint(8, time_ns).message(11, event))
    }

    fn slice(&mut self, uuid: u64, name: &str, span: (u64, u64), numbers: &[(&str, f64)]) -> io::Result<()> {
        self.begin(uuid, name, span.0, numbers)?;
        self.end(uuid, span.1)
    }

    /// `TrackEvent`: `debug_annotations` = 4 with `name` = 10 and `double_value` = 5, `name` = 23.
    fn begin(&mut self, uuid: u64, name: &str, time_ns: u64, numbers: &[(&str, f64)]) -> io::Result<()> {
        let mut event = track_event(EventType::SliceBegin, uuid).string(23, name);
        for (name, value) in numbers {
            event = event.message(4, &Message::new().double(5, *value).string(10, name));
        }
        self.event(time_ns, &event)
    }

    fn end(&mut self, uuid: u64, time_ns: u64) -> io::Result<()> {
        self.event(time_ns, &track_event(EventType::SliceEnd, uuid))
    }

    /// `TracePacket.sequence_flags` = 13, `TrackDescriptor.process` = 3 with `pid` = 1 and `process_name` = 6,
    /// `TrackDescriptor.child_ordering` = 11.
    fn process(&mut self, name: &str) -> io::Result<()> {
        let process = Message::new().uint(1, PROCESS_ID).string(6, name);
        let descriptor = Message::new().uint(1, PROCESS_UUID).message(3, &process).uint(11, EXPLICIT_ORDER);
        self.packet(Message::new().uint(13, INCREMENTAL_STATE_CLEARED).message(60, &descriptor))
    }

    fn frames(&mut self, frames: &[FrameSpan]) -> io::Result<()> {
        self.track(&child_track(FRAMES_UUID, "frames", 0))?;
        for frame in frames {
            self.begin(FRAMES_UUID, &format!("frame {}", frame.frame), frame.start_ns, &frame.numbers)?;
            self.begin(FRAMES_UUID, "busy", frame.start_ns, &[])?;
            for pass in &frame.passes {
                self.slice(FRAMES_UUID, &pass.name, (pass.start_ns, pass.end_ns), &[])?;
            }
            self.end(FRAMES_UUID, frame.busy_end_ns)?;
            if frame.end_ns > frame.busy_end_ns {
                self.slice(FRAMES_UUID, "idle", (frame.busy_end_ns, frame.end_ns), &[])?;
            }
            self.end(FRAMES_UUID, frame.end_ns)?;
        }
        Ok(())
    }

    /// `TrackDescriptor.description` = 14. Slices are named by tenths of utilisation, which gives them their colour.
    fn unit(&mut self, index: u64, unit: &UnitTrack<'_>) -> io::Result<()> {
        let uuid = UNITS_UUID + index;
        self.track(&child_track(uuid, unit.name, 1000 + index).string(14, unit.doc))?;
        for slice in &unit.slices {
            let name = format!("{} %", tenth(slice.utilisation) * 10);
            let span = (slice.start_ns, slice.end_ns);
            self.slice(uuid, &name, span, &[("utilisation", slice.utilisation)])?;
        }
        Ok(())
    }

    /// `TrackDescriptor.counter` = 8 with `unit_name` = 6, `TrackEvent.double_counter_value` = 44.
    fn counter(&mut self, index: u64, counter: &CounterTrack<'_>) -> io::Result<()> {
        let uuid = COUNTERS_UUID + index;
        let unit = Message::new().string(6, counter.unit);
        self.track(&child_track(uuid, counter.name, 100 + index).message(8, &unit))?;
        for (time_ns, value) in decimate(&counter.points, MAX_POINTS) {
            self.event(time_ns, &track_event(EventType::Counter, uuid).double(44, value))?;
        }
        Ok(())
    }
}

/// `TrackEvent`: `type` = 9, `track_uuid` = 11.
fn track_event(kind: EventType, uuid: u64) -> Message {
    Message::new().uint(9, kind as u64).uint(11, uuid)
}

/// `TrackDescriptor`: `uuid` = 1, `name` = 2, `parent_uuid` = 5, `sibling_order_rank` = 12.
fn child_track(uuid: u64, name: &str, rank: u64) -> Message {
    Message::new().uint(1, uuid).string(2, name).uint(5, PROCESS_UUID).uint(12, rank)
}
