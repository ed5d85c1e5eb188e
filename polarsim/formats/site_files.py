"""Files of a site below a root, found by the patterns of `site.files`; `site_paths` has the paths for writing.

A pattern is a path with fields in braces, `Terrain{terrain}_{any}/Pos{position}.{xyz|ply}`. The folders up to the one
with the terrain are the folder of the terrain. It may be in up to two additional folders, and the files may be in one
additional folder inside. Suffixes match in upper and lower case.
"""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from polarsim.errors import FormatError
from polarsim.formats.site_paths import spelled_text
from polarsim.photo import PhotoKey, Terrain, parse_terrain, terrain_text
from polarsim.site import Site
from polarsim.site_file_names import FIELD, composed

log = logging.getLogger("polarsim")

_LEADING, _INSIDE = 2, 1  # maximum number of additional folders above and inside the folder of a terrain
_STRAY = 3  # maximum number of further folders in which stray files are reported
_OF_TERRAIN = {"terrain", "terrain_name", "any"}  # fields in the path of the folder of a terrain
_SUFFIX = re.compile(r"\.(?:\w+|{[^{}/]*\|[^{}/]*})\Z")  # of a pattern
Photos = list[tuple[PhotoKey, Path]]


def find_photos(site: Site, root: str | Path, terrain: Terrain) -> tuple[Photos, list[Path]]:
    """Return the photos of a terrain, sorted by key, and stray files: files with the same suffix and other names.

    Two files of one photo are an error.
    """
    photos: dict[PhotoKey, Path] = {}
    strays = []
    suffix = re.compile(f".*{_suffix_regex(site.files.photos)}", re.DOTALL)
    for path, fields in _matches(site, site.files.photos, root, terrain):
        key = None if fields is None else _photo_key(site, terrain, fields)
        if key is None:
            if suffix.fullmatch(path.name) and not _is_of_other_terrain(site, root, path, terrain):
                strays.append(path)
        elif key in photos:
            raise FormatError(f"the photo {key} is also {photos[key]}: remove a file", path=path)
        else:
            photos[key] = path
    return sorted(photos.items()), strays


def find_range_maps(site: Site, root: str | Path, terrain: Terrain) -> dict[str, Path]:
    """Return the range maps of a terrain by position."""
    return _by_position(site, site.files.range_maps, root, terrain)


def find_clouds(site: Site, root: str | Path, terrain: Terrain) -> dict[str, Path]:
    """Return the scan clouds of a terrain by position; files with other suffixes are skipped with a warning."""
    pattern = site.files.clouds
    if pattern is None:
        return {}
    clouds = _by_position(site, pattern, root, terrain)
    any_suffix = _SUFFIX.sub(".{any}", pattern)
    used = set(clouds.values())
    for path, fields in _matches(site, any_suffix, root, terrain):
        if fields is not None and path not in used and "." in path.name:
            log.warning("%s: skipped, clouds have the suffix %s", path, _SUFFIX.search(pattern)[0])  # type: ignore[index]
    return clouds


def find_calibration(site: Site, root: str | Path, terrain: Terrain) -> Path | None:
    """Return the calibration of a terrain; None if it does not exist."""
    if site.files.calibration is None:
        return None
    found = [path for path, fields in _matches(site, site.files.calibration, root, terrain) if fields is not None]
    return min(found, key=lambda path: (len(path.parts), path), default=None)


def find_terrain_folder(site: Site, root: str | Path, pattern: str, terrain: Terrain) -> Path | None:
    """Return the folder of a terrain in a pattern; None if it does not exist. Two folders are an error."""
    base, _ = _split(site, pattern, terrain)
    for leading in range(_LEADING + 1 if base else 1):
        folders = [Path(root)]
        for _ in range(leading):
            folders = [inner for folder in folders for inner in _folders(folder)]
        for part in base:
            folders = [
                inner for folder in folders for inner in _folders(folder) if part.fullmatch(composed(inner.name))
            ]
        if len(folders) > 1:
            names = f"{folders[0].name} and {folders[1].name}"
            raise FormatError(f"two folders of terrain {terrain_text(terrain)}, {names}: remove a folder", path=root)
        if folders:
            return folders[0] if folders[0].is_dir() else None
    return None


def patterns_of(site: Site) -> list[str]:
    """Return all patterns of a site."""
    files = site.files
    return [text for text in (files.photos, files.clouds, files.range_maps, files.calibration) if text]


