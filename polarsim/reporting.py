"""Logging of a process to a file or the terminal, and one-line error messages."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from polarsim import progress
from polarsim.errors import PolarsimError

_EXTRAS = {  # extra of each optional module
    **dict.fromkeys(("torch", "torchvision", "ultralytics"), "detect"),
    **dict.fromkeys(("av", "gymnasium", "mcap", "mcap_ros2", "mujoco", "rasterio", "rosbags"), "rover"),
}


@contextmanager
def reporting(log: str | Path | None = None) -> Iterator[None]:
    """Log to an optional file; print a `PolarsimError` or a missing extra as one line and exit with code 1.

    Warnings are also printed, and without a file the progress of long loops.
    """
    handlers: list[logging.Handler] = [logging.StreamHandler()]
    handlers[0].addFilter(
        lambda record: record.levelno >= logging.WARNING or (log is None and record.name == progress.log.name)
    )
    if log:
        Path(log).parent.mkdir(parents=True, exist_ok=True)
        handlers.append(logging.FileHandler(log, mode="w", encoding="utf-8"))
    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(message)s", handlers=handlers, force=True)
    try:
        yield
    except (PolarsimError, ModuleNotFoundError) as error:
        message: object = error
        if isinstance(error, ModuleNotFoundError):
            if (extra := _EXTRAS.get((error.name or "").partition(".")[0])) is None:
                raise
            message = f"{error.name} is not installed: pip install 'polarsim[{extra}]'"
        logging.getLogger("polarsim").info("stopped: %s", message)
        sys.stderr.write(f"error: {message}\n")
        sys.exit(1)
    except KeyboardInterrupt:
        sys.stderr.write("stopped by the user\n")
        sys.exit(130)
