//! Settings of designs as factors of a model: their values by number.

use std::collections::HashMap;

/// Number of groups of a setting with many values.
const GROUPS: usize = 4;

/// A setting, or several that are linked: their values by number.
pub(crate) struct Factor {
    pub name: String,
    /// Numbers in their order; other values in order of first use.
    pub values: Vec<String>,
    /// Value of each design.
    pub codes: Vec<usize>,
}

impl Factor {
    /// The values as numbers, linked ones by the first setting; `None` if one is no number.
    fn numbers(&self) -> Option<Vec<f64>> {
        let number = |value: &String| {
            value.split(" + ").next()?.parse().ok().filter(|number: &f64| number.is_finite())
        };
        self.values.iter().map(number).collect()
    }

    /// Sorts the values, if they are numbers.
    fn sort(&mut self) {
        let Some(numbers) = self.numbers() else { return };
        let mut order: Vec<usize> = (0..numbers.len()).collect();
        order.sort_by(|&a, &b| numbers[a].total_cmp(&numbers[b]));
        let mut places = vec![0; order.len()];
        order.iter().enumerate().for_each(|(place, &from)| places[from] = place);
        self.values = order.iter().map(|&from| self.values[from].clone()).collect();
        self.codes.iter_mut().for_each(|code| *code = places[*code]);
    }

    /// The factor with groups of neighbouring values in place of values, of about as many designs each; `None` if values are no numbers.
    pub fn grouped(&self) -> Option<Self> {
        self.numbers()?;
        let counts: Vec<usize> =
            cells(self.codes.iter().copied(), self.values.len()).iter().map(Vec::len).collect();
        let (mut before, mut groups) = (0, Vec::with_capacity(counts.len()));
        for count in &counts {
            // By the middle of the designs with this value.
            groups.push((2 * before + count) * GROUPS / (2 * self.codes.len()));
            before += count;
        }
        // A value with many designs may leave a group empty.
        let mut used = groups.clone();
        used.dedup();
        let value = |group: &usize| {
            let mut members =
                self.values.iter().zip(&groups).filter(|(_, of)| *of == group).map(|(value, _)| value);
            let first = members.next().cloned().unwrap_or_default();
            members.next_back().map_or(first.clone(), |last| format!("{first} to {last}"))
        };
        let code = |code: &usize| used.iter().position(|group| *group == groups[*code]).unwrap_or_default();
        Some(Self {
            name: self.name.clone(),
            values: used.iter().map(value).collect(),
            codes: self.codes.iter().map(code).collect(),
        })
    }
}

/// Settings that vary, of which those that always change together are one.
pub(crate) fn factors(settings: &[Vec<(String, String)>]) -> Vec<Factor> {
    let mut factors = linked(varied(settings));
    factors.iter_mut().for_each(Factor::sort);
    factors
}

/// Settings that vary, with values in order of first use.
fn varied(settings: &[Vec<(String, String)>]) -> Vec<Factor> {
    let mut factors: Vec<Factor> = Vec::new();
    let mut places: HashMap<&str, usize> = HashMap::new();
    let mut known: Vec<HashMap<&str, usize>> = Vec::new();
    for (at, (path, value)) in
        settings.iter().enumerate().flat_map(|(at, set)| set.iter().map(move |s| (at, s)))
    {
        let place = *places.entry(path).or_insert_with(|| {
            factors.push(Factor { name: path.clone(), values: Vec::new(), codes: vec![0; settings.len()] });
            known.push(HashMap::new());
            known.len() - 1
        });
        let factor = &mut factors[place];
        let code = *known[place].entry(value).or_insert_with(|| {
            factor.values.push(value.clone());
            factor.values.len() - 1
        });
        factor.codes[at] = code;
    }
    factors.retain(|factor| factor.values.len() > 1);
    factors
}

/// Factors of which settings that always change together are one.
fn linked(factors: Vec<Factor>) -> Vec<Factor> {
    let mut kept: Vec<Factor> = Vec::new();
    for factor in factors {
        match kept.iter_mut().find(|other| other.codes == factor.codes) {
            Some(other) => {
                other.name = format!("{} + {}", other.name, factor.name);
                other.values =
                    other.values.iter().zip(&factor.values).map(|(a, b)| format!("{a} + {b}")).collect();
            }
            None => kept.push(factor),
        }
    }
    kept
}

/// Values of a design, with 0 for the one that is left out.
pub(crate) fn codes(factors: &[Factor], at: usize, without: Option<usize>) -> Vec<usize> {
    let code = |(place, factor): (usize, &Factor)| if Some(place) == without { 0 } else { factor.codes[at] };
    factors.iter().enumerate().map(code).collect()
}

/// Members of each of `count` cells.
pub(crate) fn cells(of: impl Iterator<Item = usize>, count: usize) -> Vec<Vec<usize>> {
    let mut cells = vec![Vec::new(); count];
    of.enumerate().for_each(|(at, cell)| cells[cell].push(at));
    cells
}
