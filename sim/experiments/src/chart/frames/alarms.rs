//! How many wrong and right results carry an alarm.

use serde::Serialize;

/// How many frames or searches are wrong and right, and how many of each carry a flag or a warning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct AlarmCount {
    /// Wrong ones: frames with an end that is not a true one, or a start missed within; searches that fail
    /// ([`FAILS_BELOW`](super::FAILS_BELOW)).
    pub wrong: usize,
    /// Number of them with an alarm.
    pub wrong_with: usize,
    /// The others.
    pub right: usize,
    /// Number of them with an alarm all the same.
    pub right_with: usize,
}

impl AlarmCount {
    /// Counts one more.
    pub(super) fn add(&mut self, right: bool, alarm: bool) {
        let (all, some) = if right {
            (&mut self.right, &mut self.right_with)
        } else {
            (&mut self.wrong, &mut self.wrong_with)
        };
        *all += 1;
        *some += usize::from(alarm);
    }

    /// The sum of all.
    pub(super) fn sum<'a>(counts: impl IntoIterator<Item = &'a Self>) -> Self {
        counts.into_iter().fold(Self::default(), |sum, more| Self {
            wrong: sum.wrong + more.wrong,
            wrong_with: sum.wrong_with + more.wrong_with,
            right: sum.right + more.right,
            right_with: sum.right_with + more.right_with,
        })
    }

    /// How many of the wrong ones have an alarm: `2 of 3`.
    pub(super) fn of_wrong(self) -> String {
        format!("{} of {}", self.wrong_with, self.wrong)
    }

    /// How many of the right ones have one all the same.
    pub(super) fn of_right(self) -> String {
        format!("{} of {}", self.right_with, self.right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_added_to_their_kind() {
        let mut one = AlarmCount::default();
        [(true, false), (false, true), (false, false)]
            .into_iter()
            .for_each(|(right, alarm)| one.add(right, alarm));
        let two = AlarmCount::sum([&one, &one]);
        assert_eq!(two, AlarmCount { wrong: 4, wrong_with: 2, right: 2, right_with: 0 });
        assert_eq!([two.of_wrong(), two.of_right()], ["2 of 4", "0 of 2"]);
    }
}
