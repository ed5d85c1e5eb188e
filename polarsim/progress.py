"""Progress where a person waits: a bar on a terminal, a log line now and then elsewhere."""

from __future__ import annotations

import logging
import sys
from collections.abc import Collection, Iterator
from typing import TypeVar

Item = TypeVar("Item")
log = logging.getLogger("polarsim")


def track(items: Collection[Item], text: str) -> Iterator[Item]:
    """Yield the items and show how far one is."""
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
