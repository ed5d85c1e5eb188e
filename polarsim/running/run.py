"""Run the workflow: checks, Snakemake, a summary. The same command resumes a run that was stopped.

Snakemake schedules, retries and resumes jobs. This module adds checks before the start, terminates all processes at the
end, and stores lost outputs: a job that is repeated with another option and stopped has lost its output. If later files
still exist, Snakemake considers the run complete, although these files belong to the former option.
"""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from shutil import get_terminal_size
from typing import TextIO

from polarsim.arguments import STOPPED
from polarsim.config import Config
from polarsim.errors import ConfigError, PolarsimError
from polarsim.extras import require
from polarsim.formats.files import write_text
from polarsim.paths import RunPaths
from polarsim.running import cluster, disk, forks, processes
from polarsim.running.configuration import read_configs, store_config
from polarsim.running.console import showing
from polarsim.running.durations import expected_durations
from polarsim.running.first_page import FirstPage, is_first_page
from polarsim.running.inputs import check_paths
from polarsim.running.jobs import LOGS, WorkflowJob, first_log, jobs_of, latest_log, log_text, logs_in
from polarsim.running.site_stages import plan_lines
from polarsim.running.stages import RunProgress
from polarsim.running.summary import result_lines, warning_lines
from polarsim.running.targets import refuse_unknown, stages_of_rules, targets_of

OUTPUT = ".snakemake/polarsim_run.log"  # output of Snakemake and of the jobs of the last run
UNFINISHED = ".snakemake/polarsim_unfinished.txt"  # outputs of unfinished jobs
MISSING_PAGE = "missing.md"  # in the folder of an incomplete run
PROFILE = "SNAKEMAKE_PROFILE"  # environment variable of Snakemake
_FIXED = ("--rerun-incomplete", "--keep-going", "--retries", "1")
# Snakemake's default scheduler runs a solver for each choice of jobs. Among jobs of equal priority, `greedy` prefers
# larger inputs: labels before twins, so that the first page does not wait for all twins of its terrain.
_SCHEDULING = ("--scheduler", "greedy", "--latency-wait", "10")
_REFUSED = {"--nolock", "--ignore-incomplete", "--ii", "--unlock"}  # concurrent runs of a folder, incomplete files
_WITHOUT_JOBS = {  # options that only print
    *(
        "-n",
        "--dry-run",
        "--dryrun",
        "--dag",
        "--rulegraph",
        "--filegraph",
        "--d3dag",
        "--lint",
        "--list",
        "--list-rules",
    ),
    *("-l", "--summary", "-S", "--detailed-summary", "-D", "--list-changes", "--lc", "--list-target-rules", "--lt"),
}
_QUIET = {"--quiet", "-q"}
_TAIL = 15  # lines of the output of Snakemake after an error without jobs


@dataclass(frozen=True)
class Call:
    """Arguments of `polarsim run`: targets, configuration files and settings, cores, options of Snakemake."""

    targets: tuple[str, ...]
    configfiles: tuple[Path, ...]
    settings: tuple[str, ...]
    cores: int | None = None  # None: two, or from the profile
    rest: tuple[str, ...] = ()
    verbose: bool = False  # show the output of Snakemake instead of the progress

    def words(self) -> list[str]:
        """Return the arguments of Snakemake. Targets are first, because options with several values consume targets.

        A profile keeps its scheduler and its latency: on a cluster, files of other nodes appear later.
        """
        profiled = "--profile" in self.options
        cores = [] if profiled and self.cores is None else ["--cores", str(self.cores or 2)]
        scheduling = () if profiled else _SCHEDULING
        return [*self.targets, *cores, *_FIXED, *scheduling, *self.configured(), *self.rest]

    def configured(self) -> list[str]:
        """Return the arguments that define the configuration."""
        files = ["--configfile", *map(str, self.configfiles)] if self.configfiles else []
        return [*files, *(["--config", *self.settings] if self.settings else [])]

    @property
    def options(self) -> set[str]:
        """Names of the options of Snakemake among the arguments."""
        return {word.partition("=")[0] for word in self.rest}

    @property
    def allows_forks(self) -> bool:
        """Whether jobs may be forks: on this machine, with a core for the imports while Snakemake plans the jobs."""
        elsewhere = self.options & {"--profile", "--executor", "-e"}
        return sys.platform == "linux" and (self.cores or 2) > 1 and not elsewhere and PROFILE not in os.environ

    def config(self) -> Config:
        """Return the merged configuration."""
        return read_configs(self.configfiles, self.settings)


