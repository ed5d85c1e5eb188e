"""Synthetic drive for tests of images: a straight line over small hills, with analytic ruts."""

from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.drive.trace import COLUMNS, LevelChanges, Trace
from polarsim.rover.vehicle.table import Vehicle, read_vehicle
from polarsim.rover.world.surface import ROCK_COLUMNS, World

RENDER = RenderOptions()
CELL, SPEED, SINKAGE = 0.02, 0.2, 0.016
RADIUS = 0.275
ROCKS = (  # x, y, height above the ground, half-width
    (2.4, 0.15, 0.20, 0.14), (3.0, -0.9, 0.12, 0.10), (1.6, 0.95, 0.30, 0.20),
    (3.3, 0.25, 0.07, 0.06), (1.2, -0.2, 0.15, 0.12),
)  # fmt: skip


def vehicle() -> Vehicle:
    return read_vehicle(Path(__file__).parents[2] / "config" / "viper.yaml")


def options(**changes) -> CameraSuiteOptions:
    """Options for pictures that are small enough for tests."""
    return CameraSuiteOptions(**{"scale": 0.08, "finer": 2, "suns": ("2",), **changes})


def level(x, y):
    return 0.01 * np.sin(2.1 * x + 0.3) * np.cos(1.7 * y)


def world() -> World:
    x, y = np.arange(0, 7.0, CELL), np.arange(-2.0, 2.0, CELL)
    ground = level(*np.meshgrid(x, y))
    rows, vertices, faces = [], [], []
    for number, (cx, cy, height, half) in enumerate(ROCKS):
        mesh, sides = lump(cx, cy, height, half)
        rows.append((number, 1, number + 10, cx, cy, height, 2 * half, half, sum(map(len, faces)), len(sides)))
        faces.append(sides + sum(map(len, vertices)))
        vertices.append(mesh)
    table = pd.DataFrame(rows, columns=list(ROCK_COLUMNS))
    return World(
        x[0], y[0], CELL, ground, table,
        np.concatenate(vertices).astype(np.float32), np.concatenate(faces).astype(np.int32),
    )  # fmt: skip


def lump(cx, cy, height, half, rings=7, sides=14):
    """Return the upper half of an ellipsoid with a foot below the ground."""
    rise = np.linspace(-0.2, np.pi / 2 - 0.05, rings)
    angle = 2 * np.pi * np.arange(sides) / sides
    x = cx + half * np.cos(rise)[:, None] * np.cos(angle)
    y = cy + half * np.cos(rise)[:, None] * np.sin(angle)
    z = level(cx, cy) + height * np.sin(rise)[:, None] + 0 * angle
    top = [[cx, cy, level(cx, cy) + height]]
    vertices = np.concatenate([np.stack([x, y, z], -1).reshape(-1, 3), top])
    number = np.arange(rings * sides).reshape(rings, sides)
    onward = np.roll(number, -1, axis=1)
    a, b, c, d = number[:-1].ravel(), onward[:-1].ravel(), onward[1:].ravel(), number[1:].ravel()
    cap = np.stack([number[-1], onward[-1], np.full(sides, rings * sides)], 1)
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1), cap])


def trace(seconds: float = 6.0, start: float = 5.5, hz: float = 50, picture_hz: float = 5) -> Trace:
    """Return a drive from x = `start` to the west along y = 0."""
    ground, rover = world(), vehicle().wheel_centres
    time = np.arange(0, seconds + 1e-9, 1 / hz)
    x = start - SPEED * time
    table = pd.DataFrame({name: np.zeros(len(time)) for name in COLUMNS})
    table["time_s"], table["x_m"] = time, x
    table["z_m"] = level(x, 0) + RADIUS - SINKAGE
    table["qz"] = 1.0  # rotated by 180 degrees about z
    table["vx_m_s"], table["command_speed_m_s"] = -SPEED, SPEED
    spin = SPEED * time / RADIUS
    for code, centre in zip(("lf", "rf", "lr", "rr"), rover, strict=True):
        table[f"{code}_x_m"], table[f"{code}_y_m"] = x - centre[0], -centre[1]
        table[f"{code}_z_m"] = level(x - centre[0], -centre[1]) + RADIUS - SINKAGE
        # about z by 180 degrees, then about the wheel's axle
        table[f"{code}_qx"], table[f"{code}_qz"] = -np.sin(spin / 2), np.cos(spin / 2)
        table[f"{code}_spin_rad"], table[f"{code}_contact"] = spin, "soil"
    return Trace(
        table, ground, tracks(ground, rover, start, np.arange(0, seconds + 1e-9, 1 / picture_hz)), {"ended": "finished"}
    )


def tracks(ground: World, rover: np.ndarray, start: float, times: np.ndarray) -> LevelChanges:
    before, cells, levels, first = ground.level.copy(), [], [], [0]
    for time in times:
        now = ground.level.copy()
        for side in (1, -1):
            across = np.abs(ground.y - side * rover[0, 1])
            berm = 0.008 * np.exp(-(((across - 0.13) / 0.03) ** 2)) * (across < 0.22)
            profile = np.where(across < 0.1, -SINKAGE, berm)
            under = (ground.x >= start - SPEED * time - rover[0, 0]) & (ground.x <= start + rover[0, 0])
            now += profile[:, None] * under
        changed = np.flatnonzero(now != before)
        cells.append(changed)
        levels.append(now.ravel()[changed])
        first.append(first[-1] + len(changed))
        before = now
    return LevelChanges(
        times, np.array(first), np.concatenate(cells).astype(np.int32), np.concatenate(levels).astype(np.float32)
    )
