//! Slices of busy time from busy shares of bins.

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
