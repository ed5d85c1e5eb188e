"""Photo keys, polarsim's photo format, and classes of labels."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import log2
from typing import Literal

from polarsim.errors import LabelError

Light = Literal["on", "off"]
Azimuth = str  # name of a lamp that stands in for the Sun, such as "30", or `NO_SUN`
CameraSide = Literal["L", "R"]
Terrain = int | str  # number or name; the terrains of a site are all numbers or all names
PositionCamera = tuple[str, str]  # position and camera of one terrain
Bracket = tuple[Terrain, str, Light, Azimuth, CameraSide]  # fields of a key except the exposure

NO_SUN = "no"  # azimuth of photos without a lamp that stands in for the Sun

LIGHTS: tuple[Light, ...] = ("off", "on")

BLACK_LEVEL = 16  # DN of an unlit pixel in polarsim's photo format; `photo_format` converts the photos of other sites
WHITE_LEVEL = 4095  # DN of a clipped pixel in this format: 12 bits in a 16-bit file
# Width and height, px, of the photos for which lengths in pixels are stated: tolerances, gates and models tuned on
# POLAR. Photos of other widths use the length times `photo_scale`, except lengths that the pixels of any sensor cause:
# noise, interpolation, edges of masks.
REFERENCE_SIZE_PX = (1936, 1216)
REFERENCE_WIDTH_PX = REFERENCE_SIZE_PX[0]
ELECTRONS_PER_DN = 8  # not published; value of similar sensors (Sony IMX249: 33,000 electrons at 12 bits)
READ_NOISE_ELECTRONS = 7  # standard deviation, of similar sensors
CENTRE_DN = 768.0  # DN above black of level sand at the centre, a fifth of white: makes the usual exposure optimal

ROCK, SHADOW = "rock", "shadow"
BOX_CLASSES = (ROCK, SHADOW)  # index: class number of a box
COLOURS = {ROCK: (255, 176, 0), SHADOW: (70, 190, 255)}  # RGB; distinguishable by colour-blind people and from grey
HEX_COLOURS = {kind: "#{:02x}{:02x}{:02x}".format(*colour) for kind, colour in COLOURS.items()}
POLYGON_CLASSES = ("background", "ground", ROCK, SHADOW)  # index: class number of a polygon; differs from boxes
GREY_VALUES = {"background": 0, "ground": 86, ROCK: 128, SHADOW: 43}  # of the class masks of the release

NO_ROCK = -1  # label or pixel without known rock
FIRST_ID_WITHOUT_MESH = 901  # first id of labelled rocks without mesh; ids of meshed rocks are smaller

_NAME = "[A-Za-z0-9][A-Za-z0-9-]*"  # of a terrain, position or lamp
_KEY = re.compile(
    rf"(?P<terrain>{_NAME})_(?P<position>{_NAME})_(?P<light>on|off)_(?P<azimuth>{_NAME})_(?P<camera>[LR])"
    r"_(?P<exposure>\d{4,5})"
)


def photo_scale(width: int) -> float:
    """Return the scale of photos of a width, px, relative to photos of the reference width."""
    return width / REFERENCE_WIDTH_PX


def reduced_scale(scale: float, width: int) -> float:
    """Return the scale, at most 1, that gives photos of a width, px, the size of reference photos at `scale`."""
    return min(1.0, scale / photo_scale(width))


def terrain_text(terrain: Terrain) -> str:
    """Return a terrain as written in keys and paths: `01`, or a name."""
    return terrain if isinstance(terrain, str) else f"{terrain:02d}"


def parse_terrain(text: str) -> Terrain:
    """Return the terrain of a text in a key, a path or a configuration: a number, or a name."""
    return int(text) if text.isdecimal() else text


def terrain_of_text(text: str) -> Terrain | None:
    """Return the terrain with this text; None if the text is not exactly that of a terrain, such as `1` for `01`."""
    terrain = parse_terrain(text)
    return terrain if terrain_text(terrain) == text else None


def sorted_terrains(terrains: Iterable[Terrain]) -> list[Terrain]:
    """Return the different terrains, numbers before names."""
    return sorted(set(terrains), key=lambda terrain: (isinstance(terrain, str), terrain))


@dataclass(frozen=True, order=True)
class PhotoKey:
    """Name of one photo, `01_A_off_180_L_0256`: terrain, position, light, azimuth, camera, exposure in ms.

    `Site.key` also checks that a site has these terrains, positions, lamps and exposures.
    """

    terrain: Terrain
    position: str
    light: Light
    azimuth: Azimuth
    camera: CameraSide
    exposure_ms: int

    def __str__(self) -> str:
        start = f"{terrain_text(self.terrain)}_{self.position}_{self.light}_{self.azimuth}"
        return f"{start}_{self.camera}_{self.exposure_ms:04d}"

    @classmethod
    def parse(cls, text: str) -> PhotoKey:
        """Parse a key. The text must not contain anything else: `..._0256 copy` is rejected."""
        match = _KEY.fullmatch(text)
        if match:
            terrain, position, light, azimuth, camera, exposure = match.groups()
            key = cls(parse_terrain(terrain), position, light, azimuth, camera, int(exposure))  # type: ignore[arg-type]
            if str(key) == text and key.exposure_ms:
                return key
        raise LabelError(f"{text!r} is not a photo key, for example 01_A_off_180_L_0256")

    @property
    def station(self) -> tuple[Terrain, str]:
        """Terrain and position."""
        return self.terrain, self.position

    @property
    def view(self) -> tuple[Terrain, str, CameraSide]:
        """Terrain, position and camera."""
        return self.terrain, self.position, self.camera

    @property
    def bracket(self) -> Bracket:
        """All fields except the exposure."""
        return self.terrain, self.position, self.light, self.azimuth, self.camera

    @property
    def has_sun(self) -> bool:
        """Whether a lamp stands in for the Sun."""
        return self.azimuth != NO_SUN

    def stops_from(self, exposure_ms: float) -> float:
        """Absolute difference to an exposure time, ms, in stops (factors of two)."""
        return abs(log2(self.exposure_ms / exposure_ms))

    @property
    def other_camera(self) -> PhotoKey:
        """Key of the same photo with the other camera of the rig."""
        return replace(self, camera="R" if self.camera == "L" else "L")

    def with_exposure(self, exposure_ms: int) -> PhotoKey:
        return replace(self, exposure_ms=exposure_ms)


def leading_key(text: str) -> PhotoKey | None:
    """Return the photo key at the start of a text; None if there is none."""
    match = _KEY.match(text)
    try:
        return PhotoKey.parse(match[0]) if match else None
    except LabelError:
        return None


def by_bracket(keys: Iterable[PhotoKey]) -> dict[Bracket, list[PhotoKey]]:
    """Return sorted keys by exposure bracket."""
    found: dict[Bracket, list[PhotoKey]] = {}
    for key in sorted(keys):
        found.setdefault(key.bracket, []).append(key)
    return found
