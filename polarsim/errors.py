"""Every error that a user can put right: one line with the position, what was found, and what was expected."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class PolarsimError(Exception):
    """Bad input. One line: where, what was found, what was expected. Anything else that is raised is a bug of ours.

    Code that needs the position asks the fields; the message is for people and may be worded anew.

    Parameters
    ----------
    reason
        What was found and what was expected, without the position.
    path
        The file or folder that is wrong; None where only the caller knows it, which says so with `about`.
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
    """A configuration that no run can have."""


class FormatError(PolarsimError):
    """A file is not what its format promises."""


class FetchError(PolarsimError):
    """A download failed, or brought something else than what was pinned."""


class RegistrationError(PolarsimError):
    """Scans, labels or meshes do not determine a pose."""


class ReconstructionError(PolarsimError):
    """A cloud does not determine a surface."""


class LabelError(PolarsimError):
    """Labels that contradict each other or the photo grid."""


class RenderError(PolarsimError):
    """A scene that cannot be rendered."""


class DetectError(PolarsimError):
    """A data set, detector or prediction that cannot be used."""


class RoverError(PolarsimError):
    """A soil, wheel or drive that the rover's physics cannot have."""


@contextmanager
def about(path: str | Path) -> Iterator[None]:
    """Name the file of a `PolarsimError` that the core raised, which knows arrays only. A file that is there stays."""
    try:
        yield
    except PolarsimError as error:
        if error.path is None:
            error.path = Path(path)
        raise


@contextmanager
def within(part: str) -> Iterator[None]:
    """Put what is no file, such as a position or a photo, in front of a `PolarsimError`'s reason."""
    try:
        yield
    except PolarsimError as error:
        error.reason = f"{part}: {error.reason}"
        raise
