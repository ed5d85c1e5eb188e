"""Selection of published images by fields of the photo key and by a maximum size."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from polarsim.errors import ConfigError
from polarsim.photo import parse_terrain
from polarsim.randomness import generator

log = logging.getLogger(__name__)

if TYPE_CHECKING:  # the configuration is read without pandas
    from polarsim.publish.catalogue import Catalogue, CatalogueImage

FIELDS: Mapping[str, Callable[[CatalogueImage], str]] = {
    "terrain": lambda one: str(one.key.terrain),
    "position": lambda one: one.key.position,
    "light": lambda one: one.key.light,
    "azimuth": lambda one: one.key.azimuth,
    "camera": lambda one: one.key.camera,
    "exposure": lambda one: str(one.key.exposure_ms),
    "domain": lambda one: one.domain,
    "part": lambda one: one.part,
}
_PLAIN: Mapping[str, Callable[[str], str]] = {  # text of a value that can be written in several ways
    "terrain": lambda word: str(parse_terrain(word)),
    "exposure": lambda word: str(int(word)),
}
_UNITS = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12}


def parse_subset(text: str) -> dict[str, tuple[str, ...]]:
    """Return the allowed values of each field of a text such as `terrain=1+3,exposure=256`."""
    allowed: dict[str, tuple[str, ...]] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, values = (word.strip() for word in part.partition("="))
        if name not in FIELDS or not equals or not values or name in allowed:
            raise ConfigError(f"subset {part!r}, expected for example terrain=1+3; fields: {', '.join(FIELDS)}")
        words = tuple(word.strip() for word in values.split("+"))
        if name == "exposure" and not all(word.isdigit() for word in words):
            raise ConfigError(f"subset {part!r}, expected integers")
        allowed[name] = tuple(_PLAIN.get(name, str)(word) for word in words)
    return allowed


def select(catalogue: Catalogue, subset: Mapping[str, Sequence[str]]) -> Catalogue:
    """Return the catalogue with the images whose fields have the allowed values; an empty subset keeps all images.

    A warning lists values that no image has.
    """
    if not subset:
        return catalogue
    kept = list(catalogue.pictures)
    for name, values in subset.items():
        present = {FIELDS[name](picture) for picture in kept}
        in_order = sorted(present, key=lambda word: (len(word) if name in _PLAIN and word.isdigit() else 0, word))
        listed = ", ".join(in_order[:12])
        kept = [picture for picture in kept if FIELDS[name](picture) in values]
        if not kept:
            raise ConfigError(f"subset: no image with {name}={'+'.join(values)}, expected values: {listed}")
        if absent := [value for value in values if value not in present]:
            log.warning("subset: no image with %s=%s, expected values: %s", name, "+".join(absent), listed)
    selection = ", ".join(f"{name} {' or '.join(values)}" for name, values in subset.items())
    return catalogue.with_pictures(kept, f"Subset: {len(kept)} of {len(catalogue.pictures)} images, {selection}.")


def parse_size(text: str) -> int:
    """Return the bytes of a text such as `2GB`, `500 MB` or a plain number; prefixes are powers of 1,000."""
    match = re.fullmatch(r"\s*([0-9.]+)\s*([kmgt]?)i?b?\s*", text.lower())
    try:
        size = int(float(match[1]) * _UNITS[match[2]]) if match else 0
    except ValueError:
        size = 0
    if size <= 0:
        raise ConfigError(f"size {text!r}, expected for example 500MB or 2GB")
    return size


def limit_size(catalogue: Catalogue, size_of: Callable[[CatalogueImage], int], fixed: int, limit: int) -> Catalogue:
    """Return a random subset of scenes of at most `limit` bytes; a scene is a stereo pair of photos and the twins.

    The random order depends only on the photo keys, so that a larger limit selects a superset.
    `size_of` is the size of an image in the format, `fixed` that of all other files, bytes.
    """
    scenes: dict[str, list[CatalogueImage]] = {}
    for picture in catalogue.pictures:
        scenes.setdefault(_scene(picture), []).append(picture)
    ranked = sorted(scenes, key=lambda name: (generator(0, "publish", name).random(), name))
    selected: set[str] = set()
    total = fixed
    for name in ranked:
        total += sum(map(size_of, scenes[name]))
        if total > limit:
            break
        selected.add(name)
    if not selected:
        need = fixed + sum(map(size_of, scenes[ranked[0]]))
        raise ConfigError(f"the maximum size is {limit:,} bytes, but a single scene needs {need:,}: raise --max-size")
    if len(selected) == len(scenes):
        return catalogue
    kept = [picture for picture in catalogue.pictures if _scene(picture) in selected]
    note = f"Limited to {limit:,} bytes: {len(kept)} of {len(catalogue.pictures)} images, selected at random."
    return catalogue.with_pictures(kept, note)


def _scene(picture: CatalogueImage) -> str:
    """Return the key of the left photo, which identifies the stereo pair and the twins."""
    return str(picture.key if picture.key.camera == "L" else picture.key.other_camera)
