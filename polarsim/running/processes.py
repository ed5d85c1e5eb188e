"""Who works in a folder: its owner by a lock, its jobs by a mark in their environment, other Snakemakes by their call.

The mark finds jobs that outlived the Snakemake that started them: no parent leads to them and no lock is theirs.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import signal
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from polarsim.errors import PolarsimError

MARK = "POLARSIM_RUN"  # in the environment of all that works for the run of a folder, with the folder as value
OWNER = ".snakemake/polarsim_run.pid"
_PROC = Path("/proc")
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36  # linux/prctl.h
_GRACE_S, _KILLED_S = 3.0, 10.0


@contextmanager
def owned(folder: Path) -> Iterator[None]:
    """Own a folder: nobody else does, and a process that dies owns nothing.

    Raises
    ------
    PolarsimError
        Another process owns the folder; its pid is named.
    """
    path = folder / OWNER
    with path.open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            file.seek(0)
            raise PolarsimError(f"polarsim run is at work here (pid {file.read().strip()})", path=folder) from error
        if workers := unmarked_snakemakes(folder):
            pids = ", ".join(map(str, workers))
            raise PolarsimError(f"snakemake is at work here (pid {pids}): await it, or end it", path=folder)
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        yield


def marked(folder: Path) -> list[int]:
    """Processes that work for the run of a folder, as far as this user may see them."""
    mark = f"{MARK}={folder}".encode()
    return [pid for pid in _others() if mark in _read(pid, "environ").split(b"\0")]


def unmarked_snakemakes(folder: Path) -> list[int]:
    """Snakemakes, and jobs of theirs, that somebody started without `polarsim run` in a folder that they locked."""
    if not any((folder / ".snakemake/locks").glob("*.lock")):
        return []
    found = []
    for pid in _others():
        words = _words(pid)
        ours = runs_script(pid) or any(Path(word).name == "snakemake" for word in words)
        if ours and Path(words[0]).name.startswith(("python", "snakemake")) and _cwd(pid) == folder:
            found.append(pid)
    return sorted(set(found) - set(marked(folder)))


def runs_script(pid: int) -> bool:
    """Whether a process runs the script of a job; not, if it is gone."""
    return any("/.snakemake/scripts/" in word for word in _words(pid))


def end(folder: Path) -> int:
    """End all that works for the run of a folder, first gently; how many processes that were."""
    found = marked(folder)
    send(found, signal.SIGTERM)
    if not _gone(folder, _GRACE_S):
        send(marked(folder), signal.SIGKILL)
        _gone(folder, _KILLED_S)
    return len(found)


def adopt_orphans() -> None:
    """Become the parent of what this process's children leave behind."""
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)


def die_with_parent() -> None:
    """Have this process killed when its parent ends, however that ends."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def children(parent: int) -> list[int]:
    """Children of a process, adopted ones too."""
    return [pid for pid in _others() if _parent(pid) == parent]


def _gone(folder: Path, seconds: float) -> bool:
    until = time.monotonic() + seconds
    while marked(folder):
        if time.monotonic() > until:
            return False
        time.sleep(0.05)
    return True


def send(pids: Iterable[int], number: int) -> None:
    """Send a signal to those of these processes that are still there."""
    for pid in pids:
        with suppress(ProcessLookupError, PermissionError):
            os.kill(pid, number)


def end_adopted(own: int) -> None:
    """Kill what a killed process left to this one: all children but the one that it started."""
    for pid in children(os.getpid()):
        if pid != own:
            send([pid], signal.SIGKILL)
            with suppress(ChildProcessError):
                os.waitpid(pid, os.WNOHANG)


def _others() -> Iterator[int]:
    """All processes but this one and those above it."""
    above = set()
    pid = os.getpid()
    while pid > 0 and pid not in above:
        above.add(pid)
        pid = _parent(pid)
    for path in _PROC.iterdir():
        if path.name.isdigit() and int(path.name) not in above:
            yield int(path.name)


def _words(pid: int) -> list[str]:
    """The first words of a process's command: interpreter, options, script."""
    return [word.decode(errors="replace") for word in _read(pid, "cmdline").split(b"\0")[:3]]


def _parent(pid: int) -> int:
    """The parent of a process; 0 where it is gone or has none."""
    stat = _read(pid, "stat").rpartition(b")")[2].split()
    return int(stat[1]) if len(stat) > 1 else 0


def _read(pid: int, name: str) -> bytes:
    """A file of a process; empty where it is gone or another user's."""
    try:
        return (_PROC / str(pid) / name).read_bytes()
    except OSError:
        return b""


def _cwd(pid: int) -> Path | None:
    try:
        return (_PROC / str(pid) / "cwd").readlink()
    except OSError:
        return None


def _prctl(option: int, value: int) -> None:
    """No such call, as on other systems than Linux, is no error: jobs are found by their mark at the next start."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)
