//! Shards: each of `n` tasks runs every n-th point.

use std::fmt;

use serde::Serialize;

use crate::SweepError;

/// Part `index` of `count` parts of the points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(into = "String")]
pub struct Shard {
    /// Number of the part, from 0.
    index: usize,
    /// Number of parts, at least 1.
    count: usize,
}

impl Default for Shard {
    /// All points.
    fn default() -> Self {
        Self { index: 0, count: 1 }
    }
}

impl fmt::Display for Shard {
    /// As [`Shard::parse`] reads it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index + 1, self.count)
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> Self {
        shard.to_string()
    }
}

/// Variables with the number of a task, and with the number of tasks where the scheduler gives it.
const VARIABLES: [(&str, Option<&str>); 3] = [
    ("SLURM_ARRAY_TASK_ID", Some("SLURM_ARRAY_TASK_COUNT")),
    ("PBS_ARRAY_INDEX", None),
    ("HQ_TASK_ID", None),
];

impl Shard {
    /// The shard `text`, such as `2/8`: the second of eight.
    ///
    /// # Errors
    /// In words, if it is no such pair.
    pub fn parse(text: &str) -> Result<Self, String> {
        let numbers =
            text.split_once('/').and_then(|(i, n)| Some((i.trim().parse().ok()?, n.trim().parse().ok()?)));
        match numbers {
            Some((number, count)) if (1..=count).contains(&number) => Ok(Self { index: number - 1, count }),
            _ => Err(format!("`{text}` is no shard; write 1/8 to 8/8 for eight of them")),
        }
    }

    /// The shard of this task by the variables of Slurm, PBS or HyperQueue, which `variable` looks up; all points outside of
    /// a task. `count` is the number of tasks if it is given; PBS and HyperQueue do not say it.
    ///
    /// Numbers of tasks may start at 0, 1 or elsewhere: those that follow each other are different shards.
    ///
    /// # Errors
    /// If a variable is not a number, or the number of tasks is unknown.
    pub fn of_task(
        count: Option<usize>,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<Self, SweepError> {
        let number = |name: &str, text: String| {
            let parsed = text.trim().parse::<usize>();
            parsed.map_err(|_| {
                SweepError::Shard(format!("{name}: `{text}` is not a number of a task; give --shard i/n"))
            })
        };
        let task = VARIABLES.into_iter().find_map(|(task, tasks)| Some((task, variable(task)?, tasks)));
        let Some((task, text, tasks)) = task else {
            return match count {
                None => Ok(Self::default()),
                Some(_) => Err(SweepError::Shard(
                    "--shards: no scheduler gives the number of this task; give --shard i/n".to_owned(),
                )),
            };
        };
        let given = tasks.and_then(|tasks| Some((tasks, variable(tasks)?)));
        let count = match (count, given) {
            (Some(count), _) => count,
            (None, Some((tasks, text))) => number(tasks, text)?,
            (None, None) => {
                return Err(SweepError::Shard(format!(
                    "{task} is set, and the number of tasks is not: give --shards N"
                )));
            }
        };
        let count = count.max(1);
        Ok(Self { index: number(task, text)? % count, count })
    }

    /// Whether it is all points.
    pub const fn is_whole(self) -> bool {
        self.count == 1
    }

    /// Whether point `index` belongs to it.
    pub(crate) const fn has(self, index: usize) -> bool {
        index % self.count == self.index
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(count: Option<usize>, variables: &[(&str, &str)]) -> Result<Shard, String> {
        let variable = |name: &str| Some(variables.iter().find(|(known, _)| *known == name)?.1.to_owned());
        Shard::of_task(count, variable).map_err(|error| error.to_string())
    }

    #[test]
    fn shards_are_read_from_options_and_variables() {
        let slurm = |id| [("SLURM_ARRAY_TASK_ID", id), ("SLURM_ARRAY_TASK_COUNT", "4")];
        assert_eq!(Shard::parse("2/4"), Ok(Shard { index: 1, count: 4 }));
        assert_eq!(Shard::parse("2/4").unwrap().to_string(), "2/4");
        assert_eq!(of(None, &slurm("4")), Ok(Shard { index: 0, count: 4 }));
        assert_eq!(of(Some(8), &slurm("5")), Ok(Shard { index: 5, count: 8 }));
        assert_eq!(of(Some(3), &[("PBS_ARRAY_INDEX", "2")]), Ok(Shard { index: 2, count: 3 }));
        assert_eq!(of(Some(3), &[("HQ_TASK_ID", "0")]), Ok(Shard { index: 0, count: 3 }));
        assert_eq!(of(None, &[]), Ok(Shard::default()));
    }

    #[test]
    fn wrong_shards_say_what_to_give() {
        for text in ["0/4", "5/4", "1", "a/b", "1/0"] {
            assert!(Shard::parse(text).unwrap_err().contains("is no shard"), "{text}");
        }
        assert!(of(None, &[("PBS_ARRAY_INDEX", "2")]).unwrap_err().contains("give --shards N"));
        assert!(of(Some(2), &[("HQ_TASK_ID", "x")]).unwrap_err().contains("not a number of a task"));
        assert!(of(Some(2), &[]).unwrap_err().contains("give --shard i/n"));
    }

    #[test]
    fn shards_share_all_points() {
        for point in 0..20 {
            let owners = (1..=3).filter(|n| Shard::parse(&format!("{n}/3")).unwrap().has(point)).count();
            assert_eq!(owners, 1);
        }
    }
}
