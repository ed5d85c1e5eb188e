"""Masks as rings of points: what an exposure bracket's labels and twins cover."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from polarsim.formats import png
from polarsim.formats.yolo import read_polygons
from polarsim.geometry.polygons import outlines
from polarsim.photo import NO_ROCK, POLYGON_CLASSES, ROCK, SHADOW
from polarsim.run_files.instances import ROCK_IDS, SHADOW_IDS

SIMPLIFY_PX = 1.0


def of_photos(polygons: Path) -> list[dict[str, Any]]:
    """Rings of the labels that a polygon file holds; it does not know of which rock."""
    named = [(POLYGON_CLASSES[number], ring) for number, ring in read_polygons(polygons)]
    return [_ring(kind, NO_ROCK, ring) for kind, ring in named if kind in (ROCK, SHADOW)]


def of_twins(instances: Path) -> list[dict[str, Any]]:
    """Rings of what the pixels of an instance map show: rocks, and ground in their shadows."""
    ids = png.read(instances)
    found = []
    for number in np.unique(ids[ids >= ROCK_IDS]).tolist():
        kind, rock = (SHADOW, number - SHADOW_IDS) if number >= SHADOW_IDS else (ROCK, number - ROCK_IDS)
        found += [_ring(kind, rock, ring) for ring in outlines(ids == number, SIMPLIFY_PX)]
    return found


def _ring(kind: str, rock: int, ring: np.ndarray) -> dict[str, Any]:
    return {"kind": kind, "rock": rock, "ring": np.round(ring).astype(int).ravel().tolist()}
