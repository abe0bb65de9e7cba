//! The timeline, read back by a decoder that knows nothing of the writer but the published format.

use std::collections::BTreeMap;

use traces::io::perfetto::{
    BusySlice, CounterTrack, FrameSlice, MAX_POINTS, PassSpan, PerfettoTimeline, UnitTrack, write,
};

/// A decoded field: a varint, eight bytes, or bytes that may be a message.
#[derive(Clone, Debug, PartialEq)]
enum Field {
    Varint(u64),
    Fixed64(u64),
    Bytes(Vec<u8>),
}

impl Field {
    fn message(&self) -> Vec<(u64, Field)> {
        let Field::Bytes(bytes) = self else { panic!("not a message: {self:?}") };
        decode(bytes)
    }

    fn text(&self) -> String {
        let Field::Bytes(bytes) = self else { panic!("not a string: {self:?}") };
        String::from_utf8(bytes.clone()).unwrap()
    }

    fn double(&self) -> f64 {
        let Field::Fixed64(bits) = self else { panic!("not a double: {self:?}") };
        f64::from_bits(*bits)
    }

    fn uint(&self) -> u64 {
        let Field::Varint(value) = self else { panic!("not a varint: {self:?}") };
        *value
    }
}

fn varint(bytes: &mut &[u8]) -> u64 {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let byte = bytes[0];
        *bytes = &bytes[1..];
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return value;
        }
    }
    panic!("a varint of more than ten bytes")
}

fn decode(mut bytes: &[u8]) -> Vec<(u64, Field)> {
    let mut fields = Vec::new();
    while !bytes.is_empty() {
        let key = varint(&mut bytes);
        let field = match key & 7 {
            0 => Field::Varint(varint(&mut bytes)),
            1 => {
                let (value, rest) = bytes.split_at(8);
                bytes = rest;
                Field::Fixed64(u64::from_le_bytes(value.try_into().unwrap()))
            }
            2 => {
                let length = varint(&mut bytes) as usize;
                let (value, rest) = bytes.split_at(length);
                bytes = rest;
                Field::Bytes(value.to_vec())
            }
            other => panic!("wire type {other}"),
        };
        fields.push((key >> 3, field));
    }
    fields
}

fn get(message: &[(u64, Field)], number: u64) -> Option<&Field> {
    message.iter().find(|(field, _)| *field == number).map(|(_, value)| value)
}

/// A decoded `TrackEvent` with the time of its packet.
#[derive(Debug)]
struct Event {
    time_ns: u64,
    kind: u64,
    uuid: u64,
    name: Option<String>,
    value: Option<f64>,
}

/// Track names by uuid, and events in file order.
#[derive(Debug, Default)]
struct Decoded {
    tracks: BTreeMap<u64, String>,
    parents: BTreeMap<u64, u64>,
    process: Option<(u64, String)>,
    events: Vec<Event>,
}

impl Decoded {
    fn track(&mut self, track: &[(u64, Field)]) {
        let uuid = get(track, 1).unwrap().uint();
        if let Some(process) = get(track, 3) {
            self.process = Some((uuid, get(&process.message(), 6).unwrap().text()));
            return;
        }
        assert!(
            self.tracks.insert(uuid, get(track, 2).unwrap().text()).is_none(),
            "a track is described once"
        );
        self.parents.insert(uuid, get(track, 5).unwrap().uint());
    }

    fn event(&mut self, time_ns: u64, event: &[(u64, Field)]) {
        self.events.push(Event {
            time_ns,
            kind: get(event, 9).unwrap().uint(),
            uuid: get(event, 11).unwrap().uint(),
            name: get(event, 23).map(Field::text),
            value: get(event, 44).map(Field::double),
        });
    }
}

fn read(bytes: &[u8]) -> Decoded {
    let mut decoded = Decoded::default();
    for (index, (field, packet)) in decode(bytes).into_iter().enumerate() {
        assert_eq!(field, 1, "a trace is packets only");
        let packet = packet.message();
        assert!(get(&packet, 10).unwrap().uint() > 0, "every packet names its sequence");
        assert_eq!(
            get(&packet, 13).map(Field::uint),
            (index == 0).then_some(1),
            "the first packet clears state"
        );
        if let Some(track) = get(&packet, 60) {
            decoded.track(&track.message());
        }
        if let Some(event) = get(&packet, 11) {
            decoded.event(get(&packet, 8).unwrap().uint(), &event.message());
        }
    }
    decoded
}

