//! Values over time: keyframes and their interpolation.

use glam::{DQuat, DVec3};

/// Interpolation between keys (glTF 2.0, appendix C).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// On a straight line; rotations on the shortest great circle.
    #[default]
    Linear,
    /// The earlier key holds until the next one.
    Step,
    /// Cubic Hermite spline; every key is in-tangent, value, out-tangent.
    CubicSpline,
}

/// A time: the opening of a frame's shutter, and the time since then.
///
/// The two are kept apart because a looping track wraps at the opening only: a shutter that crosses the end
/// of the loop sees the last key held, not a jump back to the first one smeared over the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// When the frame's shutter opens, in seconds from the start of the scene.
    pub open_s: f64,
    /// Seconds since then.
    pub offset_s: f64,
}

impl Instant {
    /// Seconds from the start of the scene.
    pub fn time_s(self) -> f64 {
        self.open_s + self.offset_s
    }
}

/// Keyframes of one property: `width` numbers at each of some times.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    times_s: Vec<f64>,
    values: Vec<f64>,
    width: usize,
    interpolation: Interpolation,
    period_s: Option<f64>,
}

impl Track {
    /// A track of `width` numbers at each of `times_s`; a cubic spline holds three times as many values.
    ///
    /// # Errors
    /// What is wrong, in words: no keys, times that are not finite or go back, values that are not finite
    /// or too few or too many.
    pub fn new(
        times_s: Vec<f64>,
        values: Vec<f64>,
        width: usize,
        interpolation: Interpolation,
    ) -> Result<Self, String> {
        let parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        if times_s.is_empty() || width == 0 {
            return Err("it has no keys".to_owned());
        }
        if let Some(key) = times_s.iter().position(|t| !t.is_finite()) {
            return Err(format!("the time of key {key} is not finite"));
        }
        if let Some(key) = times_s.windows(2).position(|pair| pair[1] < pair[0]) {
            return Err(format!("the time of key {} lies before that of key {key}", key + 1));
        }
        let expected = times_s.len().saturating_mul(width).saturating_mul(parts);
        if values.len() != expected {
            return Err(format!(
                "{} keys need {expected} numbers, there are {}",
                times_s.len(),
                values.len()
            ));
        }
        if let Some(at) = values.iter().position(|v| !v.is_finite()) {
            return Err(format!("a value of key {} is not finite", at / (width * parts)));
        }
        Ok(Self { times_s, values, width, interpolation, period_s: None })
    }

    /// The same track, repeated every `period_s` seconds; not repeated if the period is not above zero.
    #[must_use]
    pub fn looping(self, period_s: f64) -> Self {
        Self { period_s: (period_s.is_finite() && period_s > 0.0).then_some(period_s), ..self }
    }

