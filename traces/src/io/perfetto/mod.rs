//! A timeline for the Perfetto viewer (<https://ui.perfetto.dev>).
//!
//! One process; below it a track of frames, their passes and draws, a track per unit with slices of busy
//! time, and counter tracks of power. Field numbers are those of Perfetto v59's `trace_packet.proto`,
//! `track_descriptor.proto`, `track_event.proto`, `counter_descriptor.proto`, `process_descriptor.proto` and
//! `debug_annotation.proto` (Apache-2.0, google/perfetto).
//!
//! Tracks are bounded for the viewer: a counter track has at most [`MAX_POINTS`] points, including the lowest
//! and the highest of each segment; a unit's track has at most [`MAX_SLICES`] slices.

mod protobuf;

use std::io::{self, Write};
use std::path::Path;

use super::{TraceChunk, TraceReader, TraceWriter, WriteError, atomic};
use protobuf::Message;

/// Largest number of points of a counter track.
pub const MAX_POINTS: usize = 20_000;

/// Largest number of slices of a unit's track.
pub const MAX_SLICES: usize = 10_000;

/// Contents of a timeline. Times are in ns from the start of the run.
#[derive(Clone, Debug, Default)]
pub struct PerfettoTimeline<'a> {
    /// Name of the process, for example `quintile default on hd7970`.
    pub process: &'a str,
    /// Frames in order.
    pub frames: Vec<FrameSlice>,
    /// Units in the order of display.
    pub units: Vec<UnitTrack<'a>>,
    /// Counters in the order of display.
    pub counters: Vec<CounterTrack<'a>>,
}

/// A frame from its start to the start of the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameSlice {
    /// The number of the frame.
    pub frame: u64,
    /// Start.
    pub start_ns: u64,
    /// End of its work, not before `start_ns`.
    pub busy_end_ns: u64,
    /// Start of the next frame, not before `busy_end_ns`.
    pub end_ns: u64,
    /// Passes of the frame in order, without overlap.
    pub passes: Vec<PassSpan>,
    /// Numbers shown with the frame, each with a name that carries its unit, for example `energy_mJ`.
    pub numbers: Vec<(&'static str, f64)>,
}

