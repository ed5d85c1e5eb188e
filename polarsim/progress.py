"""Progress of long loops: a bar on a terminal, otherwise log lines."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import TypeVar

Item = TypeVar("Item")
log = logging.getLogger("polarsim")


def track(items: Collection[Item], text: str) -> Iterator[Item]:
    """Yield the items and show the progress."""
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import track as rich_track

        yield from rich_track(items, description=text, console=Console(stderr=True))
        return
    step = max(1, len(items) // 10)
    for number, item in enumerate(items, 1):
        yield item
        if number % step == 0 or number == len(items):
            log.info("%s: %d of %d", text, number, len(items))


@contextmanager
def progress_bar(text: str) -> Iterator[Callable[[float], None]]:
    """Yield a function that shows the completed share, 0 to 1, of work without countable items."""
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import Progress

        with Progress(console=Console(stderr=True)) as bars:
            task = bars.add_task(text, total=1.0)
            yield lambda share: bars.update(task, completed=share)
        return
    tenths = 0

    def report(share: float) -> None:
        nonlocal tenths
        if int(10 * share) > tenths:
            tenths = int(10 * share)
            log.info("%s: %d %%", text, 10 * tenths)

    yield report
