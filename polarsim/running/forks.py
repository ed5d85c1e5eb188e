"""Jobs as forks of a process that has imported all modules: imports take 5 % of the CPU time of the demo.

`python -P forks.py run ARGUMENTS` is Snakemake with a server beside it, which imports the modules of all scripts and
then forks for every request. Snakemake starts scripts with `sys.executable`. Here this is a client, which requests a
fork with its own folder, environment and streams, waits for it and returns its exit code; without a fork (the server
still imports, or the job has several threads) the client becomes the Python interpreter. Otherwise jobs run as usual:
the same scripts in separate processes, of which each ends with its client. The client has no site packages, because it
starts for every job.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

SOCKET, PYTHON = Path(".snakemake/polarsim_forks"), Path(".snakemake/polarsim_python")  # in the folder of the run
# Snakemake sets these variables to the number of threads of a job; NumPy and torch read them when they are imported.
_THREADS = ("OMP_NUM_THREADS", "GOTO_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
_SCRIPTS = Path("workflow/scripts")
_LATE = ("open3d", "torch", "torch._dynamo")  # imported inside functions
_WAIT_S = 2.0  # between checks whether the server is still needed
_KILLED = 128 + signal.SIGKILL  # exit code of a job that ends without an exit code
_MODULES = ("snakemake", "sphinx")  # that `python -m` runs in a fork


def arguments_of(snakemake: Sequence[str]) -> list[str]:
    """Return the command that runs Snakemake with these arguments and with jobs in forks."""
    return [sys.executable, "-P", __file__, "run", *snakemake]


def run_with_server(arguments: Sequence[str]) -> int:
    """Run Snakemake in this process and the server in a child process; return the exit code of Snakemake."""
    from polarsim.running.processes import die_with_parent

    owner = os.getpid()
    SOCKET.unlink(missing_ok=True)
    if os.fork() == 0:
        die_with_parent()
        for number in (signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        os.environ |= dict.fromkeys(_THREADS, "1")
        serve(SOCKET, prepare, lambda: os.getppid() == owner)
        os._exit(0)
    write_client(PYTHON, SOCKET)
    return run_python(["-m", "snakemake", *arguments], executable=str(PYTHON.absolute()))


def write_client(path: Path, address: Path) -> None:
    """Write the program that replaces the Python interpreter, for the server at `address`."""
    import shlex

    places = str(address.absolute()), str(path.absolute())
    words = (sys.executable, "-I", "-S", __file__, "client", *places, sys.executable)
    new = path.with_suffix(".new")
    new.write_text(f'#!/bin/sh\nexec {shlex.join(words)} "$@"\n', encoding="utf-8")
    new.chmod(0o755)
    new.rename(path)


def prepare() -> None:
    """Import the modules of all scripts, then compile the kernels of rendering in a child while the first job runs."""
    from polarsim.running.processes import die_with_parent

    import_scripts()
    if os.fork() == 0:
        die_with_parent()
        os.nice(19)
        with suppress(Exception):  # jobs compile what is missing and report errors
            from polarsim.render.first_use import compile_kernels

            compile_kernels()
        os._exit(0)


def import_scripts() -> None:
    """Import the modules of all scripts of the workflow in this folder, without those whose libraries are missing."""
    import importlib
    import re

    texts = "".join(path.read_text(encoding="utf-8") for path in sorted(_SCRIPTS.glob("*.py")))
    names = sorted(set(re.findall(r"^from (polarsim\S*) import", texts, re.MULTILINE)))
    for name in (*names, "snakemake.script", *_LATE) if names else ():
        with suppress(ImportError, OSError):
            importlib.import_module(name)


def serve(address: Path, prepare: Callable[[], object], is_needed: Callable[[], bool]) -> None:
    """Prepare this process, then fork for every request at a new socket `address`, as long as the server is needed."""
    import gc

    prepare()
    _forget_exit_functions()
    gc.freeze()  # collections of forks skip these objects and do not copy their memory
    with socket.socket(socket.AF_UNIX) as server:
        new = address.with_suffix(".new")
        new.unlink(missing_ok=True)  # of a server that was killed
        server.bind(str(new))
        new.chmod(0o600)  # of this user
        server.listen(64)
        new.rename(address)  # the socket accepts connections before the file appears
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # forks are not awaited
        server.settimeout(_WAIT_S)
        while is_needed():
            try:
                connection, _ = server.accept()
            except TimeoutError:
                continue
            connection.setblocking(True)
            if os.fork() == 0:
                server.close()
                _answer(connection)
            connection.close()


def _forget_exit_functions() -> None:
    """Drop the exit functions and finalizers of imported modules, which would take 60 ms at the end of each fork."""
    import atexit
    import weakref

    atexit._clear()
    weakref.finalize._registry.clear()  # type: ignore[attr-defined]
    weakref.finalize._registered_with_atexit = False  # type: ignore[attr-defined] # finalizers of a fork register anew


def _answer(connection: socket.socket) -> None:
    """Send the process id, run the command of a client with its folder, environment and streams, send the exit code."""
    import fcntl
    import tempfile

    for stop in (signal.SIGCHLD, signal.SIGHUP, signal.SIGIO):
        signal.signal(stop, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.setpgid(0, 0)  # the client forwards signals to this process; signals to its group would be a second time
    fcntl.fcntl(connection, fcntl.F_SETOWN, os.getpid())  # SIGIO ends this process when the client ends
    fcntl.fcntl(connection, fcntl.F_SETFL, fcntl.fcntl(connection, fcntl.F_GETFL) | os.O_ASYNC)
    code = 1
    try:
        connection.sendall(os.getpid().to_bytes(4, "little"))
        length = int.from_bytes(_received(connection, 4), "little")
        request = json.loads(_received(connection, length))
        _, descriptors, _, _ = socket.recv_fds(connection, 1, 3)
        for number, descriptor in enumerate(descriptors):
            os.dup2(descriptor, number)
            os.close(descriptor)
        os.environ.clear()
        os.environ.update(request["environment"])
        tempfile.tempdir = None  # determined by TMPDIR
        os.chdir(request["folder"])
        code = run_python(request["arguments"], executable=request["client"])
    finally:
        _finish()
        with suppress(OSError):
            connection.sendall(bytes([code & 0xFF]))
        os._exit(code & 0xFF)


def _finish() -> None:
    """Do what the interpreter does at its end, except to free the memory of all modules, which takes 0.4 s."""
    import atexit
    import ctypes
    import threading

    with suppress(Exception):
        threading._shutdown()  # type: ignore[attr-defined] # multiprocessing ends its forks with the same functions
        atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    ctypes.CDLL(None).fflush(None)  # output of libraries in C


def run_python(arguments: Sequence[str], executable: str) -> int:
    """Run `python ARGUMENTS` of a script or module in this process; return the exit code.

    A module (Snakemake) starts scripts with `executable`.
    """
    import runpy
    import shlex

    try:
        if arguments[0] == "-m":
            sys.argv, sys.executable = list(arguments[1:]), shlex.quote(executable)  # Snakemake does not quote it
            sys.path.insert(0, str(Path.cwd()))
            runpy.run_module(arguments[1], run_name="__main__", alter_sys=True)
        else:
            sys.argv = list(arguments)
            sys.path.insert(0, str(Path(arguments[0]).parent))
            runpy.run_path(arguments[0], run_name="__main__")
    except SystemExit as ended:
        if isinstance(ended.code, str):
            print(ended.code, file=sys.stderr)
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except BaseException:
        sys.excepthook(*sys.exc_info())
        return 1
    return 0


def client(address: str, itself: str, python: str, arguments: Sequence[str]) -> int:
    """Run `python ARGUMENTS` in a fork of the server, or replace this process by `python` if there is no fork."""
    is_served = arguments[:1] == ["-m"] and arguments[1:2] and arguments[1] in _MODULES
    is_served = is_served or (bool(arguments) and arguments[0].endswith(".py") and os.environ.get(_THREADS[0]) == "1")
    fork = 0
    with socket.socket(socket.AF_UNIX) as connection:
        if is_served:
            with suppress(OSError):
                connection.connect(min(address, os.path.relpath(address), key=len))  # at most 107 characters
                here = {"folder": str(Path.cwd()), "environment": dict(os.environ)}
                request = {"client": itself, "arguments": arguments, **here}
                text = json.dumps(request).encode()
                connection.sendall(len(text).to_bytes(4, "little") + text)
                socket.send_fds(connection, [b"0"], [0, 1, 2])
                fork = int.from_bytes(_received(connection, 4), "little")
        if not fork:
            connection.close()
            os.execv(python, [python, *arguments])  # noqa: S606

        def forward(number: int, _: object) -> None:
            with suppress(ProcessLookupError):
                os.kill(fork, number)

        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, forward)
        code = connection.recv(1)
        connection.recv(1)  # until the fork has ended
    return code[0] if code else _KILLED


def _received(connection: socket.socket, count: int) -> bytes:
    """Receive exactly `count` bytes, or none if the other side has ended."""
    data = b""
    while len(data) < count:
        if not (part := connection.recv(count - len(data))):
            return b""
        data += part
    return data


if __name__ == "__main__":
    _MODE, _WORDS = sys.argv[1], sys.argv[2:]
    sys.exit(run_with_server(_WORDS) if _MODE == "run" else client(_WORDS[0], _WORDS[1], _WORDS[2], _WORDS[3:]))
