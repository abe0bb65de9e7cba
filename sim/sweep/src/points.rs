//! Points of a sweep: the values of its axes, combined.

use pipeline::random::{mix, unit};
use timing::Level;

use crate::axis::Axis;
use crate::setting::{Setting, Text};
use crate::spec::{Combination, SweepSpec};

/// Points of a sweep.
pub(crate) struct Points {
    /// Settings of all points.
    pub common: Vec<Setting>,
    /// Further settings of each point, in order: with repetitions and without forbidden combinations.
    pub varied: Vec<Vec<Setting>>,
    /// Places in the file of constraints that leave out no point.
    pub idle: Vec<String>,
}

impl Points {
    /// Points of `spec`, with the settings of `--quick` if it is given.
    ///
    /// # Errors
    /// Place in the file and message: a constraint compares values that do not fit, or no point is left.
    pub fn new(spec: &SweepSpec, quick: bool) -> Result<Self, (String, String)> {
        let once = kept(spec, spec.base(quick))?;
        Ok(once.repeated(spec.repetitions).at_levels(&spec.screen))
    }

    /// Each point with one seed after another.
    fn repeated(self, repetitions: u32) -> Self {
        if repetitions == 1 {
            return self;
        }
        let Self { mut common, varied, idle } = self;
        let seed = common.iter().find(|setting| &*setting.path == "seed");
        let first: u64 = seed.and_then(|seed| seed.value.parse().ok()).unwrap_or(1);
        common.retain(|setting| &*setting.path != "seed");
        let seeds = (0..u64::from(repetitions)).map(|repetition| first.wrapping_add(repetition));
        let seeds: Vec<Setting> = seeds.map(|seed| Setting::new("seed", seed.to_string())).collect();
        let repeated = |point: &Vec<Setting>| {
            let with = |seed| [point.as_slice(), std::slice::from_ref(seed)].concat();
            seeds.iter().map(with).collect::<Vec<_>>()
        };
        Self { varied: varied.iter().flat_map(repeated).collect(), common, idle }
    }

    /// All points at the first level, then all of them at the next.
    fn at_levels(self, levels: &[Level]) -> Self {
        if levels.is_empty() {
            return self;
        }
        let at = |level: &Level| {
            let timing = Setting::new("timing", level.name());
            self.varied.iter().map(move |point| [point.as_slice(), std::slice::from_ref(&timing)].concat())
        };
        Self { varied: levels.iter().flat_map(at).collect(), ..self }
    }

    /// All settings of point `at`.
    pub fn settings(&self, at: usize) -> Vec<Setting> {
        self.common.iter().chain(&self.varied[at]).cloned().collect()
    }
}

/// Points that no constraint leaves out, without repetitions.
fn kept(spec: &SweepSpec, common: Vec<Setting>) -> Result<Points, (String, String)> {
    let constraints = spec.parsed_constraints()?;
    let mut forbids = vec![false; spec.forbidden.len()];
    let mut excludes = vec![false; constraints.len()];
    let mut points = Vec::new();
    for point in varied(spec) {
        let mut is_kept = true;
        for index in spec.forbids(&point) {
            (forbids[index], is_kept) = (true, false);
        }
        for (index, constraint) in constraints.iter().enumerate() {
            let holds = constraint.holds(&[&point, &common]).map_err(|message| {
                (format!("constraints[{index}]"), format!("`{}`: {message}", spec.constraints[index]))
            })?;
            excludes[index] |= !holds;
            is_kept &= holds;
        }
        if is_kept {
            points.push(point);
        }
    }
    if points.is_empty() {
        let place = if spec.constraints.is_empty() { "forbidden" } else { "constraints" };
        return Err((place.to_owned(), "all combinations are left out: leave out fewer".to_owned()));
    }
    let idle = |place: &'static str, matched: Vec<bool>| {
        let idle = matched.into_iter().enumerate().filter(|(_, matched)| !matched);
        idle.map(move |(index, _)| format!("{place}[{index}]"))
    };
    let idle = idle("forbidden", forbids).chain(idle("constraints", excludes)).collect();
    Ok(Points { common, varied: points, idle })
}

/// Settings of the axes, point by point.
fn varied(spec: &SweepSpec) -> Box<dyn Iterator<Item = Vec<Setting>> + '_> {
    let count = spec.points.count().unwrap_or(0);
    let at = |shares: &dyn Fn(u32) -> f64| -> Vec<Setting> {
        (0..).zip(&spec.axes).flat_map(|(dimension, axis)| axis.at(shares(dimension))).collect()
    };
    match spec.points {
        Combination::Grid => Box::new(grid(&spec.axes)),
        Combination::LatinHypercube { seed, .. } => {
            let parts: Vec<Vec<f64>> =
                (0..spec.axes.len()).map(|axis| latin(count, seed, axis as u64)).collect();
            Box::new((0..count as usize).map(move |point| at(&|axis| parts[axis as usize][point])))
        }
        Combination::Sobol { seed, .. } => Box::new(
            (0..count).map(move |point| at(&|axis| f64::from(sobol_burley::sample(point, axis, seed)))),
        ),
    }
}

