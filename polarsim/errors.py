"""Errors that a user can correct: one line with the position, the problem and the expected input."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class PolarsimError(Exception):
    """Invalid input, reported as one line. Every other exception is a bug.

    Code reads the position from the fields, because the wording of the message may change.

    Parameters
    ----------
    reason
        The problem and the expected input, without the position.
    path
        The invalid file or folder; None if only the caller knows the path and adds it with `with_path`.
    line
        Line of the file, from 1.
    """

    def __init__(self, reason: str, path: str | Path | None = None, line: int | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.path = None if path is None else Path(path)
        self.line = line

    def __str__(self) -> str:
        where = [] if self.path is None else [str(self.path)]
        where += [] if self.line is None else [str(self.line)]
        return f"{':'.join(where)}: {self.reason}" if where else self.reason


class ConfigError(PolarsimError):
    """Invalid configuration."""


class FormatError(PolarsimError):
    """A file violates its format."""


class FetchError(PolarsimError):
    """A download failed, or the file does not match the pinned checksum."""


class RegistrationError(PolarsimError):
    """Scans, labels or meshes do not determine a pose."""


class ReconstructionError(PolarsimError):
    """A cloud does not determine a surface."""


class LabelError(PolarsimError):
    """Labels that are inconsistent with each other or with the photo grid."""


class RenderError(PolarsimError):
    """A scene that cannot be rendered."""


class DetectError(PolarsimError):
    """A data set, detector or prediction that cannot be used."""


class RoverError(PolarsimError):
    """A soil, wheel or drive that the rover physics does not support."""


@contextmanager
def with_path(path: str | Path) -> Iterator[None]:
    """Add a path to a `PolarsimError` without path, for example of a function that processes arrays only."""
    try:
        yield
    except PolarsimError as error:
        if error.path is None:
            error.path = Path(path)
        raise


@contextmanager
def with_part(part: str) -> Iterator[None]:
    """Add the name of a part, such as a position or a photo, to the reason of a `PolarsimError`."""
    try:
        yield
    except PolarsimError as error:
        error.reason = f"{part}: {error.reason}"
        raise
