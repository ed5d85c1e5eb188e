"""Safe extraction of downloaded zip archives: all entries are extracted, or none. Harmful entries are errors."""

from __future__ import annotations

import re
import shutil
import stat
import zipfile
from pathlib import Path, PurePosixPath

from polarsim.errors import FetchError, FormatError
from polarsim.formats.files import writing_folder
from polarsim.formats.readers import MB, reader
from polarsim.progress import track

_COPY_BYTES = 1 << 20
_MIN_BOMB_BYTES = 1 << 20  # smaller archives may have any compression ratio
_MAX_RATIO = 200.0  # maximum ratio of the size of all files to the size of the archive, against zip bombs
_OUTSIDE = re.compile(r"^/|^[A-Za-z]:|\0|(^|/)\.\.(/|$)")
_OF_MACOS = ("__MACOSX", ".DS_Store")  # additional entries in archives made by macOS
_SUPPORTED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
_DEFLATE64 = 9
_ENCRYPTED = 0x1  # bit of the flags of an entry


@reader("zip archive", largest_mb=1e6)
def unpack(archive: Path, folder: Path, layout: re.Pattern[str] | None = None) -> None:
    """Extract a zip archive into `folder`, which is created when all entries are extracted.

    A single top folder with the name of `folder` is removed from the paths. If a layout is given, so is every single
    top folder outside the layout.

    Parameters
    ----------
    layout
        Names of the top folders of the data.

    Raises
    ------
    FormatError
        The file is no zip archive, is truncated or damaged (all checksums are tested), or an entry is outside the
        folder, a link, repeated, encrypted, compressed by an unsupported method, or the archive is a zip bomb.
    FetchError
        The disk has not enough space.
    """
    with zipfile.ZipFile(archive) as source:
        entries = [entry for entry in source.infolist() if not _name(entry).endswith("/")]
        check_entries(entries)
        total, packed = sum(entry.file_size for entry in entries), archive.stat().st_size
        if total > max(_MIN_BOMB_BYTES, _MAX_RATIO * packed):  # also many small entries, and entries that share bytes
            reason = f"unpacks to {total / MB:.0f} MB, more than {_MAX_RATIO:g} times the size of the archive"
            raise FormatError(f"{reason}: suspected zip bomb")
        _check_space(total, folder)
        with writing_folder(folder) as temporary:
            for entry in track(entries, f"unpacking {archive.name}"):
                _extract(source, entry, temporary)
            _flatten(temporary, folder.name)
            while layout is not None and _flatten(temporary, layout):
                pass


def check_entries(entries: list[zipfile.ZipInfo]) -> None:
    """Raise an error for a harmful entry in the directory of an archive, before files are written."""
    names: set[str] = set()
    for entry in entries:
        name = _name(entry)
        if _OUTSIDE.search(entry.orig_filename.replace("\\", "/")) or _OUTSIDE.search(name):
            raise FormatError(f"entry {name!r} is outside the folder")
        if entry.flag_bits & _ENCRYPTED:
            raise FormatError(f"entry {name!r} is encrypted: replace the archive with the unpacked folder")
        if entry.compress_type not in _SUPPORTED:
            method = "Deflate64" if entry.compress_type == _DEFLATE64 else f"method {entry.compress_type}"
            raise FormatError(
                f"entry {name!r} is compressed with {method} (used by Windows above 2 GB), expected Deflate: "
                "unpack the archive with another program and replace the archive with the folder"
            )
        if stat.S_ISLNK(entry.external_attr >> 16):
            raise FormatError(f"entry {name!r} is a link")
        if str(PurePosixPath(name)) in names:
            raise FormatError(f"entry {name!r} is repeated")
        names.add(str(PurePosixPath(name)))


def _name(entry: zipfile.ZipInfo) -> str:
    """Return the path of an entry; .NET and old Windows programs separate folders with backslashes."""
    return entry.filename.replace("\\", "/")


def _check_space(needed: int, folder: Path) -> None:
    above = next(path for path in folder.absolute().parents if path.is_dir())
    free = shutil.disk_usage(above).free
    if needed > free:
        raise FetchError(f"unpacks to {needed / MB:.0f} MB, but the disk has only {free / MB:.0f} MB of free space")


def _extract(source: zipfile.ZipFile, entry: zipfile.ZipInfo, folder: Path) -> None:
    """Extract an entry. zipfile stops at the stated size and tests the checksum at the end."""
    target = folder / _name(entry)
    target.parent.mkdir(parents=True, exist_ok=True)
    with source.open(entry) as packed, target.open("wb") as file:
        shutil.copyfileobj(packed, file, _COPY_BYTES)
    if target.stat().st_size != entry.file_size:
        raise FormatError(f"entry {_name(entry)!r} has {target.stat().st_size} of {entry.file_size} bytes")


def _flatten(folder: Path, names: str | re.Pattern[str]) -> bool:
    """Replace a single subfolder by the content of the subfolder, if it has a name or is outside a layout."""
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
