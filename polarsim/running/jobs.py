"""States of the jobs of a run, parsed from the logs of Snakemake."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence, Set
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path

LOGS = ".snakemake/log"
# Jobs of a group (a single submission to a cluster) are indented by 4 spaces, in the report of a failed group by 8.
_BLOCK = re.compile(r"^( *)(?:(?:local)?(?:rule|checkpoint)|(Error in rule)) (\w+):$")
_FIELD = re.compile(r"^( +)(\w+): (.*)$")
_IN_FAILED_GROUP = 8
_STOPPED = "INFO stopped: "  # prefix of an error in the log of a job, written by `reporting`
_PLANNED = re.compile(r"^(\w+) +(\d+)$")  # in the table of the planned jobs
_FINISHED = re.compile(r"^Finished jobid: (\d+)")


@dataclass(frozen=True)
class WorkflowJob:
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
        """`Terrain03`; empty for a job without terrain."""
        found = re.search(r"terrain=(\d\d)", self.wildcards) or re.search(r"Terrain(\d\d)", " ".join(self.outputs))
        return f"Terrain{found[1]}" if found else ""

    @property
    def name(self) -> str:
        return f"{self.terrain}: {self.rule}" if self.terrain else self.rule

    def error(self, folder: Path) -> str | None:
        """Return the error in the log of the job; None if the job was killed."""
        found = [line.removeprefix(_STOPPED) for line in self.lines(folder) if line.startswith(_STOPPED)]
        return found[-1] if found else None

    def reason(self, folder: Path) -> str:
        """Return the error in the log of the job, else the last line of the log."""
        lines = self.lines(folder)
        return self.error(folder) or f"killed or crashed{f' after: {lines[-1]}' if lines else ''}"

    def lines(self, folder: Path) -> list[str]:
        """Return the lines of the log of the job."""
        return [line.strip() for line in log_text(folder / self.log).splitlines() if line.strip()]


def read_jobs(lines: Iterable[str]) -> list[WorkflowJob]:
    """Return the jobs in a log, each with the state of the last attempt."""
    jobs: dict[int, WorkflowJob] = {}
    rule, failed, indent = "", False, 0
    fields: dict[str, str] = {}

    def close() -> None:
        if rule and fields.get("jobid", "").isdigit():
            number = int(fields["jobid"])
            outputs = tuple(part.split(" (")[0] for part in fields.get("output", "").split(", ") if part)
            log = fields.get("log", "").split(" (")[0].split(", ")[0]
            known = jobs.get(number)
            wildcards = fields.get("wildcards", known.wildcards if known else "")
            jobs[number] = WorkflowJob(rule, number, outputs, log, wildcards, failed=failed)

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


def planned_jobs(lines: Sequence[str]) -> dict[str, int]:
    """Return the number of jobs of each rule that Snakemake has planned, as stated at the start of a log."""
    if "Job stats:" not in lines:
        return {}
    table = lines[lines.index("Job stats:") + 3 :]
    rows = takewhile(bool, map(_PLANNED.match, table))
    return {row[1]: int(row[2]) for row in rows if row and row[1] != "total"}


def jobs_of(folder: Path, log: str) -> list[WorkflowJob]:
    """Return the jobs in a log file; empty if the file is missing."""
    return read_jobs(log_text(folder / LOGS / log).splitlines())


def log_text(log: Path) -> str:
    """Return the text of a log; empty if the file is missing."""
    try:
        return log.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def logs_in(folder: Path) -> set[str]:
    return {path.name for path in (folder / LOGS).glob("*.snakemake.log")}


def first_log(folder: Path, before: Set[str]) -> list[str]:
    """Return a list with the name of the first log that is not among `before`, or an empty list.

    Later logs belong to other calls of Snakemake in the folder.
    """
    return sorted(logs_in(folder) - before)[:1]


def latest_log(folder: Path) -> list[str]:
    """Return a list with the name of the last log, or an empty list; names start with the time."""
    return sorted(logs_in(folder))[-1:]
