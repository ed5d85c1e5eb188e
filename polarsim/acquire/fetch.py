"""Archives by HTTP: resumable downloads, pinned checksums, and the folders of a terrain."""

from __future__ import annotations

import hashlib
import logging
import re
import zipfile
from pathlib import Path

from polarsim.acquire.archives import unpack
from polarsim.acquire.options import FetchLimits, SourceOptions
from polarsim.download import downloaded_file, exclusive_lock
from polarsim.errors import ConfigError, FetchError, FormatError
from polarsim.formats.files import read_json, write_json
from polarsim.formats.readers import reader
from polarsim.photo import Terrain, terrain_text
from polarsim.site import Site
from polarsim.sources.registry import SOURCES

PINS = "checksums.json"  # archive name -> SHA-256, written after the first download

_DEFAULT = FetchLimits()

log = logging.getLogger("polarsim")


def fetch_archive(*, name: str, url: str | None, root: Path, limits: FetchLimits) -> Path:
    """Return the archive `root/name` after a check of the pinned checksum. Download the archive if it is missing.

    An interrupted download is stored in a hidden file in the same folder. The next call resumes the download if the
    file on the server has not changed.
    """
    path = root / name
    with exclusive_lock(root):
        if path.exists():
            log.info("%s: exists already", path)
            _check_pin(path, path, root)
            return path
        if url is None:
            raise FetchError("missing, and source.urls has no address of the archive", path=path)
        with downloaded_file(url, path, limits.tries, limits.backoff_s, limits.timeout_s) as partial:
            if not zipfile.is_zipfile(partial):  # do not pin the checksum of a login page
                raise FetchError(f"the file at {url} is no zip archive", path=path)
            _check_pin(partial, path, root)
    return path


def fetch_terrain(
    *, site: Site, terrain: Terrain, source: SourceOptions, done: Path, limits: FetchLimits = _DEFAULT
) -> None:
    """Download and extract the folders of a terrain, and write a receipt of the used archives and files.

    Archives are those of the configuration and those in the root. Existing folders are not changed.
    """
    data = SOURCES[source.kind]
    if data.is_generated:
        raise ConfigError(f"source.kind: {source.kind!r} is generated, not fetched")
    for name in archives_of(site, terrain, source):
        folder = source.root / Path(name).stem
        named = terrain in _terrains_in(site, name) and data.unpacked(site, source.root, terrain)
        if not named and not folder.is_dir():
            path = fetch_archive(name=name, url=source.urls.get(name), root=source.root, limits=limits)
            with exclusive_lock(source.root):
                if not folder.is_dir():  # the job of another terrain may have extracted the archive
                    unpack(path, folder, data.layout(site))
        data.arrange(folder, source.root)
    pins = read_pins(source.root)
    used = {name: pins[name] for name in archives_of(site, terrain, source) if name in pins}
    folders = data.folders(site, source.root, terrain)
    if not folders:
        raise FetchError(
            f"no data of terrain {terrain_text(terrain)} in {len(used)} archives: expected "
            f"{data.expected(site, terrain)}",
            path=source.root,
        )
    files = sorted(path for folder in folders for path in folder.rglob("*") if path.is_file())
    if not files:
        raise FetchError(f"no file of terrain {terrain_text(terrain)}", path=folders[0])
    data.check_fetched(site, source.root, terrain, files)
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


def archives_of(site: Site, terrain: Terrain, source: SourceOptions) -> list[str]:
    """Return the archives that may have data of a terrain: with its name, or without a terrain in the name."""
    local = set[str]()
    if source.root.is_dir():
        local = {path.name for path in source.root.iterdir() if path.suffix.lower() == ".zip" and path.is_file()}
    return [name for name in sorted(local | set(source.urls)) if terrain in (_terrains_in(site, name) or (terrain,))]


def _terrains_in(site: Site, name: str) -> list[Terrain]:
    """Return the terrains in the name of an archive: `Terrain01_LargeOnly.zip`, `yard-a.zip`."""
    start = re.match(r"(?:Terrain)?([A-Za-z0-9-]+)", name)
    return [] if start is None else [terrain for terrain in site.terrains if terrain_text(terrain) == start[1]]


def _check_pin(content: Path, path: Path, root: Path) -> None:
    """Compare the checksum of a file with the pinned checksum of `path`, or pin the checksum."""
    with content.open("rb") as file:
        checksum = hashlib.file_digest(file, "sha256").hexdigest()
    pins = read_pins(root)
    if path.name not in pins:
        write_json(root / PINS, {**pins, path.name: checksum})
    elif pins[path.name] != checksum:
        raise FetchError(f"SHA-256 {checksum}, expected {pins[path.name]}, pinned in {root / PINS}", path=path)


@reader("list of checksums")
def read_pins(root: Path) -> dict[str, str]:
    path = root / PINS
    if not path.exists():
        return {}
    pins = read_json(path)
    if not isinstance(pins, dict) or not all(isinstance(value, str) for value in pins.values()):
        raise FormatError("expected archive names with their SHA-256", path=path)
    return pins
