#!/usr/bin/env python3
"""Runs the shards of a sweep as tasks of Ray, and merges.

    python ray_sweep.py tiles.ron --out tiles --shards 16
    python ray_sweep.py tiles.ron --out tiles --shards 400 --address auto

Without --address a cluster is started on this machine. On several machines, file and folder have to be on a disk that all of
them see. A shard whose machine is lost, or that was stopped by a signal, is run again; finished points are skipped.
"""

import argparse
import os
import subprocess
import sys

import ray

# `quintile` after USR1 and TERM; killed by the system.
STOPPED = (138, 143, -9, -15)


class Stopped(Exception):
    """A shard ended before its points did."""


def run_shard(command, directory):
    """Runs one shard; returns its exit code and the last lines of its messages."""
    ended = subprocess.run(command, cwd=directory, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    if ended.returncode in STOPPED:
        raise Stopped(f"{' '.join(command)}: stopped")
    return ended.returncode, ended.stderr.splitlines()[-3:]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", help="the sweep file")
    parser.add_argument("--out", default="sweep", help="folder of the sweep")
    parser.add_argument("--shards", type=int, default=2 * (os.cpu_count() or 1), help="number of tasks")
    parser.add_argument("--threads", type=int, default=1, help="threads of a task")
    parser.add_argument("--address", help="a running cluster; without it one is started on this machine")
    parser.add_argument("--quintile", default="quintile", help="the program")
    parser.add_argument("--quick", action="store_true", help="as for `quintile sweep run`")
    options = parser.parse_args()
    if options.shards < 1 or options.threads < 1:
        parser.error("--shards and --threads have to be 1 or more")

    sweep = [options.quintile, "sweep"]
    quick = ["--quick"] * options.quick
    # Wrong files are refused before any task.
    planned = subprocess.run([*sweep, "plan", options.file, "--out", options.out, *quick])
    if planned.returncode != 0:
        return planned.returncode

    ray.init(address=options.address, include_dashboard=False, log_to_driver=False)
    task = ray.remote(num_cpus=options.threads, max_retries=3, retry_exceptions=[Stopped])(run_shard)
    run = [*sweep, "run", options.file, "--out", options.out, "--threads", str(options.threads), *quick]
    count = options.shards
    shards = {task.remote([*run, "--shard", f"{i}/{count}"], os.getcwd()): i for i in range(1, count + 1)}
    pending, failed = list(shards), 0
    while pending:
        done, pending = ray.wait(pending)
        for shard in done:
            name = f"shard {shards[shard]}/{count}"
            try:
                code, messages = ray.get(shard)
            except Exception as error:
                code, messages = 1, [str(error).splitlines()[-1]]
            failed += code != 0
            print(f"{name}: {'done' if code == 0 else ' '.join(messages)}", file=sys.stderr)
    # A shard with a point that failed ends with 1, and is finished: `merge` refuses what is not.
    merged = subprocess.run([*sweep, "merge", options.out]).returncode
    if failed:
        print(f"{failed} of {count} shards with failures, see above", file=sys.stderr)
    return merged or int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
