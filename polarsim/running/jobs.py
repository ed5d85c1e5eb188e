"""What became of a run's jobs, from the log that Snakemake writes of each call."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

LOGS = ".snakemake/log"
# Jobs of one submission to a cluster (a group) stand four spaces to the right, in the report of a failed one eight.
_BLOCK = re.compile(r"^( *)(?:(?:local)?(?:rule|checkpoint)|(Error in rule)) (\w+):$")
_FIELD = re.compile(r"^( +)(\w+): (.*)$")
_IN_FAILED_GROUP = 8
_STOPPED = "INFO stopped: "  # as `reporting` writes an error into the log of a job
_FINISHED = re.compile(r"^Finished jobid: (\d+)")


@dataclass(frozen=True)
class Job:
    """A job that was started."""

    rule: str
    number: int
    outputs: tuple[str, ...]
    log: str
    wildcards: str
    finished: bool = False
    failed: bool = False

    @property
    def terrain(self) -> str:
        """`Terrain03`; empty where the job belongs to none."""
        found = re.search(r"terrain=(\d\d)", self.wildcards) or re.search(r"Terrain(\d\d)", " ".join(self.outputs))
        return f"Terrain{found[1]}" if found else ""

    def error(self, folder: Path) -> str | None:
        """Return the error in the job's log; None where the job did not end by itself."""
        found = [line.removeprefix(_STOPPED) for line in self._lines(folder) if line.startswith(_STOPPED)]
        return found[-1] if found else None

    def reason(self, folder: Path) -> str:
        """Return the error in the job's log, or the last line that the job wrote."""
        said = self._lines(folder)
        return self.error(folder) or f"it was killed or broke off{f' after: {said[-1]}' if said else ''}"

    def _lines(self, folder: Path) -> list[str]:
        try:
            lines = (folder / self.log).read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            return []
        return [line.strip() for line in lines if line.strip()]


def read_jobs(lines: Iterable[str]) -> list[Job]:
    """All jobs that a log tells of; a job that was tried again counts by its last try."""
    jobs: dict[int, Job] = {}
    rule, failed, indent = "", False, 0
    fields: dict[str, str] = {}

    def close() -> None:
        if rule and fields.get("jobid", "").isdigit():
            number = int(fields["jobid"])
            outputs = tuple(part.split(" (")[0] for part in fields.get("output", "").split(", ") if part)
            log = fields.get("log", "").split(" (")[0].split(", ")[0]
            known = jobs.get(number)
            wildcards = fields.get("wildcards", known.wildcards if known else "")
            jobs[number] = Job(rule, number, outputs, log, wildcards, failed=failed)

    for line in (*lines, ""):
        field = _FIELD.match(line)
        if field and len(field[1]) == indent + 4:
            fields[field[2]] = field[3]
            continue
        close()
        rule, failed, indent, fields = "", False, 0, {}
        if block := _BLOCK.match(line):
            rule, indent = block[3], len(block[1])
            failed = block[2] is not None or indent == _IN_FAILED_GROUP
        elif (done := _FINISHED.match(line)) and int(done[1]) in jobs:
            jobs[int(done[1])] = replace(jobs[int(done[1])], finished=True, failed=False)
    return list(jobs.values())


def jobs_of(folder: Path, log: str) -> list[Job]:
    """Jobs of the call that wrote a log; none where it is gone."""
    try:
        return read_jobs((folder / LOGS / log).read_text(encoding="utf-8", errors="replace").splitlines())
    except OSError:
        return []


def logs_in(folder: Path) -> set[str]:
    return {path.name for path in (folder / LOGS).glob("*.snakemake.log")}


def latest_log(folder: Path) -> list[str]:
    """The log of the last call; none where there was none."""
    return [
        path.name
        for path in sorted((folder / LOGS).glob("*.snakemake.log"), key=lambda path: path.stat().st_mtime)[-1:]
    ]
