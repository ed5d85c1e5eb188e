"""Habits of annotators, fitted to labels that people drew: edges of shadow boxes, and rocks under the rover light.

Annotators extend a shadow's box a little beyond its tip and a little into the rock: each edge of a cast shadow's box is
moved outwards by a linear rule. Where only the rover light shines, annotators omit far and small rocks: a logistic rule
in the annotations under Sun lamps, in size and in distance.

`annotator.json` has the coefficients of both rules, and what they were fitted to. `polarsim.labels.fit_annotator` fits
them; `benchmarks/transfers.py --fit` scores each terrain with coefficients fitted to the others.
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
EDGE_TERMS = (  # by where the edge is along the shadow: at its far end, at its near end at the rock, or along its side
    "far m", "near m", "side m", "down m",  # metres at the rock
    "far of shadow", "side of shadow",  # of the shadow's extent across the edge
    "near of rock", "near gap",  # of the rock's extent; of how far the edge lies outside the rock's own
    "near label", "side label",  # of how far the rock's label reaches beyond its projected mesh there
)  # fmt: skip
ROVER_LIGHT_TERMS = ("all", "share here", "share elsewhere", "small", "far m")
PRESENCE = 0.45  # minimum probability of a label: F1 is highest where labels that are right less often are left out
LARGE_PX = 50.0  # sqrt(area) from which size does not matter
USUAL_M = 3.5  # distance of the centre of the sandbox, about
PACKAGED = Path(__file__).with_suffix(".json")


@dataclass(frozen=True)
class Annotator:
    """Coefficients of the habits."""

    edges: tuple[float, ...]  # one for each of EDGE_TERMS
    rover_light: tuple[float, ...]  # one for each of ROVER_LIGHT_TERMS

    def draw_shadow(
        self, box: np.ndarray, rock_label: np.ndarray, rock_mesh: np.ndarray, px_per_m: float
    ) -> np.ndarray:
        """Return the box (4,) that an annotator draws around a shadow whose visible part is in `box` (4,), px.

        Parameters
        ----------
        rock_label, rock_mesh : (4,) float
            Box of the shadow's rock as labelled, and as its mesh projects; px.
        px_per_m
            Scale of the photo at the rock.
        """
        moves = edge_terms(box, rock_label, rock_mesh, px_per_m) @ np.asarray(self.edges)
        return np.asarray(box + OUTWARD.sum(axis=1) * moves)

    def rock_probability(self, terms: np.ndarray) -> float:
        """Return the probability that a rock of some `rover_light_terms` (t,) is annotated where its label is."""
        return float(1 / (1 + np.exp(-terms @ np.asarray(self.rover_light))))


GEOMETRY_ALONE = Annotator((0.0,) * len(EDGE_TERMS), (0.0,) * len(ROVER_LIGHT_TERMS))  # cast shadows as they are


@cache
def read_annotator(path: Path = PACKAGED) -> Annotator:
    """Read the coefficients of a file such as `annotator.json`.

    Raises
    ------
    FormatError
        The file lacks a coefficient, or has another one.
    """
    content = json.loads(path.read_text(encoding="utf-8"))
    values = []
    for rule, terms in (("shadow_edges", EDGE_TERMS), ("rover_light", ROVER_LIGHT_TERMS)):
        found: Mapping[str, float] = content[rule]["coefficients"]
        if set(found) != set(terms):
            raise FormatError(f"coefficients of {rule}: {', '.join(found)}; expected {', '.join(terms)}", path=path)
        values.append(tuple(float(found[term]) for term in terms))
    return Annotator(*values)


def edge_terms(box: np.ndarray, rock_label: np.ndarray, rock_mesh: np.ndarray, px_per_m: float) -> np.ndarray:
    """Return the terms (4, len(EDGE_TERMS)) of the moves of a box's edges, px."""
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

    Parameters
    ----------
    share, elsewhere
        Share of the annotations under Sun lamps that have the rock: at the photo's position, and at others.
    size_px
        sqrt(width * height) of the label.
    distance_m
        From the camera to the rock.
    """
    small = min(np.log(max(size_px, 1.0) / LARGE_PX), 0.0)
    return np.array([1.0, share - 1, elsewhere - 1, small, distance_m - USUAL_M])
