"""Habits of annotators, fitted to human labels: edges of shadow boxes, and rocks under the rover light.

Annotators extend the box of a shadow beyond the tip and into the rock: a linear model moves each edge of the box of a
cast shadow outwards. Under the rover light, annotators omit distant and small rocks: a logistic model of the
annotations under Sun lamps, size and distance.

`annotator.json` contains the coefficients of both models and the name of the data. `polarsim.labels.fit_annotator` fits
them; `benchmarks/transfers.py --fit` evaluates each terrain with coefficients fitted to all terrains except that one.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError

OUTWARD = np.array([[-1.0, 0.0], [0.0, -1.0], [1.0, 0.0], [0.0, 1.0]])  # normals of the left, top, right, bottom edge
EDGE_TERMS = (  # far: edge at the tip of the shadow; near: at the rock; side: parallel to the shadow
    "far m", "near m", "side m", "down m",  # metres at the rock
    "far of shadow", "side of shadow",  # share of the extent of the shadow perpendicular to the edge
    "near of rock", "near gap",  # share of the extent of the rock; of the distance to the edge of the rock
    "near label", "side label",  # share of the distance between the edges of the label and the projected mesh
)  # fmt: skip
ROVER_LIGHT_TERMS = ("all", "share here", "share elsewhere", "small", "far m")
MIN_PROBABILITY = 0.45  # minimum probability of a label, maximises F1
LARGE_PX = 50.0  # sqrt(area) above which the size has no effect
CENTRE_DISTANCE_M = 3.5  # zero of this term: distance of the centre of POLAR's sandbox, to which the model is fitted
PACKAGED = Path(__file__).with_suffix(".json")


@dataclass(frozen=True)
class Annotator:
    """Coefficients of both models."""

    edges: tuple[float, ...]  # in the order of EDGE_TERMS
    rover_light: tuple[float, ...]  # in the order of ROVER_LIGHT_TERMS

    def draw_shadow(
        self, box: np.ndarray, rock_label: np.ndarray, rock_mesh: np.ndarray, px_per_m: float
    ) -> np.ndarray:
        """Return the box (4,) that an annotator draws around a shadow with visible extent `box` (4,), px.

        `rock_label`, `rock_mesh` (4,): label and projected mesh box of the rock that casts the shadow, px.
        `px_per_m`: scale of the photo at the rock.
        """
        moves = edge_terms(box, rock_label, rock_mesh, px_per_m) @ np.asarray(self.edges)
        return np.asarray(box + OUTWARD.sum(axis=1) * moves)

    def rock_probability(self, terms: np.ndarray) -> float:
        """Return the probability that a rock with `rover_light_terms` (t,) is annotated."""
        return float(1 / (1 + np.exp(-terms @ np.asarray(self.rover_light))))


NO_HABITS = Annotator((0.0,) * len(EDGE_TERMS), (0.0,) * len(ROVER_LIGHT_TERMS))  # keeps cast shadows unchanged


@cache
def read_annotator(path: Path = PACKAGED) -> Annotator:
    """Read the coefficients of a file such as `annotator.json`."""
    content = json.loads(path.read_text(encoding="utf-8"))
    values = []
    for rule, terms in (("shadow_edges", EDGE_TERMS), ("rover_light", ROVER_LIGHT_TERMS)):
        coefficients: Mapping[str, float] = content[rule]["coefficients"]
        if set(coefficients) != set(terms):
            raise FormatError(
                f"coefficients of {rule}: {', '.join(coefficients)}; expected {', '.join(terms)}", path=path
            )
        values.append(tuple(float(coefficients[term]) for term in terms))
    return Annotator(*values)


def edge_terms(box: np.ndarray, rock_label: np.ndarray, rock_mesh: np.ndarray, px_per_m: float) -> np.ndarray:
    """Return the terms (4, len(EDGE_TERMS)) of the shifts of the edges of a box, px."""
    away = (box[:2] + box[2:] - rock_label[:2] - rock_label[2:]) / 2
    along = OUTWARD @ (away / max(float(np.linalg.norm(away)), 1.0))
    far, near = np.clip(along, 0, None), np.clip(-along, 0, None)
    side = 1 - np.abs(along)
    outward = OUTWARD.sum(axis=1)
    shadow_extent, rock_extent = np.tile(box[2:] - box[:2], 2), np.tile(rock_label[2:] - rock_label[:2], 2)
    gap, label = outward * (box - rock_label), outward * (rock_label - rock_mesh)
    metres = [far * px_per_m, near * px_per_m, side * px_per_m, OUTWARD[:, 1] * px_per_m]
    shares = [far * shadow_extent, side * shadow_extent, near * rock_extent, near * gap, near * label, side * label]
    return np.stack([*metres, *shares], axis=1)


def rover_light_terms(share: float, elsewhere: float, size_px: float, distance_m: float) -> np.ndarray:
    """Return the terms (len(ROVER_LIGHT_TERMS),) of the log odds that a rock is annotated under the rover light.

    `share`, `elsewhere`: share of the annotations under Sun lamps that contain the rock: at the position of the photo,
    and at all different positions.
    `size_px`: sqrt(width * height) of the label in a photo of the reference width.
    `distance_m`: distance from the camera to the rock.
    """
    small = min(np.log(max(size_px, 1.0) / LARGE_PX), 0.0)
    return np.array([1.0, share - 1, elsewhere - 1, small, distance_m - CENTRE_DISTANCE_M])
