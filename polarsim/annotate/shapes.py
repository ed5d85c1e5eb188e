"""What a person drew on a picture, as the readers of other tools' exports return it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.photo import HEIGHT, WIDTH

SIZE = np.array([WIDTH, HEIGHT], float)
_SAME_SHAPE = 0.01  # largest relative difference between width over height of a resized picture and of a photo


@dataclass(frozen=True, eq=False)
class Shape:
    """One annotation of a picture."""

    where: str  # its name in messages, such as "box 3"
    form: str  # how it was drawn, in the singular: "box", "mask", "polyline"
    label: str  # name of its class, as the tool stores it
    box: np.ndarray | None  # (4,) box around it, px of the photo; None where no box can be made of it


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of an export and everything that was drawn on it."""

    name: str
    shapes: list[Shape] = field(default_factory=list)


def scale_of(source: Path, name: str, width: float, height: float) -> float:
    """Pixels of the photo per pixel of a picture of another size.

    Raises
    ------
    FormatError
        The picture has another shape than a photo.
    """
    if not (width > 0 and height > 0) or abs(width / height * HEIGHT / WIDTH - 1) > _SAME_SHAPE:
        raise FormatError(f"{name}: {width:g} x {height:g} px, a photo has {WIDTH} x {HEIGHT}", path=source)
    return WIDTH / width
