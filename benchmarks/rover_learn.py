"""What policies earn in the environment for learners, over seeds, and what a step costs.

`python benchmarks/rover_learn.py [--seeds 10] [--first 0] [--policies planner] [--meshes MESHES --terrains 3 1 11]`

Without meshes every seed has a made-up ground of 12 x 8 m with 40 rocks, 8 m to the goal. Returns are not discounted.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.rover.learn.baselines import BASELINES, returns
from polarsim.rover.learn.courses import TerrainCourse
from polarsim.rover.learn.environment import TraverseEnvironment
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.world.options import WorldOptions

RESAMPLES = 1000


def made(asked: argparse.Namespace) -> TraverseEnvironment:
    if asked.meshes is None:
        return TraverseEnvironment(image=asked.image)
    options = AutonomyOptions(scale=0.25, suns=("1", "2", "3", "4"), longest_s=80.0 * len(asked.terrains))
    course = TerrainCourse(asked.meshes, WorldOptions(terrains=tuple(asked.terrains)), options=options)
    return TraverseEnvironment(course, options=options, image=asked.image)


def interval(values: np.ndarray) -> str:
    """The mean with its 95 % interval, bootstrapped over episodes."""
    rng = np.random.default_rng(0)
    means = rng.choice(values, (RESAMPLES, len(values))).mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return f"{values.mean():.2f} [{low:.2f}, {high:.2f}]"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--policies", nargs="+", choices=list(BASELINES), default=list(BASELINES))
    parser.add_argument("--meshes", type=Path)
    parser.add_argument("--terrains", type=int, nargs="+", default=[3, 1, 11])
    parser.add_argument("--image", action="store_true", help="with pictures")
    asked = parser.parse_args()
    environment = made(asked)
    environment.reset(seed=0)  # compiles
    for name in asked.policies:
        begun, rows = time.process_time(), []
        for seed in range(asked.first, asked.first + asked.seeds):
            rows.append(returns(environment, BASELINES[name], [seed]))
            print(name, rows[-1].to_string(index=False, header=False, float_format="%.3f"), flush=True)
        found, spent = pd.concat(rows), time.process_time() - begun
        ended = ", ".join(f"{count} {how}" for how, count in found["ended"].value_counts().items())
        earned, hits = (interval(found[column].to_numpy(float)) for column in ("return", "collisions"))
        print(
            f"{name}: return {earned}, collisions {hits}, {ended}; {spent / found['seconds'].sum():.3f} CPU s a second",
            flush=True,
        )


if __name__ == "__main__":
    main()