def run_workflow(call: Call, min_free_bytes: int | None = None) -> int:
    """Check the call, run Snakemake in this folder and report the result.

    Returns
    -------
    int
        Exit code: 0 complete, 1 a job failed, 130 stopped by Ctrl-C, SIGTERM or SIGHUP.
    """
    folder = Path.cwd().resolve()
    if not (folder / "Snakefile").exists():
        raise PolarsimError("no Snakefile in this folder: start in the clone", path=folder)
    require("snakemake")
    if refused := _REFUSED.intersection(call.rest):
        raise ConfigError(f"{sorted(refused)[0]}: not allowed with polarsim run")
    targets = targets_of(call.targets, call.rest)
    config = call.config()
    check_paths(config)
    refuse_unknown(folder, config.run, targets, call.configured())
    if _WITHOUT_JOBS.intersection(call.rest):
        return min(1, subprocess.run(_snakemake(*call.words()), check=False).returncode)
    if call.options & _QUIET:
        raise ConfigError("--quiet: removes the jobs from Snakemake's log, which the progress is read from; omit it")
    for line in plan_lines(config):
        _print_line(line)
    results, data = Path("results") / config.run, config.data_source
    made = (results, *([config.source.root] if data.is_generated else []))
    for place in (Path("results"), *made, Path(".snakemake")):
        disk.refuse_unwritable(place)
    (folder / ".snakemake").mkdir(exist_ok=True)
    with processes.folder_lock(folder) as killed:
        if killed:
            _tidy(folder, results)
        needed = disk.needed_bytes(config, not targets, made) if min_free_bytes is None else min_free_bytes
        for place in made:
            disk.refuse_full(place, needed)
        code = _run_owned(folder, call, config, is_full=not targets)
    if code == 0:  # without jobs, the workflow does not store the configuration
        store_config(config, results)
    return code


def _tidy(folder: Path, results: Path) -> None:
    """End the jobs of a run that was killed, and remove their unfinished files."""
    if count := cluster.end_submitted(folder):
        _print_line(f"{count} SLURM jobs of an earlier run cancelled")
    if count := processes.end_processes(folder):
        _print_line(f"{count} processes of an earlier run ended")
    disk.remove_leftovers(results)


def _run_owned(folder: Path, call: Call, config: Config, *, is_full: bool) -> int:
    results, paths = Path("results") / config.run, RunPaths(config)
    stages = stages_of_rules(folder)
    lost = _lost_outputs(folder, call)
    processes.remove_locks(folder)  # of a killed run: `folder_lock` raises for an active run
    before, start = logs_in(folder), time.monotonic()
    progress = RunProgress(stages, expected_durations(results, stages), call.cores or 2, start)
    page = FirstPage(paths)
    if is_full and "render_twins" in stages:
        _print_result(f"page:  {page.page}, with the first images as soon as a terrain has labels and a twin")
    if not call.verbose:
        _print_result(f"log:   {OUTPUT}: output of Snakemake and of the jobs (on the terminal: --verbose)")
    with showing(progress, sys.stderr, is_silent=call.verbose) as display:

        def watch() -> None:
            log = "".join(log_text(folder / LOGS / name) for name in first_log(folder, before))
            progress.update(log, time.monotonic())
            page.update(progress)
            display.update()

        forced = ["--forcerun", *lost] if lost else []
        first = _first_shown(call, paths) if is_full and "render_twins" in stages else []
        words = [*call.words(), *first, *forced]
        words = forks.arguments_of(words) if call.allows_forks else _snakemake(*words)
        output = None if call.verbose else folder / OUTPUT
        code, stopped = processes.supervise(folder, words, watch, display.write, output)
        watch()
    page.stop(progress)
    disk.remove_leftovers(results)
    jobs = [job for log in first_log(folder, before) for job in jobs_of(folder, log)]
    _remember(folder, lost, jobs)
    for line in warning_lines(folder, jobs):
        _print_result(line)
    _report(folder, results, call, jobs, code, stopped)
    if code == 0 and is_full and page.page.exists():
        for line in result_lines(config, page.page):
            _print_result(line)
    return STOPPED if stopped else min(1, abs(code))


def _first_shown(call: Call, paths: RunPaths) -> list[str]:
    """Return arguments that give priority to the twins and labels of the terrain that the first page shows."""
    if paths.only_covers or "--prioritize" in call.options:
        return []
    folder, terrain = f"results/{paths.run}", paths.first_shown
    shown = [
        f"{folder}/renders/{paths.models[-1]}/Terrain{terrain}",
        f"{folder}/labels/tables/Terrain{terrain}.parquet",
    ]
    return ["--prioritize", *shown, "--scheduler-greediness", "1"]  # 1 is the default without --prioritize


def _snakemake(*words: str) -> list[str]:
    return [sys.executable, "-m", "snakemake", *words]


def _lost_outputs(folder: Path, call: Call) -> list[str]:
    """Return the requested outputs that are missing because a repeated job was stopped."""
    started = [job for log in latest_log(folder) for job in jobs_of(folder, log) if not job.finished]
    missing = sorted(path for path in {*_remembered(folder), *_outputs(started)} if not (folder / path).exists())
    if not missing:
        return []
    requested = {name for name, _, _ in _summary(call)}
    return [path for path in missing if path in requested]