def expected_folders(site: Site, terrain: Terrain) -> list[str]:
    """Return the folders of a terrain in the patterns of a site, for messages: `Terrain05_*`; or whole patterns."""
    names = []
    for pattern in patterns_of(site):
        count = len(_base_parts(pattern))
        parts = pattern.split("/")[: count or None]
        stated = {"terrain": spelled_text(site, "terrain", terrain_text(terrain)), "any": "*", "terrain_name": "*"}
        names.append(FIELD.sub(lambda match: stated.get(match[1], match[0]), "/".join(parts)))  # noqa: B023
    return list(dict.fromkeys(names))


def archive_layout(site: Site) -> re.Pattern[str]:
    """Return the names of the folders at the start of the patterns and inside the folders of terrains.

    Other single top folders of an archive are removed.
    """
    parts = []
    for pattern in patterns_of(site):
        count = max(len(_base_parts(pattern)), 1)
        for part in pattern.split("/")[:-1][: count + 1]:
            parts += [_regex(site, text, None) for text in _spelled_parts(site, part)]
    unnamed = dict.fromkeys(re.sub(r"\(\?P<\w+>", "(?:", part) for part in parts)
    return re.compile("|".join(unnamed) or "(?!)")


def _by_position(site: Site, pattern: str | None, root: str | Path, terrain: Terrain) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for path, fields in _matches(site, pattern, root, terrain) if pattern else ():
        if fields is None:
            continue
        position = _name(site, "position", fields) or site.positions_of(terrain)[0]
        if position not in site.positions_of(terrain):
            log.warning("%s: skipped, terrain %s has no position %s", path, terrain_text(terrain), position)
            continue
        if position in found:
            raise FormatError(f"position {position} also has the scan {found[position]}: remove a file", path=path)
        found[position] = path
    return found


def _matches(
    site: Site, pattern: str, root: str | Path, terrain: Terrain
) -> Iterator[tuple[Path, dict[str, str] | None]]:
    """Yield the files in the folder of a terrain with the fields of the pattern; None for files that do not match."""
    folder = find_terrain_folder(site, root, pattern, terrain)
    if folder is None:
        return
    base, rest = _split(site, pattern, terrain)
    extra = _INSIDE if base else _LEADING
    regex = re.compile(rf"(?:[^/]+/){{0,{extra}}}{_regex(site, rest, terrain)}", re.DOTALL)
    depth = _folders_in(site, rest) + extra + (_STRAY if pattern == site.files.photos else 0)
    for path in _files(folder, depth):
        match = regex.fullmatch(composed(path.relative_to(folder).as_posix()))
        yield path, None if match is None else match.groupdict()


def _folders_in(site: Site, pattern: str) -> int:
    """Return the maximum number of folders of a pattern; texts of names may contain folders."""
    spelled = site.files.spelling
    inner = [
        max((text.count("/") for text in spelled.get(name, {}).values()), default=0) for name in FIELD.findall(pattern)
    ]
    return pattern.count("/") + sum(inner)


def _split(site: Site, pattern: str, terrain: Terrain) -> tuple[list[re.Pattern[str]], str]:
    """Return the names of the folders up to that of the terrain, and the rest of the pattern."""
    parts = pattern.split("/")
    count = len(_base_parts(pattern))
    base = "/".join(parts[:count]).replace("{terrain}", spelled_text(site, "terrain", terrain_text(terrain)))
    names = [re.compile(_regex(site, part, terrain)) for part in base.split("/")] if count else []
    return names, "/".join(parts[count:])


def _base_parts(pattern: str) -> list[str]:
    """Return the folders of a pattern up to the last one with the terrain; empty if they contain other fields."""
    folders = pattern.split("/")[:-1]
    fields = [set(FIELD.findall(part)) for part in folders]
    own = [number for number, names in enumerate(fields) if names & {"terrain", "terrain_name"}]
    count = own[-1] + 1 if own else 0
    return folders[:count] if all(names <= _OF_TERRAIN for names in fields[:count]) else []


def _regex(site: Site, pattern: str, terrain: Terrain | None) -> str:
    """Return a regular expression of a part of a pattern; terrain None: any terrain."""
    regex, position, named = "", 0, set[str]()
    suffix = _SUFFIX.search(pattern)
    end = suffix.start() if suffix else len(pattern)
    for match in FIELD.finditer(pattern, 0, end):
        regex += re.escape(pattern[position : match.start()]) + _field_regex(site, match[1], terrain, named)
        position = match.end()
    return regex + re.escape(pattern[position:end]) + (_suffix_regex(pattern) if suffix else "")


