"""Paths of the files of a simulated terrain, by the patterns of the site."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from polarsim.errors import ConfigError
from polarsim.formats import png
from polarsim.formats.files import writing, writing_folder
from polarsim.formats.site_paths import format_path, photo_fields
from polarsim.photo import PhotoKey, Terrain
from polarsim.site import Site
from polarsim.site_parts import Images

_DISTANCE_STEP_MM = 500  # NASA's folders of positions contain the distance from the edge of the sand


@dataclass(frozen=True)
class RawFiles:
    """Paths of a terrain's files. Files in a folder of the terrain are written to its temporary replacement."""

    site: Site
    terrain: Terrain
    root: Path
    folders: Mapping[str, Path]  # folder of the terrain relative to the root -> temporary folder

    def photo(self, key: PhotoKey, token: str) -> Path:
        """Return the path of a photo; `token` fills `{any}` in its name."""
        return self._path(self.site.files.photos, photo_fields(key), token)

    def cloud(self, position: str) -> Path | None:
        """Return the path of a scan of a position; None if the site has no scans."""
        pattern = self.site.files.clouds
        return None if pattern is None else self._path(pattern, {"position": position})

    def range_map(self, position: str) -> Path | None:
        """Return the path of the range map of a position; None if the site has no range maps."""
        pattern = self.site.files.range_maps
        return None if pattern is None else self._path(pattern, {"position": position})

    @property
    def calibration(self) -> Path | None:
        """Path of the calibration; None if the site has no calibration of terrains."""
        pattern = self.site.files.calibration
        return None if pattern is None else self._path(pattern, {})

    @property
    def folder(self) -> str:
        """Folder of the photos, relative to the root."""
        return _folder(self.site, self.terrain, self.site.files.photos)

    def _path(self, pattern: str, values: Mapping[str, Any], token: str = "") -> Path:
        path = PurePosixPath(_filled(self.site, self.terrain, pattern, values, token))
        for folder, temporary in self.folders.items():
            if path.is_relative_to(folder):
                return temporary / path.relative_to(folder)
        return self.root / path


@contextmanager
def writing_raw_files(site: Site, terrain: Terrain, root: Path) -> Iterator[RawFiles]:
    """Yield the paths of a terrain's files; folders of the terrain are replaced at the end."""
    folders = raw_folders(site, terrain)
    with ExitStack() as stack:
        yield RawFiles(
            site, terrain, root, {folder: stack.enter_context(writing_folder(root / folder)) for folder in folders}
        )


def raw_folders(site: Site, terrain: Terrain) -> list[str]:
    """Return the folders of a terrain's files, relative to the root."""
    files = site.files
    patterns = [pattern for pattern in (files.photos, files.clouds, files.range_maps, files.calibration) if pattern]
    return list(dict.fromkeys(_folder(site, terrain, pattern) for pattern in patterns))


def write_photo(path: Path, values: np.ndarray, form: Images) -> None:
    """Write the values (h, w) of a photo as PNG or TIFF with 8 or 16 bits per value."""
    stored = values.astype(np.uint8) if form.bits == 8 else values
    if path.suffix.lower() == ".png":
        png.write_png(path, stored)
        return
    if path.suffix.lower() not in (".tif", ".tiff"):
        raise ConfigError(f"files.photos: {path.name}, expected the suffix .png or .tif for the simulated sandbox")
    import tifffile

    with writing(path) as temporary:
        tifffile.imwrite(temporary, stored, photometric="minisblack", metadata=None, software=False)


def _folder(site: Site, terrain: Terrain, pattern: str) -> str:
    """Return the first folder of a pattern that contains the terrain, without fields of photos."""
    folders = pattern.split("/")[:-1]
    for count, name in enumerate(folders, 1):
        if "{terrain}" in name:
            return _filled(site, terrain, "/".join(folders[:count]) + "/", {}, "").rstrip("/")
    raise ConfigError(
        f"site {site.name}, files: {pattern}: the simulated sandbox requires a folder with the field {{terrain}}"
    )


def _filled(site: Site, terrain: Terrain, pattern: str, values: Mapping[str, Any], token: str) -> str:
    """Return a path as in `format_path`; `{any}` is a name of the terrain, a distance or the token."""
    *folders, file = pattern.split("/")
    name = site.options(terrain).name or "Unnamed"
    anys = []
    for part in folders:
        text = _distance_mm(site, str(values["position"])) if "{position}" in part else name
        anys += [text] * part.count("{any}")
    return format_path(site, pattern, terrain, values, [*anys, *[token] * file.count("{any}")])


def _distance_mm(site: Site, position: str) -> str:
    """Return the distance of a position from the edge of the sand, as in the names of NASA's folders."""
    if position not in site.tripods:
        return str(3 * _DISTANCE_STEP_MM)
    half = site.sandbox.half_width_m
    away = max(abs(at) - edge for at, edge in zip(site.tripods[position].camera_m[:2], half, strict=True))
    return str(round(away * 1000 / _DISTANCE_STEP_MM) * _DISTANCE_STEP_MM)
