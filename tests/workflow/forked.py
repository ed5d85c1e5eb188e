"""Snakemake and jobs as forks of a process that has imported all modules: imports take half of the time of a small job.

The server forks for every command. The client replaces the Python interpreter: it is `sys.executable` of a forked
Snakemake, which starts scripts with it. Otherwise jobs run as usual: the same scripts in separate processes.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import re
import runpy
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

LONGEST_S = 1800  # timeout of a command, also on busy machines
CHECKOUT = Path(__file__).parents[2]
LATE = (  # imported inside functions; the last four by each plan
    "open3d", "snakemake.cli", "torch._dynamo", "nbformat", "smart_open", "snakemake.report.html_reporter", "yte",
)  # fmt: skip


class Server:
    """A process that has imported the modules of all scripts and forks; started by the first call of all workers.

    `folder` is the same in all workers. The server ends with `owner`, the process that outlives all workers.
    """

    def __init__(self, folder: Path, owner: int, hash_seed: str | None = None) -> None:
        self._folder, self._owner = folder, owner
        self._environment = os.environ | ({} if hash_seed is None else {"PYTHONHASHSEED": hash_seed})
        self.python = folder / "python"

    def start(self) -> None:
        from filelock import FileLock  # the client has no site packages

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
            assert process.poll() is None, "the server that forks ended at its start"
            time.sleep(0.05)
        # Options for a fast start of the client: no site packages, no environment.
        words = (sys.executable, "-I", "-S", __file__, str(address), str(self.python), sys.executable)
        script = self.python.with_suffix(".new")
        script.write_text(f'#!/bin/sh\nexec {shlex.join(words)} "$@"\n')
        script.chmod(0o755)
        script.rename(self.python)

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
    """Import the modules of all rules and scripts, then fork for every connection until the process `owner` ends."""
    from polarsim.digest import script_digest  # the client has no site packages

    scripts = list((CHECKOUT / "workflow/scripts").glob("*.py"))
    texts = "".join(path.read_text() for path in [*scripts, *(CHECKOUT / "workflow/rules").glob("*.smk")])
    imported = set(re.findall(r"^from (polarsim\S*) import", texts, re.MULTILINE))
    for name in sorted({*imported, *LATE}):
        importlib.import_module(name)
    for script in scripts:
        script_digest(script)  # the digests of modules are cached, and every plan needs them
    gc.freeze()  # collections of forks skip these objects and do not copy their memory
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(f"{address}.new")
        server.listen(64)
        Path(f"{address}.new").rename(address)  # the socket accepts connections before the file appears
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # forks are not awaited
        server.settimeout(2)
        while _exists(owner):
            try:
                connection, _ = server.accept()
            except TimeoutError:
                continue
            if os.fork() == 0:
                server.close()
                _answer(connection)
            connection.close()
    shutil.rmtree(Path(address).parent, ignore_errors=True)


def _exists(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def _answer(connection: socket.socket) -> None:
    """Run the command of a client with its folder, environment and outputs, and send the exit code."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    message, descriptors, _, _ = socket.recv_fds(connection, 1 << 20, 3)
    asked = json.loads(message)
    for number, descriptor in enumerate(descriptors):
        os.dup2(descriptor, number)
        os.close(descriptor)
    os.environ.clear()
    os.environ.update(asked["environment"])
    os.chdir(asked["folder"])
    code = 1
    try:
        code = _run(asked["python"], asked["arguments"])
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        connection.sendall(bytes([code]))
        os._exit(code)


def _run(python: str, arguments: list[str]) -> int:
    """Run `python ARGUMENTS` of a script, of Snakemake or of Sphinx; return the exit code."""
    sys.executable = python
    try:
        if arguments[0] == "-m":
            sys.argv = arguments[1:]
            runpy.run_module(arguments[1], run_name="__main__", alter_sys=True)
        else:
            sys.argv = arguments
            runpy.run_path(arguments[0], run_name="__main__")
    except SystemExit as ended:
        if isinstance(ended.code, str):
            print(ended.code, file=sys.stderr)
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except BaseException:
        sys.excepthook(*sys.exc_info())
        return 1
    return 0


def client(address: str, itself: str, python: str, arguments: list[str]) -> int:
    """Run `python ARGUMENTS` on the server, with `itself` as interpreter; return the exit code."""
    if arguments[:2] not in (["-m", "snakemake"], ["-m", "sphinx"]) and not arguments[0].endswith(".py"):
        os.execv(python, [python, *arguments])
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(address)
        asked = {
            "python": itself, "arguments": arguments, "folder": str(Path.cwd()), "environment": dict(os.environ),
        }  # fmt: skip
        socket.send_fds(connection, [json.dumps(asked).encode()], [0, 1, 2])
        code = connection.recv(1)
    return code[0] if code else 128 + signal.SIGKILL


if __name__ == "__main__":
    sys.exit(client(*sys.argv[1:4], sys.argv[4:]))
