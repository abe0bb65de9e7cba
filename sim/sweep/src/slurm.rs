//! Batch scripts for Slurm: an array of tasks that run the points, and a job that merges.

use std::path::{Path, PathBuf};
use std::process::Command;

use output::dir::OutDir;
use output::table::shell_line;

use crate::{ExpectedRuns, Folder, SweepError};

/// Names of the scripts: the array, and the job that merges.
const SCRIPTS: [&str; 2] = ["array.sh", "merge.sh"];

/// Most tasks of an array: the usual limit `MaxArraySize` of Slurm is 1001.
const MAX_TASKS: usize = 1000;

/// Length of a task that is aimed at, in seconds. A task costs the scheduler about a second.
const TASK_S: f64 = 600.0;

/// Requested wall time over the expected time of a task: nodes and points differ.
const TIME_MARGIN: f64 = 3.0;

/// Shortest requested wall time in minutes.
const MIN_MINUTES: f64 = 10.0;

/// An array of tasks for a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct SlurmArray {
    /// Number of tasks.
    pub tasks: usize,
    /// Threads of a task.
    pub threads: usize,
    /// Requested wall time of a task in minutes.
    pub minutes: u32,
}

impl SlurmArray {
    /// Tasks of `threads` each for runs that are expected to take `expected` on `host_threads`. `tasks` is
    /// their number if it is given; otherwise a task takes about ten minutes.
    pub fn new(expected: &ExpectedRuns, host_threads: usize, threads: usize, tasks: Option<usize>) -> Self {
        let total_s = expected.host_s.unwrap_or(0.0) * host_threads as f64 / threads as f64;
        let packed = libm::ceil(total_s / TASK_S) as usize;
        let tasks = tasks.unwrap_or(packed).clamp(1, MAX_TASKS.min(expected.pending.max(1)));
        let minutes = libm::ceil((TIME_MARGIN * total_s / tasks as f64 / 60.0).max(MIN_MINUTES)) as u32;
        Self { tasks, threads, minutes }
    }

    /// Script of the array, for `sbatch`. The command of `job` is that of a task, without shard and threads.
    pub fn script(&self, job: &SlurmJob<'_>) -> String {
        let Self { tasks, threads, minutes } = self;
        let options = ["--shards", &tasks.to_string(), "--threads", &threads.to_string()].map(str::to_owned);
        let command: Vec<String> = job.command.iter().cloned().chain(options).collect();
        let last = tasks - 1;
        // The program gets the signal in place of the shell, begins no further point, and ends.
        let options = format!(
            "#SBATCH --array=0-{last}\n#SBATCH --cpus-per-task={threads}\n#SBATCH --time={minutes}\n\
             #SBATCH --signal=B:USR1@60\n"
        );
        job.head("", "slurm-%A_%a.log") + &options + &job.exec(&command)
    }
}

/// What both scripts of a sweep need.
#[derive(Clone, Copy, Debug)]
pub struct SlurmJob<'a> {
    /// Name of the sweep.
    pub name: &'a str,
    /// Folder of the sweep.
    pub folder: &'a Path,
    /// Directory at which relative paths of settings begin.
    pub directory: &'a Path,
    /// Command, word by word.
    pub command: &'a [String],
}

impl SlurmJob<'_> {
    /// Script that merges the results, to be submitted after the array.
    pub fn merge_script(&self) -> String {
        self.head("-merge", "slurm-%A.log") + &self.exec(self.command)
    }

    /// First lines of a script whose job is called as the sweep and `ending`.
    fn head(&self, ending: &str, log: &str) -> String {
        // A name with spaces would end the option.
        let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let name: String = self.name.chars().map(plain).collect();
        let log = self.folder.join(log).display().to_string().replace('"', "");
        format!(
            "#!/bin/sh\n#SBATCH --job-name={name}{ending}\n#SBATCH --output=\"{log}\"\n#SBATCH --open-mode=append\n"
        )
    }

    fn exec(&self, command: &[String]) -> String {
        let directory = shell_line(&[self.directory.display().to_string()]);
        format!("cd {directory} && exec {}\n", shell_line(command))
    }
}

/// Place of both scripts in the folder of a sweep.
#[derive(Debug)]
pub struct Scripts(OutDir);

