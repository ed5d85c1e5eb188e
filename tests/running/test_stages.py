"""Progress of the stages of a run from a log of Snakemake, expected durations, and lines for terminals and files."""

import io

import pytest

from polarsim.progress import LINE_S
from polarsim.running.console import progress_line, showing
from polarsim.running.durations import UNKNOWN_S, expected_durations, measured_durations
from polarsim.running.stages import RunProgress, clock
from polarsim.running.targets import stages_of_rules
from tests.running.conftest import CHECKOUT

STAGES = {"scan": "acquire", "mesh": "rocks", "mesh_fine": "rocks"}
DURATIONS = {"scan": 10.0, "mesh": 30.0, "mesh_fine": 20.0}
PLAN = """\
Building DAG of jobs...
Job stats:
job          count
---------  -------
scan             2
mesh             2
all              1
total            5

"""
STARTED = """\
[Wed Nov 25 22:30:24 2026]
rule {rule}:
    output: results/toy/{rule}/Terrain{terrain}
    log: results/toy/logs/{rule}_{terrain}.log
    jobid: {number}
    wildcards: terrain={terrain}
"""
FAILED = "[Wed Nov 25 22:31:30 2026]\nError in rule {rule}:\n    jobid: {number}\n    output: results/toy\n"
FINISHED = "[Wed Nov 25 22:32:00 2026]\nFinished jobid: {number} (Rule: any)\n"


def started(*jobs: tuple[str, str, int]) -> str:
    return "".join(STARTED.format(rule=rule, terrain=terrain, number=number) for rule, terrain, number in jobs)


@pytest.fixture
def progress():
    return RunProgress(STAGES, DURATIONS, cores=2, start=0.0)


def test_stages_in_the_order_of_the_workflow_with_planned_running_and_finished_jobs(progress):
    log = PLAN + started(("scan", "01", 1), ("scan", "03", 2))
    progress.update(log, 4.0)
    log += FINISHED.format(number=1) + started(("mesh", "01", 3))
    progress.update(log, 10.0)
    progress.update(log, 20.0)
    acquire, rocks = progress.stages()
    assert (acquire.name, acquire.jobs, acquire.done, acquire.running, acquire.elapsed_s) == (
        "acquire", 2, 1, ("scan 03",), 16.0,
    )  # fmt: skip
    assert (rocks.name, rocks.jobs, rocks.done, rocks.running, rocks.elapsed_s) == ("rocks", 2, 0, ("mesh 01",), 10.0)
    total = progress.total()
    assert (total.jobs, total.done) == (4, 1)  # without the target rule `all`
    # Of 80 s of work 30 s are done: 10 s and at most 10 s of the scans, 10 s of the mesh.
    assert total.left_s == pytest.approx(50 / ((30 + 2 * 60) / (20 + 60)))
    assert acquire.left_s + rocks.left_s == pytest.approx(total.left_s)


def test_the_time_left_is_at_least_the_rest_of_the_longest_running_job(progress):
    plan = PLAN.replace("scan             2", "scan             1").replace("mesh             2", "mesh             1")
    log = plan + started(("scan", "01", 1)) + FINISHED.format(number=1) + started(("mesh", "01", 2))
    progress.update(log, 0.0)
    assert progress.left_s == 30.0


def test_the_time_left_follows_the_measured_speed():
    """A machine of half the speed needs twice the time, once the measured speed outweighs the assumed speed."""
    found = {}
    for slowdown in (1, 2):
        progress = RunProgress(STAGES, {"scan": 600.0, "mesh": 0.0}, cores=1, start=0.0)
        progress.update(PLAN + started(("scan", "01", 1)), 0.0)
        progress.update(PLAN + started(("scan", "01", 1)) + FINISHED.format(number=1), 600.0 * slowdown)
        found[slowdown] = progress.left_s
    assert found[1] == pytest.approx(600)
    assert found[2] == pytest.approx(600 * (1200 + 60) / (600 + 60))


def test_a_failed_job_is_counted_until_it_is_repeated(progress):
    log = PLAN + started(("scan", "01", 1)) + FAILED.format(rule="scan", number=1)
    progress.update(log, 5.0)
    (acquire, _) = progress.stages()
    assert (acquire.failed, acquire.running) == (1, ())
    assert "1 failed" in acquire.line()
    assert "1 failed" in progress_line(progress)
    progress.update(log + started(("scan", "01", 1)), 6.0)
    (acquire, _) = progress.stages()
    assert (acquire.failed, acquire.running) == (0, ("scan 01",))


