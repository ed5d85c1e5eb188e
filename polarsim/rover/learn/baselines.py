"""Policies to compare a learner with: at random, straight on, the pilot of drives that decide; what episodes return."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import pandas as pd

from polarsim.rover.drive.control import Driver, SteeringLaw
from polarsim.rover.drive.job import GAIN_RAD_M, HEADING_GAIN
from polarsim.rover.drive.state import State
from polarsim.rover.learn.environment import TraverseEnvironment
from polarsim.rover.perception.hazard_grid import HazardGrid
from polarsim.rover.perception.observation import Eyes, Glance
from polarsim.rover.planning.pilot import pilot

Policy = Callable[[dict[str, np.ndarray]], np.ndarray | None]  # from an observation to an action; none: it gave up
MakePolicy = Callable[[TraverseEnvironment], Policy]  # at the start of an episode


def random_policy(environment: TraverseEnvironment) -> Policy:
    """An action drawn evenly every time, from the environment's own seed."""
    rng = environment.np_random
    return lambda _: rng.uniform(-1.0, 1.0, 2).astype(np.float32)


def straight_policy(environment: TraverseEnvironment) -> Policy:
    """Along the straight line whatever lies on it, steered by offset and heading."""
    law = SteeringLaw(environment.options.speed_m_s, GAIN_RAD_M, HEADING_GAIN, math.radians(90))
    driver = Driver(environment.line, law)
    return lambda _: _action(environment, driver)


def planner_policy(environment: TraverseEnvironment) -> Policy:
    """The pilot of drives that decide, on the environment's map; it stops, backs off and gives up as there."""
    driver = pilot(environment.line, cast(Eyes, _Seen(defaultdict(float))), environment.options)
    driver.board(environment.simulation)
    driver.grid = environment.map

    def act(_: dict[str, np.ndarray]) -> np.ndarray | None:
        action = _action(environment, driver)
        return None if driver.given_up else action

    return act


@dataclass
class _Seen:
    """Eyes that add nothing: the environment has looked already."""

    seconds: defaultdict[str, float]

    def look(self, state: State, level: np.ndarray, grid: HazardGrid) -> Glance:  # noqa: ARG002
        return Glance([], cast(Any, None))


def _action(environment: TraverseEnvironment, driver: Driver) -> np.ndarray:
    """What a driver commands here, as an action."""
    simulation, task = environment.simulation, environment.task
    x, y = simulation.data.qpos[:2].tolist()
    command = driver.command(x, y, simulation.heading)
    share = command.speed_m_s / task.top_speed_m_s, command.steer_rad / math.radians(task.top_steer_deg)
    return np.clip(share, -1.0, 1.0).astype(np.float32)


BASELINES: dict[str, MakePolicy] = {
    "random": random_policy, "straight": straight_policy, "planner": planner_policy,
}  # fmt: skip


def returns(environment: TraverseEnvironment, make: MakePolicy, seeds: Iterable[int]) -> pd.DataFrame:
    """A row an episode: seed, return (undiscounted), seconds, how it ended, collisions, along_m, energy_j.

    A policy that gives up earns nothing more, for a rover at rest neither gains nor spends: its episode ends there.
    """
    rows = []
    for seed in seeds:
        observed, info = environment.reset(seed=seed)
        policy, total, over = make(environment), 0.0, False
        while not over:
            action = policy(observed)
            if action is None:
                info = {**info, "ended": "gave up"}
                break
            observed, reward, terminated, truncated, info = environment.step(action)
            total, over = total + reward, terminated or truncated
        numbers = (info[name] for name in ("ended", "collisions", "along_m", "energy_j"))
        rows.append((seed, total, environment.simulation.time, *numbers))
    names = ["seed", "return", "seconds", "ended", "collisions", "along_m", "energy_j"]
    return pd.DataFrame(rows, columns=names)
