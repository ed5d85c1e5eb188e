"""Processes of a run: lock of the folder, Snakemake and its jobs, and remaining jobs of a killed run."""

from __future__ import annotations

import ctypes
import fcntl
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

import psutil

from polarsim.errors import PolarsimError

MARK = "POLARSIM_RUN"  # environment variable of all processes of a run; the value is the folder
OWNER = ".snakemake/polarsim_run.pid"  # contains a pid while a run is active, and after it was killed
_LOCKS = ".snakemake/locks"  # of Snakemake
_PR_SET_PDEATHSIG = 1  # linux/prctl.h
_GRACE_S = 3.0  # between SIGTERM and SIGKILL
_STOPS = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
_CANCEL_S = 30.0  # for Snakemake to cancel the jobs that it submitted to a cluster
_POLL_S = 0.2  # between checks for a signal
_WATCH_S, _WATCH_SHARE = 1.0, 0.02  # between updates of the progress; maximum share of the time of a core


@contextmanager
def folder_lock(folder: Path) -> Iterator[bool]:
    """Lock a folder for one run; yield whether the last run of the folder was killed.

    Raises
    ------
    PolarsimError
        The folder is locked by another run, or by a Snakemake that was not started by `polarsim run`.
    """
    path = folder / OWNER
    with path.open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            file.seek(0)
            raise PolarsimError(
                f"polarsim run is active in this folder (pid {file.read().strip()})", path=folder
            ) from error
        file.seek(0)
        killed = bool(file.read().strip())
        if is_locked(folder) and not killed:
            reason = "Snakemake has locked this folder; wait until it ends, or remove the lock: snakemake --unlock"
            raise PolarsimError(reason, path=folder)
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        yield killed
        if not is_locked(folder):
            file.truncate(0)


def supervise(
    folder: Path, words: Sequence[str], watch: Callable[[], None], write: Callable[[str], None], output: Path | None
) -> tuple[int, bool]:
    """Run Snakemake in its own process group; return its exit code and whether a signal stopped it.

    `watch` is called about every second; `write` prints a line; `output` is a file for the output of Snakemake.
    Each of `_STOPS` sends SIGINT to the group, like Ctrl-C in a terminal. At the end the group is killed.
    """
    caught: list[int] = []
    before = {number: signal.signal(number, lambda number, _: caught.append(number)) for number in _STOPS}
    try:
        environment = {**os.environ, MARK: str(folder)}
        with output.open("wb") if output else nullcontext() as file:
            child = subprocess.Popen(
                words, env=environment, start_new_session=True, preexec_fn=die_with_parent,
                stdout=file, stderr=subprocess.STDOUT if file else None,
            )  # fmt: skip
        try:
            until, due = float("inf"), 0.0
            while child.poll() is None and time.monotonic() < until:
                if caught and until == float("inf"):
                    until = time.monotonic() + _CANCEL_S
                    write("polarsim run: stopping; the same command resumes the run")
                    os.killpg(child.pid, signal.SIGINT)
                with suppress(subprocess.TimeoutExpired):
                    child.wait(_POLL_S)
                if (began := time.monotonic()) >= due:
                    watch()
                    due = time.monotonic() + max(_WATCH_S, (time.monotonic() - began) / _WATCH_SHARE)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
        return child.wait(), bool(caught)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def is_locked(folder: Path) -> bool:
    """Return whether a folder has locks of Snakemake, active or killed."""
    return any((folder / _LOCKS).glob("*.lock"))


def remove_locks(folder: Path) -> None:
    """Remove the locks of a killed Snakemake, as `snakemake --unlock` does after it has read the workflow."""
    for path in (folder / _LOCKS).glob("*.lock"):
        path.unlink(missing_ok=True)


def die_with_parent() -> None:
    """Let Linux kill this process when the parent ends; on other systems, the next run ends this process."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def processes_of_run(folder: Path) -> list[psutil.Process]:
    """Return the processes of the run of a folder on this machine, without this process and its parents."""
    excluded = {process.pid for process in (psutil.Process(), *psutil.Process().parents())}
    found = [process for process in psutil.process_iter(["environ"]) if process.pid not in excluded]
    return [process for process in found if (process.info["environ"] or {}).get(MARK) == str(folder)]


def end_processes(folder: Path) -> int:
    """End all processes of the run of a folder; return their number."""
    found = processes_of_run(folder)
    for process in found:
        with suppress(psutil.NoSuchProcess):
            process.terminate()
    _, alive = psutil.wait_procs(found, timeout=_GRACE_S)
    for process in alive:
        with suppress(psutil.NoSuchProcess):
            process.kill()
    psutil.wait_procs(alive, timeout=_GRACE_S)
    return len(found)
