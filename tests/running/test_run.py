"""`polarsim run` resumes after kills, invalid inputs and full disks, and rejects a second run and read-only disks."""

import os
import random
import re
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from polarsim.config import read_config
from polarsim.running import processes
from polarsim.running.run import MISSING_PAGE, UNFINISHED

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
        found = processes.processes_of_run(folder)
        scripts = [one for one in found if any("/.snakemake/scripts/" in word for word in command_of(one))]
        if scripts:
            (snakemake,) = [one for one in found if one.ppid() == process.pid]
            return snakemake, scripts
        assert process.poll() is None, process.communicate()[0]
        time.sleep(0.03)
    raise AssertionError("no job was started")


def command_of(process: psutil.Process) -> list[str]:
    try:
        return process.cmdline()
    except psutil.NoSuchProcess:
        return []


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

    assert disturbed("hang-up")[0] == 130
    assert processes.processes_of_run(folder) == []
    assert disturbed("run")[0] == -signal.SIGKILL  # Snakemake is killed too; the next call ends the jobs
    code, terminal = disturbed("snakemake")
    assert (code, processes.processes_of_run(folder)) == (1, [])
    assert "signal 9" in terminal
    code, terminal = disturbed("job")
    assert code == 0, terminal  # second attempt
    assert_whole(folder)


def test_a_forced_job_is_repeated_after_a_kill(folder, start):
    """Without the stored list, Snakemake considers later files complete."""
    assert ended(start(folder))[0] == 0
    process = start(folder, "--forcerun", "results/toy/second/Terrain01.txt", "--until", "second")
    snakemake, jobs = jobs_at_work(folder, process)
    for one in (process, snakemake, *jobs):
        one.kill()
    ended(process)
    assert not (folder / "results/toy/second/Terrain01.txt").exists()
    code, terminal = ended(start(folder))
    assert code == 0
    assert {"second", "last", "together"} <= set(re.findall(r"^(?:local)?rule (\w+):", terminal, re.MULTILINE))
    assert_whole(folder)


@AT_ONCE
def test_a_failed_terrain_is_reported_and_does_not_stop_others(folder, start):
    scan = folder / "data/analog/Terrain01.txt"
    scan.write_text("broken")
    code, terminal = ended(start(folder))
    assert code == 1
    assert (folder / "results/toy/last/Terrain02.txt").read_text() == expected(2)
    report_lines = [
        line.removeprefix("polarsim run: ") for line in terminal.splitlines() if line.startswith("polarsim run: ")
    ]
    assert any("data/analog/Terrain01.txt" in line and "results/toy/logs/first_01.log" in line for line in report_lines)
    assert [line for line in report_lines if "Terrain02" in line] == ["Terrain02: complete"]
    page = (folder / "results/toy" / MISSING_PAGE).read_text()
    assert all(f"- {line}\n" in page for line in report_lines)
    scan.write_text("scan of 1\n")
    code, terminal = ended(start(folder))
    assert code == 0, terminal
    assert_whole(folder)


def one_line(process: subprocess.Popen) -> str:
    """Return the single error line of a call that cannot start."""
    code, terminal = ended(process)
    assert code == 1
    (line,) = terminal.splitlines()
    return line


def test_a_second_run_is_rejected_with_the_pid_of_the_first(folder, start):
    (folder / ".snakemake").mkdir()
    with processes.folder_lock(folder):
        line = one_line(start(folder))
        assert line.startswith(f"error: {folder}: ")
        assert str(os.getpid()) in line
    (folder / ".snakemake/locks").mkdir()
    (folder / ".snakemake/locks/0.output.lock").write_text("results/toy/together.txt\n")
    assert "snakemake --unlock" in one_line(start(folder))


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


SIZES_KB = [200]  # full during the second rule; benchmarks/chaos.py tries ten sizes


@AT_ONCE
@pytest.mark.parametrize("size_kb", SIZES_KB)
def test_a_full_disk_leaves_no_incomplete_file(folder, start, mounted, size_kb):
    mounted(f"size={size_kb}k")
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


def test_missing_space_or_permission_is_an_error_before_any_job(folder, start, mounted):
    mounted("size=1m")
    line = one_line(start(folder, "--min-free", "9"))
    assert line.startswith("error: results/toy: ")
    assert "--min-free" in line
    mounted("size=1m,ro")
    assert one_line(start(folder)).startswith(f"error: {folder}/results: ")
    assert not list((folder / "results").iterdir())


def test_a_stopped_run_reports_no_failure(folder, start):
    process = start(folder)
    jobs_at_work(folder, process)
    process.send_signal(signal.SIGINT)
    code, terminal = ended(process)
    assert code == 130
    report_lines = [line for line in terminal.splitlines() if line.startswith("polarsim run: ")]
    assert not any(word in line for line in report_lines for word in ("failed", "killed", "error"))
    assert any(" jobs done, stopped" in line for line in report_lines)
    page = (folder / "results/toy" / MISSING_PAGE).read_text()
    assert "stopped" in page
    assert "failed" not in page


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


@AT_ONCE
def test_a_run_stores_its_configuration_and_a_dry_run_does_not(folder, start):
    stored = folder / "results/toy/config.yaml"
    (folder / "more.yaml").write_text("rocks: {rock_cell_mm: 2.5}\n")
    several = ("--default-resources", "mem_mb=10", "runtime=3")  # values of an option, not targets
    assert ended(start(folder, "--cores", "all", "--configfile", "more.yaml", "-n", *several))[0] == 0
    assert not stored.exists()
    code, terminal = ended(start(folder, "--configfile", "more.yaml", "--config", "positions=[B]"))
    assert code == 0, terminal
    config = read_config(stored)
    assert (config.rocks.rock_cell_mm, config.positions, config.run) == (2.5, ("B",), "toy")
