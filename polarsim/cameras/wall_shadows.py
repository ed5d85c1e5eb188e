"""Lamps and walls from the edges of the shadows of walls in photos.

Shadows of rocks determine the direction of a lamp, but hardly its distance. The edge of the shadow of a wall depends on
direction and distance, and on face and top of the wall. The lamp is fitted if scans show the wall, otherwise the wall
is fitted to the photos under the lamp: one face and one level top.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from polarsim.cameras.lamps import across, offset_text
from polarsim.photo import Terrain
from polarsim.run_files.lamps import error_scale
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh
from polarsim.run_files.wall_edges import EdgeSamples, OpenGround, measure_edges
from polarsim.run_files.walls import SIDES, Side, Wall, Walls
from polarsim.site import Site

log = logging.getLogger("polarsim")
MIN_SAMPLES = 10  # minimum number of measured points of an edge
INDEPENDENT = 10  # maximum weight of an edge, in points: relief and folds of the cloth shift neighbours alike
NOISE = 0.006  # standard deviation of a measured point, metres at the height of the top: some 3 cm on the ground
MAX_SCATTER = 0.012  # maximum median residual of a fit, metres at the height of the top
DISTANCE_SD = 0.10  # standard deviation of a lamp from its start along the line to the sandbox's centre, metres
LEVEL_SD = 0.02  # the same on the level across this line, to which edges are insensitive, metres
HEIGHT_SD = {True: 0.015, False: 0.10}  # the same of the height, if shadows of rocks locate the lamp or not, metres
FACE_SD, TOP_SD = 0.03, 0.05  # standard deviations of walls from the nominal walls, metres
MAX_SD = 3.0  # maximum distance of a result from the prior, standard deviations
ROUNDS = 2  # of measuring edges with the fitted walls, whose penumbra and reach differ from those of nominal walls


def fit_lamps(
    name: str, walls: Walls, edges: Mapping[str, EdgeSamples], suns: Mapping[str, np.ndarray], located: set[str]
) -> dict[str, np.ndarray]:
    """Return the positions (3,) of the lamps whose light passes over measured walls, by azimuth.

    `located`: azimuths of the lamps whose direction is known from the shadows of rocks.
    """
    measured = [SIDES.index(side) for side, wall in walls.sides.items() if wall.support > 0]
    lamps = {}
    for azimuth, samples in sorted(edges.items()):
        points = samples.measured[np.isin(samples.side, measured)]
        if len(points) < MIN_SAMPLES:
            if len(samples):
                log.info("%s: %d wall shadow edges under lamp %s, fewer than %d; lamp not moved",
                         name, len(points), azimuth, MIN_SAMPLES)  # fmt: skip
            continue
        start = suns[azimuth]
        sd = error_scale(start) * np.array([DISTANCE_SD, LEVEL_SD, HEIGHT_SD[azimuth in located]])
        axes = np.concatenate([[start / np.linalg.norm(start)], across(start)])

        def residuals(move: np.ndarray, start=start, axes=axes, sd=sd, points=points) -> np.ndarray:
            return np.clip(walls.clearance(points, start + (move * sd) @ axes), -1.0, 1.0)  # infinite for lamps inside

        move, scatter = _fit(residuals, 3, len(points))
        if scatter > MAX_SCATTER or np.abs(move).max() > MAX_SD:
            log.warning("%s: the shadows of walls under lamp %s contradict the survey; lamp not moved", name, azimuth)
            continue
        lamps[azimuth] = start + (move * sd) @ axes
        log.info("%s: wall shadows move lamp %s by %s", name, azimuth, offset_text(start, lamps[azimuth]))
    return lamps


def fit_walls(
    name: str, walls: Walls, edges: Mapping[str, EdgeSamples], suns: Mapping[str, np.ndarray]
) -> Walls | None:
    """Return walls with the sides that scans do not show fitted to the photos; None without enough clear edges."""
    sides, fitted = dict(walls.sides), []
    for number, side in enumerate(SIDES):
        if side not in walls.sides or walls.sides[side].support > 0:
            continue
        points = {azimuth: samples.measured[samples.side == number] for azimuth, samples in edges.items()}
        lamps = np.repeat([suns[azimuth] for azimuth in points], [len(part) for part in points.values()], axis=0)
        wall = _fit_side(side, walls.sides[side], np.concatenate([*points.values(), np.zeros((0, 3))]), lamps)
        if wall is not None:
            sides[side] = wall
            fitted.append(side)
    if not fitted:
        log.info("%s: the photos show no clear shadow edges of the walls; walls unchanged", name)
        return None
    log.info("%s: walls %s are fitted to their shadows in photos", name, ", ".join(fitted))
    return replace(walls, sides=sides, origin="photos" if walls.origin == "survey" else walls.origin)


def _fit_side(side: Side, nominal: Wall, points: np.ndarray, lamps: np.ndarray) -> Wall | None:
    """Fit face and top of a wall to points (n, 3) on the shadow edge under lamps (n, 3); None without success."""
    if len(points) < MIN_SAMPLES:
        return None
    axis, sign = "xy".index(side[1]), -1.0 if side[0] == "-" else 1.0
    top = float(np.median(nominal.top_m))
    outward, to_lamp = sign * points[:, axis], sign * (lamps - points)[:, axis]

    def residuals(move: np.ndarray) -> np.ndarray:
        share = (nominal.face_m + FACE_SD * move[0] - outward) / to_lamp
        height = points[:, 2] + share * (lamps - points)[:, 2]
        return np.asarray(height - top - TOP_SD * move[1])

    move, scatter = _fit(residuals, 2, len(points))
    if scatter > MAX_SCATTER or np.abs(move).max() > MAX_SD:
        return None
    count = len(nominal.along_m)
    shown = np.unique(np.searchsorted(nominal.along_m, points[:, 1 - axis])).size / count
    return replace(
        nominal,
        face_m=nominal.face_m + FACE_SD * float(move[0]),
        top_m=np.full(count, top + TOP_SD * float(move[1])),
        support=min(shown, 1.0),
    )


def _fit(residuals: Callable[[np.ndarray], np.ndarray], unknowns: int, count: int) -> tuple[np.ndarray, float]:
    """Return the unknowns in standard deviations of their priors, and the median residual, metres."""
    noise = NOISE * np.sqrt(max(1.0, count / INDEPENDENT))

    def weighted(move: np.ndarray) -> np.ndarray:
        return np.concatenate([residuals(move) / noise, move])

    move = least_squares(weighted, np.zeros(unknowns), loss="soft_l1").x
    return move, float(np.median(np.abs(residuals(move))))


def refine_by_wall_shadows(
    name: str,
    terrain: Terrain,
    mesh: TerrainMesh,
    photos: Path,
    localised: Mapping[str, LocalisedRig],
    suns: Mapping[str, np.ndarray],
    site: Site,
    located: set[str],
    drawn: Path | None = None,
) -> tuple[dict[str, np.ndarray], Walls | None]:
    """Return the lamps fitted to the shadows of measured walls, by azimuth, and walls with fitted sides or None.

    `photos`, `drawn`: as in `measure_edges`. `suns`: positions (3,) of all Sun lamps. `located`: azimuths of the lamps
    located by the shadows of rocks.
    """
    walls = mesh.walls
    if walls is None:
        return {}, None
    ground = OpenGround.of(mesh)
    edges = measure_edges(terrain, ground, walls, photos, localised, suns, site, drawn)
    lamps = fit_lamps(name, walls, edges, suns, located)
    if all(wall.support > 0 for wall in walls.sides.values()):
        return lamps, None
    suns = {**suns, **lamps}
    found = None
    for _ in range(ROUNDS):
        found = fit_walls(name, walls, edges, suns) or found
        if found is None:
            break
        edges = measure_edges(terrain, ground, found, photos, localised, suns, site, drawn)
    return lamps, found
