"""`polarsim run` resumes after kills, invalid inputs and full disks, and rejects a second run and read-only disks."""

import os
import pty
import random
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from polarsim.config import read_config
from polarsim.running import processes
from polarsim.running.first_page import MODIFIED_S
from polarsim.running.run import MISSING_PAGE, OUTPUT, UNFINISHED

pytestmark = pytest.mark.slow
AT_ONCE = pytest.mark.parametrize("folder", [0], indirect=True, ids=["no pause"])


def expected(terrain: int) -> str:
    """Return the content of the output of rule `last` for a terrain."""
    parts = [f"scan of {terrain}\n" * 1000 + "and so on\n"] * 6
    return "".join(parts) + "and so on\n"


def assert_whole(folder: Path) -> None:
    """Check that the outputs equal those of an uninterrupted run, without other files and active processes."""
    assert processes.processes_of_run(folder) == []
    results = folder / "results/toy"
    for terrain in (1, 2):
        assert (results / f"last/Terrain{terrain:02d}.txt").read_text() == expected(terrain)
    assert (results / "together.txt").read_text() == "".join(f"{expected(terrain)}and so on\n" for terrain in (1, 2))
    assert [path for path in results.rglob(".*") if path.name != ".snakemake_timestamp"] == []
    assert len(list(results.glob("first/*/*.txt"))) == 2 * 6
    assert not (results / MISSING_PAGE).exists()
    assert not (folder / UNFINISHED).exists()


def ended(process: subprocess.Popen) -> tuple[int, str]:
    terminal, _ = process.communicate(timeout=600)
    return process.returncode, terminal


def jobs_at_work(folder: Path, process: subprocess.Popen) -> tuple[psutil.Process, list[psutil.Process]]:
    """Wait for the first job; return the processes of Snakemake and of the jobs."""
    for _ in range(2000):
        for snakemake in children_of(process.pid):
            below = children_of(snakemake.pid, recursive=True)
            if scripts := [one for one in below if "/.snakemake/scripts/" in command_of(one)]:
                return snakemake, scripts
        assert process.poll() is None, process.communicate()[0]
        time.sleep(0.03)
    raise AssertionError("no job was started")


def children_of(pid: int, *, recursive: bool = False) -> list[psutil.Process]:
    """Return the children of a process; a search of the environments of all processes takes four times as long."""
    try:
        return psutil.Process(pid).children(recursive)
    except psutil.NoSuchProcess:
        return []


def command_of(process: psutil.Process) -> str:
    try:
        return " ".join(process.cmdline())
    except psutil.NoSuchProcess:
        return ""


def rules_in(text: str) -> set[str]:
    """Return the rules of the jobs in the output of Snakemake."""
    return set(re.findall(r"^(?:local)?rule (\w+):", text, re.MULTILINE))


def report_lines_of(terminal: str) -> list[str]:
    start = "polarsim run: "
    return [line.removeprefix(start) for line in terminal.splitlines() if line.startswith(start)]


def test_the_same_command_resumes_after_stops_and_kills(folder, start):
    rng = random.Random(32)

    def disturbed(kind: str) -> tuple[int, str]:
        process = start(folder)
        snakemake, jobs = jobs_at_work(folder, process)
        time.sleep(rng.uniform(0, 0.25))
        victim, number = {
            "hang-up": (process, signal.SIGHUP),
            "run": (process, signal.SIGKILL),
            "snakemake": (snakemake, signal.SIGKILL),
            "job": (jobs[0], signal.SIGKILL),
        }[kind]
        with suppress(psutil.NoSuchProcess):
            victim.send_signal(number)
        return ended(process)

    code, terminal = disturbed("hang-up")
    assert (code, processes.processes_of_run(folder)) == (130, [])
    reported = report_lines_of(terminal)
    assert any(" jobs done, stopped" in line for line in reported)
    assert not any(word in line for line in reported for word in ("failed", "killed", "error"))
    page = (folder / "results/toy" / MISSING_PAGE).read_text()
    assert "stopped" in page
    assert "failed" not in page
    assert disturbed("run")[0] == -signal.SIGKILL  # Snakemake is killed too; the next call ends the jobs
    code, terminal = disturbed("snakemake")
    assert (code, processes.processes_of_run(folder)) == (1, [])
    assert "signal 9" in terminal
    code, terminal = disturbed("job")
    assert code == 0, terminal  # second attempt
    assert_whole(folder)

    # A repeated job of a complete run is killed. Without the stored list, Snakemake considers later files complete.
    process = start(folder, "--forcerun", "results/toy/second/Terrain01.txt", "--until", "second")
    snakemake, jobs = jobs_at_work(folder, process)
    for one in (process, snakemake, *jobs):
        one.kill()
    ended(process)
    assert not (folder / "results/toy/second/Terrain01.txt").exists()
    code, terminal = ended(start(folder))
    assert code == 0
    assert {"second", "last", "together"} <= rules_in((folder / OUTPUT).read_text())
    assert_whole(folder)


