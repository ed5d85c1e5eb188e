"""What arguments of the command must be, checked before any work: finite numbers, places to write, runs that are there.

Everything here ends a call in one line: `typer.BadParameter` (exit code 2) where the call itself cannot be,
`PolarsimError` (exit code 1) where a file or folder is not what it should be.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand

from polarsim.errors import PolarsimError

Check = Callable[[Path | None], Path | None]
PLOTS = (".eps", ".jpg", ".jpeg", ".pdf", ".pgf", ".png", ".ps", ".svg", ".tif", ".tiff", ".webp")  # of matplotlib
STOPPED = 130  # as a shell has it: 128 and the number of SIGINT
_SHOWN_RUNS = 10
_EXTRAS = {  # what brings a module that polarsim does without
    **dict.fromkeys(("torch", "torchvision", "ultralytics"), "detect"),
    **dict.fromkeys(("av", "gymnasium", "mcap", "mcap_ros2", "mujoco", "rasterio", "rosbags"), "rover"),
}


class Checked(TyperCommand):
    """A command whose numbers are finite: `nan` and `inf` are floats to a parser, and nobody's exposure."""

    def invoke(self, ctx: Any) -> Any:
        for name, value in ctx.params.items():
            for number in value if isinstance(value, tuple | list) else (value,):
                if isinstance(number, float) and not math.isfinite(number):
                    raise typer.BadParameter(f"{number} is no finite number", ctx, param_hint=_hint(ctx, name))
        return super().invoke(ctx)


def _hint(ctx: Any, name: str) -> str:
    (param,) = [param for param in ctx.command.params if param.name == name]
    return " / ".join(f"'{option}'" for option in param.opts) if param.opts else name


def writes_file(*suffixes: str) -> Check:
    """A check that a file of one of these endings (any when none is named) can be written there."""

    def check(path: Path | None) -> Path | None:
        if path is None:
            return None
        if _is_dir(path):
            raise typer.BadParameter(f"{path} is a folder, expected the name of a file to write")
        if suffixes and path.suffix.lower() not in suffixes:
            raise typer.BadParameter(f"{path} ends in {path.suffix or 'nothing'!r}, expected {' or '.join(suffixes)}")
        _refuse_unwritable(path.parent)
        return path

    return check


def writes_folder(path: Path | None) -> Path | None:
    """Check that a folder can be written there."""
    if path is not None:
        _refuse_unwritable(path)
    return path


def refuse_existing_folder(path: Path) -> None:
    """End where a file that goes with another one cannot be written."""
    if _is_dir(path):
        raise typer.BadParameter(f"{path} is a folder, and a file of that name is to be written")


def _refuse_unwritable(folder: Path) -> None:
    """End where a folder is a file, lies below one, or may not be written."""
    for level in (folder, *folder.parents):
        if _is_dir(level):
            if not os.access(level, os.W_OK | os.X_OK):
                raise typer.BadParameter(f"{level} may not be written")
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
    """The folder of a run.

    Raises
    ------
    PolarsimError
        There is none of that name; the message lists those that are there.
    """
    folder = results / run
    if run and run == Path(run).name and _is_dir(folder):
        return folder
    if not _is_dir(results):
        raise PolarsimError("no such folder of results; --results names it, or start where `results/` is", path=results)
    raise PolarsimError(f"no run {run!r}; {_listed(run, runs_in(results))}", path=results)


def runs_in(results: Path) -> list[str]:
    return sorted(path.name for path in results.iterdir() if path.is_dir() and not path.name.startswith("."))


def _listed(name: str, runs: Iterable[str]) -> str:
    """The runs that are there, those with a name like this first."""
    runs = list(runs)
    if not runs:
        return "there are no runs yet: polarsim run makes them"
    near = get_close_matches(name, runs)
    ordered = [*near, *(run for run in runs if run not in near)]
    return f"there are {', '.join(ordered[:_SHOWN_RUNS])}{', ...' if len(ordered) > _SHOWN_RUNS else ''}"


def call(app: typer.Typer) -> int:
    """Run the command and return its exit code; a call that cannot be is one line on the terminal."""
    try:
        code = app(prog_name="polarsim", standalone_mode=False)  # which ends with 130 where Ctrl-C was pressed
    except typer.TyperException as error:
        context = getattr(error, "ctx", None)
        hint = f" ({context.command_path} --help)" if context else ""
        sys.stderr.write(f"error: {' '.join(error.format_message().split()).rstrip('.')}{hint}\n")
        return error.exit_code
    except typer.Abort:
        return 1
    except ModuleNotFoundError as error:
        if (extra := _EXTRAS.get((error.name or "").partition(".")[0])) is None:
            raise
        raise PolarsimError(f"{error.name} is not installed: pip install 'polarsim[{extra}]'") from error
    except OSError as error:  # of a file that the user named: no permission, no space, a name that is too long
        if error.filename is None:
            raise
        raise PolarsimError(error.strerror or str(error), path=str(error.filename)[:200]) from error
    if code == STOPPED:
        sys.stderr.write("stopped by the user\n")
    return code if isinstance(code, int) else 0
