#!/usr/bin/env python3
"""The whole analysis of a long trace beside chunked-FFT least squares in numpy and stumpy, by turns in one run.

    beside_peers.py PEERS QUINTILE [--n 100000000] [--stumpy-n 10000000] [--rounds 3] [--dir DIR]

PEERS is a folder, not part of the repository, with `baseline.py` (both rivals: profile, spaced minima, threshold) and
`bench_throughput.py` (the trace). QUINTILE is the program. Times are by the clock and of the CPU; ours with two threads, file to
frames.csv. numpy starts from memory, and once more from the same file. stumpy is run on fewer samples: its time is linear.
"""
import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import time

WORKER = """
import sys, time, json, resource
sys.path.insert(0, sys.argv[1])
import numpy as np, baseline as b
from bench_throughput import trace
method, n, file = sys.argv[2], int(sys.argv[3]), sys.argv[4]
m, fs, sep = 250, 50_000.0, 100
x, mk = trace(n)
a = m // 5
q = x[mk - a:mk - a + m].copy()
if method == "stumpy":
    import stumpy
    stumpy.mass(q, x[:5000].copy())
if method == "file":
    del x
t0, c0 = time.perf_counter(), time.process_time()
if method == "file":
    import pyarrow.parquet as pq
    t = pq.read_table(file, columns=["voltage_V", "current_A"])
    x = t["voltage_V"].to_numpy().astype(np.float64) * t["current_A"].to_numpy()
d = b.profile("stumpy" if method == "stumpy" else "numpy", q, x)
cand = b.spaced_minima(d, sep)
thr = b.otsu_log(d[cand[np.abs(cand - (mk - a)) > sep]])
s = b.starts_below(d, thr, sep) + a
b.energies(x, fs, s)
print(json.dumps([time.perf_counter() - t0, time.process_time() - c0, len(s),
                  resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024]))
"""

WRITER = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np, pyarrow as pa, pyarrow.parquet as pq
from bench_throughput import trace
n, file = int(sys.argv[2]), sys.argv[3]
x, mk = trace(n)
schema = pa.schema([("time_ns", pa.int64()), ("voltage_V", pa.float32()), ("current_A", pa.float32())])
layout = dict(compression="snappy", use_dictionary=["voltage_V", "current_A"],
              column_encoding={"time_ns": "DELTA_BINARY_PACKED"})
with pq.ParquetWriter(file, schema, **layout) as out:
    for s in range(0, n, 1 << 20):
        p = x[s:s + (1 << 20)]
        v = np.full(len(p), 5.0, np.float32)
        i = (np.round(p / 5.0 / 2.0 * 8192) * 2.0 / 8192).astype(np.float32)
        t = np.arange(s, s + len(p), dtype=np.int64) * 20_000
        out.write_table(pa.table([t, v, i], schema=schema))
print(mk / 50_000.0)
"""


def peer(peers, method, n, file):
    out = subprocess.run([sys.executable, "-c", WORKER, peers, method, str(n), file], capture_output=True, text=True)
    if out.returncode:
        sys.exit(out.stderr)
    return json.loads(out.stdout.strip().splitlines()[-1])


def ours(program, file, mark, table):
    before, t0 = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    words = [program, "trace", "frames", file, "--mark", mark, "--threads", "2", "--out", table]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    wall, after = time.perf_counter() - t0, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    with open(table) as lines:
        return [wall, cpu, sum(1 for _ in lines) - 1, 0]


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("peers")
    a.add_argument("program")
    a.add_argument("--n", type=int, default=100_000_000)
    a.add_argument("--stumpy-n", type=int, default=10_000_000)
    a.add_argument("--rounds", type=int, default=3)
    a.add_argument("--dir", default="/tmp")
    a = a.parse_args()
    file, table = os.path.join(a.dir, f"beside_{a.n}.parquet"), os.path.join(a.dir, "beside.csv")
    mark = file + ".mark"
    if not os.path.exists(mark):
        out = subprocess.run([sys.executable, "-c", WRITER, a.peers, str(a.n), file], capture_output=True, text=True)
        if out.returncode:
            sys.exit(out.stderr)
        with open(mark, "w") as to:
            to.write(out.stdout.strip())
    with open(mark) as was:
        mark_s = was.read()
    print(f"{os.path.getsize(file) / 1e6:.0f} MB, mark at {mark_s} s")
    runs = {"quintile": [], "memory": [], "file": [], "stumpy": []}
    for _ in range(a.rounds):
        runs["quintile"].append(ours(a.program, file, mark_s, table))
        runs["memory"].append(peer(a.peers, "memory", a.n, file))
        runs["quintile"].append(ours(a.program, file, mark_s, table))
        runs["file"].append(peer(a.peers, "file", a.n, file))
    if a.stumpy_n:
        runs["stumpy"].append(peer(a.peers, "stumpy", a.stumpy_n, file))
    median = {name: [statistics.median(run[k] for run in of) for k in range(4)] for name, of in runs.items() if of}
    for name, (wall, cpu, starts, mib) in median.items():
        n = a.stumpy_n if name == "stumpy" else a.n
        base = median["quintile"]
        scale = a.n / n
        print(f"{name:9} {wall:8.2f} s by the clock, {cpu:7.2f} s CPU, {n / wall / 1e6:7.2f} Msamples/s, {starts:.0f} starts, "
              f"{mib:.0f} MiB; ours is {wall * scale / base[0]:.1f} times as fast by the clock, {cpu * scale / base[1]:.1f} by CPU")


if __name__ == "__main__":
    main()
