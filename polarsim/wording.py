"""Wording of messages: plural forms, and commands for a shell."""

import shlex
from collections.abc import Iterable
from pathlib import Path


def counted(number: int, noun: str) -> str:
    """Return a number and a noun that is plural unless the number is one, such as `1 rock` and `0 rocks`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def run_command(files: Iterable[str | Path], targets: Iterable[str] = (), settings: Iterable[str] = ()) -> str:
    """Return the command that runs the workflow with configuration files and settings `KEY=VALUE`, for a shell."""
    options = [word for file in files for word in ("--configfile", str(file))]
    options += [word for setting in settings for word in ("--config", setting)]
    return shlex.join(["polarsim", "run", *targets, *options])
