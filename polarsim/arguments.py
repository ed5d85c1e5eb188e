"""Checks of command-line arguments before any work: finite numbers, writable paths, existing runs.

Each check ends the call with one line: `typer.BadParameter` (exit code 2) for a usage error, `PolarsimError` (exit
code 1) for an invalid or missing file or folder.
"""

from __future__ import annotations

import math
import os
import re
import sys
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from inspect import cleandoc
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand

from polarsim.errors import PolarsimError

Check = Callable[[Path | None], Path | None]
PLOTS = (".eps", ".jpg", ".jpeg", ".pdf", ".pgf", ".png", ".ps", ".svg", ".tif", ".tiff", ".webp")  # of matplotlib
STOPPED = 130  # exit code of a shell: 128 + number of SIGINT
_SHOWN_RUNS = 10


class CheckedCommand(TyperCommand):
    """Command that rejects `nan` and `inf`, which the parser accepts as floats, and joins wrapped lines of help."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.help = join_wrapped(self.help or "")

    def invoke(self, ctx: Any) -> Any:
        for name, value in ctx.params.items():
            for number in value if isinstance(value, tuple | list) else (value,):
                if isinstance(number, float) and not math.isfinite(number):
                    raise typer.BadParameter(f"{number} is not a finite number", ctx, param_hint=_hint(ctx, name))
        return super().invoke(ctx)


def join_wrapped(text: str) -> str:
    """Return a docstring in which a line only ends at the end of a sentence; typer keeps all ends of lines."""
    return re.sub(r"(?<![.:\n])\n(?=\S)", " ", cleandoc(text))


def _hint(ctx: Any, name: str) -> str:
    (param,) = [param for param in ctx.command.params if param.name == name]
    return " / ".join(f"'{option}'" for option in param.opts) if param.opts else name


def writes_file(*suffixes: str) -> Check:
    """Return a check that a file can be written and has one of these extensions (default: any)."""

    def check(path: Path | None) -> Path | None:
        if path is None:
            return None
        if _is_dir(path):
            raise typer.BadParameter(f"{path} is a folder, expected a file name")
        if suffixes and path.suffix.lower() not in suffixes:
            raise typer.BadParameter(f"{path} has the extension {path.suffix!r}, expected {' or '.join(suffixes)}")
        _refuse_unwritable(path.parent)
        return path

    return check


def writes_folder(path: Path | None) -> Path | None:
    """Check that a folder can be written."""
    if path is not None:
        _refuse_unwritable(path)
    return path


def refuse_existing_folder(path: Path) -> None:
    """Raise `BadParameter` if the path of an accompanying file is a folder."""
    if _is_dir(path):
        raise typer.BadParameter(f"{path} is a folder, expected a file name")


def _refuse_unwritable(folder: Path) -> None:
    """Raise `BadParameter` if a folder or a parent of it is a file or is not writable."""
    for level in (folder, *folder.parents):
        if _is_dir(level):
            if not os.access(level, os.W_OK | os.X_OK):
                raise typer.BadParameter(f"{level} is not writable")
            return
        if level.exists():
            raise typer.BadParameter(f"{level} is a file, expected a folder")


def _is_dir(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError as error:  # a name that is too long
        raise typer.BadParameter(f"{str(path)[:80]}: {error.strerror}") from error


def sun_above_horizon(sun: tuple[float, float] | None) -> tuple[float, float] | None:
    """Check azimuth and elevation of the Sun, degrees."""
    if sun is not None and not 0 < sun[1] <= 90:
        raise typer.BadParameter(f"elevation {sun[1]:g} deg, expected more than 0 and at most 90")
    return sun


def run_folder(results: Path, run: str) -> Path:
    """Return the folder of a run."""
    folder = results / run
    if run and run == Path(run).name and _is_dir(folder):
        return folder
    if not _is_dir(results):
        raise PolarsimError(
            "no such folder of results; set it with --results, or start in the folder that contains `results/`",
            path=results,
        )
    raise PolarsimError(f"no run {run!r}; {_listed(run, runs_in(results))}", path=results)


def runs_in(results: Path) -> list[str]:
    return sorted(path.name for path in results.iterdir() if path.is_dir() and not path.name.startswith("."))


def _listed(name: str, runs: Iterable[str]) -> str:
    """Return a list of existing runs for a message, similar names first."""
    runs = list(runs)
    if not runs:
        return "no run exists yet: create it with polarsim run"
    near = get_close_matches(name, runs)
    ordered = [*near, *(run for run in runs if run not in near)]
    return f"existing runs: {', '.join(ordered[:_SHOWN_RUNS])}{', ...' if len(ordered) > _SHOWN_RUNS else ''}"


def call(app: typer.Typer) -> int:
    """Run the command and return the exit code; print a usage error as one line."""
    try:
        code = app(prog_name="polarsim", standalone_mode=False)  # returns 130 after Ctrl-C
    except typer.TyperException as error:
        context = getattr(error, "ctx", None)
        hint = f" ({context.command_path} --help)" if context else ""
        sys.stderr.write(f"error: {' '.join(error.format_message().split()).rstrip('.')}{hint}\n")
        return error.exit_code
    except typer.Abort:
        return 1
    except OSError as error:  # of a user's file: no permission, no space, file name too long
        if error.filename is None:
            raise
        raise PolarsimError(error.strerror or str(error), path=str(error.filename)[:200]) from error
    if code == STOPPED:
        sys.stderr.write("stopped by the user\n")
    return code if isinstance(code, int) else 0
