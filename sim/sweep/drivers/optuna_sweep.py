#!/usr/bin/env python3
"""Searches the space of a sweep file for designs with little time and energy, by NSGA-II of Optuna, beside as many random points.

    python optuna_sweep.py caches.ron --out caches --points 60
    python optuna_sweep.py caches.ron --out caches --points 60 --truth     # also all points, where the space is small

It asks `quintile sweep ask` for one point after another. Points that were run before cost nothing. The result is a line of JSON:
by method the number of different points, and the dominated area (hypervolume) of logarithms of time and energy below the worst
values seen, as a share of that of all points known; with --truth these are all there are.
"""

import argparse
import itertools
import json
import math
import random
import subprocess
import sys

import optuna


class Sweep:
    """The program at the other end of a pipe."""

    def __init__(self, options):
        command = [options.quintile, "sweep", "ask", options.file, "--out", options.out]
        command += ["--quick"] * options.quick
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.axes = self.read()["axes"]
        self.costs = {}

    def read(self):
        line = self.process.stdout.readline()
        if not line:
            sys.exit(self.process.wait() or 1)
        return json.loads(line)

    def ask(self, place):
        """Logarithms of time and energy of a point and its id; None if it cannot run."""
        self.process.stdin.write(json.dumps({"at": place}) + "\n")
        self.process.stdin.flush()
        answer = self.read()
        if answer["error"] is not None:
            return None
        self.costs[answer["id"]] = (math.log(answer["busy_ms"]), math.log(answer["busy_mJ"]))
        return answer["id"]

    def end(self):
        self.process.stdin.close()
        return self.process.wait()


def place(axis, draw_index, draw_share):
    """A place on an axis: in the middle of one of its values, or anywhere."""
    count = axis["values"]
    return draw_share() if count is None else (draw_index(count) + 0.5) / count


def nsga2(sweep, points, seed):
    """Ids of the points that NSGA-II tries."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    population = max(4, min(20, points // 4))
    sampler = optuna.samplers.NSGAIISampler(population_size=population, seed=seed)
    study = optuna.create_study(directions=["minimize", "minimize"], sampler=sampler)
    found = []

    def costs(trial):
        number = itertools.count()
        at = [
            place(
                axis,
                lambda count: trial.suggest_int(f"axis{next(number)}", 0, count - 1),
                lambda: trial.suggest_float(f"axis{next(number)}", 0.0, 1.0),
            )
            for axis in sweep.axes
        ]
        point = sweep.ask(at)
        if point is None:
            raise optuna.TrialPruned
        found.append(point)
        return sweep.costs[point]

    study.optimize(costs, n_trials=points)
    return found


def at_random(sweep, points, seed):
    """Ids of as many random points."""
    draw = random.Random(seed)
    places = ([place(axis, draw.randrange, draw.random) for axis in sweep.axes] for _ in range(points))
    return [point for point in map(sweep.ask, places) if point is not None]


def everything(sweep):
    """Ids of all points."""
    counts = [axis["values"] for axis in sweep.axes]
    if None in counts:
        sys.exit("--truth: an axis has any number of values; give it a count or a step")
    places = itertools.product(*([(i + 0.5) / count for i in range(count)] for count in counts))
    return [point for point in map(sweep.ask, places) if point is not None]


def dominated_area(costs, worst):
    """Area below `worst` that the costs dominate (Zitzler and Thiele 1999)."""
    area, lowest = 0.0, worst[1]
    for time, energy in sorted(costs):
        if energy < lowest:
            area += (worst[0] - time) * (lowest - energy)
            lowest = energy
    return area


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", help="the sweep file")
    parser.add_argument("--out", default="sweep", help="folder of the search")
    parser.add_argument("--points", type=int, default=60, help="points of each method")
    parser.add_argument("--seed", type=int, default=1, help="seed of both methods")
    parser.add_argument("--truth", action="store_true", help="also run all points")
    parser.add_argument("--quintile", default="quintile", help="the program")
    parser.add_argument("--quick", action="store_true", help="as for `quintile sweep run`")
    options = parser.parse_args()
    if options.points < 1:
        parser.error("--points has to be 1 or more")

    sweep = Sweep(options)
    found = {
        "nsga2": nsga2(sweep, options.points, options.seed),
        "random": at_random(sweep, options.points, options.seed),
    }
    if options.truth:
        found["all"] = everything(sweep)
    if not sweep.costs:
        print("no point can run; `quintile sweep run` has the reasons", file=sys.stderr)
        return sweep.end() or 1
    worst = [max(cost[of] for cost in sweep.costs.values()) for of in (0, 1)]
    best = dominated_area(sweep.costs.values(), worst) or 1.0
    shares = {
        name: {
            "points": len(set(points)),
            "hypervolume": dominated_area([sweep.costs[point] for point in points], worst) / best,
        }
        for name, points in found.items()
    }
    print(json.dumps(shares))
    return sweep.end()


if __name__ == "__main__":
    sys.exit(main())