impl Scripts {
    /// Place in `folder`, which is created if missing.
    ///
    /// # Errors
    /// [`SweepError::InTheWay`] if a file there is not of this program or was edited, and if the folder
    /// cannot be written.
    pub fn open(folder: &Folder) -> Result<Self, SweepError> {
        Ok(Self(folder.open("sweep slurm", SCRIPTS)?))
    }

    /// Writes both; returns their paths.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn write(mut self, array: &str, merge: &str) -> Result<[PathBuf; 2], SweepError> {
        for (name, text) in SCRIPTS.into_iter().zip([array, merge]) {
            self.0.write_file(name, |out| Ok(out.write_all(text.as_bytes())?))?;
        }
        self.0.publish()?;
        Ok(SCRIPTS.map(|name| self.0.path().join(name)))
    }
}

/// Submits [`Scripts`] by `sbatch`: the array, and the merge job for when it has ended. Returns the numbers of
/// both jobs.
///
/// # Errors
/// [`SweepError::Slurm`] if `sbatch` is not there or refuses a script.
pub fn submit([array, merge]: [&Path; 2]) -> Result<[String; 2], SweepError> {
    let array = sbatch(&[], array)?;
    let merge = sbatch(&[&format!("--dependency=afterany:{array}")], merge).map_err(|error| {
        SweepError::Slurm(format!(
            "{error}; the array is submitted as job {array}: merge by hand once it has ended"
        ))
    })?;
    Ok([array, merge])
}

/// Number of the job that `sbatch` makes of `script`.
fn sbatch(options: &[&str], script: &Path) -> Result<String, SweepError> {
    let wrong = |message: String| SweepError::Slurm(format!("sbatch {}: {message}", script.display()));
    let ended = Command::new("sbatch").arg("--parsable").args(options).arg(script).output();
    let ended = ended.map_err(|error| {
        wrong(format!("cannot be started: {error}; submit where Slurm is installed, or leave out --submit"))
    })?;
    if !ended.status.success() {
        return Err(wrong(String::from_utf8_lossy(&ended.stderr).trim().replace('\n', "; ")));
    }
    // The name of the cluster may follow.
    let text = String::from_utf8_lossy(&ended.stdout);
    let number = text.trim().split(';').next().unwrap_or_default();
    match number.parse::<u64>() {
        Ok(_) => Ok(number.to_owned()),
        Err(_) => Err(wrong(format!("it printed `{}`, and no number of a job", text.trim()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(pending: usize, host_s: f64, tasks: Option<usize>) -> SlurmArray {
        let expected = ExpectedRuns { runs: pending, pending, host_s: Some(host_s) };
        SlurmArray::new(&expected, 8, 2, tasks)
    }

    #[test]
    fn points_are_packed_into_tasks_of_minutes() {
        // 8 threads for an hour are 14400 s of two threads.
        assert_eq!(array(500, 3600.0, None), SlurmArray { tasks: 24, threads: 2, minutes: 30 });
        assert_eq!(array(500, 1.0, None), SlurmArray { tasks: 1, threads: 2, minutes: 10 });
        assert_eq!(array(100_000, 1e7, None).tasks, MAX_TASKS);
        assert_eq!(array(5, 3600.0, None).tasks, 5);
        assert_eq!(array(500, 3600.0, Some(4)), SlurmArray { tasks: 4, threads: 2, minutes: 180 });
    }

    #[test]
    fn scripts_quote_names_and_paths() {
        let command = ["/opt/my tools/quintile", "sweep", "run", "a b.ron"].map(str::to_owned);
        let [folder, directory] = ["/scratch/a", "/home/me"].map(Path::new);
        let job = SlurmJob { name: "tile sizes", folder, directory, command: &command };
        let text = array(500, 3600.0, Some(4)).script(&job);
        assert!(text.contains("#SBATCH --signal=B:USR1@60\n"), "{text}");
        assert!(text.contains("#SBATCH --array=0-3\n") && text.contains("--job-name=tile_sizes\n"), "{text}");
        let last =
            "cd /home/me && exec '/opt/my tools/quintile' sweep run 'a b.ron' --shards 4 --threads 2\n";
        assert!(text.ends_with(last), "{text}");
        let merge = job.merge_script();
        assert!(
            merge.contains("--job-name=tile_sizes-merge\n") && merge.starts_with("#!/bin/sh\n"),
            "{merge}"
        );
    }
}
