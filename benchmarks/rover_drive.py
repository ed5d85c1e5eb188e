"""Cost and energy balance of a rover's drive: flat ground, a slope, and Case III.

`python benchmarks/rover_drive.py [--meshes results/demo/meshes] [--terrains 3 1 11] [--seeds 10] [--out FOLDER]`

Without --meshes only the flat drive and the slope are simulated. CPU seconds of one thread.

Last metrics (two shared cores): flat ground, 8 s, steps of 2, 1, 0.5, 0.25 ms end at 1.3008, 1.3008, 1.3009, 1.3009 m,
load ripples by 2.7 %, energy missing -0.016, -0.008, -0.004, -0.002 %; 55 us a step of 1 ms with bulldozing and the
log. Locked on 10 and 15 degrees: 0.007 and 0.019 mm in 10 s. Before the shear displacement was limited to the rim's:
Ten seeds, 10.5 m, all across, mean +- standard deviation; heading control with combined steering, then P-only:
demo meshes, terrains 3, 1, 11: 17.9 +- 0.7 mm RMS off the line (77 at most, in the crater of terrain 11), slip 0.104,
sinkage 13.0 mm (95th percentile 28.0), 144 J/m; P-only 51.0 +- 2.3 mm (168), 0.095, 11.6 mm, 126 J/m.
Release, terrains 4, 1, 11: 11.6 +- 0.3 mm (58), 0.085, 16.7 mm (25.6), 112 J/m; P-only 138.8 +- 33.9 mm (336), 0.086,
14.7 mm, 120 J/m. Energy missing at most 0.07 %. On the demo's rocks, otherwise idle, 10.5 to 11.9 times real time (12.5
on flat ground); a complete drive of 61 s with reading of meshes and writing of files: 10.1 s of CPU.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from polarsim.rover.drive.control import Command
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.drive.ride import run_drive
from polarsim.rover.drive.simulation import Simulation
from polarsim.rover.drive.state import Start
from polarsim.rover.drive.table import drive_table
from polarsim.rover.soil.law import read_soil
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import read_vehicle
from polarsim.rover.world.options import WorldOptions
from polarsim.rover.world.surface import World, bare_world

CONFIG = Path(__file__).parents[1] / "config"
VIPER, SOIL = read_vehicle(CONFIG / "viper.yaml"), read_soil(CONFIG / "soils.csv", "lunar")


def ground(slope_deg: float = 0.0) -> World:
    x = -3 + 0.02 * np.arange(301)
    return bare_world(np.tile(np.tan(np.radians(slope_deg)) * x, (151, 1)), 0.02, -3.0, -1.5)


def flat_drive(step: float, seconds: float = 8.0) -> None:
    simulation = Simulation(ground(), VIPER, SOIL, SoilOptions(step_s=step), Start(-1.5))
    for _ in range(200):
        simulation.advance(0.01)
    simulation.zero()
    simulation.apply(Command(0.2))
    loads, began = [], time.process_time()
    for _ in range(round(seconds / 0.01)):
        simulation.advance(0.01)
        loads.append(simulation.state().wheel("load_n").sum())
    spent = time.process_time() - began
    last, steady = simulation.state(), np.array(loads[300:])
    print(
        f"{1000 * step:g} ms: end {last.position[0] + 1.5:.4f} m, ripple {100 * steady.std() / steady.mean():.2f} %, "
        f"energy missing {100 * last.energy_open:+.3f} %, {1e6 * spent * step / seconds:.0f} us a step, "
        f"{seconds / spent:.1f} times real time"
    )


def parked(slope_deg: float) -> None:
    simulation = Simulation(ground(slope_deg), VIPER, SOIL)
    points = []
    for _ in range(1200):
        simulation.advance(0.01)
        points.append(simulation.state().position)
    creep = np.linalg.norm(points[-1] - points[199])
    print(f"locked on {slope_deg:g} degrees: {1000 * creep:.3f} mm in 10 s")


@contextmanager
def physics_timed() -> Iterator[list[tuple[float, float]]]:
    """Yield wall and CPU seconds of the simulation, without reading of meshes and writing of files."""
    steps: list[tuple[float, float]] = []
    advance = Simulation.advance

    def timed(simulation: Simulation, seconds: float) -> None:
        began = time.process_time()
        advance(simulation, seconds)
        steps.append((seconds, time.process_time() - began))

    Simulation.advance = timed  # type: ignore[method-assign]
    try:
        yield steps
    finally:
        Simulation.advance = advance  # type: ignore[method-assign]


def crossings(meshes: Path, terrains: tuple[int, ...], seeds: int, out: Path) -> None:
    traces = []
    for control in ("heading", "P-only"):
        for seed in range(seeds):
            began = time.process_time()
            with physics_timed() as steps:
                trace = run_drive(
                    meshes=meshes,
                    folder=out / control / f"seed{seed}",
                    world=WorldOptions(terrains=terrains),
                    soil=SoilOptions(table=CONFIG / "soils.csv"),
                    drive=DriveOptions(control=control, vehicle=CONFIG / "viper.yaml"),
                    seed=seed,
                )
            traces.append(trace)
            spent = time.process_time() - began
            simulated, physics = map(sum, zip(*steps, strict=True))
            ended, seconds = trace.drive["ended"], trace.drive["seconds"]
            print(
                f"{control}, seed {seed}: {ended} after {seconds:.1f} s, {spent:.1f} s of CPU, "
                f"physics {simulated / physics:.1f} times real time",
                flush=True,
            )
    print(drive_table(traces).to_string(index=False, float_format="%.4g"))
    print(f"memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshes", type=Path)
    parser.add_argument("--terrains", type=int, nargs="+", default=[3, 1, 11])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--out", type=Path, default=Path("results/rover_drive"))
    asked = parser.parse_args()
    flat_drive(0.001, 4.0)  # compiles
    for step in (0.002, 0.001, 0.0005, 0.00025):
        flat_drive(step)
    for slope_deg in (10, 15):
        parked(slope_deg)
    if asked.meshes:
        crossings(asked.meshes, tuple(asked.terrains), asked.seeds, asked.out)


if __name__ == "__main__":
    main()
