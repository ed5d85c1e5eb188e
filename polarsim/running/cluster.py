"""Jobs of SLURM that a killed run of a folder has submitted: they run on other machines, or wait."""

from __future__ import annotations

import re
import shutil
import subprocess
import time
from pathlib import Path

from polarsim.errors import PolarsimError
from polarsim.running.jobs import LOGS, logs_in

# As Snakemake's executors for SLURM and for any scheduler say it in the log of a call.
_SUBMITTED = re.compile(r"(?:with SLURM jobid |with external jobid ')(\d+)")
_GONE_S = 120.0  # SLURM kills what does not end by itself 30 s after it was told to, unless it is set otherwise


def end_submitted(folder: Path) -> int:
    """Cancel the unfinished jobs that Snakemake submitted for a folder; return their number.

    Raises
    ------
    PolarsimError
        They are still running minutes later: two jobs would write the same files.
    """
    found = submitted(folder)
    if found:
        subprocess.run(["scancel", *found], capture_output=True, check=False)
    until = time.monotonic() + _GONE_S
    while left := submitted(folder) if found else []:
        if time.monotonic() > until:
            raise PolarsimError(f"SLURM does not end jobs of an earlier run: {' '.join(left)}", path=folder)
        time.sleep(1)
    return len(found)


def submitted(folder: Path) -> list[str]:
    """Return the numbers of the unfinished jobs that Snakemake submitted for a folder; none without SLURM."""
    if shutil.which("squeue") is None:
        return []
    known = {number for log in logs_in(folder) for number in _SUBMITTED.findall(_text(folder / LOGS / log))}
    if not known:
        return []
    done = subprocess.run(
        ["squeue", "--me", "--noheader", "--format=%i %Z"], capture_output=True, text=True, check=False
    )
    jobs = (line.strip().partition(" ") for line in done.stdout.splitlines())
    return sorted(number for number, _, place in jobs if number in known and Path(place) == folder)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
