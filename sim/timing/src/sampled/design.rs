//! Stratified sampling: strata of units with similar signatures, and the representatives drawn from each.

/// Fewest representatives per stratum; one would not show the variance.
const MIN_PER_STRATUM: usize = 2;
/// Fewest representatives in all: two strata, so the regression has residuals.
const MIN_REPRESENTATIVES: usize = 2 * MIN_PER_STRATUM;

/// Units with neighbouring signatures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stratum {
    /// Its units, sorted by signature.
    pub members: Vec<usize>,
    /// Its representatives, in the same order.
    pub chosen: Vec<usize>,
}

/// The strata, and the stratum of every unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Design {
    strata: Vec<Stratum>,
    /// Stratum of each unit.
    of: Vec<usize>,
}

impl Design {
    /// Split units into strata of (nearly) equal size, in the order of `signature`, and draw two or three
    /// representatives from each without replacement. Ties are in the order of the units. There are as many
    /// strata as `representatives` has pairs. `random` returns a random word for each unit; equal words give
    /// equal designs. The unit `certain` is measured in any case: it counts as a representative and forms the
    /// last stratum by itself.
    ///
    /// Equal sizes with equal draws give every unit the same probability, so a stratified mean is a plain
    /// mean (Cochran 1977, 5.3). Doubling `representatives` keeps those of the first design: strata are
    /// halved, and the units drawn from a stratum are drawn from its halves.
    ///
    /// At least 4 representatives are drawn, and at most all units.
    pub fn draw(
        signature: &[f64],
        certain: Option<usize>,
        representatives: usize,
        random: impl Fn(u64) -> u64,
    ) -> Self {
        let mut order: Vec<usize> = (0..signature.len()).filter(|&unit| Some(unit) != certain).collect();
        let units = order.len();
        let wanted = representatives.saturating_sub(certain.iter().len()).max(MIN_REPRESENTATIVES).min(units);
        order.sort_by(|&a, &b| signature[a].total_cmp(&signature[b]).then(a.cmp(&b)));
        let parts = (wanted / MIN_PER_STRATUM).max(1);
        let share = |whole: usize, part: usize| whole * part / parts;
        let mut strata: Vec<Stratum> = (0..parts)
            .map(|part| {
                let members = order[share(units, part)..share(units, part + 1)].to_vec();
                let count = share(wanted, part + 1) - share(wanted, part);
                let chosen = draw(&members, count.min(members.len()), &random);
                Stratum { members, chosen }
            })
            .collect();
        strata.retain(|stratum| !stratum.members.is_empty());
        strata.extend(certain.map(|unit| Stratum { members: vec![unit], chosen: vec![unit] }));
        let mut of = vec![0; signature.len()];
        for (stratum, at) in strata.iter().zip(0..) {
            stratum.members.iter().for_each(|&unit| of[unit] = at);
        }
        Self { strata, of }
    }

    /// All strata, in the order of their signatures; the certain unit's is the last.
    pub fn strata(&self) -> &[Stratum] {
        &self.strata
    }

    /// The stratum of a unit.
    pub fn stratum_of(&self, unit: usize) -> usize {
        self.of[unit]
    }

    /// Number of units.
    pub fn units(&self) -> usize {
        self.of.len()
    }

    /// All representatives, sorted.
    pub fn chosen(&self) -> Vec<usize> {
        let mut all: Vec<usize> = self.strata.iter().flat_map(|stratum| stratum.chosen.clone()).collect();
        all.sort_unstable();
        all
    }
}

/// Draw `count` of `members`: those with the smallest random words, which depend on the unit alone.
fn draw(members: &[usize], count: usize, random: &impl Fn(u64) -> u64) -> Vec<usize> {
    let mut words: Vec<(u64, usize)> =
        members.iter().zip(0..).map(|(&unit, at)| (random(unit as u64), at)).collect();
    words.sort_unstable();
    let mut positions: Vec<usize> = words[..count].iter().map(|&(_, at)| at).collect();
    positions.sort_unstable();
    positions.into_iter().map(|at| members[at]).collect()
}
