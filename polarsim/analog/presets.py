"""Presets of terrains: number, sizes and layout of rocks, and shape of the ground, as in NASA's 13 terrains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from polarsim.photo import Terrain
from polarsim.site import Site

Layout = Literal["spread", "cluster", "sides", "diagonal", "around", "in_crater", "pile"]


@dataclass(frozen=True)
class Preset:
    """Preset of a terrain. Sizes are the longest sides (minimum, median, maximum), metres."""

    rocks: int  # in 16 m2 of sand
    sizes: tuple[float, float, float] = (0.06, 0.09, 0.20)
    layout: Layout = "spread"
    touching: float = 0.1  # share of rocks that lean against a neighbour
    stacked: int = 0  # number of rocks on top of rocks
    giant: float = 0.0  # size of an additional bright rock at the front, metres; 0: none
    relief: float = 1.0  # strength of the fractal relief
    trowel: float = 1.0  # strength of trowel marks
    pits: int = 8
    mounds: int = 5
    tracks: int = 0
    crater: Literal["", "fresh", "old"] = ""
    like: int = 0  # preset with the same ground and rocks; 0: none


PRESETS = {
    1: Preset(15, (0.08, 0.22, 0.38), trowel=1.3),
    2: Preset(15, (0.08, 0.22, 0.38), trowel=1.3, giant=0.55, like=1),
    3: Preset(28, (0.07, 0.11, 0.36), touching=0.15),
    4: Preset(27, (0.06, 0.10, 0.36), touching=0.3, mounds=12, tracks=1),
    5: Preset(23, (0.05, 0.09, 0.36), layout="cluster", touching=0.2, stacked=1),
    6: Preset(0, relief=0.35, trowel=0.15, pits=0, mounds=0),
    7: Preset(18, (0.07, 0.09, 0.38), layout="sides"),
    8: Preset(16, (0.07, 0.10, 0.34), layout="pile", stacked=2, pits=20),
    9: Preset(20, (0.06, 0.09, 0.15), touching=0.05, tracks=1),
    10: Preset(20, (0.07, 0.09, 0.15), layout="diagonal", touching=0.2, tracks=1),
    11: Preset(9, (0.07, 0.09, 0.14), layout="around", crater="fresh", touching=0.2),
    12: Preset(23, (0.05, 0.09, 0.26), layout="in_crater", crater="old", touching=0.15),
    13: Preset(3, (0.07, 0.09, 0.12), relief=0.3, trowel=0.1, pits=0, mounds=0),
}


def preset_of(site: Site, terrain: Terrain) -> tuple[Preset, Terrain]:
    """Return the preset of a terrain, and the terrain that has the same ground and rocks.

    The preset is that of `site.analog.scenes`, else of the number of the terrain, else of its place among the terrains.
    """
    preset = PRESETS[_number(site, terrain)]
    alike = [other for other in site.terrains if preset.like and _number(site, other) == preset.like]
    return preset, alike[0] if alike else terrain


def _number(site: Site, terrain: Terrain) -> int:
    if terrain in site.analog.scenes:
        return site.analog.scenes[terrain]
    if terrain in PRESETS:
        return int(terrain)
    usual = [number for number, preset in PRESETS.items() if not preset.like and number != max(PRESETS)]
    return usual[list(site.terrains).index(terrain) % len(usual)]
