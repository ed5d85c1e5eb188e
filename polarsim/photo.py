"""Photo keys, NASA's photo grid, and constants of the data set."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from math import log2
from typing import Literal

from polarsim.errors import LabelError

Light = Literal["on", "off"]
Azimuth = Literal["no", "30", "180", "270", "350"]
CameraSide = Literal["L", "R"]
PositionCamera = tuple[str, str]  # position and camera of one terrain
Bracket = tuple[int, str, Light, Azimuth, CameraSide]  # fields of a key except the exposure

TERRAINS = tuple(range(1, 14))
LIGHTS: tuple[Light, ...] = ("off", "on")
AZIMUTHS: tuple[Azimuth, ...] = ("no", "30", "180", "270", "350")
SUNS: tuple[Azimuth, ...] = ("30", "180", "270", "350")
CAMERAS: tuple[CameraSide, ...] = ("L", "R")

WIDTH, HEIGHT = 1936, 1216  # pixels of every photo
BLACK_LEVEL = 16  # DN of an unlit pixel
WHITE_LEVEL = 4095  # DN, 12 bits in a 16-bit file
ELECTRONS_PER_DN = 8  # not published; value of similar sensors (Sony IMX249: 33,000 electrons at 12 bits)
READ_NOISE_ELECTRONS = 7  # standard deviation, of similar sensors
REFERENCE_EXPOSURE_MS = 256  # median exposure with a Sun lamp, at which most labels were annotated
CENTRE_DN_PER_MS = 3.0  # DN per ms of level sand at the centre under Sun lamp 30; makes the usual exposure optimal

ROCK, SHADOW = "rock", "shadow"
BOX_CLASSES = (ROCK, SHADOW)  # index: class number of a box
COLOURS = {ROCK: (255, 176, 0), SHADOW: (70, 190, 255)}  # RGB; distinguishable by colour-blind people and from grey
HEX_COLOURS = {kind: "#{:02x}{:02x}{:02x}".format(*colour) for kind, colour in COLOURS.items()}
POLYGON_CLASSES = ("background", "ground", ROCK, SHADOW)  # index: class number of a polygon; differs from boxes
SHADOWS_ANNOTATED_FROM_MS = 128  # minimum exposure of annotated shadows; a second annotator has no minimum
GREY_VALUES = {"background": 0, "ground": 86, ROCK: 128, SHADOW: 43}  # of the class masks of the release

NO_ROCK = -1  # label or pixel without known rock
FIRST_ID_WITHOUT_MESH = 901  # first id of labelled rocks without mesh; ids of meshed rocks are smaller

_QUERY = re.compile(r"\?(?!d=).*", re.DOTALL)  # of an address; Label Studio's files are `?d=FOLDER/FILE`
_ENDING = re.compile(r"(?:_[A-Za-z]{3,4}\.rf\.\w+)?(?:\.[A-Za-z]\w{1,4})?\Z")  # of Roboflow's KEY_png.rf.HASH.jpg
# Fields of a photo key in order: name -> valid texts, and their description in messages.
_FIELDS: dict[str, tuple[frozenset[str], str]] = {
    "terrain": (frozenset(f"{terrain:02d}" for terrain in TERRAINS), "01 to 13"),
    "position": (frozenset("ABCDEFG"), "A to G"),
    "light": (frozenset(LIGHTS), "on or off"),
    "azimuth": (frozenset(AZIMUTHS), "no, 30, 180, 270 or 350"),
    "camera": (frozenset(CAMERAS), "L or R"),
    "exposure": (frozenset(f"{2**n:04d}" for n in range(4, 14)), "0016, 0032, 0064 ... 8192"),
}


@dataclass(frozen=True, order=True)
class PhotoKey:
    """Name of one photo, `01_A_off_180_L_0256`: terrain, position, light, azimuth, camera, exposure in ms."""

    terrain: int
    position: str
    light: Light
    azimuth: Azimuth
    camera: CameraSide
    exposure_ms: int

    def __str__(self) -> str:
        return f"{self.terrain:02d}_{self.position}_{self.light}_{self.azimuth}_{self.camera}_{self.exposure_ms:04d}"

    @classmethod
    def parse(cls, text: str) -> PhotoKey:
        """Parse a key. The text must not contain anything else: `..._0256 copy` is rejected."""
        fields = text.split("_")
        if len(fields) != len(_FIELDS):
            raise LabelError(f"{text!r} is not a photo key, for example 01_A_off_180_L_0256")
        wrong = [_wrong_field(name, field) for name, field in zip(_FIELDS, fields, strict=True)]
        if any(wrong):
            raise LabelError(f"{text!r} is not a photo key: {'; '.join(filter(None, wrong))}")
        terrain, position, light, azimuth, camera, exposure = fields
        key = cls(int(terrain), position, light, azimuth, camera, int(exposure))  # type: ignore[arg-type]
        if position not in (there := positions(key.terrain)):
            raise LabelError(f"{text!r}: position {position}, expected {', '.join(there)} of terrain {terrain}")
        if key.exposure_ms not in (times := exposures(key.terrain, key.azimuth)):
            usual = f"{times[0]:04d} to {times[-1]:04d}"
            raise LabelError(f"{text!r}: exposure {exposure}, expected {usual} of terrain {terrain}, azimuth {azimuth}")
        return key

    @classmethod
    def of_picture(cls, name: str) -> PhotoKey:
        """Parse the key in the name of an image, which may have folders, a suffix, and a prefix with a dash."""
        base = re.split(r"[/\\=]", _QUERY.sub("", name))[-1]
        try:
            return cls.parse(_ENDING.sub("", base, count=1).rsplit("-", 1)[-1])
        except LabelError as error:
            raise LabelError(f"picture {name!r}: {error.reason}") from error

    @property
    def station(self) -> tuple[int, str]:
        """Terrain and position."""
        return self.terrain, self.position

    @property
    def view(self) -> tuple[int, str, CameraSide]:
        """Terrain, position and camera."""
        return self.terrain, self.position, self.camera

    @property
    def bracket(self) -> Bracket:
        """All fields except the exposure."""
        return self.terrain, self.position, self.light, self.azimuth, self.camera

    @property
    def stops_off_usual(self) -> float:
        """Absolute difference to the usual exposure, in stops (factors of two)."""
        return abs(log2(self.exposure_ms / REFERENCE_EXPOSURE_MS))

    @property
    def other_camera(self) -> PhotoKey:
        """Key of the same photo with the other camera of the rig."""
        return replace(self, camera="R" if self.camera == "L" else "L")

    def with_exposure(self, exposure_ms: int) -> PhotoKey:
        return replace(self, exposure_ms=exposure_ms)


def _wrong_field(name: str, text: str) -> str | None:
    """Return a description of an invalid field of a photo key; None for a valid field."""
    possible, expected = _FIELDS[name]
    return None if text in possible else f"{name} {text!r}, expected {expected}"


def by_bracket(keys: Iterable[PhotoKey]) -> dict[Bracket, list[PhotoKey]]:
    """Return sorted keys by exposure bracket."""
    found: dict[Bracket, list[PhotoKey]] = {}
    for key in sorted(keys):
        found.setdefault(key.bracket, []).append(key)
    return found


def is_exposure(exposure_ms: int) -> bool:
    """Return whether an exposure is one of NASA's: powers of two from 16 to 8192 ms."""
    return 16 <= exposure_ms <= 8192 and exposure_ms & (exposure_ms - 1) == 0


