//! Decimation of tracks for the viewer; extremes are kept.

/// Largest number of points of a counter track.
pub const MAX_POINTS: usize = 20_000;

/// Largest number of slices of a unit's track.
pub const MAX_SLICES: usize = 10_000;

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

/// Reduces `points` to at most `limit` (at least 4), in order, as [`Thinner`] does. Points that are not
/// finite are dropped.
pub fn decimate(points: &[(u64, f64)], limit: usize) -> Vec<(u64, f64)> {
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
pub(super) fn tenth(utilisation: f64) -> u32 {
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
