"""Progress of a run on the terminal: one live line per stage, or a line every 30 seconds if the output is a file."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

from rich.console import Console
from rich.live import Live
from rich.text import Text

from polarsim.progress import LINE_S, about
from polarsim.running.stages import RunProgress, clock

_WIDTH = 100  # of lines in a file, characters


class RunDisplay:
    """Lines of progress on a stream; errors of a closed terminal are ignored."""

    def __init__(self, progress: RunProgress, stream: TextIO, live: Live | None, next_s: float = 0) -> None:
        self._progress, self._stream, self._live = progress, stream, live
        self._next_s = next_s

    def update(self) -> None:
        """Show the progress: live lines, or a line if 30 seconds have passed since the last line."""
        with suppress(OSError):
            if self._live:
                stages = [*self._progress.stages(), self._progress.total()]
                lines = [stage.line() for stage in stages if stage.jobs] or ["planning the jobs"]
                self._live.update(Text("\n".join(lines), no_wrap=True, overflow="ellipsis"), refresh=True)
            elif self._progress.elapsed_s >= self._next_s:
                self._next_s += LINE_S * (1 + (self._progress.elapsed_s - self._next_s) // LINE_S)
                self._stream.write(f"{progress_line(self._progress)}\n")
                self._stream.flush()

    def write(self, line: str) -> None:
        """Write a line above the live lines."""
        with suppress(OSError):
            if self._live:
                self._live.console.print(line, markup=False, highlight=False)
            else:
                self._stream.write(f"{line}\n")
                self._stream.flush()


@contextmanager
def showing(progress: RunProgress, stream: TextIO, *, is_silent: bool = False) -> Iterator[RunDisplay]:
    """Yield the display of a run on a stream. Live lines remain on the terminal; a file gets the stages at the end."""
    if stream.isatty() and not is_silent:
        live = Live(console=Console(file=stream), auto_refresh=False, redirect_stdout=False, redirect_stderr=False)
        with suppress(OSError):
            live.start()
        try:
            yield RunDisplay(progress, stream, live)
        finally:
            with suppress(OSError):
                live.stop()
        return
    display = RunDisplay(progress, stream, None, float("inf") if is_silent else LINE_S)
    yield display
    for stage in [] if is_silent else progress.stages():
        display.write(f"{stage.name:14} {stage.done:>4} of {stage.jobs:>4} jobs {clock(stage.elapsed_s):>8}")


def progress_line(progress: RunProgress) -> str:
    """Return the progress of a run with the unfinished stages in one line."""
    total = progress.total()
    if not total.jobs:
        return f"{clock(total.elapsed_s)}: planning the jobs"
    left = f", {about(total.left_s)} left" if total.done < total.jobs else ""
    failed = f", {total.failed} failed" if total.failed else ""
    active = [f"{one.name} {one.done}/{one.jobs}" for one in progress.stages() if one.running]
    text = f"{clock(total.elapsed_s)}: {total.done} of {total.jobs} jobs{failed}{left}: {', '.join(active)}"
    return textwrap.shorten(text.rstrip(": "), shutil.get_terminal_size((_WIDTH, 0)).columns - 1, placeholder=" ...")