/// A pass of a frame, or a part of a pass.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PassSpan {
    /// Name of the pass.
    pub name: String,
    /// Start, not before that of the frame.
    pub start_ns: u64,
    /// End of its work, not after that of the frame.
    pub end_ns: u64,
    /// Parts of the pass in order, without overlap, such as draws.
    pub parts: Vec<PassSpan>,
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
    /// Unit of the counter, for example `W`.
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
/// Errors of `out`.
pub fn write(timeline: &PerfettoTimeline<'_>, out: &mut dyn Write) -> io::Result<()> {
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

/// Writes the power of a trace as a counter track, thinned out to [`MAX_POINTS`] points. Times count from the
/// first sample.
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
        let timeline = PerfettoTimeline { process: "trace", counters, ..PerfettoTimeline::default() };
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

    fn frames(&mut self, frames: &[FrameSlice]) -> io::Result<()> {
        self.track(&child_track(FRAMES_UUID, "frames", 0))?;
        for frame in frames {
            self.begin(FRAMES_UUID, &format!("frame {}", frame.frame), frame.start_ns, &frame.numbers)?;
            self.begin(FRAMES_UUID, "busy", frame.start_ns, &[])?;
            for pass in &frame.passes {
                self.pass(pass)?;
            }
            self.end(FRAMES_UUID, frame.busy_end_ns)?;
            if frame.end_ns > frame.busy_end_ns {
                self.slice(FRAMES_UUID, "idle", (frame.busy_end_ns, frame.end_ns), &[])?;
            }
            self.end(FRAMES_UUID, frame.end_ns)?;
        }
        Ok(())
    }

    /// A pass, and its parts below it.
    fn pass(&mut self, pass: &PassSpan) -> io::Result<()> {
        self.begin(FRAMES_UUID, &pass.name, pass.start_ns, &[])?;
        pass.parts.iter().try_for_each(|part| self.pass(part))?;
        self.end(FRAMES_UUID, pass.end_ns)
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

/// Interval in which a unit was busy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BusySlice {
    /// Start in ns from the start of the run.
    pub start_ns: u64,
    /// End in ns, after `start_ns`.
    pub end_ns: u64,
    /// Busy share of the interval, 0 to 1.
    pub utilisation: f64,
}

/// Slices of a unit with busy share `busy[i]` in bin `i`, which starts at `start_ns + i bin_ns`.
///
/// Idle bins give no slice. Neighbouring bins in the same tenth of utilisation are merged. If more than
/// `limit` slices (at least 1) remain, groups of two, four, ... bins are merged first.
pub fn slices_of_bins(start_ns: u64, bin_ns: f64, busy: &[f64], limit: usize) -> Vec<BusySlice> {
    let mut group = 1;
    loop {
        let slices = merged(start_ns, bin_ns, busy, group);
        if slices.len() <= limit.max(1) || group >= busy.len() {
            return slices;
        }
        group *= 2;
    }
}

/// Tenth, 1 to 10, of a utilisation above 0.
fn tenth(utilisation: f64) -> u32 {
    libm::ceil(utilisation * 10.0).clamp(1.0, 10.0) as u32
}

fn merged(start_ns: u64, bin_ns: f64, busy: &[f64], group: usize) -> Vec<BusySlice> {
    let edge = |bin: usize| start_ns.saturating_add(libm::round(bin as f64 * bin_ns) as u64);
    let mut slices: Vec<(BusySlice, u32, usize)> = Vec::new();
    for (index, bins) in busy.chunks(group).enumerate() {
        let utilisation = bins.iter().map(|b| b.clamp(0.0, 1.0)).filter(|b| b.is_finite()).sum::<f64>();
        let utilisation = utilisation / bins.len() as f64;
        let (first, end) = (index * group, index * group + bins.len());
        if utilisation <= 0.0 || edge(end) <= edge(first) {
            continue;
        }
        let (start_ns, end_ns) = (edge(first), edge(end));
        match slices.last_mut() {
            Some((slice, level, count)) if slice.end_ns == start_ns && *level == tenth(utilisation) => {
                let total = (*count + bins.len()) as f64;
                slice.utilisation =
                    (slice.utilisation * *count as f64 + utilisation * bins.len() as f64) / total;
                slice.end_ns = end_ns;
                *count += bins.len();
            }
            _ => slices.push((BusySlice { start_ns, end_ns, utilisation }, tenth(utilisation), bins.len())),
        }
    }
    slices.into_iter().map(|(slice, _, _)| slice).collect()
}

/// Reduces `points` to at most `limit` (at least 4), in order, as [`Thinner`] does. Points that are not
/// finite are dropped.
fn decimate(points: &[(u64, f64)], limit: usize) -> Vec<(u64, f64)> {
    let finite: Vec<(u64, f64)> = points.iter().copied().filter(|(_, value)| value.is_finite()).collect();
    let mut thinner = Thinner::new(finite.len() as u64, limit);
    finite.iter().for_each(|(_, value)| thinner.push(*value));
    thinner.kept().into_iter().map(|(index, _)| finite[index as usize]).collect()
}

/// Reduces a stream of values to at most `limit` (at least 4). Few values are all kept. Otherwise the first
/// and the last are kept, and the lowest and the highest of each of `limit / 2 - 1` equal segments.
#[derive(Clone, Debug)]
pub struct Thinner {
    count: u64,
    /// Values in a segment; 1 keeps all.
    length: u64,
    seen: u64,
    low: (u64, f64),
    high: (u64, f64),
    kept: Vec<(u64, f64)>,
}

impl Thinner {
    /// Thinner for `count` finite values.
    pub fn new(count: u64, limit: usize) -> Self {
        let limit = limit.max(4) as u64;
        let length = if count <= limit { 1 } else { count.div_ceil(limit / 2 - 1) };
        Self { count, length, seen: 0, low: (0, 0.0), high: (0, 0.0), kept: Vec::new() }
    }

    /// Adds a value.
    pub fn push(&mut self, value: f64) {
        let point = (self.seen, value);
        let fresh = self.seen.is_multiple_of(self.length);
        if fresh || value.total_cmp(&self.low.1).is_lt() {
            self.low = point;
        }
        if fresh || value.total_cmp(&self.high.1).is_ge() {
            self.high = point;
        }
        self.seen += 1;
        let last = self.seen == self.count;
        if point.0 == 0 || last {
            self.kept.push(point);
        }
        if last || self.seen.is_multiple_of(self.length) {
            self.kept.extend([self.low, self.high]);
        }
    }

    /// Kept values in order, each with its index.
    pub fn kept(mut self) -> Vec<(u64, f64)> {
        self.kept.sort_unstable_by_key(|(index, _)| *index);
        self.kept.dedup_by_key(|(index, _)| *index);
        self.kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_neighbours_are_merged_and_idle_bins_give_no_slice() {
        let busy = [0.0, 0.51, 0.59, 0.0, 1.0, f64::NAN];
        let slices = slices_of_bins(1000, 100.0, &busy, 10);
        let expected = [(1100, 1300, 0.55), (1400, 1500, 1.0)];
        assert_eq!(slices.len(), expected.len());
        for (slice, (start, end, utilisation)) in slices.iter().zip(expected) {
            assert_eq!((slice.start_ns, slice.end_ns), (start, end));
            assert!((slice.utilisation - utilisation).abs() < 1e-12);
        }
    }

    #[test]
    fn too_many_slices_are_coarsened_and_keep_the_busy_time() {
        let busy: Vec<f64> = (0..4096).map(|i| if i % 2 == 0 { 0.9 } else { 0.2 }).collect();
        let slices = slices_of_bins(0, 10.0, &busy, 100);
        assert!(!slices.is_empty() && slices.len() <= 100);
        let time = |s: &BusySlice| (s.end_ns - s.start_ns) as f64 * s.utilisation;
        let expected = busy.iter().sum::<f64>() * 10.0;
        assert!((slices.iter().map(time).sum::<f64>() / expected - 1.0).abs() < 1e-9);
    }

    #[test]
    fn bins_shorter_than_a_nanosecond_never_overlap() {
        let slices = slices_of_bins(0, 0.3, &[0.1, 0.9, 0.1, 0.9, 0.1, 0.9, 0.1], 100);
        assert!(slices.iter().all(|slice| slice.end_ns > slice.start_ns));
        assert!(slices.windows(2).all(|pair| pair[0].end_ns <= pair[1].start_ns));
    }

    #[test]
    fn decimation_keeps_every_spike_and_the_ends() {
        let mut points: Vec<(u64, f64)> = (0..100_000).map(|i| (i * 10, 5.0)).collect();
        points[33_333].1 = 50.0;
        points[77_777].1 = -1.0;
        points[50_000].1 = f64::NAN;
        let kept = decimate(&points, 1000);
        assert!(kept.len() <= 1000, "{}", kept.len());
        assert!(kept.contains(&(333_330, 50.0)) && kept.contains(&(777_770, -1.0)));
        assert_eq!((kept[0].0, kept[kept.len() - 1].0), (0, 999_990));
        assert!(kept.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }

    /// Reference implementation on a list of all points.
    fn of_all(points: &[(u64, f64)], limit: usize) -> Vec<(u64, f64)> {
        if points.len() <= limit.max(4) {
            return points.to_vec();
        }
        let length = points.len().div_ceil(limit.max(4) / 2 - 1);
        let mut kept = vec![0, points.len() - 1];
        for start in (0..points.len()).step_by(length) {
            let segment = start..(start + length).min(points.len());
            let value = |index: &usize| points[*index].1;
            kept.extend(segment.clone().min_by(|a, b| value(a).total_cmp(&value(b))));
            kept.extend(segment.max_by(|a, b| value(a).total_cmp(&value(b))));
        }
        kept.sort_unstable();
        kept.dedup();
        kept.into_iter().map(|index| points[index]).collect()
    }

    #[test]
    fn oracle_a_stream_is_thinned_like_a_list() {
        for count in [0_u64, 1, 4, 5, 6, 7, 99, 100, 101, 1000, 1001, 4097] {
            // Few distinct values give ties of lowest and highest.
            let points: Vec<(u64, f64)> = (0..count).map(|i| (i * 3, (i * 7919 % 13) as f64)).collect();
            for limit in [0, 4, 7, 20, 100, 1000] {
                assert_eq!(decimate(&points, limit), of_all(&points, limit), "{count} {limit}");
            }
        }
    }

    #[test]
    fn few_points_are_unchanged() {
        let points = [(0, 1.0), (5, 2.0)];
        assert_eq!(decimate(&points, 20), points);
        assert!(decimate(&[], 20).is_empty());
    }
}