@AT_ONCE
def test_a_failed_terrain_does_not_stop_others_and_the_configuration_is_stored(folder, start):
    scan, stored = folder / "data/analog/Terrain01.txt", folder / "results/toy/config.yaml"
    scan.write_text("broken")
    (folder / "more.yaml").write_text("rocks: {rock_cell_mm: 2.5}\n")
    call = ("--configfile", "more.yaml", "--config", "positions=[B]")
    code, terminal = ended(start(folder, *call))
    assert code == 1
    assert (folder / "results/toy/last/Terrain02.txt").read_text() == expected(2)
    reported = report_lines_of(terminal)
    assert any("data/analog/Terrain01.txt" in line and "results/toy/logs/first_01.log" in line for line in reported)
    assert [line for line in reported if "Terrain02" in line] == ["Terrain02: complete"]
    page = (folder / "results/toy" / MISSING_PAGE).read_text()
    assert all(f"- {line}\n" in page for line in reported)
    scan.write_text("scan of 1\n")
    code, terminal = ended(start(folder, *call))
    assert code == 0, terminal
    assert_whole(folder)
    config = read_config(stored)
    assert (config.rocks.rock_cell_mm, config.positions, config.run) == (2.5, ("B",), "toy")


@AT_ONCE
def test_the_output_is_short_and_names_warnings_and_the_log(folder, start):
    code, terminal = ended(start(folder))
    assert code == 0, terminal
    lines = terminal.splitlines()
    assert lines[0].startswith(f"log:   {OUTPUT}")
    assert lines[-1] == "polarsim run: 7 jobs done, all requested files exist"
    assert len([line for line in lines if "scan without date" in line]) == 1  # of two jobs
    assert rules_in(terminal) == set()
    assert len(lines) < 10
    assert max(map(len, lines)) <= 100
    assert rules_in((folder / OUTPUT).read_text()) == {"all", "first", "second", "last", "together"}

    # The first page of an interrupted run has no metadata, and is older than the inputs of the results page.
    last = folder / "results/toy/together.txt"
    last.write_text("first page")
    os.utime(last, (MODIFIED_S, MODIFIED_S))
    shutil.rmtree(folder / ".snakemake/metadata")
    code, terminal = ended(start(folder, "together", "--verbose"))
    assert code == 0, terminal
    assert rules_in(terminal) == {"together"}
    assert_whole(folder)


