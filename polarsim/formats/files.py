"""Nothing half-written: files and folders are made under a temporary name beside the target, then renamed."""

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

ENCODINGS = (  # by byte order mark; that of UTF-16 starts that of UTF-32
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_CONFIGS = Path(__file__).parents[1] / "configs"  # config/ of the repository, in a wheel a copy


@contextmanager
def writing(path: str | Path) -> Iterator[Path]:
    """A temporary path beside `path`; what was written there takes its name at the end, or vanishes on an error.

    Raises
    ------
    PolarsimError
        The disk is full or not writable: one line with the file's name.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")  # keeps the suffix: writers look at it
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise PolarsimError(f"cannot be written, {error.strerror or error}", path=path) from error
    finally:
        with suppress(OSError):  # the error that is under way says more
            temporary.unlink(missing_ok=True)


@contextmanager
def writing_folder(path: str | Path) -> Iterator[Path]:
    """As `writing`, for a whole folder: an existing one is replaced only when the new one is complete."""
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    former = path.with_name(f".{path.name}.former.{os.getpid()}")
    try:
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir(parents=True)
        yield temporary
        if path.is_dir():  # moved away whole: who is killed while removing it leaves no half of it under this name
            path.replace(former)
        temporary.replace(path)
    except OSError as error:
        raise PolarsimError(f"cannot be written, {error.strerror or error}", path=path) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        shutil.rmtree(former, ignore_errors=True)


def existing_folder(path: str | Path) -> Path:
    """Return a folder that exists.

    Raises
    ------
    FormatError
        The folder is missing, or a file has its name.
    """
    path = Path(path)
    if not path.is_dir():
        raise FormatError("a file, expected a folder" if path.exists() else "no such folder", path=path)
    return path


def check_new_folder(path: Path) -> None:
    """Refuse a folder to write that holds something, or a file of its name.

    Raises
    ------
    ConfigError
        The folder is not empty.
    """
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise ConfigError("not empty, and nothing is overwritten: name a new folder", path=path)


def found_from(path: str | Path, file: str | Path) -> Path:
    """A path that a file states, such as a table of photos: where it is, whatever folder the program was started in.

    A relative path counts from the file's own folder, or from the nearest folder above it where it is there: paths of a
    run count from the folder in which the run was made. One that is nowhere stays as it is, from the current folder.
    """
    path = Path(path)
    if not path.is_absolute():
        for folder in Path(file).absolute().parents:
            if (there := folder / path).exists():
                return path if folder == Path.cwd() else there  # the shorter form where both are one
    return path


def packaged(path: str | Path) -> Path:
    """A path below `config/`: where there is none from here, the file of that name that came with polarsim.

    So configurations, vehicles and soils are at hand without a clone.
    """
    path = Path(path)
    own = _CONFIGS.joinpath(*path.parts[1:])
    return own if path.parts[:1] == ("config",) and not path.exists() and own.is_file() else path


def census(folder: Path, most: int = 6) -> str:
    """How many files of each suffix a folder holds at any depth, with an example of each, for messages."""
    by_suffix: dict[str, list[str]] = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file() and not path.name.startswith(".")):
        by_suffix.setdefault(path.suffix.lower() or "without suffix", []).append(relative_to(path, folder))
    parts = [f"{len(names)} {suffix} ({names[0]})" for suffix, names in by_suffix.items()]
    return ", ".join(parts[:most]) or "no file"


def relative_to(path: str | Path, folder: str | Path) -> str:
    """A path as it is written into a file of a folder: from there, with slashes."""
    return Path(os.path.relpath(path, folder)).as_posix()


def share_file(source: Path, target: Path) -> None:
    """Give a file a second name, which takes no room and is a file to `tar`, `rsync` and `cp`, as a link is not.

    Where the file system has no hard links, or the names lie on two of them, its bytes are copied. What replaces the
    source later leaves the target as it is.
    """
    source = source.resolve()  # the file itself, not what links to it
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def decode_text(content: bytes) -> str:
    """Return the text of a file: UTF-8, or UTF-16 and UTF-32 with a byte order mark, else Latin-1.

    Every reader of text uses this function. PowerShell writes UTF-16, editors of Windows write marks, and old programs
    write Latin-1 names and comments.

    Raises
    ------
    UnicodeError
        Binary data, or bytes that are invalid in the encoding of the mark.
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
    """Return the lines of a text, see `decode_text`, of any system: they end in CR LF, LF or CR."""
    return decode_text(content).replace("\r\n", "\n").replace("\r", "\n").split("\n")


def text_of(path: str | Path) -> str:
    """Return the text of a file, see `decode_text`, with line feeds between its lines."""
    return "\n".join(lines_of(Path(path).read_bytes()))


def write_text(path: str | Path, text: str) -> None:
    with writing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_bytes(path: str | Path, content: bytes) -> None:
    with writing(path) as temporary:
        temporary.write_bytes(content)


def write_json(path: str | Path, content: Any) -> None:
    """Sorted keys and shortest floats: same content, same bytes."""
    write_text(path, json.dumps(content, indent=1, sort_keys=True, allow_nan=False) + "\n")


@reader("JSON", largest_mb=500)
def read_json(path: str | Path) -> Any:
    """Parse a JSON file.

    Raises
    ------
    FormatError
        The file is missing or is no JSON.
    """
    return json.loads(decode_text(Path(path).read_bytes()))
