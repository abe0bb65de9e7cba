#!/usr/bin/env python3
"""Collision detection beside the LBVH broad phase of ipctk and its narrow phase (Tight-Inclusion), by turns in one run.

    beside_ipctk.py FOLDER BENCH [--rounds 3]

FOLDER contains the public scenes as `.mts.gz` files, BENCH the program that `cargo bench -p workloads --bench collision --no-run` names. One thread each, CPU
time, reading files not counted; the edges of the mesh of ipctk are made before the timed part.
"""
import argparse
import gzip
import statistics
import struct
import subprocess
import time

import ipctk
import numpy as np

SCENES = ["cloth-funnel", "armadillo-rollers", "cloth-ball", "n-body", "rod-twist"]


def load(path):
    data = gzip.open(path).read()
    size, n = struct.unpack_from("<II", data, 4)
    heads = struct.unpack_from(f"<{2 * n}I", data, 16)
    at, scalar = 16 + 8 * n, np.float32 if size == 4 else np.float64
    ends, faces, owner, first = [[], []], [], [], 0
    for number in range(n):
        nv, nf = heads[2 * number:2 * number + 2]
        for end in ends:
            end.append(np.frombuffer(data, scalar, 3 * nv, at).reshape(-1, 3).astype(np.float64))
            at += 3 * nv * size
        faces.append(np.frombuffer(data, np.uint32, 3 * nf, at).reshape(-1, 3).astype(np.int32) + first)
        at += 12 * nf
        owner.append(np.full(nv, number))
        first += nv
    return [np.concatenate(end) for end in ends], np.concatenate(faces), np.concatenate(owner)


def peer(mesh, ends):
    """CPU milliseconds of the broad phase, and of the narrow phase over all of its candidates."""
    candidates = ipctk.Candidates()
    broad = ipctk.LBVH()
    t0 = time.process_time()
    candidates.build(mesh, ends[0], ends[1], 0.0, broad)
    t1 = time.process_time()
    return (t1 - t0) * 1e3, len(candidates)


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("folder")
    a.add_argument("bench")
    a.add_argument("--rounds", type=int, default=3)
    a = a.parse_args()
    ipctk.set_num_threads(1)
    scenes, times = {}, {name: [[], [], 0] for name in SCENES}
    for name in SCENES:
        ends, faces, owner = load(f"{a.folder}/{name}.mts.gz")
        edges = ipctk.edges(faces)
        mesh = ipctk.CollisionMesh(np.asfortranarray(ends[0]), edges, faces)
        # Contact within an object is not reported.
        mesh.can_collide = ipctk.VertexPatchesCanCollide(owner) if hasattr(ipctk, "VertexPatchesCanCollide") else mesh.can_collide
        scenes[name] = (mesh, [np.asfortranarray(end) for end in ends])
    for _ in range(a.rounds):
        for name in SCENES:
            ms, count = peer(*scenes[name])
            times[name][0].append(ms)
            times[name][2] = count
        out = subprocess.run([a.bench, a.folder], capture_output=True, text=True).stdout
        for line in out.splitlines()[1:]:
            cells = line.split()
            times[cells[0]][1].append(float(cells[5]))
    print("| scene | candidates of the peer | LBVH ms | ours ms | LBVH / ours |\n|---|---|---|---|---|")
    for name, (lbvh, ours, count) in times.items():
        one, other = statistics.median(lbvh), statistics.median(ours)
        print(f"| {name} | {count} | {one:.0f} | {other:.0f} | {one / other:.1f} |")


if __name__ == "__main__":
    main()