    /// Time of the last key in seconds.
    pub fn end_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or(0.0)
    }

    /// Times of the keys in seconds.
    pub(super) fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// Interpolation between keys.
    pub(super) fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// Period of repetition in seconds, if it repeats.
    pub(super) fn period_s(&self) -> Option<f64> {
        self.period_s
    }

    /// Keys.
    pub fn key_count(&self) -> usize {
        self.times_s.len()
    }

    /// The value of the key number `key`, `width` numbers.
    pub(super) fn key(&self, key: usize) -> &[f64] {
        self.value(key)
    }

    fn clock_s(&self, at: Instant) -> f64 {
        match self.period_s {
            Some(period) => libm::fmod(at.open_s, period) + at.offset_s,
            None => at.time_s(),
        }
    }

    /// The value at `at`, `width` numbers; before the first key the first, after the last the last.
    pub fn sample(&self, at: Instant) -> Vec<f64> {
        match self.segment(at) {
            Segment::Held(key) => self.value(key).to_vec(),
            Segment::Between { key, fraction, .. } if self.interpolation == Interpolation::Linear => {
                let (from, to) = (self.value(key), self.value(key + 1));
                from.iter().zip(to).map(|(a, b)| a + fraction * (b - a)).collect()
            }
            Segment::Between { key, fraction, length_s } => self.spline(key, fraction, length_s),
        }
    }

    /// The value at `at` as a vector; missing components are zero.
    pub fn vec3(&self, at: Instant) -> DVec3 {
        let value = self.sample(at);
        DVec3::from_array(std::array::from_fn(|axis| value.get(axis).copied().unwrap_or(0.0)))
    }

    /// The value at `at` as a unit quaternion `x, y, z, w`.
    pub fn quat(&self, at: Instant) -> DQuat {
        match self.segment(at) {
            Segment::Between { key, fraction, .. } if self.interpolation == Interpolation::Linear => {
                slerp(quat(self.value(key)), quat(self.value(key + 1)), fraction)
            }
            _ => quat(&self.sample(at)),
        }
    }

    fn segment(&self, at: Instant) -> Segment {
        let clock = self.clock_s(at);
        let after = self.times_s.partition_point(|time| *time <= clock);
        let last = self.times_s.len() - 1;
        match after {
            0 => Segment::Held(0),
            _ if after > last || self.interpolation == Interpolation::Step => Segment::Held(after - 1),
            _ => {
                let (from, to) = (self.times_s[after - 1], self.times_s[after]);
                let length_s = to - from;
                Segment::Between { key: after - 1, fraction: (clock - from) / length_s, length_s }
            }
        }
    }

    fn value(&self, key: usize) -> &[f64] {
        let parts = if self.interpolation == Interpolation::CubicSpline { (3, 1) } else { (1, 0) };
        self.part(key, parts)
    }

    fn part(&self, key: usize, (parts, part): (usize, usize)) -> &[f64] {
        let start = (key * parts + part) * self.width;
        &self.values[start..start + self.width]
    }

    /// glTF 2.0, appendix C.5 (cubic Hermite spline; tangents are per second).
    fn spline(&self, key: usize, t: f64, length_s: f64) -> Vec<f64> {
        let (t2, t3) = (t * t, t * t * t);
        let (from, out) = (self.part(key, (3, 1)), self.part(key, (3, 2)));
        let (to, into) = (self.part(key + 1, (3, 1)), self.part(key + 1, (3, 0)));
        (0..self.width)
            .map(|i| {
                (2.0 * t3 - 3.0 * t2 + 1.0) * from[i]
                    + length_s * (t3 - 2.0 * t2 + t) * out[i]
                    + (3.0 * t2 - 2.0 * t3) * to[i]
                    + length_s * (t3 - t2) * into[i]
            })
            .collect()
    }
}

enum Segment {
    Held(usize),
    Between { key: usize, fraction: f64, length_s: f64 },
}

fn quat(value: &[f64]) -> DQuat {
    let part = |i: usize| value.get(i).copied().unwrap_or(0.0);
    unit_quat(DQuat::from_xyzw(part(0), part(1), part(2), part(3)))
}

/// `q` with unit length; the identity where it has none.
pub(crate) fn unit_quat(q: DQuat) -> DQuat {
    let length = q.dot(q).sqrt();
    if length.is_finite() && length > 0.0 { q * (1.0 / length) } else { DQuat::IDENTITY }
}

/// Spherical interpolation on the shorter way (glTF 2.0, appendix C.4), through `libm`.
fn slerp(from: DQuat, to: DQuat, t: f64) -> DQuat {
    let dot = from.dot(to);
    let (to, dot) = if dot < 0.0 { (-to, -dot) } else { (to, dot) };
    if dot > 1.0 - 1e-9 {
        return unit_quat(from + (to - from) * t);
    }
    let angle = libm::acos(dot);
    let scale = 1.0 / libm::sin(angle);
    unit_quat(from * (libm::sin((1.0 - t) * angle) * scale) + to * (libm::sin(t * angle) * scale))
}

