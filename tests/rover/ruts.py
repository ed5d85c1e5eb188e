"""A hilly lattice with two ruts, and tracks over it."""

import numpy as np

from polarsim.rover.cameras.tracks import NodeGrid, WheelTracks

CELL = 0.02


def hills(rows=97, columns=129):
    y, x = np.mgrid[:rows, :columns] * CELL
    return NodeGrid(-0.5, 0.3, CELL, 0.03 * np.sin(2 * x) * np.cos(3 * y))


def rutted(lattice, columns=slice(30, 90)):
    level = lattice.level.copy()
    level[40:50, columns] -= 0.016
    return level


def tracks(lattice, finer=3):
    return WheelTracks(lattice, rutted(lattice) != lattice.level, finer)