@pytest.mark.parametrize("folder", [0.5], indirect=True, ids=["jobs of several seconds"])
def test_a_terminal_has_live_lines_until_ctrl_c(folder, start, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("TERM", "xterm")
    own, terminal = pty.openpty()
    with os.fdopen(own, "rb", buffering=0) as screen:
        process = start(folder, output=terminal)
        os.close(terminal)
        text = read_terminal(screen, until=r"(?m)^jobs +0/7 .*first 0[12]")
        process.send_signal(signal.SIGINT)
        text += read_terminal(screen)
    assert process.wait(60) == 130
    lines = without_codes(text).splitlines()
    assert any(re.match(r"jobs +0/7 .*first 0[12]", line) for line in lines)
    assert any(line.startswith("polarsim run: stopping") for line in lines)
    assert max(map(len, lines)) <= 80
    assert rules_in(text) == set()


def read_terminal(screen, until: str | None = None) -> str:
    """Return the text written to a pseudo terminal, until it contains a pattern or all writers have closed it."""
    text = b""
    with suppress(OSError):  # Linux: at the end
        while part := screen.read(65536):
            text += part
            if until and re.search(until, without_codes(text.decode(errors="ignore"))):
                break
    return text.decode(errors="ignore")


def without_codes(text: str) -> str:
    """Return text of a terminal without control codes."""
    return re.sub(r"\x1b\[\??[0-9;]*[A-Za-z]", "", text).replace("\r", "\n")


@pytest.mark.parametrize("broken", ["Snakefile", "rule"])
@AT_ONCE
def test_an_error_before_the_first_job_shows_the_output_of_snakemake(folder, start, broken):
    path = folder / "Snakefile"
    text = path.read_text()
    path.write_text("import nothing\n" + text if broken == "Snakefile" else text.replace("scripts/first", "scripts/no"))
    code, terminal = ended(start(folder))
    assert code == 1
    assert ("nothing" if broken == "Snakefile" else "scripts/no.py") in terminal
    assert len(terminal.splitlines()) < 40


@pytest.fixture
def one_line(polarsim, folder, monkeypatch) -> Callable[..., str]:
    """Return the single error line of a call that cannot start."""
    monkeypatch.chdir(folder)

    def call(*words: str) -> str:
        done = polarsim("run", *words)
        (line,) = (done.stdout + done.stderr).splitlines()
        assert done.returncode == 1
        return line

    return call


def test_a_second_run_is_rejected_with_the_pid_of_the_first(folder, one_line):
    (folder / ".snakemake").mkdir()
    with processes.folder_lock(folder):
        line = one_line("--min-free", "0")
        assert line.startswith(f"error: {folder}: ")
        assert str(os.getpid()) in line
    (folder / ".snakemake/locks").mkdir()
    (folder / ".snakemake/locks/0.output.lock").write_text("results/toy/together.txt\n")
    assert "snakemake --unlock" in one_line("--min-free", "0")


@pytest.fixture
def mounted(folder):
    """Return a function that mounts a small disk at the results, or remounts it with other options."""
    results = folder / "results"
    results.mkdir()

    def mount(options: str) -> None:
        again = ",remount" if results.is_mount() else ""
        words = ["mount", "-t", "tmpfs", "-o", options + again, "tmpfs", str(results)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode:
            pytest.skip(f"no disk can be mounted here, which needs root: {done.stderr.strip()}")

    yield mount
    if results.is_mount():
        subprocess.run(["umount", str(results)], check=True)


@AT_ONCE
def test_a_full_disk_leaves_no_incomplete_file(folder, start, mounted):
    mounted("size=200k")  # full during the second rule; benchmarks/chaos.py tries ten sizes
    code, terminal = ended(start(folder, "--cores", "1"))
    assert code == 1
    assert "No space left on device" in terminal
    assert re.search(r"^polarsim run: .*results/toy.* \d+ MB", terminal, re.MULTILINE)
    for path in (folder / "results/toy").glob("last/*.txt"):
        assert path.read_text() == expected(int(path.stem[-2:]))
    mounted("size=8m")
    code, terminal = ended(start(folder))
    assert code == 0, terminal
    assert_whole(folder)


@AT_ONCE
def test_quiet_is_for_plans_only_and_plans_store_nothing(folder, polarsim, one_line):
    assert "--quiet" in one_line("--min-free", "0", "--quiet", "progress")
    several = ("--default-resources", "mem_mb=10", "runtime=3")  # values of an option, not targets
    planned = polarsim("run", "--dry-run", "--quiet", "--cores", "all", "--config", "positions=[B]", *several)
    assert planned.returncode == 0
    assert not (folder / "results/toy").exists()


def test_missing_space_or_permission_is_an_error_before_any_job(folder, one_line, mounted):
    mounted("size=1m")
    line = one_line("--min-free", "9")
    assert line.startswith("error: results/toy: ")
    assert "--min-free" in line
    mounted("size=1m,ro")
    assert one_line("--min-free", "0").startswith(f"error: {folder}/results: ")
    assert not list((folder / "results").iterdir())


@AT_ONCE
@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("-n", "run=mine"), ["--config run=mine"]),
        (("together", "-n", "tugether"), ["'tugether'", "all", "together"]),
        (("config/config.yaml",), ["--configfile config/config.yaml"]),
        (("--configfile", "config/config.yaml", "config/more.yaml"), ["--configfile config/more.yaml"]),
        (("results/other/together.txt",), ["'other'", "'toy'", "--configfile"]),
        (("results/toy/togther.txt",), ["results/toy/togther.txt"]),
        (("-n", "--configfiles", "config/config.yaml"), ["--configfile"]),
        (("--cores", "some"), ["--cores", "'some'"]),
        (("-n", "--retries"), ["--retries"]),
    ],
)
def test_a_usage_error_is_one_line_and_nothing_is_run(folder, polarsim, monkeypatch, words, named):
    monkeypatch.chdir(folder)
    done = polarsim("run", "--min-free", "0", *words)
    (line,) = (done.stdout + done.stderr).splitlines()
    assert done.returncode == 2
    assert line.startswith("error: ")
    assert all(name in line for name in named)
    assert "Exception" not in line
    assert not (folder / "results").exists()
