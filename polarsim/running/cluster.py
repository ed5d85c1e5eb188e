"""SLURM jobs that were submitted by a killed run of a folder, pending or running on other machines."""

from __future__ import annotations

import re
import shutil
import subprocess
import time
from pathlib import Path

from polarsim.errors import PolarsimError
from polarsim.running.jobs import LOGS, log_text, logs_in

# Messages in the log of Snakemake's executors for SLURM and for generic schedulers.
_SUBMITTED = re.compile(r"(?:with SLURM jobid |with external jobid ')(\d+)")
_GONE_S = 120.0  # by default, SLURM kills a cancelled job after 30 s


def end_submitted(folder: Path) -> int:
    """Cancel the unfinished jobs that Snakemake submitted for a folder; return their number.

    Raises
    ------
    PolarsimError
        Jobs are still running after two minutes; a new run would write the same files.
    """
    found = submitted_jobs(folder)
    if found:
        subprocess.run(["scancel", *found], capture_output=True, check=False)
    until = time.monotonic() + _GONE_S
    while remaining := submitted_jobs(folder) if found else []:
        if time.monotonic() > until:
            raise PolarsimError(f"SLURM jobs of an earlier run do not end: {' '.join(remaining)}", path=folder)
        time.sleep(1)
    return len(found)


def submitted_jobs(folder: Path) -> list[str]:
    """Return the numbers of the unfinished jobs that Snakemake submitted for a folder; none without SLURM."""
    if shutil.which("squeue") is None:
        return []
    known = {number for log in logs_in(folder) for number in _SUBMITTED.findall(log_text(folder / LOGS / log))}
    if not known:
        return []
    done = subprocess.run(
        ["squeue", "--me", "--noheader", "--format=%i %Z"], capture_output=True, text=True, check=False
    )
    jobs = (line.strip().partition(" ") for line in done.stdout.splitlines())
    return sorted(number for number, _, place in jobs if number in known and Path(place) == folder)
