"""Paths, text encodings and atomic writing: files have a temporary name in the same folder until they are complete."""

from __future__ import annotations

import codecs
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from polarsim.errors import ConfigError, FormatError, PolarsimError
from polarsim.formats.readers import reader

ENCODINGS = (  # by byte order mark; UTF-32 first, because its mark begins with the mark of UTF-16
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_CONFIGS = Path(__file__).parents[1] / "configs"  # config/ of the repository; in a wheel a copy


@contextmanager
def writing(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`; rename it to `path` at the end; delete it on an error."""
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")  # writers choose the format by the suffix
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise PolarsimError(f"cannot be written, {error.strerror or error}", path=path) from error
    finally:
        with suppress(OSError):  # do not replace the first error
            temporary.unlink(missing_ok=True)


@contextmanager
def writing_folder(path: str | Path) -> Iterator[Path]:
    """Write a folder as `writing` does a file: an existing folder is replaced only when the new folder is complete."""
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    former = path.with_name(f".{path.name}.former.{os.getpid()}")
    try:
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir(parents=True)
        yield temporary
        if path.is_dir():  # renamed first: a process killed during removal must not leave a partial folder at `path`
            path.replace(former)
        temporary.replace(path)
    except OSError as error:
        raise PolarsimError(f"cannot be written, {error.strerror or error}", path=path) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        shutil.rmtree(former, ignore_errors=True)


def existing_folder(path: str | Path) -> Path:
    """Return the folder; raise an error if it is missing or a file."""
    path = Path(path)
    if not path.is_dir():
        raise FormatError("a file, expected a folder" if path.exists() else "no such folder", path=path)
    return path


def check_new_folder(path: Path) -> None:
    """Raise an error if a folder to be written exists and is not empty, or if the path is a file."""
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise ConfigError("exists and is not empty, files are not overwritten: give a new folder", path=path)


def resolve_from(path: str | Path, file: str | Path) -> Path:
    """Return the location of a path that is stated in a file, such as a table of photos.

    A relative path is resolved from the folder of the file, then from each folder above: paths in a run are relative to
    the folder in which the run was started. A path that does not exist in any of these folders is returned unchanged.
    """
    path = Path(path)
    if not path.is_absolute():
        for folder in Path(file).absolute().parents:
            if (resolved := folder / path).exists():
                return path if folder == Path.cwd() else resolved  # the shorter form from the current folder
    return path


def resolve_packaged(path: str | Path) -> Path:
    """Return a path; if a path below `config/` does not exist, return the file of that name in the installed package.

    Configurations, vehicles and soils can therefore be used without a clone of the repository.
    """
    path = Path(path)
    installed = packaged(path)
    return installed if path.parts[:1] == ("config",) and not path.exists() and installed.is_file() else path


def packaged(path: str | Path) -> Path:
    """Return the file of the installed package for a path below `config/`."""
    return _CONFIGS.joinpath(*Path(path).parts[1:])


def suffix_counts(folder: Path, max_suffixes: int = 6) -> str:
    """Return, for messages, the number of files of each suffix below a folder with an example of each."""
    by_suffix: dict[str, list[str]] = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file() and not path.name.startswith(".")):
        by_suffix.setdefault(path.suffix.lower() or "without suffix", []).append(relative_to(path, folder))
    parts = [f"{len(names)} {suffix} ({names[0]})" for suffix, names in by_suffix.items()]
    return ", ".join(parts[:max_suffixes]) or "no file"


def relative_to(path: str | Path, folder: str | Path) -> str:
    """Return a path relative to a folder, with forward slashes, as it is written into files of the folder."""
    return Path(os.path.relpath(path, folder)).as_posix()


def share_file(source: Path, target: Path) -> None:
    """Create a hard link to a file, or a copy if the file system does not support the link.

    A hard link needs no space, and `tar`, `rsync` and `cp` treat it as a file, unlike a symbolic link. The target does
    not change if the source is replaced later.
    """
    source = source.resolve()  # the file, not a symbolic link to it
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def decode_text(content: bytes) -> str:
    """Return the text of a file: UTF-8, or UTF-16 and UTF-32 with a byte order mark, else Latin-1.

    PowerShell writes UTF-16, Windows editors write byte order marks, and old programs write Latin-1.
    """
    for mark, encoding in ENCODINGS:
        if content.startswith(mark):
            return content.decode(encoding)
    if b"\0" in content:
        raise UnicodeError("binary data, expected text; UTF-16 needs a byte order mark, UTF-8 does not")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def lines_of(content: bytes) -> list[str]:
    """Return the lines of a text, decoded by `decode_text`. Lines end with CR LF, LF or CR."""
    return decode_text(content).replace("\r\n", "\n").replace("\r", "\n").split("\n")


def text_of(path: str | Path) -> str:
    """Return the text of a file, decoded by `decode_text`, with line feeds between the lines."""
    return "\n".join(lines_of(Path(path).read_bytes()))


def write_text(path: str | Path, text: str) -> None:
    write_bytes(path, text.encode())


def write_bytes(path: str | Path, content: bytes) -> None:
    with writing(path) as temporary:
        temporary.write_bytes(content)


def write_json(path: str | Path, content: Any) -> None:
    """Write JSON with sorted keys and shortest floats, so that equal content makes equal bytes."""
    write_text(path, json.dumps(content, indent=1, sort_keys=True, allow_nan=False) + "\n")


@reader("JSON", largest_mb=500)
def read_json(path: str | Path) -> Any:
    """Parse a JSON file."""
    return json.loads(decode_text(Path(path).read_bytes()))
