"""The override file: rocks as a person cropped them, and finds to be left out."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError, about
from polarsim.formats.files import write_text


@dataclass(frozen=True)
class Cuboid:
    """An upright box of the sandbox, metres."""

    low: np.ndarray  # (3,)
    high: np.ndarray  # (3,)


@dataclass(frozen=True)
class Overrides:
    """Cuboids by rock id, and ids of finds to leave out."""

    cuboids: dict[int, Cuboid] = field(default_factory=dict)
    drop: tuple[int, ...] = ()


def read_overrides(path: str | Path) -> Overrides:
    """Read a list whose entries are `{rock: id, min: [x, y, z], max: [x, y, z]}` or `{drop: [ids]}`; metres.

    Raises
    ------
    FormatError
        No YAML list, an entry of another form, an id twice, or a cuboid without volume.
    """
    import yaml

    try:
        entries = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise FormatError(f"{path}: no readable YAML, {' '.join(str(error).split())}") from error
    with about(path):
        if entries is not None and not isinstance(entries, list):
            raise FormatError("expected a list of cuboids and drops")
        cuboids: dict[int, Cuboid] = {}
        drop: list[int] = []
        for number, entry in enumerate(entries or [], 1):
            if isinstance(entry, dict) and set(entry) == {"drop"}:
                drop += _ids(number, entry["drop"])
            else:
                rock, cuboid = _cuboid(number, entry)
                if rock in cuboids:
                    raise FormatError(f"entry {number}: rock {rock} is there twice")
                cuboids[rock] = cuboid
        return Overrides(cuboids, tuple(sorted(set(drop))))


def _ids(number: int, value: Any) -> list[int]:
    if not isinstance(value, list) or not all(type(rock) is int and rock > 0 for rock in value):
        raise FormatError(f"entry {number}: drop is {value!r}, expected a list of rock ids")
    return value


def _cuboid(number: int, entry: Any) -> tuple[int, Cuboid]:
    if not isinstance(entry, dict) or set(entry) != {"rock", "min", "max"}:
        raise FormatError(f"entry {number}: expected the keys rock, min, max, or the key drop")
    if type(entry["rock"]) is not int or entry["rock"] <= 0:
        raise FormatError(f"entry {number}: rock is {entry['rock']!r}, expected an id from 1 on")
    try:
        low, high = (np.array(entry[name], float) for name in ("min", "max"))
    except (TypeError, ValueError) as error:
        raise FormatError(f"entry {number}: min or max is no list of numbers, {error}") from error
    if low.shape != (3,) or high.shape != (3,) or not np.isfinite([low, high]).all() or (low >= high).any():
        raise FormatError(f"entry {number}: min and max must be x, y, z with min below max")
    return entry["rock"], Cuboid(low, high)


def write_cuboids(path: str | Path, cuboids: dict[int, Cuboid]) -> None:
    """Write cuboids in the form of the override file, to the millimetre."""
    lines = ["# metres, sandbox frame; a copy as config/rocks/terrainTT.yaml keeps these ids and crops\n"]
    for rock, cuboid in sorted(cuboids.items()):
        low, high = (", ".join(f"{value:.3f}" for value in corner) for corner in (cuboid.low, cuboid.high))
        lines.append(f"- {{rock: {rock}, min: [{low}], max: [{high}]}}\n")
    write_text(path, "".join(lines) if cuboids else lines[0] + "[]\n")
