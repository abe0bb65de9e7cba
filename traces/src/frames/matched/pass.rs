//! The one pass over the samples, and the buffers of its threads.

use super::screen::{Buffers, Screen, minima};
use super::{Piece, Template, powers};
use crate::clock::SampleClock;
use crate::frames::marks::{Marks, Placed, Placement};
use crate::frames::subsample::vertex;
use crate::frames::{FinderMethod, spacing};
use crate::stats::{PairSum, mean};
use core::ops::Range;
use multiversion::multiversion;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Samples searched at once.
pub(super) const PIECE_SAMPLES: usize = 1 << 20;
/// About the offsets that a thread handles at once.
const TASK_OFFSETS: usize = 1 << 16;
/// Farthest the lowest exact offset may lie from that of the screen, with one more for its neighbours.
const MAX_REFINEMENT_SAMPLES: usize = 2;
/// Samples kept beside what offsets need: for energies at starts between samples.
const MARGIN_SAMPLES: usize = 8;
/// Samples at the beginning that are kept: the first frame is searched in them again.
const HEAD_SAMPLES: usize = 1 << 21;
/// About the most values that medians are taken from.
const MAX_MEDIAN_VALUES: u64 = 65_536;

/// Samples in order, in memory or in a file.
pub(crate) trait Samples: Send {
    /// Why they cannot be had.
    type Error: Send;

    /// Appends the next voltages and currents, of which the first is sample `from` of all: how many; 0 at the end.
    fn append(
        &mut self,
        from: u64,
        voltage_v: &mut Vec<f32>,
        current_a: &mut Vec<f32>,
    ) -> Result<usize, Self::Error>;

    /// The error where some that were appended, the first of them sample `from`, are not finite.
    fn check_finite(&self, from: u64, voltage_v: &[f32], current_a: &[f32]) -> Result<(), Self::Error>;
}

/// A minimum of the profile.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub offset: u64,
    /// The best position of the template, in samples.
    pub aligned: f64,
    pub distance_w2: f64,
    /// Sum of all powers (W) up to its start.
    pub sum_w: PairSum,
    pub mark: u32,
}

/// The result of a pass.
#[derive(Default)]
pub(crate) struct Gathered {
    /// All but those beside marks.
    pub(super) candidates: Vec<Candidate>,
    /// Offset of the last one, those included.
    last: Option<u64>,
    /// Distances at evenly spaced offsets, W^2, and steps between neighbours, W.
    pub(super) distances_w2: Vec<f64>,
    pub(super) steps_w: Vec<f64>,
    pub(super) head: Piece,
    /// Sums at the requested positions.
    pub(super) sums_w: Vec<Option<PairSum>>,
    pub total_w: PairSum,
    pub samples: u64,
}

/// The parameters of a pass.
pub(crate) struct MatchPlan {
    pub(super) clock: SampleClock,
    pub(super) placement: Placement,
    /// The marks' windows.
    pub(super) templates: Vec<Template>,
    pub(super) spacing: usize,
    pub(super) method: FinderMethod,
    mean_w: f32,
    screen: Screen,
    stride: u64,
    /// Marks' positions, then that of the end mark.
    positions: Vec<f64>,
}

impl MatchPlan {
    /// To find what resembles `windows`, the powers (W) of the marks, by [`FinderMethod::Normalized`] or else
    /// by squares.
    pub fn new(
        clock: SampleClock,
        placement: Placement,
        windows: Vec<Vec<f64>>,
        marks: &Marks,
        method: FinderMethod,
    ) -> Self {
        let normalized = method == FinderMethod::Normalized;
        let mean_w = mean(&windows[0]) as f32;
        let templates: Vec<Template> =
            windows.into_iter().map(|watts| Template::new(watts, normalized)).collect();
        let screen = Screen::new(&templates, f64::from(mean_w));
        let mut positions: Vec<f64> = marks.starts_s.iter().map(|&mark_s| clock.position(mark_s)).collect();
        positions.push(clock.position(marks.end_s));
        let spacing = spacing(placement.samples);
        let stride = clock.samples.map_or(1024, |samples| samples.div_ceil(MAX_MEDIAN_VALUES).max(1));
        let method = if normalized { method } else { FinderMethod::SumOfSquares };
        Self { clock, placement, templates, spacing, method, mean_w, screen, stride, positions }
    }

