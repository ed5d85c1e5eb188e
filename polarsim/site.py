"""Site: what distinguishes one sandbox or test yard from another, in one file.

A site lists terrains, positions, lamps, exposures, image format, cameras, size and walls of the sandbox, and the names
of the files. NASA's POLAR is the site file `config/sites/polar.yaml`; `site:` in a configuration names another one.

All lengths are metres in the sandbox frame unless a name says otherwise: origin at the centre of the terrain on the
ground, +X to Sun azimuth 0, +Y to azimuth 90, +Z up.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, get_args

from pydantic import BeforeValidator, Field, PositiveFloat, PositiveInt, field_validator, model_validator

from polarsim.errors import ConfigError, LabelError
from polarsim.formats.files import packaged, resolve_packaged
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
    terrain_text,
)
from polarsim.site_file_names import FIELD, Files
from polarsim.site_parts import (
    MAX_EXPOSURE_MS,
    NAME,
    AnalogSite,
    Cameras,
    ImageIds,
    Images,
    Licence,
    Name,
    Part,
    RigLamp,
    Sandbox,
    SunLamp,
    TerrainName,
    TerrainOptions,
    Tripod,
)
from polarsim.wording import alternatives

DEFAULT = "polar"
FOLDER = Path("config/sites")  # of the sites that polarsim ships
KEY_FIELDS = 6  # terrain, position, light, azimuth, camera, exposure

_QUERY = re.compile(r"\?(?!d=).*", re.DOTALL)  # of an address; Label Studio's files are `?d=FOLDER/FILE`
_ENDING = re.compile(r"(?:_[A-Za-z]{3,4}\.rf\.\w+)?(?:\.[A-Za-z]\w{1,4})?\Z")  # of Roboflow's KEY_png.rf.HASH.jpg


class Site(Part):
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
                raise ValueError(f"analog.{name}: {wrong[0]!r}, expected {alternatives(known)}")
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

    @property
    def all_exposures_ms(self) -> tuple[int, ...]:
        """Exposures with a lamp of all terrains, ms, ascending."""
        times = {time for options in self.terrains.values() for time in options.exposures_ms or self.exposures_ms}
        return tuple(sorted(times))

    def wrong_choices(self, choices: Iterable[tuple[str, Sequence[Any], Sequence[Any]]]) -> Iterator[str]:
        """Yield a message for each option, with its values and the possible values, that selects an unknown value."""
        for name, values, known in choices:
            if unknown := [value for value in values if value not in known]:
                yield f"{name}: {unknown[0]!r}, expected {', '.join(map(str, known)) or 'none'} of the site {self.name}"

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
                yield f"{name} {value!r}, expected {alternatives(known)}{note}"
        terrains = self.terrains if of_terrain is None else (of_terrain,)
        azimuths = (azimuth,) if azimuth in self.azimuths else self.azimuths
        times = sorted(
            {f"{time:04d}" for each in terrains for name in azimuths for time in self.exposures_of(each, name)}
        )
        if exposure not in times:
            note = f"{of}, azimuth {azimuth}" if of and azimuth in self.azimuths else of
            yield f"exposure {exposure!r}, expected {alternatives(times)}{note}"

    @property
    def terrains_text(self) -> str:
        """The terrains, for messages: `01 to 13`, or `yard-a or yard-b`."""
        names = [terrain_text(terrain) for terrain in self.terrains]
        numbers = [terrain for terrain in self.terrains if isinstance(terrain, int)]
        if len(numbers) > 2 and numbers == list(range(numbers[0], numbers[-1] + 1)):
            return f"{names[0]} to {names[-1]}"
        return alternatives(names)

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


def read_site(name: str | Path) -> Site:
    """Read a site: the name of one that polarsim ships, such as `polar`, or the path of a file."""
    path = Path(name)
    if path.suffix not in (".yaml", ".yml"):
        path = FOLDER / f"{name}.yaml"
        if not NAME.fullmatch(str(name)) or not resolve_packaged(path).is_file():
            raise ConfigError(
                f"site {str(name)!r}: expected {alternatives(shipped_sites())}, or a file with suffix .yaml"
            )
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
