//! Found starts of frames and true ones, paired one to one.

/// Largest timing error of a start that counts as found, s.
pub const TOLERANCE_S: f64 = 0.5e-3;

/// Pairs `(found, truth)` of indices, one to one and in order, whose starts differ by at most `tolerance_s`.
/// Both must be sorted by start. Greedy, earliest first: for intervals of one width on a line no other
/// matching has more pairs; of several found starts that could take the same true one the nearest does, if
/// the next true start does not need it.
pub fn pairs(found_s: &[f64], truth_s: &[f64], tolerance_s: f64) -> Vec<(usize, usize)> {
    let (mut f, mut t) = (0, 0);
    let mut pairs = Vec::new();
    while let (Some(&found), Some(&truth)) = (found_s.get(f), truth_s.get(t)) {
        if (found - truth).abs() > tolerance_s {
            if found < truth {
                f += 1
            } else {
                t += 1
            }
            continue;
        }
        while let Some(&next) = found_s.get(f + 1) {
            let needed = truth_s.get(t + 1).is_some_and(|&other| (next - other).abs() <= tolerance_s);
            if needed || (next - truth).abs() >= (found_s[f] - truth).abs() {
                break;
            }
            f += 1;
        }
        pairs.push((f, t));
        f += 1;
        t += 1;
    }
    pairs
}

/// For each found start the place of the true one beside it.
pub fn true_beside_found(found_s: &[f64], truth_s: &[f64], tolerance_s: f64) -> Vec<Option<usize>> {
    let mut beside = vec![None; found_s.len()];
    pairs(found_s, truth_s, tolerance_s).into_iter().for_each(|(found, truth)| beside[found] = Some(truth));
    beside
}

/// For each true start the place of the found one beside it.
pub fn found_beside_true(found_s: &[f64], truth_s: &[f64], tolerance_s: f64) -> Vec<Option<usize>> {
    let mut beside = vec![None; truth_s.len()];
    pairs(found_s, truth_s, tolerance_s).into_iter().for_each(|(found, truth)| beside[truth] = Some(found));
    beside
}

/// For each found frame, from a start to the next, whether both ends are true starts that follow each other.
pub fn true_frames(found_s: &[f64], truth_s: &[f64], tolerance_s: f64) -> Vec<bool> {
    let beside = true_beside_found(found_s, truth_s, tolerance_s);
    beside.windows(2).map(|ends| matches!(ends, [Some(a), Some(b)] if *b == a + 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_true_if_its_ends_follow_each_other() {
        let found_s = [0.0, 1.0, 3.0, 3.5, 4.0];
        assert_eq!(true_frames(&found_s, &[0.0, 1.0, 2.0, 3.0, 4.0], 0.1), [true, false, false, false]);
        assert!(true_frames(&[], &[1.0], 0.1).is_empty());
    }

    #[test]
    fn the_nearer_of_two_found_starts_is_the_partner() {
        assert_eq!(pairs(&[0.9, 1.01], &[1.0], 0.2), [(1, 0)]);
        assert_eq!(pairs(&[0.9, 1.01], &[1.0, 1.1], 0.2), [(0, 0), (1, 1)]);
    }
}