    /// Goes over all samples once.
    ///
    /// # Errors
    /// That of the samples.
    pub fn gather<S: Samples>(&self, samples: &mut S) -> Result<Gathered, S::Error> {
        let mut gathered = Gathered { sums_w: vec![None; self.positions.len()], ..Gathered::default() };
        let (mut piece, mut coming) = (Piece::default(), Piece::default());
        let mut read = read_piece(samples, &mut piece)?;
        let (mut from, mut fresh, workspaces) = (0, 0, Workspaces::new());
        loop {
            self.look_up(&piece, &mut gathered);
            let to = self.ready(&piece, read == 0).max(from);
            if read == 0 {
                gathered.keep_head(&piece, fresh);
                self.search(&piece, from..to, &workspaces, &mut gathered);
                (gathered.total_w, gathered.samples) = (piece.sum_to(piece.end() as f64), piece.end());
                return Ok(gathered);
            }
            coming.begin_with(&piece, to.saturating_sub((self.spacing + MARGIN_SAMPLES) as u64));
            let old = coming.len();
            // The next samples are read while these are searched.
            let (next, ()) = rayon::join(
                || read_piece(samples, &mut coming),
                || {
                    gathered.keep_head(&piece, fresh);
                    self.search(&piece, from..to, &workspaces, &mut gathered);
                },
            );
            (read, from, fresh) = (next?, to, old);
            std::mem::swap(&mut piece, &mut coming);
        }
    }

    /// Sums at the marks and at the end.
    fn look_up(&self, piece: &Piece, gathered: &mut Gathered) {
        for (position, sum) in self.positions.iter().zip(&mut gathered.sums_w) {
            if sum.is_none() && *position < piece.end() as f64 {
                *sum = Some(piece.sum_to(*position));
            }
        }
    }

    /// The offset up to which all samples are in memory, those of neighbours within the spacing too.
    fn ready(&self, piece: &Piece, last: bool) -> u64 {
        let all = self.all(piece);
        let spacing = self.spacing as u64;
        if last { all } else { all.saturating_sub(spacing + MARGIN_SAMPLES as u64) / spacing * spacing }
    }

    /// The offset after the last at which a window lies in the piece.
    fn all(&self, piece: &Piece) -> u64 {
        (piece.end() + 1).saturating_sub(self.placement.samples as u64)
    }

    /// Searches a range of offsets.
    fn search(&self, piece: &Piece, range: Range<u64>, workspaces: &Workspaces, gathered: &mut Gathered) {
        let Range { start: from, end: to } = range;
        let (all, spacing) = (self.all(piece), self.spacing as u64);
        let task = (TASK_OFFSETS as u64).div_ceil(spacing) * spacing;
        let tasks = to.saturating_sub(from).div_ceil(task);
        let one = |index: usize| {
            let begin = from + index as u64 * task;
            workspaces.with(|workspace| self.task(piece, begin, to.min(begin + task), all, workspace))
        };
        // One by one, as the thread that reads the next rows joins late and takes some of the remaining
        // tasks.
        let found: Vec<Found> = (0..tasks as usize).into_par_iter().with_max_len(1).map(one).collect();
        for found in found {
            gathered.distances_w2.extend(found.distances_w2);
            gathered.steps_w.extend(found.steps_w);
            for candidate in found.candidates {
                let offset = candidate.offset;
                if gathered.last.is_none_or(|last| offset - last >= spacing) {
                    gathered.last = Some(offset);
                    let far = |mark: &Placed| (mark.first as u64).abs_diff(offset) >= spacing;
                    gathered.candidates.extend(self.placement.marks.iter().all(far).then_some(candidate));
                }
            }
        }
    }

    fn task(&self, piece: &Piece, from: u64, to: u64, all: u64, workspace: &mut Workspace) -> Found {
        let width = self.placement.samples;
        let begin = from.saturating_sub(self.spacing as u64 - 1).max(piece.base);
        let end = all.min(to + self.spacing as u64 - 1);
        let place = |offset: u64| (offset - piece.base) as usize;
        let samples = place(begin)..place(end) + width - 1;
        let Workspace { signal, profile, power_w, buffers } = workspace;
        signal.resize(samples.len(), 0.0);
        centre(&piece.voltage_v[samples.clone()], &piece.current_a[samples], self.mean_w, signal);
        profile.resize((end - begin) as usize, 0.0);
        self.screen.profile(signal, profile, buffers);
        let mut found = Found::default();
        let inside = ((from - begin) as usize, (to - begin) as usize);
        minima(profile, inside.0, inside.1, self.spacing, |offset| {
            found.candidates.push(self.candidate(piece, begin + offset as u64, all, power_w));
        });
        let first = from.next_multiple_of(self.stride);
        for offset in (first..to).step_by(self.stride as usize) {
            let place = place(offset);
            self.powers(piece, place..place + width, power_w);
            found.distances_w2.push(self.nearest(power_w).0);
            found.steps_w.push((piece.power_w(place + 1) - piece.power_w(place)).abs());
        }
        found
    }

