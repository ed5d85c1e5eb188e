"""Site: what distinguishes one sandbox or test yard from another, in one file.

A site lists terrains, positions, lamps, exposures, image format, cameras, size and walls of the sandbox, and the names
of the files. NASA's POLAR is the site file `config/sites/polar.yaml`; `site:` in a configuration names another one.

All lengths are metres in the sandbox frame unless a name says otherwise: origin at the centre of the terrain on the
ground, +X to Sun azimuth 0, +Y to azimuth 90, +Z up.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, cached_property
from math import cos, radians, sin
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, BeforeValidator, Field, PositiveFloat, PositiveInt, field_validator, model_validator

from polarsim.errors import ConfigError, LabelError
from polarsim.formats.files import packaged
from polarsim.formats.yaml_files import read_model
from polarsim.photo import (
    BLACK_LEVEL,
    LIGHTS,
    NO_SUN,
    WHITE_LEVEL,
    CameraSide,
    Light,
    PhotoKey,
    Terrain,
    parse_terrain,
    terrain_text,
)

Point = tuple[float, float, float]  # x, y, z
Side = Literal["-x", "+x", "-y", "+y"]  # of the sandbox

DEFAULT = "polar"
FILL_IN = "FILL_IN"  # start of a value in the draft of a site file that a person must replace
FOLDER = Path("config/sites")  # of the sites that polarsim ships
FAR_M = 1000.0  # distance at which a directional lamp is placed; over 6 m its direction varies by 0.3 degrees

KEY_FIELDS = 6  # terrain, position, light, azimuth, camera, exposure

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9-]*")  # a name that is safe in photo keys and paths
MAX_EXPOSURE_MS = 99999  # photo keys have at most five digits
_NO_VALUE = ("na", "nan", "none", "null")  # names that readers of CSV files replace by missing values
_NAMED = ("terrain", "terrain_name", "position", "light", "azimuth", "camera", "exposure_ms")  # fields of file names
_SPELLED = ("terrain", "position", "light", "azimuth", "camera")
FIELD = re.compile(r"{([^{}/]*)}")  # of a pattern of file names
_QUERY = re.compile(r"\?(?!d=).*", re.DOTALL)  # of an address; Label Studio's files are `?d=FOLDER/FILE`
_ENDING = re.compile(r"(?:_[A-Za-z]{3,4}\.rf\.\w+)?(?:\.[A-Za-z]\w{1,4})?\Z")  # of Roboflow's KEY_png.rf.HASH.jpg


def _text(value: object) -> object:
    """Convert a name that YAML reads as a number to text; raise ValueError for a boolean."""
    if isinstance(value, bool):
        raise ValueError("YAML reads on, off, yes, no as booleans: put the name in quotes")
    if isinstance(value, float):
        raise ValueError(f"{value}, expected a whole number or a name")
    return str(value) if isinstance(value, int) else value


def _name(value: object) -> object:
    value = _text(value)
    if isinstance(value, str) and not _NAME.fullmatch(value):
        raise ValueError(f"{value!r}, expected a name of letters, digits and dashes")
    if isinstance(value, str) and value.lower() in _NO_VALUE:
        raise ValueError(f"{value!r} in a table is read as a missing value, expected another name")
    return value


def _terrain(value: object) -> object:
    return parse_terrain(str(_name(value)))


Name = Annotated[str, BeforeValidator(_name)]
TerrainName = Annotated[Terrain, BeforeValidator(_terrain)]


class _Part(BaseModel, extra="forbid", frozen=True):
    """Part of a site."""


class Tripod(_Part):
    """Approximate pose of the left (or only) camera at a position."""

    camera_m: Point = Field(description="Centre of the left camera, sandbox frame, m.")
    yaw_deg: float = Field(description="Heading of the optical axis, from +X towards +Y, degrees.")
    pitch_deg: float = Field(25.0, description="Downward tilt of the optical axis, degrees.")
    usual_pitch_deg: float | None = Field(
        None, description="Mean pitch of rigs that were located here, where known, degrees; null: pitch_deg."
    )
    same_tilt_as: Name | None = Field(None, description="Position with the same tilt: the rig was only moved.")

    @property
    def usual_pitch(self) -> float:
        """Most likely pitch of a rig that is not located, degrees."""
        return self.pitch_deg if self.usual_pitch_deg is None else self.usual_pitch_deg


class SunLamp(_Part):
    """A lamp that stands in for the Sun and does not move with the rig."""

    kind: Literal["point", "directional"] = Field(
        "point", description="'point': a lamp near the sandbox, also with a reflector. 'directional': parallel light."
    )
    position_m: Point | None = Field(None, description="Approximate position of a point lamp, sandbox frame, m.")
    azimuth_deg: float | None = Field(None, description="Direction to a directional lamp, from +X towards +Y, degrees.")
    elevation_deg: float | None = Field(None, description="Elevation of a directional lamp above the horizon, degrees.")

    @model_validator(mode="after")
    def _placed(self) -> SunLamp:
        if (self.kind == "point") != (self.position_m is not None):
            raise ValueError("position_m is required for a point lamp, and only for it")
        if (self.kind == "directional") != (None not in (self.azimuth_deg, self.elevation_deg)):
            raise ValueError("azimuth_deg and elevation_deg are required for a directional lamp, and only for it")
        return self

    @property
    def point(self) -> Point:
        """Position; of a directional lamp `FAR_M` away in its direction."""
        if self.position_m is not None:
            return self.position_m
        assert self.azimuth_deg is not None
        assert self.elevation_deg is not None
        azimuth, elevation = radians(self.azimuth_deg), radians(self.elevation_deg)
        return (
            FAR_M * cos(azimuth) * cos(elevation),
            FAR_M * sin(azimuth) * cos(elevation),
            FAR_M * sin(elevation),
        )


class RigLamp(_Part):
    """A lamp that moves with the rig: `on` or `off` in photo keys."""

    from_camera_m: Point = Field(description="Position in the left camera's frame (x right, y down, z forward), m.")
    share: PositiveFloat = Field(description="Radiant intensity relative to a fixed lamp.")


class Images(_Part):
    """Format of the photo files."""

    width: PositiveInt = Field(le=16384, description="Width of the photos, px.")
    height: PositiveInt = Field(le=16384, description="Height of the photos, px.")
    bits: int = Field(12, ge=8, le=16, description="Bits of a value. Files with more bits hold them in the low bits.")
    black: int = Field(16, ge=0, description="Value of an unlit pixel.")
    white: PositiveInt | None = Field(None, description="Value of a saturated pixel; null: the largest value.")
    curve: Literal["linear", "srgb"] = Field(
        "linear", description="'linear': values are proportional to light. 'srgb': values of JPEG files of cameras."
    )

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.width, self.height

    @property
    def white_level(self) -> int:
        """Value of a saturated pixel."""
        return self.white if self.white is not None else 2**self.bits - 1

    @model_validator(mode="after")
    def _levels(self) -> Images:
        if not self.black < self.white_level < 2**self.bits:
            raise ValueError(f"black {self.black}, white {self.white_level}: expected black < white < {2**self.bits}")
        return self


class Cameras(_Part):
    """Camera or stereo rig."""

    stereo: bool = Field(True, description="Two cameras, L and R. False: one camera, named L.")
    baseline_m: tuple[PositiveFloat, PositiveFloat] | None = Field(
        None, description="Smallest and largest plausible distance of the two cameras, m. Required for stereo."
    )
    calibration: Path | None = Field(
        None,
        description="Calibration for terrains without a calibration file, relative to the site file: NASA's "
        "stereo.calibration, OpenCV YAML, Kalibr YAML or COLMAP cameras.txt (and images.txt).",
    )

    field_of_view_deg: float | None = Field(
        None, gt=1, lt=150, description="Horizontal field of view of terrains without a calibration, degrees."
    )

    @model_validator(mode="after")
    def _baseline(self) -> Cameras:
        if self.stereo and self.baseline_m is None:
            raise ValueError("baseline_m is required for two cameras")
        if self.baseline_m and self.baseline_m[0] > self.baseline_m[1]:
            raise ValueError("baseline_m: the smallest distance exceeds the largest")
        return self

    @property
    def sides(self) -> tuple[CameraSide, ...]:
        """Names of the cameras."""
        return ("L", "R") if self.stereo else ("L",)


class Sandbox(_Part):
    """Size and walls of the sandbox."""

    half_width_m: tuple[PositiveFloat, PositiveFloat] = Field(description="Half the size along X and Y, m.")
    walls_m: Mapping[Side, PositiveFloat | None] = Field(
        {},
        description="Height of the wall on each side (-x, +x, -y, +y) above the ground, m; null: none.",
    )
    raised: bool = Field(
        False, description="The sandbox is a box on a floor that the scans show: it defines origin and heading."
    )

    @property
    def reach_m(self) -> float:
        """Distance of the corners from the origin along the longer axis."""
        return max(self.half_width_m)

    @property
    def is_walled(self) -> bool:
        """Whether all four sides have a wall."""
        return all(self.walls_m.get(side) for side in ("-x", "+x", "-y", "+y"))


class Missing(_Part):
    """Photos that do not exist: all that match every stated field."""

    positions: tuple[Name, ...] | None = Field(None, description="Positions of these photos; null: all.")
    lights: tuple[Annotated[Light, BeforeValidator(_text)], ...] | None = Field(
        None, description="States of the rig's lamp, 'on' or 'off'; null: both."
    )
    azimuths: tuple[Name, ...] | None = Field(None, description="Lamps of these photos, or 'no'; null: all.")

    def matches(self, position: str, light: str, azimuth: str) -> bool:
        """Return whether photos with these fields are missing."""
        pairs = ((position, self.positions), (light, self.lights), (azimuth, self.azimuths))
        return all(names is None or value in names for value, names in pairs)


class TerrainOptions(_Part):
    """Name of a terrain, and where it differs from the site."""

    name: str = Field("", pattern=r"^[A-Za-z0-9-]*$", description="Name in folders of raw data: Terrain01_NAME.")
    positions: tuple[Name, ...] | None = Field(None, description="Positions; null: those of the site.")
    exposures_ms: tuple[PositiveInt, ...] | None = Field(None, description="Exposures with a lamp, ms; null: site's.")
    missing: tuple[Missing, ...] = Field((), description="Photos that do not exist.")
    sandbox: Sandbox | None = Field(None, description="Another sandbox; null: the site's.")
    surveyed: bool = Field(True, description="Tripods and lamps of the site apply to this terrain.")


class Files(_Part):
    """Names of the files below `source.root`, with fields in braces.

    Fields: {terrain} {terrain_name} {position} {light} {azimuth} {camera} {exposure_ms} {any}. `exposure_ms` matches an
    integer, `exposure_ms:4` one of at least four digits, `any` any text without a slash. Other fields match names
    of the site, or their `spelling`. {png|tif} matches one of several texts. Suffixes match in upper and lower case.
    """

    photos: str = Field(description="Path of a photo: {terrain}/{position}/{azimuth}/{camera}_{exposure_ms}.png.")
    clouds: str | None = Field(None, description="Path of a scan of a position; null: no scans.")
    range_maps: str | None = Field(None, description="Path of a range map on the rectified left image; null: none.")
    calibration: str | None = Field(None, description="Path of a terrain's calibration; null: cameras.calibration.")
    spelling: Mapping[str, Mapping[str, str]] = Field(
        {}, description="Texts of names in paths that differ: azimuth: {'45': sun45, 'no': dark}, camera: {L: left}."
    )
    cloud_frame: Literal["left", "rectified"] = Field(
        "left",
        description="Frame of the clouds: left camera (x right, y down, z forward), or rectified left camera.",
    )
    cloud_unit: Literal["mm", "m"] = Field("m", description="Unit of the clouds.")

    @field_validator("photos", "clouds", "range_maps", "calibration")
    @classmethod
    def _known_fields(cls, pattern: str | None) -> str | None:
        if pattern is None:
            return None
        for field in FIELD.findall(pattern):
            if "|" not in field and field.partition(":")[0] not in (*_NAMED, "any"):
                raise ValueError(
                    f"{{{field}}} is no field, expected {', '.join(f'{{{name}}}' for name in _NAMED)}, {{any}}"
                )
            if ":" in field and not re.fullmatch(r"exposure_ms:\d", field):
                raise ValueError(f"{{{field}}}: only exposure_ms may have a number of digits, {{exposure_ms:4}}")
        if re.search("[{}]", FIELD.sub("", pattern)):
            raise ValueError("a brace is not closed")
        if pattern.startswith("/") or ".." in pattern.split("/") or "\\" in pattern:
            raise ValueError("expected a path below source.root, with slashes between folders")
        return pattern

    @field_validator("spelling", mode="before")
    @classmethod
    def _texts_of_names(cls, value: object) -> object:
        if not isinstance(value, Mapping):
            return value
        spelled = {}
        for field, texts in value.items():
            if field not in _SPELLED:
                raise ValueError(f"{field!r}, expected {', '.join(_SPELLED)}")
            if not isinstance(texts, Mapping):
                raise ValueError(f"{field}: expected a text for each name")
            of = {str(_text(name)): str(_text(text)) for name, text in texts.items()}
            if field == "terrain":
                of = {terrain_text(parse_terrain(name)): text for name, text in of.items()}
            if len(set(of.values())) < len(of):
                raise ValueError(f"{field}: two names have the same text")
            spelled[field] = of
        return spelled


class AnalogSite(_Part):
    """Properties of the simulated sandbox of a site (source.kind: analog) that do not follow from the site."""

    scenes: Mapping[TerrainName, Annotated[int, Field(ge=1, le=13)]] = Field(
        {},
        description="Preset of rocks and ground: the number of one of NASA's terrains. Default: 1, 3, 4, ... in order.",
    )
    scanned: tuple[Name, ...] | None = Field(None, description="Positions with a scan; null: all.")
    tripods_m: Mapping[Name, Point] = Field(
        {}, description="Mean positions of the left camera, sandbox frame, m. Default: the approximate poses."
    )
    lamp_output: Mapping[Name, PositiveFloat] = Field(
        {},
        description="Radiant intensity of lamps relative to one that exposes level sand well at the usual exposure. "
        "Default: the value at which the sand at the centre is as bright as below NASA's lamp 30.",
    )


class ImageIds(_Part):
    """Numbering of the photos in COCO files.

    The number of a photo is made of the terrain, the number of the position in the list of the terrain, the light, the
    number of the lamp, the camera and the exposure. Thus a terrain, position or lamp that is added at the end of its
    list keeps the numbers of all former photos.
    """

    positions: PositiveInt = Field(256, description="Largest number of positions of a terrain.")
    lamps: PositiveInt = Field(32, description="Largest number of lamps, 'no' included.")
    exposures_ms: tuple[PositiveInt, ...] | None = Field(
        None, description="Exposures, ms, in the order of their numbers; null: the exposure is the number."
    )


class Licence(_Part):
    """Terms under which the photos may be published."""

    terms: str = Field(min_length=1, description="Name or summary of the terms, for data cards.")
    url: str = Field("", description="Address of the text.")


class Site(_Part):
    """All that is specific to one sandbox or test yard."""

    name: Name = Field(description="Name of the site.")
    title: str = Field("", description="Name of the data set of photos in published data cards; empty: the site.")
    licence: Licence | None = Field(None, description="Terms of the photos, for published data; null: not stated.")
    terrains: Mapping[TerrainName, TerrainOptions] = Field(
        min_length=1, description="Terrains by number or name. All are numbers, or all are names."
    )
    positions: tuple[Name, ...] = Field(min_length=1, description="Names of the camera positions of a terrain.")
    tripods: Mapping[Name, Tripod] = Field({}, description="Approximate poses of the positions, where known.")
    lamps: Mapping[Name, SunLamp] = Field({}, description="Lamps that stand in for the Sun, by name, such as '45'.")
    without_lamp: bool = Field(False, description=f"Photos with azimuth '{NO_SUN}': no lamp but the rig's.")
    rig_lamp: RigLamp | None = Field(None, description="Lamp that moves with the rig; null: none, light is always off.")
    exposures_ms: tuple[PositiveInt, ...] = Field(min_length=1, description="Exposures with a lamp, ms.")
    exposures_no_sun_ms: tuple[PositiveInt, ...] = Field((), description="Exposures without a lamp, ms.")
    reference_exposure_ms: PositiveInt | None = Field(None, description="Usual exposure with a lamp, ms; null: median.")
    images: Images = Field(description="Format of the photo files.")
    cameras: Cameras = Field(description="Camera or stereo rig.")
    sandbox: Sandbox = Field(description="Size and walls of the sandbox.")
    files: Files = Field(description="Names of the files.")
    analog: AnalogSite = Field(AnalogSite(), description="Simulated sandbox of the site.")
    image_ids: ImageIds = Field(ImageIds(), description="Numbering of the photos in COCO files.")
    max_survey_error_m: PositiveFloat = Field(1.0, description="Largest error of the approximate poses, m.")

    @field_validator("terrains", mode="before")
    @classmethod
    def _options_of_terrains(cls, value: object) -> object:
        if isinstance(value, list | tuple):
            return dict.fromkeys(value, TerrainOptions())
        return {key: {} if part is None else part for key, part in value.items()} if isinstance(value, dict) else value

    @model_validator(mode="after")
    def _consistent(self) -> Site:
        if len({type(terrain) for terrain in self.terrains}) > 1:
            raise ValueError("terrains: expected either numbers or names, not both")
        if NO_SUN in self.lamps:
            raise ValueError(f"lamps: '{NO_SUN}' means no lamp, expected another name")
        if not self.lamps and not self.rig_lamp:
            raise ValueError("lamps: expected a lamp, or a rig_lamp")
        if self.without_lamp != bool(self.exposures_no_sun_ms):
            raise ValueError("exposures_no_sun_ms is required with without_lamp: true, and only then")
        if unknown := sorted(set(self.tripods) - set(self.all_positions)):
            raise ValueError(f"tripods: {unknown[0]!r} is no position of a terrain")
        for name, values, known in (
            ("scenes", self.analog.scenes, self.terrains),
            ("scanned", self.analog.scanned or (), self.all_positions),
            ("tripods_m", self.analog.tripods_m, self.all_positions),
            ("lamp_output", self.analog.lamp_output, self.lamps),
        ):
            if wrong := [value for value in values if value not in known]:
                raise ValueError(f"analog.{name}: {wrong[0]!r}, expected {_one_of(known)}")
        for name, pattern in (("photos", self.files.photos), ("clouds", self.files.clouds)):
            if pattern and (missing := self._fields_without(pattern, only_scans=name != "photos")):
                raise ValueError(f"files.{name}: the field {{{missing[0]}}} is missing, the site has several of them")
        return self

    @model_validator(mode="after")
    def _room_for_ids(self) -> Site:
        exposures = {time for terrain in self.terrains for time in self.exposures_of(terrain, "")}
        exposures |= set(self.exposures_no_sun_ms)
        if max(exposures) > MAX_EXPOSURE_MS:
            raise ValueError(f"exposures_ms: {max(exposures)}, expected at most {MAX_EXPOSURE_MS}")
        for name, count, capacity in (
            ("positions", max(len(self.positions_of(terrain)) for terrain in self.terrains), self.image_ids.positions),
            ("lamps", len(self.lamps) + 1, self.image_ids.lamps),
        ):
            if count > capacity:
                raise ValueError(f"image_ids.{name}: {capacity}, expected at least {count}")
        if self.image_ids.exposures_ms and (lacking := sorted(exposures - set(self.image_ids.exposures_ms))):
            raise ValueError(f"image_ids.exposures_ms: {lacking[0]} is missing")
        return self

    def _fields_without(self, pattern: str, *, only_scans: bool) -> list[str]:
        """Return the fields of which the site has several values and which a pattern of files does not have."""
        fields = {field.partition(":")[0] for field in FIELD.findall(pattern)}
        several = {
            "terrain": len(self.terrains) > 1 and "terrain_name" not in fields,
            "position": len(self.all_positions) > 1,
        }
        if not only_scans:
            several |= {
                "light": self.rig_lamp is not None,
                "azimuth": len(self.azimuths) > 1,
                "camera": self.cameras.stereo,
                "exposure_ms": any(
                    len(self.exposures_of(each, name)) > 1 for each in self.terrains for name in self.azimuths
                ),
            }
        return [name for name, needed in several.items() if needed and name not in fields]

    @property
    def data_set(self) -> str:
        """Name of the data set of photos."""
        return self.title or f"site {self.name}"

    # Photos

    @property
    def lights(self) -> tuple[Light, ...]:
        """States of the rig lamp."""
        return LIGHTS if self.rig_lamp else ("off",)

    @property
    def azimuths(self) -> tuple[str, ...]:
        """Names of the lamps, after `no` if there are photos without a lamp."""
        return (NO_SUN, *self.lamps) if self.without_lamp else tuple(self.lamps)

    @property
    def suns(self) -> tuple[str, ...]:
        """Names of the lamps that stand in for the Sun, in the order of the site."""
        return tuple(self.lamps)

    @cached_property
    def usual_exposure_ms(self) -> int:
        """Usual exposure with a lamp."""
        return self.reference_exposure_ms or sorted(self.exposures_ms)[len(self.exposures_ms) // 2]

    @property
    def converts_photos(self) -> bool:
        """Whether photos are converted to polarsim's photo format; photos that have it are used in place."""
        usual = Images(
            width=self.images.width, height=self.images.height, bits=12, black=BLACK_LEVEL, white=WHITE_LEVEL
        )
        same = (self.images.model_copy(update={"white": self.images.white_level})) == usual
        return not (same and self.files.photos.lower().endswith(".png"))

    def options(self, terrain: Terrain) -> TerrainOptions:
        """Return the options of a terrain; KeyError for an unknown terrain."""
        return self.terrains[terrain]

    def positions_of(self, terrain: Terrain) -> tuple[str, ...]:
        """Return the positions of a terrain."""
        own = self.options(terrain).positions
        return self.positions if own is None else own

    @property
    def all_positions(self) -> tuple[str, ...]:
        """Return the positions of all terrains."""
        names = [name for terrain in self.terrains for name in self.positions_of(terrain)]
        return tuple(dict.fromkeys([*self.positions, *names]))

    def exposures_of(self, terrain: Terrain, azimuth: str) -> tuple[int, ...]:
        """Return the exposures of a terrain and azimuth, ms."""
        if azimuth == NO_SUN:
            return self.exposures_no_sun_ms
        return self.options(terrain).exposures_ms or self.exposures_ms

    def photos_of(self, terrain: Terrain) -> Iterator[PhotoKey]:
        """Yield the keys of all photos of a terrain."""
        missing = self.options(terrain).missing
        for position in self.positions_of(terrain):
            for light in self.lights:
                for azimuth in self.azimuths:
                    if not any(part.matches(position, light, azimuth) for part in missing):
                        for camera in self.cameras.sides:
                            for exposure_ms in self.exposures_of(terrain, azimuth):
                                yield PhotoKey(terrain, position, light, azimuth, camera, exposure_ms)

    def image_id(self, key: PhotoKey) -> int:
        """Return the number of a photo in COCO files, which is above 0 and stable, see `ImageIds`."""
        ids, terrains = self.image_ids, list(self.terrains)
        number = key.terrain if isinstance(key.terrain, int) else terrains.index(key.terrain) + 1
        exposures = ids.exposures_ms
        for digit, count in (
            (self.positions_of(key.terrain).index(key.position), ids.positions),
            (LIGHTS.index(key.light), len(LIGHTS)),
            ((NO_SUN, *self.lamps).index(key.azimuth), ids.lamps),
            (get_args(CameraSide).index(key.camera), len(get_args(CameraSide))),
            (exposures.index(key.exposure_ms), len(exposures)) if exposures else (key.exposure_ms, MAX_EXPOSURE_MS + 1),
        ):
            number = number * count + digit
        return number + 1

    def key(self, text: str) -> PhotoKey:
        """Parse a key of this site. The text must not contain anything else: `..._0256 copy` is rejected."""
        fields = text.split("_")
        if len(fields) == KEY_FIELDS and (wrong := "; ".join(self._wrong_fields(fields))):
            raise LabelError(f"{text!r} is not a photo key of the site {self.name}: {wrong}")
        return PhotoKey.parse(text)

    def key_of_picture(self, name: str) -> PhotoKey:
        """Parse the key in the name of an image, which may have folders, a suffix, and a prefix with a dash."""
        base = _ENDING.sub("", re.split(r"[/\\=]", _QUERY.sub("", name))[-1], count=1)
        error: LabelError | None = None
        starts = [0, *(match.end() for match in re.finditer("-", base))]
        for start in starts:
            try:
                return self.key(base[start:])
            except LabelError as wrong:
                error = wrong
        assert error is not None
        raise LabelError(f"picture {name!r}: {error.reason}") from error

    def _wrong_fields(self, fields: Sequence[str]) -> Iterator[str]:
        """Yield a description of each field of a key that the site does not have."""
        terrain, position, light, azimuth, camera, exposure = fields
        of_terrain = next((known for known in self.terrains if terrain_text(known) == terrain), None)
        of = f" of terrain {terrain}" if of_terrain is not None else ""
        if of_terrain is None:
            yield f"terrain {terrain!r}, expected {self.terrains_text}"
        positions = self.all_positions if of_terrain is None else self.positions_of(of_terrain)
        for name, value, known, note in (
            ("position", position, positions, of),
            ("light", light, self.lights, ""),
            ("azimuth", azimuth, self.azimuths, ""),
            ("camera", camera, self.cameras.sides, ""),
        ):
            if value not in known:
                yield f"{name} {value!r}, expected {_one_of(known)}{note}"
        terrains = self.terrains if of_terrain is None else (of_terrain,)
        azimuths = (azimuth,) if azimuth in self.azimuths else self.azimuths
        times = sorted(
            {f"{time:04d}" for each in terrains for name in azimuths for time in self.exposures_of(each, name)}
        )
        if exposure not in times:
            note = f"{of}, azimuth {azimuth}" if of and azimuth in self.azimuths else of
            yield f"exposure {exposure!r}, expected {_one_of(times)}{note}"

    @property
    def terrains_text(self) -> str:
        """The terrains, for messages: `01 to 13`, or `yard-a or yard-b`."""
        names = [terrain_text(terrain) for terrain in self.terrains]
        numbers = [terrain for terrain in self.terrains if isinstance(terrain, int)]
        if len(numbers) > 2 and numbers == list(range(numbers[0], numbers[-1] + 1)):
            return f"{names[0]} to {names[-1]}"
        return _one_of(names)

    # Geometry

    def sandbox_of(self, terrain: Terrain) -> Sandbox:
        """Return the sandbox of a terrain."""
        return self.options(terrain).sandbox or self.sandbox

    def tripods_of(self, terrain: Terrain) -> dict[str, Tripod]:
        """Return the approximate poses of the positions of a terrain; empty for terrains without survey."""
        if not self.options(terrain).surveyed:
            return {}
        return {name: self.tripods[name] for name in self.positions_of(terrain) if name in self.tripods}

    def folder_of(self, terrain: Terrain) -> str:
        """Return the folder name of a terrain: `Terrain01_LargeOnly`, or `Terrain02_Unnamed` without a known name."""
        return f"Terrain{terrain_text(terrain)}_{self.options(terrain).name or 'Unnamed'}"


