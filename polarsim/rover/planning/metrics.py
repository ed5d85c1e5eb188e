"""Metrics of an autonomous drive: contacts with rocks, path, energy, stops, score of the map, errors of poses."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from polarsim.geometry.trajectories import (
    Trajectory,
    absolute_error,
    consecutive,
    motion_errors,
    trajectory_errors,
)
from polarsim.rover.drive.table import TREAD_AND_FLANK
from polarsim.rover.drive.trace import Trace, rock_contacts
from polarsim.rover.localisation.localiser import Localiser
from polarsim.rover.localisation.stereo_motion import visual_odometry
from polarsim.rover.planning.challenge import POINTS, points_of
from polarsim.rover.planning.clearance import closest_pass
from polarsim.rover.planning.drive import Outcome
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.planning.planner import Planner, hazard_field
from polarsim.rover.vehicle.table import Vehicle
from polarsim.schemas.rover import (
    AUTONOMY_EVENTS,
    COLLISION,
    END_ERROR,
    HIGH_M,
    LOST_MOTIONS,
    REJECTED_MOTIONS,
    STOP,
    TOUCH,
)

CLASSES_M = ((0.05, 0.10), (0.10, 0.20), (0.20, math.inf))
NO_ROCK = -1
GOAL_M = 1.0  # maximum true distance before the goal's line of a rover that believes itself at the goal
_OF = (("wheels", TREAD_AND_FLANK), ("legs", ("leg",)), ("the body", ("body",)))
_TOTALS = {"time_s": "min", "duration_s": "sum", "impulse_n_s": "sum"}  # of all links of a part


def event_table(outcome: Outcome) -> pd.DataFrame:
    """Return `AUTONOMY_EVENTS`: a row per rock and kind of part that touched the rock, and a row per stop."""
    contacts = rock_contacts(outcome.trace)
    by_part = contacts.groupby(["rock", "part"], as_index=False, sort=False)
    hit = by_part.agg(dict.fromkeys(("height_m", "x_m", "y_m"), "first") | _TOTALS)
    what = np.where(hit["height_m"] > HIGH_M, COLLISION, TOUCH)
    rows = [hit.assign(what=what)[list(AUTONOMY_EVENTS.columns)]]
    if outcome.pilot is not None and outcome.pilot.stops:
        nothing = (NO_ROCK, math.nan, "", 0.0, 0.0)
        stops = [(STOP, stop.time_s, stop.x, stop.y, *nothing) for stop in outcome.pilot.stops]
        rows.append(pd.DataFrame(stops, columns=list(AUTONOMY_EVENTS.columns)))
    events = pd.concat([part for part in rows if len(part)] or rows).astype(AUTONOMY_EVENTS.dtypes)
    return events.sort_values(["time_s", "rock", "part"], ignore_index=True)


def drive_metrics(outcome: Outcome, vehicle: Vehicle, options: AutonomyOptions) -> pd.DataFrame:
    """Return rows of metric, unit and value of a drive."""
    trace = outcome.trace
    drive, table = trace.drive, trace.table
    seconds = max(float(drive["seconds"]), 1e-9)
    contacts = rock_contacts(trace)
    hit = contacts[contacts["height_m"] > HIGH_M]
    arrived = drive["ended"] == "finished" and distance_to_goal(trace) <= GOAL_M
    rows: list[tuple[str, str, float]] = [
        ("success", "", float(arrived and not len(hit))),
        ("goal reached", "", float(arrived)),
        ("collisions", "", float(hit["rock"].nunique())),
        *((f"collisions of {name}", "", float(hit["rock"][hit["part"].isin(parts)].nunique())) for name, parts in _OF),
    ]
    treads = contacts["rock"][contacts["part"] == "tread"]
    for low, top in CLASSES_M:
        in_class = contacts[(contacts["height_m"] > low) & (contacts["height_m"] <= top)].drop_duplicates("rock")
        name = f"above {100 * low:.0f} cm" if math.isinf(top) else f"{100 * low:.0f} to {100 * top:.0f} cm"
        driven_over = in_class["rock"].isin(treads)
        rows.append((f"rocks of {name} driven over", "", float(driven_over.sum())))
        rows.append((f"rocks of {name} scraped", "", float((~driven_over).sum())))
    positions = table[["x_m", "y_m"]].to_numpy()
    rows += [
        ("closest pass of a rock above 10 cm", "m", closest_pass(trace, vehicle)),
        ("time", "s", float(drive["seconds"])),
        ("path", "m", float(np.hypot(*np.diff(positions, axis=0).T).sum())),
        ("energy", "J", float(drive["energy_j"]["motor"])),
        ("CPU for a second driven", "s", outcome.cpu_s / seconds),
        ("wall time for a second driven", "s", outcome.wall_s / seconds),
    ]
    if outcome.localiser is not None:
        rows += _of_localiser(outcome.localiser, trace)
    if outcome.pilot is not None:
        rows += _of_pilot(outcome, vehicle, options)
    return pd.DataFrame(rows, columns=["metric", "unit", "value"])


def _of_localiser(localiser: Localiser, trace: Trace) -> list[tuple[str, str, float]]:
    """Return errors of the pose by which the rover drove, after alignment at the start, and faults of its camera."""
    errors = trajectory_errors(Trajectory.from_table(localiser.estimate()), Trajectory.from_table(trace.table))
    rows = [
        ("position error at the end", "m", errors.end),
        (END_ERROR, "%", 100 * errors.end / errors.path if errors.path else math.nan),
        ("position error, mean", "m", errors.mean),
        ("position error, rms", "m", errors.rms),
        ("position error, rms after a rigid fit", "m", errors.rms_aligned),
        ("position error per metre", "m", errors.relative),
        ("attitude error per metre", "degrees", math.degrees(errors.relative_angle)),
    ]
    if localiser.stereo is not None:
        rows += [
            (LOST_MOTIONS, "", float(localiser.lost)),
            (REJECTED_MOTIONS, "", float(localiser.filter.rejected)),
        ]
    return rows


def distance_to_goal(trace: Trace) -> float:
    """Return the distance of the rover's true position at the end before the goal's line, m; negative beyond it."""
    line = np.array(trace.drive["path_m"])
    way = line[-1] - line[0]
    end = trace.table[["x_m", "y_m"]].to_numpy()[-1]
    return float((line[-1] - end) @ way / np.linalg.norm(way))


def _of_pilot(outcome: Outcome, vehicle: Vehicle, options: AutonomyOptions) -> list[tuple[str, str, float]]:
    pilot, world, seconds = outcome.pilot, outcome.trace.world, float(outcome.trace.drive["seconds"])
    assert pilot is not None
    perception = pilot.perception
    score = points_of(pilot.grid, world, pilot.path.points, seconds)
    rows = [
        ("stops", "", float(len(pilot.stops))),
        ("stops that nothing justified", "", float(unjustified(outcome, vehicle, options))),
        *((part, f"points of {most:.0f}", score[part]) for part, most in POINTS.items()),
        *((f"CPU for a second driven, {part}", "s", spent / seconds) for part, spent in perception.seconds.items()),
    ]
    taken = [(item.pair, item.left.world_from_camera) for _, item in pilot.observations if item.pair is not None]
    if len(taken) > 2:
        pairs, cameras = zip(*taken, strict=True)
        rectified = perception.rectification.left_from_rectified
        poses = [cameras[0].inverse() @ camera @ rectified for camera in cameras]
        estimated, lost = visual_odometry(pairs, perception.rectification)
        times = np.arange(len(poses))
        found, true = Trajectory.from_poses(times, estimated), Trajectory.from_poses(times, poses)
        moved, angle = motion_errors(found, true, consecutive(len(poses)))
        rows += [
            ("odometry: absolute error", "m", absolute_error(found.positions, true.positions)),
            ("odometry: relative error", "m", moved),
            ("odometry: relative angle", "degrees", math.degrees(angle)),
            ("odometry: moves not found", "", float(lost)),
        ]
    return rows


def unjustified(outcome: Outcome, vehicle: Vehicle, options: AutonomyOptions) -> int:
    """Return the number of stops at which a rover with the true map of rocks above `HIGH_M` would have had a path."""
    pilot, world = outcome.pilot, outcome.trace.world
    assert pilot is not None
    if not pilot.stops:
        return 0
    x, y = np.meshgrid(pilot.grid.x, pilot.grid.y)
    blocked, tall = np.zeros(x.shape, bool), np.zeros(x.shape, bool)
    rocks = world.rocks_on_grid
    for rock in rocks[rocks["height_m"] > HIGH_M].to_dict("records"):
        covered = np.hypot(x - rock["x_m"], y - rock["y_m"]) < rock["radius_m"] + pilot.grid.cell_m / 2
        blocked |= covered
        tall |= covered & (rock["height_m"] >= options.planner.clearance_m)
    ground = hazard_field(pilot.grid, blocked, tall, np.ones(x.shape, bool))
    planner = Planner(vehicle.wheel_centres[:, :2], options.planner)
    goal = pilot.path.points[-1]
    return sum(planner.plan(ground, stop.x, stop.y, stop.heading, goal) is not None for stop in pilot.stops)
