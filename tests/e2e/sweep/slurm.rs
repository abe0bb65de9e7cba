//! A sweep on Slurm: two nodes on this machine, from the packages `slurm-wlm` and `munge` of Debian.

use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use super::{SWEEP, merged, point_files, run_all};
use crate::support::Inputs;

/// Longest wait for anything, in seconds.
const PATIENCE_S: u64 = 240;

/// Slurm with two nodes of one processor each, in a temporary folder.
struct Cluster {
    folder: TempDir,
    daemons: Vec<Child>,
}

impl Cluster {
    /// Starts it and waits for its nodes.
    fn start() -> Self {
        let folder = TempDir::new().unwrap();
        let root = folder.path();
        fs::create_dir_all(root.join("state")).unwrap();
        fs::write(root.join("slurm.conf"), configuration(root)).unwrap();
        write_key(&root.join("munge.key"));
        let mut cluster = Self { folder, daemons: Vec::new() };
        let munge = ["socket", "key-file", "pid-file", "log-file", "seed-file"].map(|name| {
            let file = if name == "key-file" { "munge.key".to_owned() } else { format!("munge.{name}") };
            format!("--{name}={}", cluster.path(&file).display())
        });
        let munge: Vec<&str> = munge.iter().map(String::as_str).collect();
        // The folder belongs to this user and not to that of the package.
        cluster.daemon("munged", &[&["--foreground", "--force"], &munge[..]].concat());
        cluster.wait("munge", |cluster| cluster.path("munge.socket").exists());
        cluster.daemon("slurmctld", &["-D", "-c"]);
        ["n0", "n1"].iter().for_each(|node| cluster.daemon("slurmd", &["-D", "-N", node]));
        cluster.wait("two nodes", |cluster| {
            cluster.try_call("sinfo", &["-h", "-N", "-o", "%T"]).is_ok_and(|text| text == "idle\nidle")
        });
        cluster
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.env("SLURM_CONF", self.path("slurm.conf")).stdin(Stdio::null());
        command
    }

    fn daemon(&mut self, program: &str, args: &[&str]) {
        let log = fs::File::create(self.path(&format!("{}.{program}.out", self.daemons.len()))).unwrap();
        let mut command = self.command(program);
        // They are not in the path of all users.
        let path = std::env::var("PATH").unwrap_or_default() + ":/usr/sbin";
        command.env("PATH", path).args(args).stdout(log.try_clone().unwrap()).stderr(log);
        self.daemons.push(command.spawn().unwrap());
    }

    /// Standard output of a program, or what went wrong.
    fn try_call(&self, program: &str, args: &[&str]) -> Result<String, String> {
        let ended = self.command(program).args(args).output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
        if ended.status.success() { Ok(text(&ended.stdout)) } else { Err(text(&ended.stderr)) }
    }

    fn call(&self, program: &str, args: &[&str]) -> String {
        self.try_call(program, args).unwrap_or_else(|error| panic!("{program} {args:?}: {error}"))
    }

