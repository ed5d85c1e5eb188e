"""Error handling of parsers: every exception becomes a single line with the file name, and file sizes are limited.

Parsers raise exceptions of almost any type for damaged files. The decorator `reader` converts all exceptions.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from inspect import signature
from pathlib import Path
from pickle import UnpicklingError
from typing import Any, ParamSpec, TypeVar

from polarsim.errors import FormatError, PolarsimError
from polarsim.extras import extra_error

MB = 1_000_000  # bytes
_MAX_REASON = 400  # characters; a quotation from a file could be a megabyte
# Python's messages for text that is not a number.
_NO_FLOAT = re.compile(r"could not convert string to float: (['\"])(.*?)\1")
_NO_INTEGER = re.compile(r"invalid literal for int\(\) with base 10: (['\"])(.*?)\1")
Arguments = ParamSpec("Arguments")
Read = TypeVar("Read")


def reader(
    kind: str, largest_mb: float = 1000, error: type[PolarsimError] = FormatError
) -> Callable[[Callable[Arguments, Read]], Callable[Arguments, Read]]:
    """Decorate a function that reads the file or folder given by the first argument.

    `kind` is the kind of file for messages (`no readable KIND, ...`), `largest_mb` the maximum size of the file before
    it is read, `error` the type of the exceptions.
    """

    def mark(function: Callable[Arguments, Read]) -> Callable[Arguments, Read]:
        first = next(iter(signature(function).parameters))

        @wraps(function)
        def read(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Read:
            path: Any = args[0] if args else kwargs[first]
            with reading(kind, path, error):
                _check_size(Path(path), largest_mb, error)
                return function(*args, **kwargs)

        return read

    return mark


@contextmanager
def reading(kind: str, path: str | Path | None = None, error: type[PolarsimError] = FormatError) -> Iterator[None]:
    """Convert exceptions as `reader` does, for a part of a function or for data in memory."""
    try:
        yield
    except PolarsimError as known:
        known.path = known.path if known.path is not None or path is None else Path(path)
        known.reason = _single_line(known.reason)
        raise
    except ImportError as missing:
        raise (extra_error(missing) or error(f"no readable {kind}, {reason_of(missing)}", path=path)) from missing
    except Exception as unknown:  # never KeyboardInterrupt or SystemExit
        raise error(f"no readable {kind}, {reason_of(unknown)}", path=path, line=_line_of(unknown)) from unknown


def reason_of(error: Exception) -> str:
    """Return the message of an exception as a single line."""
    if isinstance(error, UnpicklingError):  # PyTorch's message recommends to execute code from the file
        return "the file contains no PyTorch weights, or also contains code"
    if isinstance(error, FileNotFoundError):  # pyarrow's message is the path
        return "no such file or folder"
    text = _single_line((isinstance(error, OSError) and error.strerror) or str(error))
    terse = isinstance(error, (LookupError, TypeError, AttributeError, ArithmeticError, AssertionError)) or not text
    return f"{type(error).__name__}: {text}".removesuffix(": ") if terse else text


def not_a_number(text: str, kind: str = "number") -> str:
    """Return the reason why a text of a file is no number, with a remedy for commas."""
    remedy = ""
    if text.endswith(","):
        remedy = ", separate numbers by spaces"
    elif "," in text:
        remedy = ", write a decimal point"
    return f"{text!r} is not a {kind}{remedy}"


def _single_line(text: str) -> str:
    line = " ".join(text.split())
    line = _NO_FLOAT.sub(lambda found: not_a_number(found[2]), line)
    line = _NO_INTEGER.sub(lambda found: not_a_number(found[2], "whole number"), line)
    return line if len(line) <= _MAX_REASON else f"{line[:_MAX_REASON]} ..."


def _line_of(error: Exception) -> int | None:
    """Return the line at which a text parser stopped, if the exception states the line."""
    if isinstance(error, UnicodeDecodeError):
        return error.object[: error.start].count(b"\n") + 1
    mark = getattr(error, "problem_mark", None)  # YAML's, from 0
    if mark is not None:
        return int(mark.line) + 1
    position = getattr(error, "position", None)  # XML's
    return position[0] if isinstance(position, tuple) else getattr(error, "lineno", None)  # JSON's


def _check_size(path: Path, largest_mb: float, error: type[PolarsimError]) -> None:
    if path.is_file() and (size := path.stat().st_size) > largest_mb * MB:
        raise error(f"{size / MB:.0f} MB, expected at most {largest_mb:g} MB for a file of this kind")
