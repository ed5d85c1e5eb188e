"""Archives by http: downloads that go on where they ended, checksums pinned on first sight, and a terrain's folder."""

from __future__ import annotations

import errno
import fcntl
import hashlib
import logging
import os
import re
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.client import HTTPException, HTTPResponse, IncompleteRead
from pathlib import Path

from polarsim.acquire.archives import unpack
from polarsim.acquire.options import FetchOptions, SourceOptions
from polarsim.errors import ConfigError, FetchError, FormatError
from polarsim.formats import nasa, release
from polarsim.formats.files import read_json, write_json, write_text
from polarsim.progress import track

PINS = "checksums.json"  # archive name -> SHA-256, written on first sight
CHUNK = 1 << 20  # bytes between two steps of the progress

_RELEASE_FOLDERS = (release.BOXES, release.POLYGONS, release.MESHES, release.COVERS)
_FOR_GOOD = (400, 401, 403, 404, 405, 410)  # answers that another try does not change

_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EFBIG)

log = logging.getLogger("polarsim")


class _TransferError(Exception):
    """A try failed in a way that another one may not."""


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
    with _alone(root):
        if path.exists():
            log.info("%s: already there", path)
            _check_pin(path, path, root)
            return path
        if url is None:
            raise FetchError("not there, and no address is configured for it", path=path)
        partial = path.with_name(f".{name}.part")
        _download(url, partial, options)
        try:
            _check_pin(partial, path, root)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
            _validator_of(partial).unlink(missing_ok=True)
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
            with _alone(source.root):
                if not _folder_of(name, source).is_dir():  # another terrain's job may have been here
                    unpack(path, _folder_of(name, source), source.fetch)
        if source.kind == "release":
            _lift(_folder_of(name, source), source.root)
    pins = _pins(source.root)
    used = {name: pins[name] for name in archives_of(terrain, source) if name in pins}
    folders = _folders(source, terrain)
    if not folders:
        raise FetchError(
            f"nothing of terrain {terrain:02d}, no folder Terrain{terrain:02d}_* (polar) or "
            f"{release.BOXES}/Terrain{terrain:02d} (release), and {len(used)} archives without it",
            path=source.root,
        )
    files = sorted(path for folder in folders for path in folder.rglob("*") if path.is_file())
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
    there = {path.name for path in source.root.glob("*.zip") if path.is_file()} if source.root.is_dir() else set[str]()
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
    with _alone(root):
        for name in _RELEASE_FOLDERS:
            for found in (*unpacked.glob(name), *unpacked.glob(f"*/{name}")):
                if not (root / name).exists():
                    found.rename(root / name)


def _download(url: str, partial: Path, options: FetchOptions) -> None:
    """Fetch `url` into `partial`: the one retry policy of all downloads."""
    for number in range(1, options.tries + 1):
        try:
            _transfer(url, partial, options.timeout_s)
            return
        except urllib.error.HTTPError as error:
            reason = f"the server answers {error.code} {error.reason}"
            if error.code in _FOR_GOOD:
                raise FetchError(f"{url}: {reason}") from error
        except (_TransferError, HTTPException, OSError) as error:
            if isinstance(error, OSError) and error.errno in _DISK:
                raise FetchError(f"cannot be written, {error.strerror}", path=partial) from error
            reason = str(getattr(error, "reason", error)) or type(error).__name__
        if number < options.tries:
            log.warning("%s: try %d of %d failed, %s", url, number, options.tries, reason)
            time.sleep(options.backoff_s * 2 ** (number - 1))
    raise FetchError(f"{url}: {options.tries} tries failed, the last with: {reason}")


def _transfer(url: str, partial: Path, timeout_s: float) -> None:
    """One try: append what is missing of the file, or begin anew where the server has another one now."""
    request = urllib.request.Request(url)  # noqa: S310 (the options allow http and https only)
    start = partial.stat().st_size if partial.exists() else 0
    validator = _validator_of(partial)
    if start and validator.exists():
        request.add_header("Range", f"bytes={start}-")
        request.add_header("If-Range", validator.read_text(encoding="ascii"))
    else:
        start = 0
    try:
        response = urllib.request.urlopen(request, timeout=timeout_s)  # noqa: S310
    except urllib.error.HTTPError as error:
        if error.code != 416:  # no byte beyond those that are here
            raise
        if error.headers.get("Content-Range") == f"bytes */{start}":
            return
        partial.unlink()
        raise _TransferError("the server has another file than the one that was begun") from error
    with response:
        if response.status != 206:
            start = 0
        elif not response.headers.get("Content-Range", "").startswith(f"bytes {start}-"):
            raise _TransferError("the server gives another part of the file than was asked for")
        _keep_validator(response, validator)
        length = response.headers.get("Content-Length")
        with partial.open("ab" if start else "wb") as file:
            for chunk in _chunks(response, int(length) if length else None, partial.name):
                file.write(chunk)
    received = partial.stat().st_size - start
    if length is not None and received != int(length):
        raise _TransferError(f"the connection ended after {received} of {length} bytes")


def _chunks(response: HTTPResponse, length: int | None, name: str) -> Iterator[bytes]:
    if length is None:
        while chunk := response.read(CHUNK):
            yield chunk
        return
    for _ in track(range(-(-length // CHUNK)), f"fetching {name.removeprefix('.').removesuffix('.part')}"):
        try:
            chunk = response.read(CHUNK)
        except IncompleteRead as cut:
            chunk = cut.partial
        if not chunk:
            return
        yield chunk


def _validator_of(partial: Path) -> Path:
    """The file that remembers which version of its file a server gave."""
    return partial.with_suffix(".version")


def _keep_validator(response: HTTPResponse, path: Path) -> None:
    """A weak tag does not promise equal bytes (RFC 9110, 13.1.5), so it is not kept."""
    tag = response.headers.get("ETag", "")
    value = tag if tag and not tag.startswith("W/") else response.headers.get("Last-Modified")
    if value:
        write_text(path, value)
    else:
        path.unlink(missing_ok=True)


def _check_pin(content: Path, path: Path, root: Path) -> None:
    """Compare a file with the checksum pinned for `path`, or pin it."""
    with content.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    pins = _pins(root)
    if path.name not in pins:
        write_json(root / PINS, {**pins, path.name: found})
    elif pins[path.name] != found:
        raise FetchError(f"SHA-256 {found}, but {pins[path.name]} is pinned in {root / PINS}", path=path)


def _pins(root: Path) -> dict[str, str]:
    path = root / PINS
    if not path.exists():
        return {}
    pins = read_json(path)
    if not isinstance(pins, dict) or not all(isinstance(value, str) for value in pins.values()):
        raise FormatError("expected archive names with their SHA-256", path=path)
    return pins


@contextmanager
def _alone(root: Path) -> Iterator[None]:
    """One process at a time in the root, for several terrains share an archive; the lock ends with the process."""
    try:
        root.mkdir(parents=True, exist_ok=True)
        folder = os.open(root, os.O_RDONLY)
    except OSError as error:
        raise FetchError(f"cannot be opened, {error.strerror}", path=root) from error
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)