fn timeline(points: Vec<(u64, f64)>) -> PerfettoTimeline<'static> {
    let draw = |start_ns| PassSpan {
        name: "draw 1".to_owned(),
        start_ns: start_ns + 30,
        end_ns: start_ns + 60,
        parts: Vec::new(),
    };
    let span = |frame, start_ns| FrameSlice {
        frame,
        start_ns,
        busy_end_ns: start_ns + 60,
        end_ns: start_ns + 100,
        passes: vec![
            PassSpan { name: "map".to_owned(), start_ns, end_ns: start_ns + 20, parts: Vec::new() },
            PassSpan {
                name: "image".to_owned(),
                start_ns: start_ns + 20,
                end_ns: start_ns + 60,
                parts: vec![draw(start_ns)],
            },
        ],
        numbers: vec![("energy_mJ", 1.5)],
    };
    let slices = vec![
        BusySlice { start_ns: 0, end_ns: 40, utilisation: 0.55 },
        BusySlice { start_ns: 40, end_ns: 60, utilisation: 1.0 },
    ];
    PerfettoTimeline {
        process: "quintile tiny",
        frames: vec![span(0, 0), span(1, 100)],
        units: vec![UnitTrack { name: "setup", doc: "Prepares.", slices }],
        counters: vec![CounterTrack { name: "power, total", unit: "W", points }],
    }
}

fn bytes(timeline: &PerfettoTimeline<'_>) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(timeline, &mut bytes).unwrap();
    bytes
}

#[test]
fn tracks_hang_below_one_process() {
    let decoded = read(&bytes(&timeline(vec![(0, 10.0)])));
    let (process, name) = decoded.process.unwrap();
    assert_eq!(name, "quintile tiny");
    let names: Vec<&str> = decoded.tracks.values().map(String::as_str).collect();
    assert_eq!(names, ["frames", "setup", "power, total"]);
    assert!(decoded.parents.values().all(|parent| *parent == process));
}

#[test]
fn slices_nest_and_close_on_every_track() {
    let decoded = read(&bytes(&timeline(vec![])));
    let mut open: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
    let mut last: BTreeMap<u64, u64> = BTreeMap::new();
    for Event { time_ns, kind, uuid, name, .. } in &decoded.events {
        assert!(decoded.tracks.contains_key(uuid), "an event on a track that was described");
        assert!(*last.get(uuid).unwrap_or(&0) <= *time_ns, "time does not run back");
        last.insert(*uuid, *time_ns);
        match kind {
            1 => {
                assert!(name.is_some());
                open.entry(*uuid).or_default().push(*time_ns);
            }
            2 => assert!(open.get_mut(uuid).unwrap().pop().unwrap() < *time_ns),
            other => panic!("event type {other}"),
        }
    }
    assert!(open.values().all(Vec::is_empty));
    let named: Vec<_> = decoded.events.iter().filter_map(|event| event.name.as_deref()).collect();
    assert_eq!(
        named,
        [
            "frame 0", "busy", "map", "image", "draw 1", "idle", "frame 1", "busy", "map", "image", "draw 1",
            "idle", "60 %", "100 %"
        ]
    );
}

#[test]
fn counters_carry_their_values() {
    let decoded = read(&bytes(&timeline(vec![(0, 10.25), (50, 11.5), (80, f64::NAN)])));
    let values: Vec<_> =
        decoded.events.iter().filter(|e| e.kind == 4).map(|e| (e.time_ns, e.value.unwrap())).collect();
    assert_eq!(values, [(0, 10.25), (50, 11.5)]);
}

#[test]
fn a_long_counter_is_bounded_and_keeps_its_spike() {
    let mut points: Vec<(u64, f64)> = (0..500_000).map(|i| (i, 5.0)).collect();
    points[123_456].1 = 99.0;
    let decoded = read(&bytes(&timeline(points)));
    let counters: Vec<_> = decoded.events.iter().filter(|event| event.kind == 4).collect();
    assert!(counters.len() <= MAX_POINTS);
    assert!(counters.iter().any(|event| event.time_ns == 123_456 && event.value == Some(99.0)));
}

#[test]
fn an_empty_run_is_a_trace_too_and_bytes_repeat() {
    assert_eq!(read(&bytes(&PerfettoTimeline::default())).events.len(), 0);
    let timeline = timeline(vec![(0, 1.0)]);
    assert_eq!(bytes(&timeline), bytes(&timeline));
}