/// The rotation by `turns` whole turns about the unit vector `axis`, right-handed.
pub(crate) fn rotation(axis: DVec3, turns: f64) -> DQuat {
    let half = (turns - turns.floor()) * std::f64::consts::PI;
    let (sin, cos) = (libm::sin(half), libm::cos(half));
    DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time_s: f64) -> Instant {
        Instant { open_s: time_s, offset_s: 0.0 }
    }

    #[test]
    fn linear_keys_meet_halfway_and_hold_outside() {
        let track = Track::new(vec![1.0, 3.0], vec![0.0, 2.0, 4.0, 8.0, 2.0, 0.0], 3, Interpolation::Linear);
        let track = track.unwrap();
        assert_eq!(track.vec3(at(0.0)), DVec3::new(0.0, 2.0, 4.0));
        assert_eq!(track.vec3(at(2.0)), DVec3::new(4.0, 2.0, 2.0));
        assert_eq!(track.vec3(at(9.0)), DVec3::new(8.0, 2.0, 0.0));
    }

    #[test]
    fn a_step_holds_until_its_next_key() {
        let track = Track::new(vec![0.0, 1.0], vec![5.0, 7.0], 1, Interpolation::Step).unwrap();
        assert_eq!(track.sample(at(0.999)), [5.0]);
        assert_eq!(track.sample(at(1.0)), [7.0]);
    }

    #[test]
    fn a_spline_with_the_tangents_of_a_cubic_is_that_cubic() {
        // f(t) = t^3 - 2 t over [1, 3]; f' = 3 t^2 - 2.
        let (f, slope) = (|t: f64| t * t * t - 2.0 * t, |t: f64| 3.0 * t * t - 2.0);
        let values = vec![0.0, f(1.0), slope(1.0), slope(3.0), f(3.0), 0.0];
        let track = Track::new(vec![1.0, 3.0], values, 1, Interpolation::CubicSpline).unwrap();
        for t in [1.0, 1.25, 2.0, 2.9, 3.0] {
            assert!((track.sample(at(t))[0] - f(t)).abs() < 1e-12, "at {t}");
        }
    }

    #[test]
    fn slerp_turns_at_an_even_rate() {
        let quarter = rotation(DVec3::Y, 0.25);
        for step in 0..=8 {
            let t = f64::from(step) / 8.0;
            let turned = slerp(DQuat::IDENTITY, quarter, t) * DVec3::X;
            let angle = t * std::f64::consts::FRAC_PI_2;
            let expected = DVec3::new(angle.cos(), 0.0, -angle.sin());
            assert!((turned - expected).length() < 1e-12, "at {t}");
        }
    }

    #[test]
    fn slerp_takes_the_shorter_way() {
        let quarter = rotation(DVec3::Z, 0.25);
        let turned = slerp(DQuat::IDENTITY, -quarter, 0.5) * DVec3::X;
        assert!((turned - DVec3::new(0.5f64.sqrt(), 0.5f64.sqrt(), 0.0)).length() < 1e-12);
    }

    #[test]
    fn a_loop_wraps_at_the_opening_and_holds_across_the_end() {
        let track =
            Track::new(vec![0.0, 2.0], vec![0.0, 2.0], 1, Interpolation::Linear).unwrap().looping(2.0);
        assert_eq!(track.sample(at(4.5)), [0.5]);
        assert_eq!(track.sample(Instant { open_s: 3.75, offset_s: 0.5 }), [2.0]);
    }

    #[test]
    fn bad_tracks_cannot_be_built() {
        let linear = Interpolation::Linear;
        assert!(Track::new(vec![], vec![], 1, linear).is_err());
        assert!(Track::new(vec![1.0, 0.0], vec![1.0, 2.0], 1, linear).is_err());
        assert!(Track::new(vec![0.0], vec![1.0, 2.0], 1, linear).is_err());
        assert!(Track::new(vec![0.0], vec![f64::NAN], 1, linear).is_err());
        assert!(Track::new(vec![f64::INFINITY], vec![0.0], 1, linear).is_err());
        assert!(Track::new(vec![0.0], vec![1.0], 1, Interpolation::CubicSpline).is_err());
    }
}
