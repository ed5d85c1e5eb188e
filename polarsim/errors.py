"""Every error that a user can put right: one line with the place, what was found, and what was expected."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class PolarsimError(Exception):
    """Bad input. One line: where, what was found, what was expected. Anything else that is raised is a bug of ours."""


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
    """A data set, judge or prediction that cannot be used."""


class RoverError(PolarsimError):
    """A soil, wheel or drive that the rover's physics cannot have."""


@contextmanager
def about(path: str | Path) -> Iterator[None]:
    """Put the file's name in front of a `PolarsimError` that the core raised: the core knows arrays only."""
    try:
        yield
    except PolarsimError as error:
        if str(path) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error
