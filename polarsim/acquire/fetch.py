"""Archives by http: downloads that go on where they ended, checksums pinned on first sight, and a terrain's folder."""

from __future__ import annotations

import hashlib
import logging
import re
import zipfile
from pathlib import Path

from polarsim.acquire.archives import unpack
from polarsim.acquire.options import FetchLimits, SourceOptions
from polarsim.download import alone, downloaded
from polarsim.errors import ConfigError, FetchError, FormatError
from polarsim.formats.files import read_json, write_json
from polarsim.formats.readers import reader
from polarsim.sources.registry import SOURCES

PINS = "checksums.json"  # archive name -> SHA-256, written on first sight

_DEFAULT = FetchLimits()

log = logging.getLogger("polarsim")


def fetch_archive(*, name: str, url: str | None, root: Path, limits: FetchLimits) -> Path:
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
        with downloaded(url, path, limits.tries, limits.backoff_s, limits.timeout_s) as partial:
            if not zipfile.is_zipfile(partial):  # such as the page of a portal: its checksum would be pinned
                raise FetchError(f"{url} gives no zip archive", path=path)
            _check_pin(partial, path, root)
    return path


def fetch_terrain(*, terrain: int, source: SourceOptions, done: Path, limits: FetchLimits = _DEFAULT) -> None:
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
    data = SOURCES[source.kind]
    if data.is_generated:
        raise ConfigError(f"source.kind: {source.kind!r} is generated, not fetched")
    for name in archives_of(terrain, source):
        folder = source.root / Path(name).stem
        named = _terrain_in(name) == terrain and data.unpacked(source.root, terrain)
        if not named and not folder.is_dir():
            path = fetch_archive(name=name, url=source.urls.get(name), root=source.root, limits=limits)
            with alone(source.root):
                if not folder.is_dir():  # another terrain's job may have been here
                    unpack(path, folder, limits, data.layout)
        data.arrange(folder, source.root)
    pins = read_pins(source.root)
    used = {name: pins[name] for name in archives_of(terrain, source) if name in pins}
    folders = data.folders(source.root, terrain)
    if not folders:
        raise FetchError(
            f"no data of terrain {terrain:02d} in {len(used)} archives: expected {data.expected(terrain)}",
            path=source.root,
        )
    files = sorted(path for folder in folders for path in folder.rglob("*") if path.is_file())
    if not files:
        raise FetchError(f"no file of terrain {terrain:02d}", path=folders[0])
    data.check_fetched(source.root, terrain, files)
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


def archives_of(terrain: int, source: SourceOptions) -> list[str]:
    """Archives that may hold something of a terrain: named for it, or for no terrain."""
    there = set[str]()
    if source.root.is_dir():
        there = {path.name for path in source.root.iterdir() if path.suffix.lower() == ".zip" and path.is_file()}
    return [name for name in sorted(there | set(source.urls)) if _terrain_in(name) in (None, terrain)]


def _terrain_in(name: str) -> int | None:
    found = re.match(r"Terrain(\d\d)(?!\d)", name)
    return int(found[1]) if found else None


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
