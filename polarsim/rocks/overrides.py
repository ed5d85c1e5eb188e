"""Override file: rocks with cuboids from a person, ids that rocks keep, and ids to drop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError, with_path
from polarsim.formats.files import text_of, write_text
from polarsim.formats.readers import reading
from polarsim.formats.yaml_files import parse_yaml
from polarsim.photo import FIRST_ID_WITHOUT_MESH


@dataclass(frozen=True)
class Cuboid:
    """Axis-aligned box in the sandbox frame, metres."""

    low: np.ndarray  # (3,)
    high: np.ndarray  # (3,)


@dataclass(frozen=True)
class Overrides:
    """Cuboids by rock id, positions (2,) of rocks by the id that they keep, and ids to drop."""

    cuboids: dict[int, Cuboid] = field(default_factory=dict)
    positions: dict[int, np.ndarray] = field(default_factory=dict)
    drop: tuple[int, ...] = ()


def read_overrides(path: str | Path) -> Overrides:
    """Read entries `{rock: id, min: [x, y, z], max: [x, y, z]}`, `{rock: id, at: [x, y]}`, `{drop: [ids]}`; m."""
    with reading("YAML", path):
        entries = parse_yaml(text_of(path))
    with with_path(path):
        if entries is not None and not isinstance(entries, list):
            raise FormatError("expected a list of cuboids and drops")
        read = Overrides()
        drop: list[int] = []
        for number, entry in enumerate(entries or [], 1):
            keys = set(entry) if isinstance(entry, dict) else set()
            if keys == {"drop"}:
                drop += _ids(number, entry["drop"])
                continue
            if keys not in ({"rock", "min", "max"}, {"rock", "at"}):
                raise FormatError(f"entry {number}: expected the keys rock, min, max, or rock, at, or the key drop")
            rock = _id(number, entry["rock"])
            if rock in read.cuboids or rock in read.positions:
                raise FormatError(f"entry {number}: rock {rock} occurs twice")
            if "at" in keys:
                read.positions[rock] = _numbers(number, entry, "at", 2)
            else:
                read.cuboids[rock] = _cuboid(number, entry)
        return replace(read, drop=tuple(sorted(set(drop))))


def _ids(number: int, value: Any) -> list[int]:
    if not isinstance(value, list) or not all(type(rock) is int and rock > 0 for rock in value):
        raise FormatError(f"entry {number}: drop is {value!r}, expected a list of rock ids")
    return value


def _id(number: int, value: Any) -> int:
    if type(value) is not int or not 0 < value < FIRST_ID_WITHOUT_MESH:
        raise FormatError(f"entry {number}: rock is {value!r}, expected an id from 1 to {FIRST_ID_WITHOUT_MESH - 1}")
    return value


def _cuboid(number: int, entry: Any) -> Cuboid:
    low, high = _numbers(number, entry, "min", 3), _numbers(number, entry, "max", 3)
    if (low >= high).any():
        raise FormatError(f"entry {number}: min is not below max")
    return Cuboid(low, high)


def _numbers(number: int, entry: Any, key: str, n: int) -> np.ndarray:
    """Return finite numbers (n,) under a key of an entry."""
    try:
        values = np.array(entry[key], float)
    except (TypeError, ValueError) as error:
        raise FormatError(f"entry {number}: {key} is not a list of numbers, {error}") from error
    if values.shape != (n,) or not np.isfinite(values).all():
        raise FormatError(f"entry {number}: {key} is {entry[key]!r}, expected {', '.join('xyz'[:n])}")
    return values


def write_cuboids(path: str | Path, cuboids: Mapping[int, Cuboid]) -> None:
    """Write cuboids in the format of the override file, rounded to the millimetre."""
    entries = [
        f"{{rock: {rock}, min: {_listed(cuboid.low)}, max: {_listed(cuboid.high)}}}"
        for rock, cuboid in sorted(cuboids.items())
    ]
    _write_entries(path, "these ids and crops", entries)


def write_positions(path: str | Path, positions: Mapping[int, np.ndarray]) -> None:
    """Write positions of rocks, (2,) metres, in the format of the override file, rounded to the millimetre."""
    entries = [f"{{rock: {rock}, at: {_listed(position)}}}" for rock, position in sorted(positions.items())]
    _write_entries(path, "these ids and leaves the crops to the pipeline", entries)


def _listed(values: np.ndarray) -> str:
    return f"[{', '.join(f'{value:.3f}' for value in values)}]"


def _write_entries(path: str | Path, kept: str, entries: list[str]) -> None:
    head = f"# metres, sandbox frame; a copy as config/rocks/terrainTT.yaml keeps {kept}\n"
    write_text(path, head + ("".join(f"- {entry}\n" for entry in entries) or "[]\n"))
