"""Masks of labels and twins as polygons, for each exposure bracket."""

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
    """Return the polygons of a polygon file, which has no rock ids."""
    named = [(POLYGON_CLASSES[number], ring) for number, ring in read_polygons(polygons)]
    return [_ring(kind, NO_ROCK, ring) for kind, ring in named if kind in (ROCK, SHADOW)]


def of_twins(instances: Path) -> list[dict[str, Any]]:
    """Return the polygons of rocks and shadows in an instance map."""
    ids = png.read_png(instances)
    rings = []
    for number in np.unique(ids[ids >= ROCK_IDS]).tolist():
        kind, rock = (SHADOW, number - SHADOW_IDS) if number >= SHADOW_IDS else (ROCK, number - ROCK_IDS)
        rings += [_ring(kind, rock, ring) for ring in outlines(ids == number, SIMPLIFY_PX)]
    return rings


def _ring(kind: str, rock: int, ring: np.ndarray) -> dict[str, Any]:
    return {"kind": kind, "rock": rock, "ring": np.round(ring).astype(int).ravel().tolist()}