@cache
def positions(terrain: int) -> tuple[str, ...]:
    """Return the tripod positions of a terrain."""
    return tuple("ABCDEFG") if terrain == 13 else tuple("ABC")


@cache
def exposures(terrain: int, azimuth: Azimuth) -> tuple[int, ...]:
    """Return the exposure times of a terrain and azimuth, ms."""
    if azimuth == "no":
        return tuple(2**n for n in range(5, 14))
    return tuple(2**n for n in (range(4, 11) if terrain == 1 else range(5, 12)))


def photo_grid(terrain: int) -> Iterator[PhotoKey]:
    """Yield the keys of all photos of a terrain; 5,190 for the 13 terrains."""
    for position in positions(terrain):
        for light in LIGHTS:
            for azimuth in AZIMUTHS:
                if _was_taken(terrain, position, light, azimuth):
                    for camera in CAMERAS:
                        for exposure_ms in exposures(terrain, azimuth):
                            yield PhotoKey(terrain, position, light, azimuth, camera, exposure_ms)


def _was_taken(terrain: int, position: str, light: Light, azimuth: Azimuth) -> bool:
    if terrain == 13:
        return light == "off" and azimuth == "30"
    if terrain == 1:
        return azimuth != "no" and not (position == "C" and light == "on")
    if terrain == 2 and azimuth == "no":
        return position == "A"
    return True
