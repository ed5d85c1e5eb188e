"""Zip archives from outside, unpacked whole or not at all; an entry that would harm is refused by name."""

from __future__ import annotations

import re
import shutil
import stat
import zipfile
from pathlib import Path, PurePosixPath

from polarsim.acquire.options import FetchLimits
from polarsim.errors import FetchError, FormatError
from polarsim.formats.files import writing_folder
from polarsim.formats.readers import reader
from polarsim.progress import track

MB = 1e6  # bytes
CHUNK = 1 << 20  # bytes
HARMLESS = 1 << 20  # bytes; the ratio of smaller files does not matter

_OUTSIDE = re.compile(r"^/|^[A-Za-z]:|\0|(^|/)\.\.(/|$)")
_OF_MACOS = ("__MACOSX", ".DS_Store")  # beside the content of every archive that macOS packs
_READ = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
_DEFLATE64 = 9
_DEFAULT = FetchLimits()
_ENCRYPTED = 0x1  # of an entry's flags


@reader("zip archive", largest_mb=1e6)
def unpack(archive: Path, folder: Path, limits: FetchLimits = _DEFAULT, layout: re.Pattern[str] | None = None) -> None:
    """Unpack a zip into `folder`, which appears when it is complete.

    A single top folder with the name of `folder` is left out and, where a layout is given, every single top folder that
    is not part of it.

    Parameters
    ----------
    layout
        Names of the folders that the layout of the data starts with.

    Raises
    ------
    FormatError
        No zip, cut or damaged (every entry's checksum is tested), or an entry that points outside, is a link, is there
        twice, is encrypted or compressed in a way that Python does not read, or exceeds the limits.
    FetchError
        The disk has too little room.
    """
    with zipfile.ZipFile(archive) as source:
        entries = [entry for entry in source.infolist() if not _name(entry).endswith("/")]
        check_entries(entries, limits)
        total, packed = sum(entry.file_size for entry in entries), archive.stat().st_size
        if total > max(HARMLESS, limits.max_ratio * packed):  # many small ones, or several that share their bytes
            raise FormatError(f"unpacks to {total / MB:.0f} MB, more than {limits.max_ratio:g} times its size: a bomb")
        _check_room(total, folder)
        with writing_folder(folder) as temporary:
            for entry in track(entries, f"unpacking {archive.name}"):
                _extract(source, entry, temporary)
            _flatten(temporary, folder.name)
            while layout is not None and _flatten(temporary, layout):
                pass


def check_entries(entries: list[zipfile.ZipInfo], limits: FetchLimits) -> None:
    """Refuse entries by what the archive's list says of them, before anything is written."""
    seen: set[str] = set()
    for entry in entries:
        name = _name(entry)
        if _OUTSIDE.search(entry.orig_filename.replace("\\", "/")) or _OUTSIDE.search(name):
            raise FormatError(f"entry {name!r} points outside the folder")
        if entry.flag_bits & _ENCRYPTED:
            raise FormatError(f"entry {name!r} is encrypted: unpack the archive and put its folder in its place")
        if entry.compress_type not in _READ:
            method = "Deflate64" if entry.compress_type == _DEFLATE64 else f"method {entry.compress_type}"
            raise FormatError(
                f"entry {name!r} is compressed with {method} (Windows does so above 2 GB), expected Deflate: "
                "unpack the archive with another program and put its folder in its place"
            )
        if stat.S_ISLNK(entry.external_attr >> 16):
            raise FormatError(f"entry {name!r} is a link")
        if str(PurePosixPath(name)) in seen:
            raise FormatError(f"entry {name!r} is there twice")
        if entry.file_size > limits.max_file_mb * MB:
            size = entry.file_size / MB
            raise FormatError(f"entry {name!r} unpacks to {size:.0f} MB, {limits.max_file_mb:g} MB allowed")
        if entry.file_size > max(HARMLESS, limits.max_ratio * entry.compress_size):
            raise FormatError(f"entry {name!r} unpacks to more than {limits.max_ratio:g} times its size: a bomb")
        seen.add(str(PurePosixPath(name)))


def _name(entry: zipfile.ZipInfo) -> str:
    """Return the path of an entry; .NET and old programs of Windows separate folders with backslashes."""
    return entry.filename.replace("\\", "/")


def _check_room(needed: int, folder: Path) -> None:
    above = next(path for path in folder.absolute().parents if path.is_dir())
    free = shutil.disk_usage(above).free
    if needed > free:
        raise FetchError(f"unpacks to {needed / MB:.0f} MB, the disk has {free / MB:.0f} MB free")


def _extract(source: zipfile.ZipFile, entry: zipfile.ZipInfo, folder: Path) -> None:
    """Copy one entry; zipfile stops at the stated size and tests the checksum at the end."""
    target = folder / _name(entry)
    target.parent.mkdir(parents=True, exist_ok=True)
    with source.open(entry) as packed, target.open("wb") as file:
        shutil.copyfileobj(packed, file, CHUNK)
    if target.stat().st_size != entry.file_size:
        raise FormatError(f"entry {_name(entry)!r} has {target.stat().st_size} of {entry.file_size} bytes")


def _flatten(folder: Path, names: str | re.Pattern[str]) -> bool:
    """Replace a single folder in a folder by its content: the one of a name, or one outside of a layout."""
    top = [path for path in folder.iterdir() if path.name not in _OF_MACOS]
    if len(top) != 1 or not top[0].is_dir():
        return False
    if top[0].name != names if isinstance(names, str) else names.fullmatch(top[0].name):
        return False
    inner = top[0].rename(folder / f".{top[0].name}.inner")
    for path in inner.iterdir():
        path.rename(folder / path.name)
    inner.rmdir()
    return True
