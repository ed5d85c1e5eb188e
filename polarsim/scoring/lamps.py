"""How well the directions of the Sun lamps are known: surveyed and found ones against the analog's true ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.formats.files import read_json
from polarsim.formats.lamps import FILE, read_suns, surveyed_suns
from polarsim.formats.rigs import read_all_placed
from polarsim.geometry.poses import Pose
from polarsim.photo import SUNS
from polarsim.scoring.metrics import Metric


def lamps_against_truth(cameras: Path, truth: Path, truth_from_sandbox: Pose) -> list[Metric]:
    """The angle at the sandbox's middle between where a lamp is taken to stand and where it stood.

    Shadows tell a lamp's direction and hardly its distance, so the angle is what counts.

    Parameters
    ----------
    cameras
        Folder of the terrain's rig poses, with or without lamps that were found.
    truth
        The analog's truth/TerrainTT.
    """
    placed, true = read_all_placed(cameras), read_json(truth / FILE)
    metrics, worst = [], {}
    for name, suns in (("surveyed_direction", surveyed_suns(placed)), ("direction", read_suns(cameras, placed))):
        found = [
            Metric(f"lamp {azimuth}", f"{name}_error", off_deg, "deg", 1, "truth")
            for azimuth in SUNS
            for off_deg in [_angle_deg(truth_from_sandbox.apply(suns[azimuth]), np.array(true[azimuth], float))]
        ]
        worst[name] = max(metric.value for metric in found)
        metrics += found
    return metrics + [
        Metric("worst lamp", f"{name}_error", value, "deg", len(SUNS), "truth") for name, value in worst.items()
    ]


def _angle_deg(one: np.ndarray, other: np.ndarray) -> float:
    """Between the directions of two places (3,) from the origin."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other)))
