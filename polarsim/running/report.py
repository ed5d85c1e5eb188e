"""Snakemake's report of the existing files of a run."""

from __future__ import annotations

import csv
import logging
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from polarsim.errors import PolarsimError
from polarsim.extras import require
from polarsim.wording import counted, run_command

_LOG = logging.getLogger(__name__)


def write_report(run: Path, files: Sequence[Path], page: Path, cores: int) -> None:
    """Write Snakemake's report (HTML) of the existing tables and figures of a run."""
    require("snakemake")
    configured = ["--configfile", *map(str, files)]
    rows = [line.split("\t") for line in _snakemake(run, "--summary", *configured).splitlines()[1:]]
    made = [row[0] for row in rows if len(row) == 6 and row[4] != "missing"]
    shown = [path for path in made if Path(path).parent in (run, run / "tables", run / "figures")]
    # Without targets Snakemake's report needs every file of a complete run.
    is_complete = len(made) == sum(len(row) == 6 for row in rows)
    targets = [] if is_complete else [path for path in shown if Path(path).suffix in (".csv", ".png", ".html")]
    _snakemake(run, *targets, "--cores", str(cores), *configured, "--report", str(page))


def warn_of_other_configurations(tables: Sequence[Path], digest: str, files: Sequence[Path]) -> None:
    """Log a warning about tables of other configurations than that of some files, which has this digest."""
    others = []
    for path in tables:
        with path.open(encoding="utf-8", newline="") as file:
            made_with = next(csv.DictReader(file), {}).get("config", digest)
        others += [] if made_with == digest else [path.name]
    if others:
        _LOG.warning(
            "%s of another configuration (%s); update with: %s",
            counted(len(others), "table"),
            ", ".join(others),
            run_command(files),
        )


def _snakemake(run: Path, *words: str) -> str:
    command = [sys.executable, "-m", "snakemake", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
        ours = [line.removeprefix("error: ") for line in lines if line.startswith("error: ")]
        named = [line for line in lines if re.match(r"\w*(Error|Exception)\b", line)]
        reason = " ".join(ours or named or lines[-1:])
        raise PolarsimError(f"snakemake made no report: {reason[:500]}", path=run)
    return done.stdout
