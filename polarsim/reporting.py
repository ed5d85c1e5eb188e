"""Logging of a process to a file or the terminal, and one-line error messages."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from polarsim import progress
from polarsim.errors import PolarsimError
from polarsim.extras import ExtraError, extra_error


@contextmanager
def reporting(log: str | Path | None = None) -> Iterator[None]:
    """Log to an optional file; print a `PolarsimError` as one line and exit with code 1, a missing extra with code 2.

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
    except (PolarsimError, ImportError) as error:
        message = extra_error(error) if isinstance(error, ImportError) else error
        if message is None:
            raise
        logging.getLogger("polarsim").info("stopped: %s", message)
        sys.stderr.write(f"error: {message}\n")
        sys.exit(2 if isinstance(message, ExtraError) else 1)
    except KeyboardInterrupt:
        sys.stderr.write("stopped by the user\n")
        sys.exit(130)
