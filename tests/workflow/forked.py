"""Snakemake and jobs as forks of a process that has imported all modules, shared by all tests; see `running.forks`."""

from __future__ import annotations

import importlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
from filelock import FileLock

from polarsim.digest import script_digest
from polarsim.running import forks

LONGEST_S = 1800  # timeout of a command, also on busy machines
CHECKOUT = Path(__file__).parents[2]
PLAN = (  # imported by each plan
    "snakemake.cli", "nbformat", "smart_open", "snakemake.report.html_reporter", "yte", "polarsim.running.run",
)  # fmt: skip


class Server:
    """A server of forks with the modules of all scripts and of Snakemake; started by the first call of all workers.

    `folder` is the same in all workers. The server ends with `owner`, the process that outlives all workers.
    """

    def __init__(self, folder: Path, owner: int, hash_seed: str | None = None) -> None:
        self._folder, self._owner = folder, owner
        self._environment = os.environ | ({} if hash_seed is None else {"PYTHONHASHSEED": hash_seed})
        self.python = folder / "python"

    def start(self) -> None:
        self._folder.mkdir(exist_ok=True)
        with FileLock(self._folder / "lock"):
            if not self.python.exists():
                self._start()

    def _start(self) -> None:
        address = Path(tempfile.mkdtemp(prefix="forked"), "socket")  # the path of a socket has at most 107 characters
        process = subprocess.Popen(
            [sys.executable, "-c", _SERVE, str(address), str(self._owner)], cwd=CHECKOUT, env=self._environment
        )
        while not address.exists():
            assert process.poll() is None, "the server of forks ended at its start"
            time.sleep(0.05)
        forks.write_client(self.python, address)

    def call(
        self, folder: Path, arguments: list[str], environment: dict[str, str], module: str = "snakemake"
    ) -> subprocess.CompletedProcess:
        """Run `python -m MODULE ARGUMENTS` in a folder; return exit code and output."""
        self.start()
        return subprocess.run(
            [str(self.python), "-m", module, *arguments],
            cwd=folder, env=environment, capture_output=True, text=True, timeout=LONGEST_S,
        )  # fmt: skip


_SERVE = "import sys; from tests.workflow.forked import serve; serve(sys.argv[1], int(sys.argv[2]))"


def serve(address: str, owner: int) -> None:
    """Serve forks until the process `owner` ends."""
    forks.serve(Path(address), prepare, lambda: psutil.pid_exists(owner))
    shutil.rmtree(Path(address).parent, ignore_errors=True)


def prepare() -> None:
    """Import the modules of scripts and plans, and compute the digests of all scripts, which every plan needs."""
    forks.import_scripts()
    for name in PLAN:
        importlib.import_module(name)
    # The allocator of pyarrow restarts its thread in forks.
    threads = {task.joinpath("comm").read_text().strip() for task in Path("/proc/self/task").iterdir()}
    assert all(re.match("python|jemalloc_bg_thd", thread) for thread in threads), f"forks lack the threads {threads}"
    for script in (CHECKOUT / "workflow/scripts").glob("*.py"):
        script_digest(script)
