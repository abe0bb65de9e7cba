//! Strata of units with like signatures, and the representatives drawn from each.

/// Fewest representatives of a stratum: with one nothing is known of its spread.
const LEAST: usize = 2;
/// Fewest of all: two strata, so that the line through all of them leaves something over.
const FEWEST: usize = 2 * LEAST;

/// Units whose signatures are neighbours.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stratum {
    /// Its units, in the order of their signatures.
    pub members: Vec<usize>,
    /// Those of them that are to be measured, in the same order.
    pub chosen: Vec<usize>,
}

/// Which units are measured, and for which others they stand.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Design {
    strata: Vec<Stratum>,
    /// The stratum of each unit.
    of: Vec<usize>,
}

impl Design {
    /// Cuts units into as many strata of (nearly) equal size as pairs of `representatives` allow, in the order of `signature`
    /// (ties in their own order), and draws two or three from each without replacement. `random` gives a random word for
    /// each unit; the same words give the same design. A unit that is measured anyway, `certain`, counts as a representative and
    /// stands for nobody but itself: it is a stratum of its own, the last.
    ///
    /// Equal sizes with equal draws make every unit as likely as any other, so a stratified mean is a plain one (Cochran
    /// 1977, 5.3). Twice as many representatives hold those of the first design: strata are cut in two, and those drawn from a
    /// whole are drawn from its parts.
    ///
    /// Fewer than 4 representatives drawn are taken as 4, more than there are units as all.
    pub fn draw(
        signature: &[f64],
        certain: Option<usize>,
        representatives: usize,
        random: impl Fn(u64) -> u64,
    ) -> Self {
        let mut order: Vec<usize> = (0..signature.len()).filter(|&unit| Some(unit) != certain).collect();
        let units = order.len();
        let wanted = representatives.saturating_sub(certain.iter().len()).max(FEWEST).min(units);
        order.sort_by(|&a, &b| signature[a].total_cmp(&signature[b]).then(a.cmp(&b)));
        let parts = (wanted / LEAST).max(1);
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
        for (stratum, place) in strata.iter().zip(0..) {
            stratum.members.iter().for_each(|&unit| of[unit] = place);
        }
        Self { strata, of }
    }

    /// The strata, that of the smallest signatures first, the one that was certain last.
    pub fn strata(&self) -> &[Stratum] {
        &self.strata
    }

    /// The stratum of a unit.
    pub fn stratum_of(&self, unit: usize) -> usize {
        self.of[unit]
    }

    /// How many units there are.
    pub fn units(&self) -> usize {
        self.of.len()
    }

    /// All representatives, in the order of their numbers.
    pub fn chosen(&self) -> Vec<usize> {
        let mut all: Vec<usize> = self.strata.iter().flat_map(|stratum| stratum.chosen.clone()).collect();
        all.sort_unstable();
        all
    }
}

/// Draws `count` of `members`: those with the smallest random words, each a function of the unit alone.
fn draw(members: &[usize], count: usize, random: &impl Fn(u64) -> u64) -> Vec<usize> {
    let mut words: Vec<(u64, usize)> =
        members.iter().zip(0..).map(|(&unit, place)| (random(unit as u64), place)).collect();
    words.sort_unstable();
    let mut places: Vec<usize> = words[..count].iter().map(|&(_, place)| place).collect();
    places.sort_unstable();
    places.into_iter().map(|place| members[place]).collect()
}
