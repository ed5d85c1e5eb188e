"""Paths of NASA's photos, scans and calibrations below a root. Contents are read by `nasa`, which imports NumPy."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from pathlib import Path

from polarsim.errors import FormatError
from polarsim.photo import SUNS, PhotoKey, Terrain, is_exposure, terrain_text

log = logging.getLogger("polarsim")

CALIBRATION_NAME = "stereo.calibration"
RANGE_FOLDER = "GroundTruth_RectifiedRangeMaps"
CLOUD_SUFFIXES = (".xyz", ".txt", ".pts", ".ply")

_PHOTO = re.compile(r"Pos([A-G])_\d+_L(on|off)/(NoSun|Sun_(\d+))/Cam([LR])_(.+)_(\d{4})\.(?i:png)")


def find_terrain_folder(root: str | Path, terrain: Terrain) -> Path | None:
    """Return the folder `TerrainNN_Name` in a root or in a subfolder of the root; None if it does not exist."""
    name = re.compile(rf"Terrain{terrain_text(terrain)}_.*")
    for pattern in ("*", "*/*"):
        folders = sorted(path for path in Path(root).glob(pattern) if name.fullmatch(path.name) and path.is_dir())
        if len(folders) > 1:
            names = f"{folders[0].name} and {folders[1].name}"
            raise FormatError(f"two folders of terrain {terrain_text(terrain)}, {names}: remove a folder", path=root)
        if folders:
            return folders[0]
    return None


def find_calibration(terrain_folder: str | Path) -> Path | None:
    """Return `stereo.calibration` in the folder of a terrain or in a subfolder; None if it does not exist."""
    folders = [Path(terrain_folder), *sorted(Path(terrain_folder).glob("*"))]
    return next((folder / CALIBRATION_NAME for folder in folders if (folder / CALIBRATION_NAME).exists()), None)


def find_photos(terrain_folder: str | Path, terrain: Terrain) -> list[tuple[PhotoKey, Path]]:
    """Return all photos below the folder of a terrain, with up to one additional folder level, sorted by key.

    The middle token of a photo's name is ignored. PNG files with other names are skipped and reported in the log.
    """
    photos: dict[PhotoKey, Path] = {}
    strays = []
    for path, key in _pictures(Path(terrain_folder), terrain):
        if key is None:
            strays.append(path.name)
        elif key in photos:
            raise FormatError(f"the photo {key} is also {photos[key]}: remove a file", path=path)
        else:
            photos[key] = path
    if strays:
        log.warning("%s: %d PNG files skipped that are no photos, such as %s", terrain_folder, len(strays), strays[0])
    return sorted(photos.items())


def find_strays(terrain_folder: str | Path, terrain: Terrain) -> list[Path]:
    """Return the PNG files below the folder of a terrain that do not have the name of a photo."""
    return [path for path, key in _pictures(Path(terrain_folder), terrain) if key is None]


def _pictures(folder: Path, terrain: Terrain) -> Iterator[tuple[Path, PhotoKey | None]]:
    for path in sorted(path for path in folder.rglob("*") if path.suffix.lower() == ".png"):
        above = len(path.relative_to(folder).parts) - 3
        match = _PHOTO.fullmatch("/".join(path.parts[-3:])) if above in (0, 1) else None
        yield path, _photo_key(match, terrain) if match else None


def _photo_key(match: re.Match[str], terrain: Terrain) -> PhotoKey | None:
    azimuth = match[4] or "no"
    if azimuth not in ("no", *SUNS) or not is_exposure(int(match[7])):
        return None
    return PhotoKey(terrain, match[1], match[2], azimuth, match[5], int(match[7]))  # type: ignore[arg-type]


def find_scans(root: str | Path, terrain: Terrain) -> tuple[dict[str, Path], dict[str, Path]]:
    """Return the range maps and clouds of a terrain by position; they may be in a subfolder of the root."""
    maps: dict[str, Path] = {}
    for pattern in (RANGE_FOLDER, f"*/{RANGE_FOLDER}"):
        for path in sorted(Path(root).glob(f"{pattern}/Terrain{terrain_text(terrain)}/Pos?_org-XYZ.[tT][iI][fF]")):
            maps.setdefault(path.name[3], path)
    clouds: dict[str, Path] = {}
    folder = find_terrain_folder(root, terrain)
    inside = [] if folder is None else [*sorted(folder.glob("Pos?.*")), *sorted(folder.glob("*/Pos?.*"))]
    for path in inside:
        if path.suffix.lower() not in CLOUD_SUFFIXES:
            if path.is_file():
                log.warning("%s: skipped, clouds have the suffixes %s", path, ", ".join(CLOUD_SUFFIXES))
            continue
        if path.stem[3] in clouds:
            other = clouds[path.stem[3]]
            raise FormatError(f"position {path.stem[3]} also has the cloud {other}: remove a file", path=path)
        clouds[path.stem[3]] = path
    return maps, clouds