def test_without_a_plan_there_are_no_jobs(progress):
    progress.update("Building DAG of jobs...\n", 3.0)
    assert progress.stages() == []
    assert progress_line(progress) == "0:03: planning the jobs"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class ClosedTerminal(Terminal):
    def write(self, text: str) -> int:
        raise OSError("Input/output error")


def shown(progress: RunProgress, stream: io.StringIO, seconds: int) -> list[str]:
    """Return the lines of a run of two scans, with an update per second."""
    log = PLAN + started(("scan", "01", 1), ("scan", "03", 2))
    with showing(progress, stream) as display:
        for now in range(seconds):
            progress.update(log, float(now))
            display.update()
        display.write("stopping")
    return stream.getvalue().splitlines()


def test_a_file_gets_a_line_every_30_seconds_and_the_stages_at_the_end(progress):
    lines = shown(progress, io.StringIO(), 100)
    assert [line.partition(": ")[0] for line in lines[:3]] == ["0:30", "1:00", "1:30"]
    assert lines[0].startswith("0:30: 0 of 4 jobs, about ")
    assert lines[0].endswith(" left: acquire 0/2")
    assert lines[3] == "stopping"
    assert [line.split() for line in lines[4:]] == [
        ["acquire", "0", "of", "2", "jobs", "1:39"], ["rocks", "0", "of", "2", "jobs", "0:00"],
    ]  # fmt: skip
    assert max(map(len, lines)) <= 100


def test_a_late_line_does_not_bring_more_lines(progress):
    stream = io.StringIO()
    with showing(progress, stream) as display:
        for now in (3.5 * LINE_S, 3.6 * LINE_S, 3.9 * LINE_S, 4.1 * LINE_S):
            progress.update(PLAN, now)
            display.update()
    assert [line.partition(": ")[0] for line in stream.getvalue().splitlines()[:-2]] == ["1:45", "2:03"]


def test_a_narrow_terminal_gets_no_longer_line(progress, monkeypatch):
    monkeypatch.setenv("COLUMNS", "44")
    monkeypatch.setenv("TERM", "xterm")
    text = "\n".join(shown(progress, Terminal(), 3))
    plain = text.replace("\x1b[2K", "").replace("\x1b[1A", "").replace("\x1b[?25l", "").replace("\x1b[?25h", "")
    assert "acquire" in plain
    assert "total" in plain
    assert "stopping" in plain
    assert max(len(line) for line in plain.replace("\r", "\n").splitlines()) <= 44


def test_a_closed_terminal_is_ignored(progress):
    assert shown(progress, ClosedTerminal(), 3) == []


def test_durations_of_a_run_replace_shipped_durations(tmp_path):
    def measured(stage: str, name: str, seconds: float | None) -> None:
        path = tmp_path / f"logs/{stage}/{name}.log"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(
            "INFO took 90.0 s\nINFO " + (f"took {seconds:.1f} s, 1.5 CPU s, at most 200 MB\n" if seconds else "")
        )

    measured("acquire", "scan_01", 4)
    measured("acquire", "scan_03", 6)
    measured("rocks", "mesh_fine_01", 7)  # not of the rule `mesh`
    measured("rocks", "mesh_01", None)
    measured("rocks", "unknown_01", 3)
    (tmp_path / "logs/rocks/mesh_03.log").mkdir()
    (tmp_path / "logs/rocks/mesh_11.log").write_bytes(b"\xff INFO took 2.0 s, 1.5 CPU s, at most 200 MB\n")
    assert measured_durations(tmp_path, STAGES) == {"scan": 5.0, "mesh_fine": 7.0}
    found = expected_durations(tmp_path, [*STAGES, "render_twins"])
    assert (found["scan"], found["mesh"], found["mesh_fine"]) == (5.0, UNKNOWN_S, 7.0)
    assert found["render_twins"] > 1  # shipped


def test_shipped_durations_are_of_rules_of_the_workflow():
    stages = stages_of_rules(CHECKOUT)
    assert list(dict.fromkeys(stages.values()))[:4] == ["acquire", "cameras", "rocks", "labels"]
    assert {"mesh_rocks", "draw_photos_of_other_terrains", "merge_twin_labels"} <= set(stages)
    assert not {"all", "labels", "tables"} & set(stages)
    found = expected_durations(CHECKOUT / "results/none", stages)
    known = [rule for rule, seconds in found.items() if seconds != UNKNOWN_S]
    assert len(known) > 35
    assert sum(found[rule] for rule in ("train_detector", "train_other_detector", "predict", "generate_analog")) > 60


@pytest.mark.parametrize(("seconds", "text"), [(5, "0:05"), (245.4, "4:05"), (3845, "1:04:05")])
def test_a_clock_shows_minutes_and_hours(seconds, text):
    assert clock(seconds) == text