    fn powers(&self, piece: &Piece, places: Range<usize>, into: &mut Vec<f64>) {
        powers(&piece.voltage_v[places.clone()], &piece.current_a[places], into);
    }

    /// Exact distance and number of the template nearest to some powers.
    fn nearest(&self, power_w: &[f64]) -> (f64, usize) {
        let each =
            self.templates.iter().zip(0..).map(|(template, mark)| (template.distance_w2(power_w), mark));
        each.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0))
    }

    fn candidate(&self, piece: &Piece, offset: u64, all: u64, power_w: &mut Vec<f64>) -> Candidate {
        // All samples of this offset and of those that may be better, and one more on either side.
        let reach = MAX_REFINEMENT_SAMPLES as u64 + 1;
        let low = offset.saturating_sub(reach).max(piece.base);
        let high = (offset + reach).min(all - 1);
        let place = |offset: u64| (offset - piece.base) as usize;
        self.powers(piece, place(low)..place(high) + self.placement.samples, power_w);
        let (mut distance_w2, mark) = self.nearest(&power_w[(offset - low) as usize..]);
        let at = |offset: u64| self.templates[mark].distance_w2(&power_w[(offset - low) as usize..]);
        let mut best = offset;
        let (mut before, mut after) = (f64::INFINITY, f64::INFINITY);
        let inside = |offset: u64| low < offset && offset < high;
        // The screen may be off by its rounding: downhill to the lowest, a few offsets at most.
        while inside(best) {
            (before, after) = (at(best - 1), at(best + 1));
            match (before < distance_w2, after < distance_w2) {
                (true, _) if before <= after => (best, distance_w2) = (best - 1, before),
                (_, true) => (best, distance_w2) = (best + 1, after),
                _ => break,
            }
        }
        let lowest = inside(best) && before >= distance_w2 && after >= distance_w2;
        let finer = if lowest { vertex(before, distance_w2, after) } else { 0.0 };
        let aligned = best as f64 + finer;
        let sum_w = piece.sum_to(aligned + self.placement.marks[mark].anchor);
        Candidate { offset, aligned, distance_w2, sum_w, mark: mark as u32 }
    }
}

/// Powers (W) less a mean.
#[multiversion(targets("x86_64+avx2"))]
fn centre(voltage_v: &[f32], current_a: &[f32], mean_w: f32, into: &mut [f32]) {
    for ((signal, v), i) in into.iter_mut().zip(voltage_v).zip(current_a) {
        *signal = v * i - mean_w;
    }
}

/// The result of one task.
#[derive(Default)]
struct Found {
    candidates: Vec<Candidate>,
    distances_w2: Vec<f64>,
    steps_w: Vec<f64>,
}

impl Gathered {
    fn keep_head(&mut self, piece: &Piece, fresh: usize) {
        let room = HEAD_SAMPLES - self.head.len();
        let take = fresh..piece.len().min(fresh + room);
        self.head.voltage_v.extend_from_slice(&piece.voltage_v[take.clone()]);
        self.head.current_a.extend_from_slice(&piece.current_a[take]);
    }
}

/// Appends the next samples to a piece; how many there were.
fn read_piece<S: Samples>(samples: &mut S, piece: &mut Piece) -> Result<usize, S::Error> {
    let mut read = 0;
    while read < PIECE_SAMPLES {
        let now = samples.append(piece.end(), &mut piece.voltage_v, &mut piece.current_a)?;
        if now == 0 {
            break;
        }
        piece.add_up();
        read += now;
    }
    // A sum is not finite if any part is not; the place is looked for only then.
    if !piece.sum_to(piece.end() as f64).value().is_finite() {
        samples.check_finite(piece.base, &piece.voltage_v, &piece.current_a)?;
    }
    Ok(read)
}

/// The buffers of a thread: the signal and the profile of one task.
#[derive(Default)]
pub(super) struct Workspace {
    pub signal: Vec<f32>,
    pub profile: Vec<f32>,
    /// Powers about one offset, W.
    pub power_w: Vec<f64>,
    pub buffers: Buffers,
}

/// One for each thread, not made anew for each piece.
pub(super) struct Workspaces(Vec<Mutex<Workspace>>);

impl Workspaces {
    pub fn new() -> Self {
        Self((0..rayon::current_num_threads()).map(|_| Mutex::default()).collect())
    }

    /// Does something in that of the thread it is called by.
    pub fn with<T>(&self, work: impl FnOnce(&mut Workspace) -> T) -> T {
        let thread = rayon::current_thread_index().unwrap_or(0);
        work(&mut self.0[thread % self.0.len()].lock().unwrap_or_else(PoisonError::into_inner))
    }
}
