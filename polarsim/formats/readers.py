"""The net under every reader: whatever a parser stumbles over is one line with the file, and sizes are bounded.

Parsers of damaged files raise nearly anything. So no reader lists what its parser may raise: `reader` marks it, and
`tests/formats/test_hostile_files.py` gives each that is marked thousands of damaged files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from inspect import signature
from pathlib import Path
from pickle import UnpicklingError
from typing import Any, ParamSpec, TypeVar

from polarsim.errors import FormatError, PolarsimError

READERS: dict[str, Callable[..., Any]] = {}  # every function that is marked, by module and name
MB = 1_000_000  # bytes
_LONGEST = 400  # characters of a reason: what it quotes of a file may be a megabyte
Arguments = ParamSpec("Arguments")
Read = TypeVar("Read")


def reader(
    what: str, largest_mb: float = 1000, error: type[PolarsimError] = FormatError
) -> Callable[[Callable[Arguments, Read]], Callable[Arguments, Read]]:
    """Mark a function whose first argument is the file or folder that it reads.

    Parameters
    ----------
    what
        What the file should be, as messages say it: `no readable WHAT, ...`.
    largest_mb
        A larger file is refused before a byte of it is read.
    error
        The error that it raises.
    """

    def mark(function: Callable[Arguments, Read]) -> Callable[Arguments, Read]:
        first = next(iter(signature(function).parameters))

        @wraps(function)
        def read(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Read:
            path: Any = args[0] if args else kwargs[first]
            with reading(what, path, error):
                _check_size(Path(path), largest_mb, error)
                return function(*args, **kwargs)

        READERS[f"{function.__module__}.{function.__name__}"] = read
        return read

    return mark


@contextmanager
def reading(what: str, path: str | Path | None = None, error: type[PolarsimError] = FormatError) -> Iterator[None]:
    """As `reader`, for a part of a function or for what is in memory."""
    try:
        yield
    except PolarsimError as found:
        found.path = found.path if found.path is not None or path is None else Path(path)
        found.reason = _one_line(found.reason)
        raise
    except Exception as found:  # never KeyboardInterrupt or SystemExit
        raise error(f"no readable {what}, {reason_of(found)}", path=path, line=_line_of(found)) from found


def reason_of(error: Exception) -> str:
    """What an exception complains about, in one line."""
    if isinstance(error, UnpicklingError):  # PyTorch's own text advises to run whatever code the file holds
        return "PyTorch finds no weights in it, or code beside them"
    text = _one_line((isinstance(error, OSError) and error.strerror) or str(error))
    terse = isinstance(error, (LookupError, TypeError, AttributeError, ArithmeticError, AssertionError)) or not text
    return f"{type(error).__name__}: {text}".removesuffix(": ") if terse else text


def _one_line(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= _LONGEST else f"{line[:_LONGEST]} ..."


def _line_of(error: Exception) -> int | None:
    """The line that a parser of text stopped at, where it says so."""
    if isinstance(error, UnicodeDecodeError):
        return error.object[: error.start].count(b"\n") + 1
    mark = getattr(error, "problem_mark", None)  # YAML's, from 0
    if mark is not None:
        return int(mark.line) + 1
    position = getattr(error, "position", None)  # XML's
    return position[0] if isinstance(position, tuple) else getattr(error, "lineno", None)  # JSON's


def _check_size(path: Path, largest_mb: float, error: type[PolarsimError]) -> None:
    if path.is_file() and (size := path.stat().st_size) > largest_mb * MB:
        raise error(f"{size / MB:.0f} MB, no file of this kind has more than {largest_mb:g} MB")