def _one_of(names: Any) -> str:
    *others, last = map(str, names)
    return f"{', '.join(others)} or {last}" if others else last


def read_site(name: str | Path) -> Site:
    """Read a site: the name of one that polarsim ships, such as `polar`, or the path of a file."""
    path = Path(name)
    if path.suffix not in (".yaml", ".yml"):
        path = FOLDER / f"{name}.yaml"
        if not _NAME.fullmatch(str(name)):
            raise ConfigError(f"site {str(name)!r}: expected {_one_of(shipped_sites())}, or a file with suffix .yaml")
    site = read_model(path, Site, "site")
    if site.cameras.calibration is None:
        return site
    calibration = path.parent / site.cameras.calibration
    return site.model_copy(update={"cameras": site.cameras.model_copy(update={"calibration": calibration})})


def shipped_sites() -> list[str]:
    """Return the names of the sites that polarsim ships."""
    return sorted(path.stem for path in packaged(FOLDER).glob("*.yaml"))


def site_of(value: object) -> object:
    """Return the site of a configuration's `site`: a name, a path, or content.

    Content with the key `base`, the name or path of a site, states only what differs from that site.
    """
    if isinstance(value, str | Path):
        return read_site(value)
    if isinstance(value, dict) and "base" in value:
        changes = {key: part for key, part in value.items() if key != "base"}
        return _merged(read_site(value["base"]).model_dump(mode="json"), changes)
    return value


def _merged(content: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return content with changes; sections are merged, other values replaced."""
    merged = dict(content)
    for key, value in changes.items():
        old = merged.get(key)
        merged[key] = _merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return merged


SiteChoice = Annotated[Site, BeforeValidator(site_of, json_schema_input_type=str | Site)]


@cache
def polar() -> Site:
    """Return NASA's POLAR data set."""
    return read_site(DEFAULT)