/// Each value of each axis with all others; the last axis varies fastest. Points share the text of a value.
fn grid(axes: &[Axis]) -> impl Iterator<Item = Vec<Setting>> {
    let values = |axis: &Axis| (0..axis.len()).map(|index| axis.value(index)).collect();
    let axes: Vec<Vec<Vec<Setting>>> = axes.iter().map(values).collect();
    (0..axes.iter().map(Vec::len).product()).map(move |point: usize| {
        let mut rest = point;
        let mut settings: Vec<&[Setting]> = Vec::with_capacity(axes.len());
        for values in axes.iter().rev() {
            settings.push(&values[rest % values.len()]);
            rest /= values.len();
        }
        settings.reverse();
        settings.concat()
    })
}

/// Settings for each combination of listed values; the last list varies fastest.
///
/// # Errors
/// In words, if a path is unknown or a value is listed twice.
pub fn combinations(lists: Vec<(String, Vec<String>)>) -> Result<Vec<Vec<Setting>>, String> {
    let axis = |(path, values): (String, Vec<String>)| Axis::Values {
        path: path.into(),
        values: values.into_iter().map(|value| Text(value.into())).collect(),
    };
    let axes: Vec<Axis> = lists.into_iter().map(axis).collect();
    axes.iter().try_for_each(|axis| axis.check(true))?;
    Ok(grid(&axes).collect())
}

/// A number in each of `count` equal parts of 0 to 1, in random order.
fn latin(count: u32, seed: u32, axis: u64) -> Vec<f64> {
    let mut state = mix(mix(u64::from(seed)) ^ axis);
    let mut next = move || {
        state = state.wrapping_add(1);
        unit(mix(state))
    };
    let mut parts: Vec<u32> = (0..count).collect();
    // Fisher and Yates.
    for last in (1..parts.len()).rev() {
        parts.swap(last, ((next() * (last + 1) as f64) as usize).min(last));
    }
    parts.into_iter().map(|part| (f64::from(part) + next()) / f64::from(count)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(text: &str) -> Vec<Vec<String>> {
        let spec = SweepSpec::parse(&format!("(name: \"a\", {text})"), "a.ron").unwrap();
        let values =
            |settings: Vec<Setting>| settings.into_iter().map(|setting| setting.value.to_string()).collect();
        let points = Points::new(&spec, false).unwrap();
        (0..points.varied.len()).map(|at| values(points.settings(at))).collect()
    }

    const AXES: &str = r#"axes: [Values(path: "samples", values: [1, 2]),
        Linked(settings: {"lens_radius": [0, 1], "shutter": [0.5, 1]})]"#;

    #[test]
    fn a_grid_combines_all_values_and_links_some() {
        assert_eq!(made(AXES), [["1", "0", "0.5"], ["1", "1", "1"], ["2", "0", "0.5"], ["2", "1", "1"]]);
        let fewer = made(&format!("{AXES}, forbidden: [{{\"samples\": 2, \"shutter\": 1.0}}]"));
        assert_eq!(fewer, [["1", "0", "0.5"], ["1", "1", "1"], ["2", "0", "0.5"]]);
    }

    #[test]
    fn constraints_leave_out_points_and_are_reported_if_they_leave_out_none() {
        let text = format!(
            "(name: \"a\", settings: {{\"gpu.core_hz\": 2}}, {AXES}, forbidden: [{{\"samples\": 3}}], constraints: \
             [\"samples * shutter < gpu.core_hz\", \"samples > 0\"])"
        );
        let of = |text: &str| Points::new(&SweepSpec::parse(text, "a.ron").unwrap(), false);
        let points = of(&text).unwrap();
        assert_eq!(
            (points.varied.len(), points.idle),
            (3, ["forbidden[0]", "constraints[1]"].map(str::to_owned).into())
        );
        let error = of(&text.replace("> 0", "> 9")).err().unwrap();
        assert!(error.0 == "constraints" && error.1.contains("all combinations are left out"), "{error:?}");
        let error = of(&text.replace("samples > 0", "samples > 'x'")).err().unwrap();
        assert_eq!(error.0, "constraints[1]");
    }

    #[test]
    fn repetitions_have_one_seed_after_another() {
        let text =
            r#"settings: {"seed": 7}, axes: [Values(path: "samples", values: [1, 2])], repetitions: 2"#;
        assert_eq!(made(text), [["1", "7"], ["1", "8"], ["2", "7"], ["2", "8"]]);
    }

    /// Two axes, each with eight equal parts.
    const PARTS: &str = r#"axes: [Range(path: "gpu.core_hz", from: 0, to: 8),
        Range(path: "gpu.memory_hz", from: 0, to: 8)]"#;

    #[test]
    fn sampled_points_fill_each_part_of_each_axis_once() {
        for points in ["LatinHypercube(count: 8, seed: 3)", "Sobol(count: 8, seed: 3)"] {
            let text = format!("{PARTS}, points: {points}");
            let made = made(&text);
            for axis in 0..2 {
                let mut parts: Vec<usize> =
                    made.iter().map(|point| point[axis].parse::<f64>().unwrap() as usize).collect();
                parts.sort_unstable();
                assert_eq!(parts, [0, 1, 2, 3, 4, 5, 6, 7], "{points}: {made:?}");
            }
            assert_ne!(made, self::made(&text.replace("seed: 3", "seed: 4")));
        }
    }
}
