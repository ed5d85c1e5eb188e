"""Text at the end of a run: warnings of the jobs, headline metrics, results page and next commands."""

from __future__ import annotations

import shutil
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

from polarsim.config import Config
from polarsim.errors import PolarsimError
from polarsim.formats.files import relative_to
from polarsim.paths import RunPaths
from polarsim.running.jobs import WorkflowJob

_WARNING = "WARNING "  # prefix of a warning in the log of a job, written by `reporting`
_MAX_WARNINGS = 10


def warning_lines(folder: Path, jobs: Sequence[WorkflowJob]) -> Iterator[str]:
    """Yield the different warnings of jobs, each with the first job and the number of further jobs."""
    found: dict[str, list[WorkflowJob]] = defaultdict(list)
    for job in jobs:
        for line in dict.fromkeys(job.lines(folder)):
            if line.startswith(_WARNING):
                found[line.removeprefix(_WARNING)].append(job)
    for text, warned in list(found.items())[:_MAX_WARNINGS]:
        more = f" and {len(warned) - 1} more" if len(warned) > 1 else ""
        yield f"warning: {text}  ({warned[0].name}{more})"
    if len(found) > _MAX_WARNINGS:
        yield f"warning: {len(found) - _MAX_WARNINGS} more warnings in the logs of the jobs"


def result_lines(config: Config, page: Path) -> Iterator[str]:
    """Yield the headline metrics of a complete run, the results page and the next commands."""
    from polarsim.report.headlines import headlines

    tables = {path.stem: path.with_suffix(".csv") for path in map(Path, RunPaths(config).tables_of_page())}
    try:
        for metric in headlines(tables, config.photo_domain, config.source.kind):
            yield f"{metric.title:46} {metric.value:>11}  [{metric.interval}]"
    except PolarsimError as error:
        yield f"no headline metrics: {error}"
    program = _program()
    yield f"page:  {page}"
    yield f"next:  {program} explore {config.run}   images, labels and meshes in the browser"
    yield f"       {program} report {config.run}    list of the tables, Snakemake's report"


def _program() -> str:
    """Return the command that starts this program, with its folder if the folder is not searched."""
    called = Path(sys.argv[0])
    if called.name != "polarsim" or shutil.which("polarsim"):
        return "polarsim"
    return relative_to(called, Path.cwd())
