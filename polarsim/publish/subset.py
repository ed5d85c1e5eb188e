"""Which pictures of a run are published: by fields of their keys, and as many as a size allows."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from polarsim.errors import ConfigError
from polarsim.randomness import generator

log = logging.getLogger(__name__)

if TYPE_CHECKING:  # the configuration is read without pandas
    from polarsim.publish.catalogue import Catalogue, Picture

FIELDS: Mapping[str, Callable[[Picture], str]] = {
    "terrain": lambda one: str(one.key.terrain),
    "position": lambda one: one.key.position,
    "light": lambda one: one.key.light,
    "azimuth": lambda one: one.key.azimuth,
    "camera": lambda one: one.key.camera,
    "exposure": lambda one: str(one.key.exposure_ms),
    "domain": lambda one: one.domain,
    "part": lambda one: one.part,
}
_NUMBERS = {"terrain", "exposure"}  # 01 and 1 are one, 0256 and 256
_UNITS = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12}


def parse_subset(text: str) -> dict[str, tuple[str, ...]]:
    """Fields and what they may be, of a text such as `terrain=1+3,exposure=256`.

    Raises
    ------
    ConfigError
        An unknown field, a field without values, or one that comes twice.
    """
    found: dict[str, tuple[str, ...]] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, values = (word.strip() for word in part.partition("="))
        if name not in FIELDS or not equals or not values or name in found:
            raise ConfigError(
                f"subset {part!r}, expected fields once each as terrain=1+3; they are {', '.join(FIELDS)}"
            )
        words = tuple(word.strip() for word in values.split("+"))
        if name in _NUMBERS and not all(word.isdigit() for word in words):
            raise ConfigError(f"subset {part!r}, expected whole numbers")
        found[name] = tuple(str(int(word)) for word in words) if name in _NUMBERS else words
    return found


def chosen(catalogue: Catalogue, subset: Mapping[str, Sequence[str]]) -> Catalogue:
    """The pictures whose fields are among these; all of them of an empty subset.

    Raises
    ------
    ConfigError
        No picture is left; the line names the values that there are. A warning names values that no picture has.
    """
    if not subset:
        return catalogue
    kept = list(catalogue.pictures)
    for name, values in subset.items():
        there = {FIELDS[name](one) for one in kept}
        known = ", ".join(
            sorted(there, key=lambda word: (len(word) if name in _NUMBERS else 0, word))[:12]
        )  # 3, then 11
        kept = [one for one in kept if FIELDS[name](one) in values]
        if not kept:
            raise ConfigError(f"subset: no picture with {name}={'+'.join(values)}, there are {known}")
        if absent := [value for value in values if value not in there]:
            log.warning("subset: no picture with %s=%s, there are %s", name, "+".join(absent), known)
    said = ", ".join(f"{name} {' or '.join(values)}" for name, values in subset.items())
    return catalogue.with_pictures(kept, f"A subset: {len(kept)} of {len(catalogue.pictures)} pictures, {said}.")


def parse_size(text: str) -> int:
    """Bytes of a text such as `2GB`, `500 MB` or a plain number; thousands, not 1,024.

    Raises
    ------
    ConfigError
        No size above 0.
    """
    found = re.fullmatch(r"\s*([0-9.]+)\s*([kmgt]?)i?b?\s*", text.lower())
    try:
        size = int(float(found[1]) * _UNITS[found[2]]) if found else 0
    except ValueError:
        size = 0
    if size <= 0:
        raise ConfigError(f"size {text!r}, expected one such as 500MB or 2GB")
    return size


def fitting(catalogue: Catalogue, size_of: Callable[[Picture], int], fixed: int, most: int) -> Catalogue:
    """As many pictures as fit, scenes whole: a photo, its pair and their twins stay together.

    Which scenes go is drawn by their keys alone, so that a larger size holds all that a smaller one does.

    Parameters
    ----------
    size_of
        Bytes that a picture takes in the form.
    fixed
        Bytes that the form takes whatever the pictures.
    most
        Bytes that it may take.

    Raises
    ------
    ConfigError
        Not even one scene fits.
    """
    scenes: dict[str, list[Picture]] = {}
    for one in catalogue.pictures:
        scenes.setdefault(_scene(one), []).append(one)
    ranked = sorted(scenes, key=lambda name: (generator(0, "publish", name).random(), name))
    taken: set[str] = set()
    total = fixed
    for name in ranked:
        total += sum(map(size_of, scenes[name]))
        if total > most:
            break
        taken.add(name)
    if not taken:
        need = fixed + sum(map(size_of, scenes[ranked[0]]))
        raise ConfigError(f"nothing fits into {most:,} bytes: one scene takes {need:,}")
    if len(taken) == len(scenes):
        return catalogue
    kept = [one for one in catalogue.pictures if _scene(one) in taken]
    note = f"Cut to {most:,} bytes: {len(kept)} of {len(catalogue.pictures)} pictures, drawn by their keys."
    return catalogue.with_pictures(kept, note)


def _scene(picture: Picture) -> str:
    """The key of the left photo: its pair and the twins of both have it too."""
    return str(picture.key if picture.key.camera == "L" else picture.key.other_camera)
