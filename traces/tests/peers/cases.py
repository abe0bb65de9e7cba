#!/usr/bin/env python3
"""Makes cases for `cargo bench -p traces --bench score_frames`.

    cases.py peers  GENERATOR_DIR OUT SEED...   the cases of gen_traces.py (kept outside the repository), one folder a seed
    cases.py shapes OUT SEED...                 other shapes, of our own: ramps, combs, blobs, half-rate frames, random walks

Parquet is written with Snappy, the one compression that our reader takes. Needs numpy and pyarrow (and scipy for the peers).
"""
import json
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

FS = 50_000.0
LEVELS = (1.0, 0.85, 0.7, 0.55)


def write(out, name, volts, amps, truth, info):
    out.mkdir(parents=True, exist_ok=True)
    described = {b"trace": json.dumps({"rate_hz": info["sample_rate_hz"], "start_s": 0.0}).encode()}
    table = pa.table({"voltage_V": volts.astype(np.float32), "current_A": amps.astype(np.float32)})
    pq.write_table(table.replace_schema_metadata(described), out / f"{name}.parquet", compression="snappy")
    (out / f"{name}.json").write_text(json.dumps(info))
    columns = ("start_s", "end_s", "energy_J")
    rows = zip(*(truth[c] for c in columns))
    lines = [",".join(columns)] + [",".join(f"{v:.9g}" for v in row) for row in rows]
    (out / f"{name}.truth.csv").write_text("\n".join(lines) + "\n")


def peers(generator, out, seed):
    sys.path.insert(0, str(generator))
    import gen_traces
    for case in gen_traces.suite():
        trace, truth, info = gen_traces.generate(case, seed)
        write(out / f"s{seed}", case.name, trace["voltage_V"], trace["current_A"], truth, info)


# One frame of each shape over phase x in [0, 1): watts above idle; `m` in [0, 1] is the content, which moves slowly.
SHAPES = {
    "ramp": lambda x, m: (x > 0.05) * (1.0 + 2.0 * np.abs((x * (1.5 + m)) % 1.0)) * (x < 0.9),
    "comb": lambda x, m: 2.5 * (((x * (7 + 2 * m)) % 1.0) < 0.35 + 0.3 * x) * (x < 0.92),
    "blobs": lambda x, m: sum(a * np.exp(-((x - c - 0.04 * m) / w) ** 2)
                              for a, c, w in ((3, .08, .02), (2, .25, .07), (2.6, .5, .04 + .02 * m), (1.5, .75, .1))),
    "halves": lambda x, m: np.where(x < 0.5, 2.0, 1.2 + m) * ((x % 0.5) > 0.06) + 1.2 * (x < 0.03),
}


def shape_case(shape, clocked, seed):
    rng = np.random.default_rng([seed, len(shape), int(clocked), sum(map(ord, shape))])
    t, starts, curve, level = 0.2, [], [], 0
    fine = 8                                            # steps a sample
    curve.append(np.full(int(0.2 * FS * fine), 0.6))
    walk = 0.5
    for k in range(500):
        walk = float(np.clip(walk + 0.02 * rng.standard_normal(), 0, 1))
        if clocked and rng.random() < 0.015:
            level = int(rng.integers(0, len(LEVELS)))
        length = int((0.011 + 0.003 * walk) / LEVELS[level] * (1 + 0.01 * rng.standard_normal()) * FS * fine)
        x = np.arange(length) / length
        noise = 1 + 0.02 * np.repeat(rng.standard_normal(length // 400 + 1), 400)[:length]
        curve.append(0.6 + LEVELS[level] ** 2 * SHAPES[shape](x, walk) * noise)
        starts.append(sum(map(len, curve[:-1])) if k == 0 else starts[-1] + len(curve[-2]))
    curve.append(np.full(int(0.2 * FS * fine), 0.6))
    end = starts[-1] + len(curve[-2])
    power = np.concatenate(curve)
    edges = np.array(starts + [end])
    total = np.concatenate([[0.0], np.cumsum(power)]) / (FS * fine)
    n = len(power) // fine
    samples = power[:n * fine].reshape(n, fine).mean(1)
    watts = samples + 10 ** (-25 / 20) * samples.std() * rng.standard_normal(n)
    truth = dict(start_s=edges[:-1] / (FS * fine), end_s=edges[1:] / (FS * fine), energy_J=np.diff(total[edges]))
    marks = [float(np.round((truth["start_s"][int(q * 500)] + rng.uniform(-1e-4, 1e-4)) * FS) / FS) for q in (.1, .3, .5, .7, .9)]
    info = dict(sample_rate_hz=FS, mark_s=marks[0], other_marks_s=marks[1:], window_pre_s=1e-3, window_post_s=4e-3)
    return np.full(n, 4.0), watts / 4.0, truth, info


def shapes(out, seed):
    for shape in SHAPES:
        for clocked in (False, True):
            write(out / f"shapes{seed}", f"{shape}{'_clocked' * clocked}", *shape_case(shape, clocked, seed))


def main():
    match sys.argv[1:]:
        case ["peers", generator, out, *seeds] if seeds:
            for seed in seeds:
                peers(Path(generator), Path(out), int(seed))
        case ["shapes", out, *seeds] if seeds:
            for seed in seeds:
                shapes(Path(out), int(seed))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