def _summary(call: Call) -> list[tuple[str, str, bool]]:
    """Return (name, rule, whether it exists) of the targets of a call and of all files that they depend on."""
    done = subprocess.run(_snakemake(*call.words(), "--summary"), capture_output=True, text=True, check=False)
    rows = [line.split("\t") for line in done.stdout.splitlines()[1:] if line.count("\t") == 5]
    return [(name, rule, status != "missing") for name, _, rule, _, status, _ in rows]


def _outputs(jobs: Sequence[WorkflowJob]) -> list[str]:
    return [path for job in jobs for path in job.outputs]


def _remembered(folder: Path) -> list[str]:
    path = folder / UNFINISHED
    return path.read_text(encoding="utf-8").splitlines() if path.exists() else []


def _remember(folder: Path, lost: Sequence[str], jobs: Sequence[WorkflowJob]) -> None:
    """Store the names of missing outputs for later calls."""
    started = _outputs([job for job in jobs if not job.finished])
    names = sorted(name for name in {*_remembered(folder), *lost, *started} if not (folder / name).exists())
    if names:
        write_text(folder / UNFINISHED, "".join(f"{name}\n" for name in names))
    else:
        (folder / UNFINISHED).unlink(missing_ok=True)


def _report(folder: Path, results: Path, call: Call, jobs: Sequence[WorkflowJob], code: int, stopped: bool) -> None:
    """Report finished and failed jobs, reasons and remedy; keep the report in the folder while files are missing."""
    made = [job for job in jobs if job.finished and job.outputs]
    failed = [job for job in jobs if job.failed and not (stopped and job.error(folder) is None)]
    page = results / MISSING_PAGE
    if code == 0:
        page.unlink(missing_ok=True)
        _print_line(f"{len(made)} jobs done, all requested files exist")
        return
    if not jobs and code > 0 and not stopped:
        for line in [] if call.verbose else log_text(folder / OUTPUT).splitlines()[-_TAIL:]:
            _print_result(line, sys.stderr)
        _print_line("no job was started; see the error of Snakemake above")
        return
    lines = [f"{len(made)} jobs done, {'stopped' if stopped else f'{len(failed)} failed'}"]
    lines += [f"{job.name} failed: {job.reason(folder)}  (log: {job.log})" for job in failed]
    if any(job.error(folder) is None for job in failed) and not call.verbose:  # a full disk has no log of the error
        lines += _unlogged_errors(folder, lines)
    if code < 0 and not stopped:
        lines.append(f"snakemake was killed by signal {-code}")
    free = disk.free_bytes(results)
    if free < disk.NEARLY_FULL_BYTES:
        lines.append(f"the disk of {results} is full, {free / 1e6:.0f} MB free")
    if not stopped and failed:
        lines += _missing(call)
    lines.append("the same command resumes the run" + (" after the error is corrected" if failed else ""))
    for line in lines:
        _print_line(line)
    try:
        write_text(page, "# Missing files of this run and causes\n\n" + "".join(f"- {line}\n" for line in lines))
    except PolarsimError as error:  # the disk is full: the lines are also on the terminal
        _print_line(str(error))


def _unlogged_errors(folder: Path, lines: Sequence[str]) -> list[str]:
    """Return the last errors in the output of the jobs that no line contains."""
    errors = [line for line in log_text(folder / OUTPUT).splitlines() if line.startswith("error: ")]
    found = [error for error in errors if not any(error.removeprefix("error: ") in line for line in lines)]
    return list(dict.fromkeys(found))[-3:]


def _missing(call: Call) -> list[str]:
    """Return the number of missing files of each terrain, and of all terrains together."""
    existing, missing = Counter[str](), Counter[str]()
    for name, rule, exists in _summary(call):
        part = WorkflowJob(rule, 0, (name,), "", "").terrain or "all terrains"
        (existing if exists and not is_first_page(Path(name)) else missing)[part] += 1
    return [
        f"{part}: {missing[part]} of {missing[part] + existing[part]} files missing"
        if missing[part]
        else f"{part}: complete"
        for part in sorted({*existing, *missing})
    ]


def _print_line(line: str) -> None:
    _print_result(f"polarsim run: {line}", sys.stderr)


def _print_result(line: str, stream: TextIO | None = None) -> None:
    """Write a line for the user; ignore a closed terminal."""
    stream = stream or sys.stdout
    with suppress(OSError):
        width = get_terminal_size().columns if stream.isatty() else len(line) + 1
        wrapped = textwrap.wrap(line, width, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)
        stream.write("\n".join([*(wrapped or [""]), ""]))
        stream.flush()
