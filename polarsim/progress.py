"""Progress of long loops: a bar on a terminal, otherwise log lines."""

from __future__ import annotations

import logging
import math
import sys
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

Item = TypeVar("Item")
LINE_S = 30.0  # between lines of progress without a terminal
MIN_SHARE = 0.02  # of the work for an estimate of the time left; the first item includes compilations
_bars: list[Any] = []  # the bars that are shown
log = logging.getLogger(__name__)  # commands print its messages, see `reporting`


def track(items: Collection[Item], text: str) -> Iterator[Item]:
    """Yield the items and show the progress."""
    with progress_bar(text) as report:
        for number, item in enumerate(items, 1):
            yield item
            report(number / len(items))


@contextmanager
def progress_bar(text: str) -> Iterator[Callable[[float], None]]:
    """Yield a function that shows the completed share, 0 to 1, of the work."""
    if sys.stderr.isatty():
        with _terminal_bars() as bars:
            task = bars.add_task(text, total=1.0)
            yield lambda share: bars.update(task, completed=share)
        return
    start = shown = time.monotonic()

    def report(share: float) -> None:
        nonlocal shown
        now = time.monotonic()
        if 0 < share < 1 and now - shown >= LINE_S:
            shown = now
            left = f", {about((now - start) * (1 - share) / share)} left" if share >= MIN_SHARE else ""
            log.info("%s: %d %%%s", text, 100 * share, left)

    yield report


@contextmanager
def _terminal_bars() -> Iterator[Any]:
    """Yield the bars on the terminal. A bar inside another is a further line; separate displays would overwrite it."""
    from rich.console import Console
    from rich.progress import Progress

    if _bars:
        yield _bars[0]
        return
    with Progress(console=Console(stderr=True)) as bars:
        _bars.append(bars)
        try:
            yield bars
        finally:
            _bars.clear()


def about(seconds: float) -> str:
    """Return a rounded duration for messages: `about 40 s`, `about 6 min`, `about 2.5 h`."""
    if seconds <= 50:
        return f"about {10 * max(1, math.ceil(seconds / 10))} s"
    return f"about {round(seconds / 60)} min" if seconds < 5400 else f"about {seconds / 3600:.1f} h"
