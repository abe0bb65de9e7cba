//! Fewer points for a viewer, with the extremes among them.

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
}
