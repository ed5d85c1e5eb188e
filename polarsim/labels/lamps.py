"""Sun lamps that no photo places, refined from the shadows that people drew.

The survey is decimetres off, and so are the frames of published meshes, which moves the far end of a rock's shadow by
centimetres. Every drawn box is compared with the one that geometry casts under the surveyed lamp: how far its far edges
lie off, and how far they would move with the lamp. A lamp's place is the Gaussian estimate from both and from the
survey's own error, with weights that outliers lose (iterated least squares; Holland and Welsch, Commun. Stat. A 6
(1977) 813). Lamps of one terrain do not move together: an error that all share, fitted too, made the shadows under a
lamp without drawn ones worse (F1 0.667 instead of 0.681, `benchmarks/transfers.py`).
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from polarsim.geometry.boxes import centres
from polarsim.labels.fusion import CAUCHY
from polarsim.labels.habits import OUTWARD
from polarsim.labels.known import Known
from polarsim.labels.options import LabelsOptions
from polarsim.labels.position_rocks import PositionRocks
from polarsim.labels.position_shadows import PositionShadows
from polarsim.labels.shadows import thrown
from polarsim.labels.view import View
from polarsim.photo import NO_ROCK, Azimuth, Camera

log = logging.getLogger("polarsim")

SURVEY_SD = np.array([0.3, 0.3, 0.15])  # metres, x y z
MOST_SD = 2.0  # of these: so far off the survey a lamp is looked for
HEADROOM = 0.4  # metres below the surveyed lamp: the shadow of a point that is as high as the lamp has no end
FAR = 0.5  # least cosine between an edge's normal and the shadow's direction: other edges tell of rocks, not of lamps
OUTERMOST = 12  # pixels of a shadow of which one is its end, wherever the lamp stands
WALL = 0.05  # metres from the ground's end: a shadow that reaches there goes on at the wall
BORDER_PX = 6.0  # from the photo's border: a shadow that is seen there goes on unseen
NUDGE = 0.02  # metres: how far lamps are moved to see how edges follow
STEPS, CLOSE = 30, 1e-4  # of the robust fit; metres by which its last one moves a lamp
LEAST_SD_PX = 3.0  # of a drawn edge: people are no surer than that


@dataclass(frozen=True)
class FarEdges:
    """Far edges (n,) of shadows that a lamp throws, as drawn in one view."""

    view: View
    lamp_place: np.ndarray  # (3,) where they were cast from
    shadows: int  # that have these edges
    off: np.ndarray  # (n,) px by which the drawn edges lie farther out than the cast ones
    outward: np.ndarray  # (n, 2) normals in the photo
    blockers: np.ndarray  # (n, k, 3) what takes the light from a shadow's outermost pixels
    level: np.ndarray  # (n, k) height of the ground there

    def off_at(self, lamp_place: np.ndarray) -> np.ndarray:
        """(n,) `off` for a lamp at another place."""
        return np.asarray(self.off - self._ends(lamp_place) + self._ends(self.lamp_place))

    def _ends(self, lamp_place: np.ndarray) -> np.ndarray:
        """(n,) px outwards."""
        pixels = self.view.project(thrown(self.blockers, self.level, lamp_place))
        return np.asarray(np.einsum("nkj,nj->nk", pixels, self.outward).max(axis=1, initial=-np.inf))


def with_refined_lamps(known: Known, surveyed: Collection[Azimuth], options: LabelsOptions) -> Known:
    """The same terrain, the Sun lamps of some azimuths where the seeds' shadows say that they stood.

    A lamp with fewer shadows than `min_lamp_shadows` stays where it is.
    """
    edges: dict[Azimuth, list[FarEdges]] = {azimuth: [] for azimuth in sorted(surveyed)}
    for position in sorted(set(known.seeds) & set(known.placed) - set(known.apart)):
        shadows = PositionShadows(PositionRocks(known, position, options), options)
        for camera, azimuth in sorted(known.seeds[position]):
            if azimuth in edges:
                edges[azimuth] += far_edges(shadows, camera, azimuth)
    suns = dict(known.world.suns)
    for azimuth, own in edges.items():
        count = sum(part.shadows for part in own)
        if count >= options.min_lamp_shadows:
            suns[azimuth] = fit_lamp(suns[azimuth], own)
            moved = (suns[azimuth] - known.world.suns[azimuth]).round(2).tolist()
            log.info("lamp %s: moved by %s m for %d drawn shadows", azimuth, moved, count)
    return replace(known, world=replace(known.world, suns=suns))


def far_edges(shadows: PositionShadows, camera: Camera, azimuth: Azimuth) -> list[FarEdges]:
    """What the shadows drawn at one position for a camera and Sun lamp tell of the lamp; nothing, or one set."""
    drawn = shadows.drawn(camera, azimuth)
    if drawn is None or not len(drawn):
        return []
    rocks = {label.rock: label.box for label in shadows.rocks.labels(camera, azimuth)}
    cast = shadows.cast(camera, "off", azimuth, rocks)
    view, place = shadows.rocks.view(camera), shadows.world.suns[azimuth]
    off, outward, blockers, level = [], [], [], []
    count = 0
    for rock, box in zip(shadows.throwers(camera, drawn, "off", azimuth).tolist(), drawn, strict=True):
        if rock == NO_ROCK or rock not in cast:
            continue
        start, end = centres(np.array([rocks[rock], cast[rock].box]))
        far = OUTWARD @ (end - start) > FAR * max(float(np.linalg.norm(end - start)), 1.0)
        ground, own = shadows.ends(camera, azimuth, rock, OUTWARD[far], OUTERMOST)
        cut = _at_border(view.project(ground), view.size) | _at_walls(ground, shadows.world.ground_bounds)
        whole = ~cut & (own[..., 2] < place[2] - HEADROOM).all(axis=1)
        off.append((OUTWARD.sum(axis=1) * (box - cast[rock].box))[far][whole])
        outward.append(OUTWARD[far][whole])
        blockers.append(own[whole])
        level.append(ground[whole, :, 2])
        count += bool(whole.any())
    if not count:
        return []
    return [FarEdges(view, place, count, *(np.concatenate(part) for part in (off, outward, blockers, level)))]


def _at_border(pixels: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(n,) bool: ends of shadows, at pixels (n, k, 2), that the photo's border cuts."""
    return np.asarray(((pixels < BORDER_PX) | (pixels > size - BORDER_PX)).any(axis=(1, 2)))


