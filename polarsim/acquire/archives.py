"""Zip archives from outside, unpacked whole or not at all; an entry that would harm is refused by name."""

from __future__ import annotations

import re
import shutil
import stat
import zipfile
from pathlib import Path, PurePosixPath

from polarsim.acquire.options import FetchOptions
from polarsim.errors import FetchError, FormatError
from polarsim.formats.files import writing_folder
from polarsim.formats.readers import reader
from polarsim.progress import track

MB = 1e6  # bytes
CHUNK = 1 << 20  # bytes
HARMLESS = 1 << 20  # bytes; the ratio of smaller files does not matter

_OUTSIDE = re.compile(r"^/|^[A-Za-z]:|\\|\0|(^|/)\.\.(/|$)")


@reader("zip archive", largest_mb=1e6)
def unpack(archive: Path, folder: Path, options: FetchOptions | None = None) -> None:
    """Unpack a zip into `folder`, which appears when all is there; one top folder of the same name is left out.

    Raises
    ------
    FormatError
        No zip, cut or damaged (every entry's checksum is tested), or an entry that points outside, is a link, is there
        twice, or unpacks to more than the options allow.
    FetchError
        The disk has too little room.
    """
    options = options or FetchOptions()
    with zipfile.ZipFile(archive) as source:
        entries = [entry for entry in source.infolist() if not entry.is_dir()]
        check_entries(entries, options)
        total, packed = sum(entry.file_size for entry in entries), archive.stat().st_size
        if total > max(HARMLESS, options.max_ratio * packed):  # many small ones, or several that share their bytes
            raise FormatError(f"unpacks to {total / MB:.0f} MB, more than {options.max_ratio:g} times its size: a bomb")
        _check_room(total, folder)
        with writing_folder(folder) as temporary:
            for entry in track(entries, f"unpacking {archive.name}"):
                _extract(source, entry, temporary)
            _flatten(temporary, folder.name)


def check_entries(entries: list[zipfile.ZipInfo], options: FetchOptions) -> None:
    """Refuse entries by what the archive's list says of them, before anything is written."""
    seen: set[str] = set()
    for entry in entries:
        name = entry.filename
        if _OUTSIDE.search(entry.orig_filename) or _OUTSIDE.search(name):
            raise FormatError(f"entry {name!r} points outside the folder")
        if stat.S_ISLNK(entry.external_attr >> 16):
            raise FormatError(f"entry {name!r} is a link")
        if str(PurePosixPath(name)) in seen:
            raise FormatError(f"entry {name!r} is there twice")
        if entry.file_size > options.max_file_mb * MB:
            size = entry.file_size / MB
            raise FormatError(f"entry {name!r} unpacks to {size:.0f} MB, {options.max_file_mb:g} MB allowed")
        if entry.file_size > max(HARMLESS, options.max_ratio * entry.compress_size):
            raise FormatError(f"entry {name!r} unpacks to more than {options.max_ratio:g} times its size: a bomb")
        seen.add(str(PurePosixPath(name)))


def _check_room(needed: int, folder: Path) -> None:
    above = next(path for path in folder.absolute().parents if path.is_dir())
    free = shutil.disk_usage(above).free
    if needed > free:
        raise FetchError(f"unpacks to {needed / MB:.0f} MB, the disk has {free / MB:.0f} MB free")


def _extract(source: zipfile.ZipFile, entry: zipfile.ZipInfo, folder: Path) -> None:
    """Copy one entry; zipfile stops at the stated size and tests the checksum at the end."""
    target = folder / entry.filename
    target.parent.mkdir(parents=True, exist_ok=True)
    with source.open(entry) as packed, target.open("wb") as file:
        shutil.copyfileobj(packed, file, CHUNK)
    if target.stat().st_size != entry.file_size:
        raise FormatError(f"entry {entry.filename!r} has {target.stat().st_size} of {entry.file_size} bytes")


def _flatten(temporary: Path, name: str) -> None:
    """Where all lies in one folder of the archive's own name, take its content."""
    top = list(temporary.iterdir())
    if len(top) == 1 and top[0].is_dir() and top[0].name == name:
        inner = top[0].rename(temporary / f".{name}.inner")
        for path in inner.iterdir():
            path.rename(temporary / path.name)
        inner.rmdir()