    /// Waits until `holds`.
    fn wait(&self, what: &str, holds: impl Fn(&Self) -> bool) {
        let started = Instant::now();
        while !holds(self) {
            assert!(started.elapsed() < Duration::from_secs(PATIENCE_S), "no {what}: {}", self.state());
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Queue and logs, for a message.
    fn state(&self) -> String {
        let queue = self.try_call("squeue", &["-r"]);
        let logs = fs::read_dir(self.folder.path()).unwrap().map(|entry| entry.unwrap().path());
        let logs = logs.filter(|path| path.extension().is_some_and(|ending| ending == "out"));
        let logs = logs.map(|path| format!("{}: {}\n", path.display(), fs::read_to_string(&path).unwrap()));
        format!("{queue:?}\n{}", logs.collect::<String>())
    }

    /// Submits the sweep; returns the numbers of its array and of its merge job.
    fn submit(&self, file: &str, out: &str) -> [String; 2] {
        let args = ["sweep", "slurm", file, "--out", out, "--tasks", "4", "--submit", "--json"];
        let printed: serde_json::Value =
            serde_json::from_str(&self.call(env!("CARGO_BIN_EXE_quintile"), &args)).unwrap();
        [0, 1].map(|job| printed["jobs"][job].as_str().unwrap().to_owned())
    }

    /// Waits until no job is left.
    fn wait_for_jobs(&self) {
        self.wait("end of the jobs", |cluster| cluster.call("squeue", &["-h"]).is_empty());
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        let _ = self.try_call("scancel", &["--signal=KILL", "--state=running"]);
        for daemon in self.daemons.iter_mut().rev() {
            let _ = Command::new("kill").arg(daemon.id().to_string()).status();
            let started = Instant::now();
            while daemon.try_wait().is_ok_and(|ended| ended.is_none()) {
                if started.elapsed() > Duration::from_secs(5) {
                    let _ = daemon.kill();
                }
                std::thread::sleep(Duration::from_millis(50));
            }
        }
    }
}

/// A key that this user alone may read.
fn write_key(path: &Path) {
    use std::io::{Read, Write};
    use std::os::unix::fs::OpenOptionsExt;
    let mut key = [0; 1024];
    fs::File::open("/dev/urandom").unwrap().read_exact(&mut key).unwrap();
    let file = fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(path);
    file.unwrap().write_all(&key).unwrap();
}

fn configuration(root: &Path) -> String {
    let word = |program: &str, option: &str| {
        let output = Command::new(program).args(Some(option).filter(|option| !option.is_empty())).output();
        String::from_utf8(output.unwrap().stdout).unwrap().trim().to_owned()
    };
    let (root, host, user) = (root.display(), word("hostname", ""), word("id", "-un"));
    // Held together, so that they differ.
    let sockets = [0; 3].map(|_| TcpListener::bind("127.0.0.1:0").unwrap());
    let [port, first, second] = sockets.map(|socket| socket.local_addr().unwrap().port());
    format!(
        "ClusterName=test\nSlurmctldHost={host}(127.0.0.1)\nSlurmctldPort={port}\nSlurmUser={user}\nSlurmdUser={user}\n\
         AuthType=auth/munge\nAuthInfo=socket={root}/munge.socket\nMpiDefault=none\nProctrackType=proctrack/linuxproc\n\
         TaskPlugin=task/none\nReturnToService=2\nSlurmctldPidFile={root}/slurmctld.pid\nSlurmdPidFile={root}/slurmd.%n.pid\n\
         SlurmdSpoolDir={root}/spool.%n\nStateSaveLocation={root}/state\nSchedulerType=sched/backfill\n\
         SchedulerParameters=bf_interval=1,sched_interval=1\nSelectType=select/cons_tres\nSelectTypeParameters=CR_CPU\n\
         AccountingStorageType=accounting_storage/none\nJobAcctGatherType=jobacct_gather/none\n\
         NodeName=n0 NodeHostname={host} NodeAddr=127.0.0.1 Port={first} CPUs=1 State=UNKNOWN\n\
         NodeName=n1 NodeHostname={host} NodeAddr=127.0.0.1 Port={second} CPUs=1 State=UNKNOWN\n\
         PartitionName=main Nodes=n[0-1] Default=YES MaxTime=INFINITE State=UP\n"
    )
}

/// 24 points of some tenths of a second.
fn points() -> String {
    SWEEP
        .replace("\"frames\": (0, 2)", "\"frames\": (0, 2), \"size\": (320, 240), \"samples\": 8")
        .replace("axes: [", "repetitions: 6, axes: [")
}

/// A program called `sbatch` in place of Slurm.
#[test]
fn both_scripts_are_submitted_or_the_message_of_sbatch_is_shown() {
    let inputs = Inputs::new();
    let (file, out, bin) = (inputs.put("tiles.ron", SWEEP), inputs.path("out"), inputs.path("bin"));
    fs::create_dir(&bin).unwrap();
    let submit = |sbatch: Option<&str>| {
        if let Some(script) = sbatch {
            let path = Path::new(&bin).join("sbatch");
            fs::write(&path, format!("#!/bin/sh\necho \"$@\" >> '{bin}/log'\n{script}\n")).unwrap();
            let executable = std::os::unix::fs::PermissionsExt::from_mode(0o755);
            fs::set_permissions(&path, executable).unwrap();
        }
        let mut command = Command::new(env!("CARGO_BIN_EXE_quintile"));
        let path = if sbatch.is_some() { format!("{bin}:/usr/bin:/bin") } else { bin.clone() };
        command.args(["sweep", "slurm", &file, "--out", &out, "--submit"]).env("PATH", path).output().unwrap()
    };
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let missing = submit(None);
    assert_eq!(missing.status.code(), Some(1));
    assert!(text(&missing.stderr).contains("leave out --submit"), "{}", text(&missing.stderr));
    let both = submit(Some("echo '17;cluster'"));
    assert!(
        text(&both.stdout).contains("submitted as job 17, and job 17 to merge"),
        "{}",
        text(&both.stdout)
    );
    let log = fs::read_to_string(Path::new(&bin).join("log")).unwrap();
    let expected = format!("--parsable {out}/array.sh\n--parsable --dependency=afterany:17 {out}/merge.sh\n");
    assert_eq!(log, expected);
    let refused =
        submit(Some("case \"$*\" in *merge*) echo 'no such partition' >&2; exit 1;; esac; echo 18"));
    assert_eq!(refused.status.code(), Some(1));
    for says in ["no such partition", "the array is submitted as job 18"] {
        assert!(text(&refused.stderr).contains(says), "{}", text(&refused.stderr));
    }
    let other = submit(Some("echo hello"));
    assert!(text(&other.stderr).contains("it printed `hello`"), "{}", text(&other.stderr));
}

#[test]
#[cfg_attr(not(slurm), ignore = "Slurm and munge are not installed")]
fn a_cluster_merges_to_the_bytes_of_a_local_run_though_a_task_is_killed_and_one_requeued() {
    let inputs = Inputs::new();
    let file = inputs.put("tiles.ron", points());
    let [local, out] = ["local", "out"].map(|name| inputs.path(name));
    let cluster = Cluster::start();
    let [array, _] = cluster.submit(&file, &out);
    let log = |task: u32| {
        fs::read_to_string(Path::new(&out).join(format!("slurm-{array}_{task}.log"))).unwrap_or_default()
    };
    let [killed, requeued] = [0, 1].map(|task| format!("{array}_{task}"));
    cluster.wait("first results of two tasks", |_| [0, 1].iter().all(|&task| log(task).contains("1/6 ")));
    cluster.call("scancel", &["--signal=KILL", "--batch", &killed]);
    cluster.call("scontrol", &["requeue", &requeued]);
    let is_pending = |cluster: &Cluster| {
        cluster.call("squeue", &["-h", "-r", "--states=PENDING", "-o", "%F_%K"]).contains(&requeued)
    };
    cluster.wait("place in the queue", is_pending);
    // Slurm would wait for two minutes.
    cluster.call("scontrol", &["update", &format!("JobId={requeued}"), "StartTime=now"]);
    cluster.wait_for_jobs();

    assert!(log(0).contains("CANCELLED") || !log(0).contains("6 of 6"), "{}", log(0));
    assert!(log(1).contains("stopped by a signal: ") && log(1).contains("6 of 6 runs to do"), "{}", log(1));
    let again = log(1).lines().filter(|line| line.contains("of 6 runs to do")).count();
    assert!(again >= 2 && log(1).contains(": 6 of 6 runs finished"), "{}", log(1));
    let finished = point_files(&out).len();
    assert!((18..24).contains(&finished), "{finished} of 24 after a killed task: {}", log(0));
    // The merge job has run, with the points of the killed task as rows without numbers.
    assert!(Path::new(&out).join("results.parquet").exists());

    cluster.submit(&file, &out);
    cluster.wait_for_jobs();
    assert_eq!(point_files(&out).len(), 24);
    let merged_by_job = fs::read(Path::new(&out).join("results.parquet")).unwrap();
    run_all(&file, &local);
    assert!(merged_by_job == merged(&local));
}
