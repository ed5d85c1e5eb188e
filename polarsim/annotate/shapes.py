"""Annotations of an image, as returned by the readers of exports of annotation tools."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.photo import HEIGHT, WIDTH

SIZE = np.array([WIDTH, HEIGHT], float)
_MAX_ASPECT_ERROR = 0.01  # maximum relative difference of the aspect ratio of a resized image


@dataclass(frozen=True, eq=False)
class ExportedShape:
    """Annotation of an image."""

    where: str  # name in messages, such as "box 3"
    form: str  # kind of annotation, in the singular: "box", "mask", "polyline"
    label: str  # name of the class in the annotation tool
    box: np.ndarray | None  # (4,) bounding box, px of the photo; None for forms without box


@dataclass(frozen=True, eq=False)
class ExportedImage:
    """Image of an export with all annotations."""

    name: str
    shapes: list[ExportedShape] = field(default_factory=list)


def scale_of(source: Path, name: str, width: float, height: float) -> float:
    """Return the scale from pixels of a resized image to pixels of the photo."""
    if not (width > 0 and height > 0) or abs(width / height * HEIGHT / WIDTH - 1) > _MAX_ASPECT_ERROR:
        raise FormatError(f"{name}: {width:g} x {height:g} px, expected the aspect of {WIDTH} x {HEIGHT}", path=source)
    return WIDTH / width
