"""Logging of a process to a file or the terminal, and one-line error messages."""

from __future__ import annotations

import logging
import re
import resource
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from polarsim import progress
from polarsim.errors import PolarsimError
from polarsim.extras import ExtraError, extra_error

_USAGE = "took %.1f s, %.1f CPU s, at most %.0f MB"
USAGE_PATTERN = re.compile(r"^INFO took ([\d.]+) s, ([\d.]+) CPU s, at most (\d+) MB$", re.MULTILINE)


@contextmanager
def reporting(log: str | Path | None = None) -> Iterator[None]:
    """Log to an optional file; print a `PolarsimError` as one line and exit with code 1, a missing extra with code 2.

    Warnings are also printed, and without a file the progress of long loops. The last line of the file of a successful
    process states its duration, CPU time and peak memory.
    """
    start = time.perf_counter() - time.process_time()  # imports before this call take about as long as their CPU time
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
        if log:
            _log_usage(start)
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


def _log_usage(start: float) -> None:
    """Log the time since `start`, and CPU time and peak memory of this process and its finished child processes.

    Snakemake's `benchmark` reads the memory of all processes every 0.5 s, which takes 3 % of the CPU time of the demo.
    """
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    cpu_s = sum(usage.ru_utime + usage.ru_stime for usage in used)
    peak_mb = max(usage.ru_maxrss for usage in used) / 1024
    logging.getLogger("polarsim").info(_USAGE, time.perf_counter() - start, cpu_s, peak_mb)
