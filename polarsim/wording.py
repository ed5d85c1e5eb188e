"""Wording of messages: plural forms, enumerations, and commands for a shell."""

import shlex
from collections.abc import Iterable
from pathlib import Path


def counted(number: int, noun: str) -> str:
    """Return a number and a noun that is plural unless the number is one, such as `1 rock` and `0 rocks`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def enumerated(names: Iterable[object]) -> str:
    """Return names as `a, b and c`."""
    return _joined(names, "and")


def alternatives(names: Iterable[object]) -> str:
    """Return names as `a, b or c`."""
    return _joined(names, "or")


def _joined(names: Iterable[object], conjunction: str) -> str:
    *others, last = map(str, names)
    return f"{', '.join(others)} {conjunction} {last}" if others else last


def run_command(files: Iterable[str | Path], targets: Iterable[str] = (), settings: Iterable[str] = ()) -> str:
    """Return the command that runs the workflow with configuration files and settings `KEY=VALUE`, for a shell."""
    options = [word for file in files for word in ("--configfile", str(file))]
    options += [word for setting in settings for word in ("--config", setting)]
    return shlex.join(["polarsim", "run", *targets, *options])
