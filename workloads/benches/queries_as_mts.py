#!/usr/bin/env python3
"""The public collision queries as `.mts` files, a case each: queries_as_mts.py CCD OUT

CCD is the folder of the public queries; its README describes both layouts. A query is eight rows of three fractions and the answer; a point is the triangle
(v, v, v), an edge (a, b, b). The name of a file ends with the answer. Fractions are rounded to f64.
"""
import gzip
import pathlib
import struct
import sys


def objects(points, vertex_face):
    """Corners at both times, and the triangle, of the two objects of a query."""
    ends = points[:4], points[4:]
    parts = [((0, 1), (0, 0, 0)), ((1, 4), (0, 1, 2))] if vertex_face else [((0, 2), (0, 1, 1)), ((2, 4), (0, 1, 1))]
    return [([end[first:last] for end in ends], triangle) for (first, last), triangle in parts]


def encoded(case):
    heads = b"".join(struct.pack("<II", len(ends[0]), 1) for ends, _ in case)
    corners = b"".join(b"".join(struct.pack("<3d", *p) for end in ends for p in end) + struct.pack("<3I", *triangle)
                       for ends, triangle in case)
    return b"MTS1" + struct.pack("<III", 8, len(case), 0) + heads + corners


def main():
    root, out = pathlib.Path(sys.argv[1]) / "queries", pathlib.Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    count = 0
    for file in sorted(root.rglob("*.csv.gz")):
        name = "-".join(file.relative_to(root).parts).removesuffix(".csv.gz")
        rows = [[float(cell) for cell in line.split(",")] for line in gzip.open(file, "rt") if line.strip()]
        for first in range(0, len(rows), 8):
            query = rows[first:first + 8]
            points = [tuple(row[2 * axis] / row[2 * axis + 1] for axis in range(3)) for row in query]
            case = encoded(objects(points, "vertex-face" in str(file)))
            (out / f"{name}-{first // 8:05d}-{int(query[0][6])}.mts").write_bytes(case)
            count += 1
    print(f"{count} cases in {out}")


if __name__ == "__main__":
    main()
