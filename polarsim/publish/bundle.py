"""Folder of a published format, written file by file, each atomically, so that an interrupted export can be resumed.

A file gets the time stamp of the newest source file. A file with this time stamp is not written again (the rule of
`rsync`). A receipt stores the arguments of the export; a folder with another receipt is not changed.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import ConfigError, PolarsimError
from polarsim.formats import png
from polarsim.formats.files import check_new_folder, read_json, write_json, write_text, writing, writing_folder

RECEIPT = "publish.json"
SUMS = "SHA256SUMS"
_UNFINISHED = ".publishing.json"  # name of the receipt until the export is complete
SPARE = 64 * 10**6  # free space required in addition to the bundle, bytes


class Bundle:
    """Folder of a format during the export; `on_file` is called after every file and every checksum."""

    def __init__(self, folder: Path, on_file: Callable[[], None] = lambda: None) -> None:
        self.folder = folder
        self._on_file = on_file
        self._names: list[str] = []
        self._sums: dict[str, str] = {}

    def open(self, recipe: dict[str, Any], replace: bool = False) -> None:
        """Begin or resume an export; `replace` removes the files of an export with other arguments."""
        receipts = [self.folder / name for name in (_UNFINISHED, RECEIPT) if (self.folder / name).is_file()]
        if not receipts:
            check_new_folder(self.folder)
        elif read_json(receipts[0]) != recipe:
            if not replace:
                reason = (
                    "contains an export with other arguments or of another version: choose a new folder or --replace"
                )
                raise ConfigError(reason, path=self.folder)
            shutil.rmtree(self.folder)
        write_json(self.folder / _UNFINISHED, recipe)
        (self.folder / RECEIPT).unlink(missing_ok=True)

    def close(self) -> None:
        """Remove files of earlier, interrupted exports, write the checksums, and mark the export as complete."""
        kept = {*self._names, _UNFINISHED}
        for path in sorted(self.folder.rglob("*"), reverse=True):
            if path.is_file() and path.relative_to(self.folder).as_posix() not in kept:
                path.unlink()
            elif path.is_dir() and not any(path.iterdir()):
                path.rmdir()
        lines = []
        for name in sorted(self._names):
            lines.append(f"{self.sha256(name)}  {name}\n")
            self._on_file()
        write_text(self.folder / SUMS, "".join(lines))
        (self.folder / _UNFINISHED).replace(self.folder / RECEIPT)

    @property
    def names(self) -> list[str]:
        """Names of the files written so far, sorted."""
        return sorted(self._names)

    def path(self, name: str) -> Path:
        return self.folder / name

    def sha256(self, name: str) -> str:
        """Return the checksum of an existing file; the file is read once."""
        if name not in self._sums:
            with self.path(name).open("rb") as file:
                self._sums[name] = hashlib.file_digest(file, "sha256").hexdigest()
        return self._sums[name]

    def make(self, name: str, write: Callable[[Path], object], sources: Iterable[Path] = ()) -> Path:
        """Write a file by `write(path)`, unless the file is up to date with the sources."""
        target = self.path(name)
        self._names.append(name)
        stamp = max((path.stat().st_mtime_ns for path in sources), default=None)
        if stamp is None or not target.is_file() or target.stat().st_mtime_ns != stamp:
            with writing(target) as temporary:
                write(temporary)
                if stamp is not None:
                    os.utime(temporary, ns=(stamp, stamp))
            self._sums.pop(name, None)
        self._on_file()
        return target

    def folder_of(self, name: str, files: Sequence[str], write: Callable[[Path], object]) -> None:
        """Write several files of a folder by a single call of `write(folder)`."""
        with writing_folder(self.path(name)) as temporary:
            write(temporary)
        for file in files:
            self._names.append(f"{name}/{file}")
            self._sums.pop(f"{name}/{file}", None)
            self._on_file()

    def copy(self, name: str, source: Path) -> Path:
        """Copy a file of the run."""
        if not source.is_file():
            raise PolarsimError("is missing, but a table of the run lists it; run the workflow again", path=source)
        return self.make(name, partial(shutil.copyfile, source), [source])

    def png(self, name: str, pixels: Callable[[], np.ndarray], sources: Iterable[Path] = ()) -> Path:
        """Write an image; `pixels` is called only if the file is not up to date."""
        return self.make(name, lambda path: path.write_bytes(png.encode_png(pixels())), sources)

    def text(self, name: str, content: str) -> Path:
        return self.make(name, lambda path: path.write_text(content, encoding="utf-8"))

    def bytes(self, name: str, content: bytes) -> Path:
        return self.make(name, lambda path: path.write_bytes(content))

    def json(self, name: str, content: Any) -> Path:
        """Write JSON with the given order of keys; the same content gives the same bytes."""
        return self.text(name, json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False) + "\n")


def check_space(folder: Path, need: int) -> None:
    """Check the free disk space for an export of `need` bytes into `folder`."""
    existing = folder.absolute()
    while not existing.exists():
        existing = existing.parent
    present = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) if folder.is_dir() else 0
    free = shutil.disk_usage(existing).free
    missing = need - present + SPARE - free
    if missing > 0:
        raise PolarsimError(
            f"needs about {need / 1e9:.2f} GB, {free / 1e9:.2f} GB are free: free space, or use --subset or --max-size",
            path=folder,
        )
