"""A folder that is published: written file by file, each whole, so that a stopped call goes on where it was.

A file that was made from others takes the time stamp of the newest of them: where it stands with that stamp it is not
made again, as `rsync` decides it. A receipt says what was asked for; a folder with another receipt is never written to.
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
from polarsim.formats.files import read_json, write_json, writing, writing_folder

RECEIPT = "publish.json"
SUMS = "SHA256SUMS"
_UNDER_WAY = ".publishing.json"
SPARE = 64 * 10**6  # bytes that shall stay free beside the bundle


class Bundle:
    """A form's folder while it is written.

    Parameters
    ----------
    folder
        Where the form goes.
    done
        Told after every file that was asked for.
    """

    def __init__(self, folder: Path, done: Callable[[], None] = lambda: None) -> None:
        self.folder = folder
        self._done = done
        self._names: list[str] = []
        self._sums: dict[str, str] = {}

    def open(self, recipe: dict[str, Any], replace: bool = False) -> None:
        """Begin, or go on with what the same call left; `replace` what another call published there.

        Raises
        ------
        ConfigError
            The folder holds something else.
        """
        if self.folder.exists():
            if not self.folder.is_dir():
                raise ConfigError("no folder, and publishing overwrites nothing: name a new one", path=self.folder)
            receipts = [self.folder / name for name in (_UNDER_WAY, RECEIPT) if (self.folder / name).is_file()]
            if not receipts and any(self.folder.iterdir()):
                raise ConfigError("not empty, and publishing overwrites nothing: name a new folder", path=self.folder)
            if receipts and read_json(receipts[0]) != json.loads(json.dumps(recipe)):
                if not replace:
                    raise ConfigError(
                        "was published by another call: name a new folder, or --replace", path=self.folder
                    )
                shutil.rmtree(self.folder)
        write_json(self.folder / _UNDER_WAY, recipe)
        (self.folder / RECEIPT).unlink(missing_ok=True)

    def close(self) -> None:
        """Take away what an earlier, stopped call left behind, write the list of checksums, and call it whole."""
        kept = {*self._names, _UNDER_WAY}
        for path in sorted(self.folder.rglob("*"), reverse=True):
            if path.is_file() and path.relative_to(self.folder).as_posix() not in kept:
                path.unlink()
            elif path.is_dir() and not any(path.iterdir()):
                path.rmdir()
        lines = "".join(f"{self.sha256(name)}  {name}\n" for name in sorted(self._names))
        with writing(self.folder / SUMS) as temporary:
            temporary.write_text(lines, encoding="utf-8")
        (self.folder / _UNDER_WAY).replace(self.folder / RECEIPT)

    @property
    def names(self) -> list[str]:
        """Files so far, in order."""
        return sorted(self._names)

    def path(self, name: str) -> Path:
        return self.folder / name

    def sha256(self, name: str) -> str:
        """Of a file that is there; read once."""
        if name not in self._sums:
            with self.path(name).open("rb") as file:
                self._sums[name] = hashlib.file_digest(file, "sha256").hexdigest()
        return self._sums[name]

    def make(self, name: str, write: Callable[[Path], object], sources: Iterable[Path] = ()) -> Path:
        """A file that `write` makes at the path that it is given, unless it was made from these sources before."""
        target = self.path(name)
        self._names.append(name)
        stamp = max((path.stat().st_mtime_ns for path in sources), default=None)
        if stamp is None or not target.is_file() or target.stat().st_mtime_ns != stamp:
            with writing(target) as temporary:
                write(temporary)
                if stamp is not None:
                    os.utime(temporary, ns=(stamp, stamp))
            self._sums.pop(name, None)
        self._done()
        return target

    def folder_of(self, name: str, files: Sequence[str], write: Callable[[Path], object]) -> None:
        """Files that one call writes together into a folder that it is given."""
        with writing_folder(self.path(name)) as temporary:
            write(temporary)
        for file in files:
            self._names.append(f"{name}/{file}")
            self._sums.pop(f"{name}/{file}", None)
            self._done()

    def copy(self, name: str, source: Path) -> Path:
        """The bytes of a file of the run.

        Raises
        ------
        PolarsimError
            It is not there any more.
        """
        if not source.is_file():
            raise PolarsimError("is missing, though a table of the run lists it", path=source)
        return self.make(name, partial(shutil.copyfile, source), [source])

    def png(self, name: str, pixels: Callable[[], np.ndarray], sources: Iterable[Path] = ()) -> Path:
        """A picture; its pixels are asked for only where it must be made."""
        return self.make(name, lambda path: path.write_bytes(png.encode(pixels())), sources)

    def text(self, name: str, content: str) -> Path:
        return self.make(name, lambda path: path.write_text(content, encoding="utf-8"))

    def bytes(self, name: str, content: bytes) -> Path:
        return self.make(name, lambda path: path.write_bytes(content))

    def json(self, name: str, content: Any) -> Path:
        """Keys in the order given, shortest floats: same content, same bytes."""
        return self.text(name, json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False) + "\n")


def check_space(folder: Path, need: int) -> None:
    """Refuse what the disk cannot hold, before anything is written.

    Raises
    ------
    PolarsimError
        Too little is free: one line with both numbers.
    """
    existing = folder.absolute()
    while not existing.exists():
        existing = existing.parent
    held = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) if folder.is_dir() else 0
    free = shutil.disk_usage(existing).free
    missing = need - held + SPARE - free
    if missing > 0:
        raise PolarsimError(
            f"needs about {need / 1e9:.2f} GB, {free / 1e9:.2f} GB are free: make room, or use --subset or --max-size",
            path=folder,
        )
