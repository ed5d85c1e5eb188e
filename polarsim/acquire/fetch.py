"""Archives by http: downloads that go on where they ended, checksums pinned on first sight, and a terrain's folder."""

from __future__ import annotations

import hashlib
import logging
import re
import zipfile
from pathlib import Path

from polarsim.acquire.archives import unpack
from polarsim.acquire.options import FetchOptions, SourceOptions
from polarsim.download import alone, downloaded
from polarsim.errors import ConfigError, FetchError, FormatError
from polarsim.formats import nasa, release
from polarsim.formats.files import read_json, write_json
from polarsim.formats.readers import reader

PINS = "checksums.json"  # archive name -> SHA-256, written on first sight

_RELEASE_FOLDERS = (release.BOXES, release.POLYGONS, release.MESHES, release.COVERS)
_LAYOUT = re.compile("|".join([r"Terrain\d\d.*", r"Pos[A-G].*", nasa.RANGE_FOLDER, *_RELEASE_FOLDERS]))

log = logging.getLogger("polarsim")


def fetch_archive(*, name: str, url: str | None, root: Path, options: FetchOptions) -> Path:
    """The archive `root/name`, downloaded where it is not there, and checked against its pinned checksum.

    What an interrupted download brought is kept in a hidden file beside it, and the next call goes on from there as
    long as the server still has the same file.

    Raises
    ------
    FetchError
        The server does not give the file, or its checksum is not the pinned one.
    """
    path = root / name
    with alone(root):
        if path.exists():
            log.info("%s: already there", path)
            _check_pin(path, path, root)
            return path
        if url is None:
            raise FetchError("not there, and no address is configured for it", path=path)
        with downloaded(url, path, options.tries, options.backoff_s, options.timeout_s) as partial:
            if not zipfile.is_zipfile(partial):  # such as the page of a portal: its checksum would be pinned
                raise FetchError(f"{url} gives no zip archive", path=path)
            _check_pin(partial, path, root)
    return path


def fetch_terrain(*, terrain: int, source: SourceOptions, done: Path) -> None:
    """Make sure that the source's root has a terrain's folders, and write a receipt of what was used.

    Archives are those of the configuration, and those that already lie in the root. Folders that are there stay as
    they are.

    Raises
    ------
    ConfigError
        The source is the analog, which is generated.
    FetchError, FormatError
        An archive cannot be had, is damaged or hostile, or nothing there is of the terrain.
    """
    if source.kind == "analog":
        raise ConfigError("source.kind: the analog is generated, only 'polar' and 'release' are fetched")
    for name in archives_of(terrain, source):
        if _is_needed(name, terrain, source):
            path = fetch_archive(name=name, url=source.urls.get(name), root=source.root, options=source.fetch)
            with alone(source.root):
                if not _folder_of(name, source).is_dir():  # another terrain's job may have been here
                    unpack(path, _folder_of(name, source), source.fetch, _LAYOUT)
        if source.kind == "release":
            _lift(_folder_of(name, source), source.root)
    pins = read_pins(source.root)
    used = {name: pins[name] for name in archives_of(terrain, source) if name in pins}
    folders = _folders(source, terrain)
    if not folders:
        raise FetchError(
            f"nothing of terrain {terrain:02d}, no folder Terrain{terrain:02d}_* (polar) or "
            f"{release.BOXES}/Terrain{terrain:02d} (release), and {len(used)} archives without it",
            path=source.root,
        )
    files = sorted(path for folder in folders for path in folder.rglob("*") if path.is_file())
    _require_content(terrain, source, folders, files)
    write_json(
        done,
        {
            "terrain": terrain,
            "kind": source.kind,
            "archives": used,
            "folders": [folder.relative_to(source.root).as_posix() for folder in folders],
            "files": [path.relative_to(source.root).as_posix() for path in files],
        },
    )


def _require_content(terrain: int, source: SourceOptions, folders: list[Path], files: list[Path]) -> None:
    """Refuse folders without a file of the terrain, such as photos below folders that the layout does not have."""
    folder = nasa.find_terrain_folder(source.root, terrain) if source.kind == "polar" else None
    if not files:
        raise FetchError(f"no file of terrain {terrain:02d}", path=folders[0])
    if folder is None:
        return
    photos, strays = nasa.find_photos(folder, terrain), nasa.find_strays(folder, terrain)
    if strays and not photos:
        raise FetchError(
            "no photo, expected PosA_1500_Loff/Sun_30/CamL_7_0256.png or one folder deeper", path=strays[0]
        )
    if not photos and not any(nasa.find_scans(source.root, terrain)) and nasa.find_calibration(folder) is None:
        raise FetchError(
            f"no photo, scan or {nasa.CALIBRATION_NAME} of terrain {terrain:02d}, such as PosA_1500_Loff/Sun_30/"
            f"CamL_7_0256.png; found {len(files)} other files, such as {files[0].relative_to(source.root)}",
            path=folder,
        )


def archives_of(terrain: int, source: SourceOptions) -> list[str]:
    """Archives that may hold something of a terrain: named for it, or for no terrain."""
    there = set[str]()
    if source.root.is_dir():
        there = {path.name for path in source.root.iterdir() if path.suffix.lower() == ".zip" and path.is_file()}
    return [name for name in sorted(there | set(source.urls)) if _terrain_in(name) in (None, terrain)]


def _terrain_in(name: str) -> int | None:
    found = re.match(r"Terrain(\d\d)(?!\d)", name)
    return int(found[1]) if found else None


def _folders(source: SourceOptions, terrain: int) -> list[Path]:
    """Folders of the root that hold a terrain's data."""
    if source.kind == "release":
        candidates = [
            release.label_folder(source.root, terrain),
            release.polygon_folder(source.root, terrain),
            release.mesh_folder(source.root, terrain),
        ]
        return [folder for folder in candidates if folder.is_dir()]
    folder = nasa.find_terrain_folder(source.root, terrain)
    range_maps, _ = nasa.find_scans(source.root, terrain)
    return sorted({*([folder] if folder else []), *(path.parent for path in range_maps.values())})


def _folder_of(archive: str, source: SourceOptions) -> Path:
    return source.root / Path(archive).stem


def _is_needed(archive: str, terrain: int, source: SourceOptions) -> bool:
    """Whether an archive's folder is not there yet; that of a terrain may bear another name than its archive."""
    if source.kind == "polar" and _terrain_in(archive) == terrain:
        return nasa.find_terrain_folder(source.root, terrain) is None
    return not _folder_of(archive, source).is_dir()


def _lift(unpacked: Path, root: Path) -> None:
    """Move a release's folders from an unpacked archive up into the root, where they are not there."""
    with alone(root):
        for name in _RELEASE_FOLDERS:
            for found in (*unpacked.glob(name), *unpacked.glob(f"*/{name}")):
                if not (root / name).exists():
                    found.rename(root / name)


def _check_pin(content: Path, path: Path, root: Path) -> None:
    """Compare a file with the checksum pinned for `path`, or pin it."""
    with content.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    pins = read_pins(root)
    if path.name not in pins:
        write_json(root / PINS, {**pins, path.name: found})
    elif pins[path.name] != found:
        raise FetchError(f"SHA-256 {found}, but {pins[path.name]} is pinned in {root / PINS}", path=path)


@reader("list of checksums")
def read_pins(root: Path) -> dict[str, str]:
    path = root / PINS
    if not path.exists():
        return {}
    pins = read_json(path)
    if not isinstance(pins, dict) or not all(isinstance(value, str) for value in pins.values()):
        raise FormatError("expected archive names with their SHA-256", path=path)
    return pins
