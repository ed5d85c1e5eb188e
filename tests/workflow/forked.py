"""Snakemake in a fork of a process that has imported it: to import it takes longer than to plan a run."""

import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

LONGEST_S = 1800  # one that hangs ends; busy machines are slow
_SERVER = multiprocessing.get_context("forkserver")
_SERVER.set_forkserver_preload(["snakemake.cli", "pandas", "polarsim.config"])


def call(folder: Path, output: Path, arguments: list[str], environment: dict[str, str]) -> subprocess.CompletedProcess:
    """What `snakemake ARGUMENTS` in a folder returns and prints, which it writes below `output` meanwhile."""
    output.mkdir()
    process = _SERVER.Process(target=_snakemake, args=(folder, output, arguments, environment))
    process.start()
    process.join(LONGEST_S)
    if process.exitcode is None:
        process.kill()
        raise subprocess.TimeoutExpired(arguments, LONGEST_S)
    said = [(output / name).read_text() for name in ("stdout", "stderr")]
    return subprocess.CompletedProcess(arguments, process.exitcode, *said)


def _snakemake(folder: Path, output: Path, arguments: list[str], environment: dict[str, str]) -> None:
    from snakemake.cli import main

    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    for number, name in ((1, "stdout"), (2, "stderr")):
        os.dup2(os.open(output / name, os.O_WRONLY | os.O_CREAT), number)
    sys.argv = ["snakemake", *arguments]
    main()