def _suffix_regex(pattern: str) -> str:
    found = _SUFFIX.search(pattern)
    names = found[0].removeprefix(".").strip("{}").split("|") if found else [""]
    return rf"\.(?i:{'|'.join(map(re.escape, names))})" if found else ""


def _field_regex(site: Site, field: str, terrain: Terrain | None, named: set[str]) -> str:
    name, _, width = field.partition(":")
    if "|" in field:
        return f"(?:{'|'.join(map(re.escape, field.split('|')))})"
    if name == "any":
        return "[^/]+"
    if name in named:
        return f"(?P={name})"
    named.add(name)
    if name == "exposure_ms":
        return rf"(?P<{name}>[0-9]{{{width or 1},}})"
    if name == "terrain_name":
        of = {site.options(each).name for each in ([terrain] if terrain is not None else site.terrains)}
        return f"(?P<{name}>{'|'.join(map(re.escape, sorted(of - {''}))) or '[^/]*'})"
    if name == "terrain" and terrain is not None:
        return re.escape(spelled_text(site, name, terrain_text(terrain)))
    texts = sorted(
        (spelled_text(site, name, value) for value in _values(site, name)), key=lambda text: (-len(text), text)
    )
    return f"(?P<{name}>{'|'.join(map(re.escape, texts))})"


def _values(site: Site, name: str) -> Sequence[str]:
    return {
        "terrain": [terrain_text(terrain) for terrain in site.terrains],
        "position": site.all_positions,
        "light": site.lights,
        "azimuth": site.azimuths,
        "camera": site.cameras.sides,
    }[name]


def _spelled_parts(site: Site, part: str) -> list[str]:
    """Return the folders of a part whose terrain is spelled with several folders."""
    if "{terrain}" not in part:
        return [part]
    spelled = [spelled_text(site, "terrain", terrain_text(terrain)) for terrain in site.terrains]
    if not any("/" in text for text in spelled):
        return [part]
    return sorted({folder for text in spelled for folder in part.replace("{terrain}", text).split("/")})


def _name(site: Site, name: str, fields: Mapping[str, str]) -> str | None:
    """Return the name in the site of a text in a path; None if the pattern does not have the field."""
    if name not in fields:
        return None
    return next(value for value in _values(site, name) if spelled_text(site, name, value) == fields[name])


def _photo_key(site: Site, terrain: Terrain, fields: Mapping[str, str]) -> PhotoKey | None:
    """Return the key of a photo; None if the terrain has no such photo. A field that a pattern lacks has one value."""
    position = _name(site, "position", fields) or site.positions_of(terrain)[0]
    azimuth = _name(site, "azimuth", fields) or site.azimuths[0]
    times = site.exposures_of(terrain, azimuth)
    exposure_ms = int(fields.get("exposure_ms", times[0]))
    if position not in site.positions_of(terrain) or exposure_ms not in times:
        return None
    light, camera = _name(site, "light", fields) or "off", _name(site, "camera", fields) or "L"
    return PhotoKey(terrain, position, light, azimuth, camera, exposure_ms)  # type: ignore[arg-type]


def _is_of_other_terrain(site: Site, root: str | Path, path: Path, terrain: Terrain) -> bool:
    """Return whether a file in a folder of several terrains is a photo of another terrain."""
    pattern = site.files.photos
    if _base_parts(pattern):
        return False
    regex = re.compile(rf"(?:[^/]+/){{0,{_LEADING}}}{_regex(site, pattern, None)}", re.DOTALL)
    match = regex.fullmatch(composed(path.relative_to(root).as_posix()))
    if match is None or "terrain" not in match.groupdict():
        return False
    other = parse_terrain(_name(site, "terrain", match.groupdict()) or "")
    return other != terrain and _photo_key(site, other, match.groupdict()) is not None


def _folders(folder: Path) -> list[Path]:
    return [path for path in _entries(folder) if path.is_dir()]


def _files(folder: Path, depth: int) -> Iterator[Path]:
    """Yield the files of a folder and of its subfolders up to a depth, sorted."""
    for path in _entries(folder):
        if not path.is_dir():
            yield path
        elif depth:
            yield from _files(path, depth - 1)


def _entries(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            return [folder / name for name in sorted(entry.name for entry in entries)]
    except OSError:
        return []
