#!/usr/bin/env python3
"""JLS of ours compared with pyjls 0.17: samples to the bit, summaries against numpy, times, notes, lost samples; then speed.

    jls_beside_pyjls.py QUINTILE                            files that `quintile trace convert` and `trace sample` write
    jls_beside_pyjls.py --golden FILE                       the golden file of traces/tests/suite/jls_write.rs (JLS_GOLDEN=FILE writes it)
    jls_beside_pyjls.py --speed [--n 100000000]             by turns with pyjls in one run (cargo bench --bench jls_speed)

Needs numpy, pyarrow and pyjls 0.17. Ends with an error at the first difference.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from fractions import Fraction

import numpy as np
from pyjls import DataType, Reader, Writer

UNIX_2018 = 1_514_764_800
SECOND = 1 << 30
BLOCK, ENTRY, FANOUT = 8192, 128, 20


def near(said, truth, share, least, what):
    if np.isnan(truth):
        assert np.isnan(said), f"{what}: {said}, not missing"
    else:
        assert abs(said - truth) <= share * abs(truth) + least, f"{what}: {said}, not {truth}"


def check_samples(reader, number, truth):
    """Read whole, and from places about those where a chunk, an index or a summary ends."""
    assert reader.signals[number].length == len(truth), (reader.signals[number].length, len(truth))
    bits = truth.view(np.uint32)
    assert np.array_equal(reader.fsr(number, 0, len(truth)).view(np.uint32), bits)
    rng = np.random.default_rng(1)
    places = [k * step + d for step in (ENTRY, BLOCK, 10 * BLOCK) for k in (0, 1, 2) for d in (-1, 0, 1)]
    for at in [*places, *rng.integers(0, len(truth), 20), len(truth) - 1]:
        if 0 <= at < len(truth):
            count = int(min(len(truth) - at, rng.integers(1, 3 * BLOCK)))
            assert np.array_equal(reader.fsr(number, int(at), count).view(np.uint32), bits[at : at + count]), at


def check_statistics(reader, number, truth):
    """`fsr_statistics` over spans of every level. One span is put together exactly; of several only those that begin and
    end with entries are: pyjls shares an entry between two spans. What it makes of stretches with lost samples is not
    looked at here, as it counts them in; `check_entries` does."""
    rng = np.random.default_rng(2)
    n, truth = len(truth), truth.astype(np.float64)
    spread = truth.std() + 1e-12
    spans = [(0, n, 1)] if n > 1 else []
    step = ENTRY
    while step <= n:
        spans += [(0, step, n // step), (0, 3 * step, n // (3 * step)), (step, step, n // step - 1)]
        step *= FANOUT
    for _ in range(200):
        span = int(min(n, np.exp(rng.uniform(np.log(2), np.log(max(n, 3))))))
        spans.append((int(rng.integers(0, n - span + 1)), span, 1))
    checked = 0
    for start, span, count in spans:
        if span < 2 or count < 1:
            continue
        parts = truth[start : start + span * count].reshape(count, span)
        for said, part in zip(reader.fsr_statistics(number, start, span, count), parts):
            what = f"signal {number}, {span} samples from {start}"
            near(said[0], part.mean(), 1e-7, 1e-7 * spread, what + ", mean")
            # The deviation of a file is over the number, that of pyjls over one less: up to 1/256 between entries.
            near(said[1], part.std(ddof=1), 5e-3, 1e-7 * abs(part.mean()), what + ", deviation")
            near(said[2], part.min(), 0, 0, what + ", lowest")
            near(said[3], part.max(), 0, 0, what + ", highest")
            checked += 1
    return checked


def chunks(data):
    at = 32
    while at < len(data):
        tag, mark, length = data[at + 16], int.from_bytes(data[at + 18 : at + 20], "little"), int.from_bytes(
            data[at + 20 : at + 24], "little")
        yield tag, mark & 0xFFF, mark >> 12, data[at + 32 : at + 32 + length]
        at += 32 + (0 if length == 0 else (length + 4 + 7) // 8 * 8)


def check_entries(path, number, truth):
    """Every entry of every summary in the file against numpy in f64, lost samples left out; entries per level."""
    with open(path, "rb") as file:
        data = file.read()
    levels = {}
    for tag, signal, level, payload in chunks(data):
        if tag == 0x24 and signal == number:
            levels.setdefault(level, []).append(np.frombuffer(payload[16:], np.float32).reshape(-1, 4))
    told = {}
    for level, parts in levels.items():
        entries, step = np.concatenate(parts).astype(np.float64), ENTRY * FANOUT ** (level - 1)
        assert len(entries) == len(truth) // step, (level, len(entries))
        for entry, part in zip(entries, truth[: len(entries) * step].astype(np.float64).reshape(-1, step)):
            part = part[np.isfinite(part)]
            right = [part.mean(), part.std(), part.min(), part.max()] if len(part) else [np.nan] * 4
            for said, true in zip(entry, right):
                near(said, true, 6.1e-8, 1e-12, f"level {level}")
        told[level] = len(entries)
    return told


def check_times(reader, number, samples, rate_hz, start_s):
    last = samples - 1
    for sample in {0, last // 3, last}:
        truth = (Fraction(start_s) + Fraction(sample) / Fraction(rate_hz) - UNIX_2018) * SECOND
        said = reader.sample_id_to_timestamp(number, sample)
        assert abs(said - truth) <= 2, f"time of sample {sample}: {said}, not {float(truth)}"
    pairs = []
    reader.utc(number, 0, lambda entries: pairs.extend(entries) and False)
    assert [pair[0] for pair in pairs] == [0, last][: min(samples, 2)], pairs


def notes(reader):
    found = []
    reader.user_data(lambda meta, data: found.append((meta, data)) and False)
    assert len(found) == 1, found
    data = found[0][1]
    return (data if isinstance(data, dict) else json.loads(data))["trace"]


def check_whole(path, current, voltage, rate_hz, start_s):
    with Reader(path) as reader:
        named = {signal.name: number for number, signal in reader.signals.items()}
        assert [(s.name, s.units) for n, s in reader.signals.items() if n] == [("current", "A"), ("voltage", "V")]
        said = notes(reader)
        assert (said["rate_hz"], said["start_s"]) == (rate_hz, start_s), said
        spans = 0
        for name, truth in ("current", current), ("voltage", voltage):
            number = named[name]
            assert reader.signals[number].sample_rate == round(rate_hz)
            check_samples(reader, number, truth)
            if np.isfinite(truth).all():
                spans += check_statistics(reader, number, truth)
            levels = check_entries(path, number, truth)
            check_times(reader, number, len(truth), rate_hz, start_s)
    print(f"{os.path.basename(path)}: {len(current)} samples, {spans} spans, entries by level {levels}, "
          f"{os.path.getsize(path) / len(current):.3f} bytes a sample")


def parquet(path, current, voltage, rate_hz, start_s):
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table({"voltage_V": voltage, "current_A": current})
    told = json.dumps({"rate_hz": rate_hz, "start_s": start_s, "device": "JS220-000001"})
    pq.write_table(table.replace_schema_metadata({"trace": told}), path)


def run(program, *words):
    done = subprocess.run([program, "trace", *words], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)


def correctness(program, folder):
    cases = [(1, 50e3, 0.0), (2, 1.0, -3.5), (127, 50e3, 0.0), (128, 1e6, 1.7e9), (8191, 2e6, 0.0), (8193, 44_100.0, 1.7e9 + 0.125),
             (81_920, 50e3, 0.0), (81_920 + 50, 49_999.7, 1e3), (1_638_400 + 50, 1e6, 1.7e9), (3_000_001, 2e6, 0.0)]
    for samples, rate_hz, start_s in cases:
        rng = np.random.default_rng(samples)
        current = (0.5 + 0.2 * rng.standard_normal(samples)).astype(np.float32)
        voltage = (5 + 0.01 * rng.standard_normal(samples)).astype(np.float32)
        source, path = os.path.join(folder, "a.parquet"), os.path.join(folder, f"{samples}.jls")
        parquet(source, current, voltage, rate_hz, start_s)
        run(program, "convert", source, path)
        check_whole(path, current, voltage, rate_hz, start_s)
    lost(program, folder)


def lost(program, folder):
    """What a device loses is missing in Parquet and NaN in JLS, at the same samples."""
    import pyarrow.parquet as pq

    samples = 500_000
    rng = np.random.default_rng(7)
    current = (0.5 + 0.2 * rng.random(samples)).astype(np.float32)
    source = os.path.join(folder, "b.parquet")
    parquet(source, current, np.full(samples, 5, np.float32), 50e3, 0.0)
    paths = [os.path.join(folder, name) for name in ("lost.parquet", "lost.jls")]
    for path in paths:
        run(program, "sample", source, "--device-rate", "50000", "--packet-samples", "512", "--packet-loss", "0.05", "--out", path)
    table = pq.read_table(paths[0])
    start_s = json.loads(pq.read_schema(paths[0]).metadata[b"trace"])["start_s"]
    rows = np.round((table["time_ns"].to_numpy() * 1e-9 - start_s) * 50e3).astype(int)
    with Reader(paths[1]) as reader:
        length = reader.signals[1].length
    assert 0 < len(rows) < length
    truth = []
    for name in "current_A", "voltage_V":
        column = np.full(length, np.nan, np.float32)
        column[rows] = table[name].to_numpy()
        truth.append(column)
    check_whole(paths[1], *truth, 50e3, start_s)
    print(f"{length - len(rows)} lost samples are NaN")


def golden(path):
    with Reader(path) as reader:
        truth = [reader.fsr(number, 0, 30_000) for number in (1, 2)]
    mixed = np.arange(30_000, dtype=np.uint32) * np.uint32(2_654_435_761)
    one = np.float32(1)
    made = [(mixed >> 8 & 0xFFF).astype(np.float32) * np.float32(1e-4) - np.float32(0.1) * one,
            np.float32(3.8) + (mixed >> 20).astype(np.float32) * np.float32(1e-5)]
    for column in made:
        column[1000:1100] = column[29_000:] = np.nan
    assert all(np.array_equal(a.view(np.uint32), b.view(np.uint32)) for a, b in zip(truth, made))
    check_whole(path, *made, 50e3, 1.25)


def theirs(samples, path):
    piece = np.random.default_rng(1).standard_normal(1 << 16).astype(np.float32)
    t0 = time.perf_counter()
    with Writer(path) as writer:
        writer.source_def(1, "a", "", "", "", "")
        for number, name, unit in (1, "current", "A"), (2, "voltage", "V"):
            writer.signal_def(number, 1, data_type=DataType.F32, sample_rate=1_000_000, name=name, units=unit)
        for at in range(0, samples, len(piece)):
            for number in 1, 2:
                writer.fsr(number, at, piece[: samples - at])
    with open(path, "rb+") as file:
        os.fsync(file.fileno())  # ours does
    written = samples / (time.perf_counter() - t0) / 1e6
    size = os.path.getsize(path) / samples
    t0 = time.perf_counter()
    with Reader(path) as reader:
        whole = [reader.fsr(number, 0, samples) for number in (1, 2)]
    read = samples / (time.perf_counter() - t0) / 1e6
    assert all(len(column) == samples for column in whole)
    os.remove(path)
    return {"write": written, "read": read, "bytes_per_sample": size}


def ours(samples, path):
    command = ["cargo", "bench", "-q", "-p", "traces", "--bench", "jls_speed", "--", str(samples), os.path.abspath(path)]
    done = subprocess.run(command, cwd=os.path.dirname(__file__) or ".", capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    return {name: float(value) for name, value in (line.split() for line in done.stdout.splitlines())}


def speed(samples, folder, rounds):
    path = os.path.join(folder, "speed.jls")
    runs = {"ours": [], "pyjls": []}
    for _ in range(rounds):
        runs["pyjls"].append(theirs(samples, path))
        runs["ours"].append(ours(samples, path))
    for name, of in runs.items():
        write, read, size = (statistics.median(run[key] for run in of) for key in ("write", "read", "bytes_per_sample"))
        print(f"{name:6} writes {write:6.1f}, reads {read:6.1f} million samples/s; {size:.3f} bytes a sample (medians of {rounds})")


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("program", nargs="?")
    a.add_argument("--golden")
    a.add_argument("--speed", action="store_true")
    a.add_argument("--n", type=int, default=100_000_000)
    a.add_argument("--rounds", type=int, default=3)
    a.add_argument("--dir")
    a = a.parse_args()
    with tempfile.TemporaryDirectory(dir=a.dir) as folder:
        if a.golden:
            golden(a.golden)
        if a.program:
            correctness(a.program, folder)
        if a.speed:
            speed(a.n, folder, a.rounds)


if __name__ == "__main__":
    main()