def _at_walls(ground: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """(n,) bool: ends of shadows, on the ground (n, k, 3), that climb the sandbox's walls."""
    low, high = bounds
    return np.asarray(((ground[..., :2] < low + WALL) | (ground[..., :2] > high - WALL)).any(axis=(1, 2)))


def fit_lamp(surveyed: np.ndarray, edges: Sequence[FarEdges]) -> np.ndarray:
    """(3,) likeliest place of a lamp, by Gauss and Newton's method, from its surveyed one and the edges of shadows."""

    def off_at(place: np.ndarray) -> np.ndarray:
        return np.concatenate([np.zeros(0), *(part.off_at(place) for part in edges)])

    place, information = surveyed, np.diag(SURVEY_SD**-2)
    for _ in range(STEPS if edges else 0):
        off = off_at(place)
        slopes = np.stack([(off_at(place - step) - off_at(place + step)) / (2 * NUDGE) for step in NUDGE * np.eye(3)])
        sd = max(1.4826 * float(np.median(np.abs(off))), LEAST_SD_PX)
        weighted = slopes / (sd**2 * (1 + (off / (CAUCHY * sd)) ** 2))
        change = np.linalg.solve(weighted @ slopes.T + information, weighted @ off - information @ (place - surveyed))
        before, place = place, surveyed + np.clip(place + change - surveyed, -MOST_SD * SURVEY_SD, MOST_SD * SURVEY_SD)
        if np.abs(place - before).max() < CLOSE:
            break
    return place
