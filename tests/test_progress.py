"""Progress of long loops without a terminal."""

import logging
import sys

import pytest

from polarsim import progress
from polarsim.progress import about, progress_bar, track
from polarsim.reporting import reporting


@pytest.fixture
def clock(monkeypatch):
    """Clock in seconds that a test sets."""
    time = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: time[0])
    return time


@pytest.mark.parametrize("has_log", [False, True], ids=["command", "job"])
def test_a_command_prints_a_line_every_30_seconds_and_a_job_logs_it(clock, tmp_path, capsys, monkeypatch, has_log):
    monkeypatch.setattr(logging.root, "handlers", [])
    log = tmp_path / "job.log"
    with reporting(log=log if has_log else None):
        with progress_bar("drive 3") as report:
            for second in range(100):
                clock[0] = float(second)
                report(second / 100)
        logging.getLogger("polarsim").info("not progress")
        logging.getLogger("polarsim").warning("a warning")
    expected = [
        f"INFO drive 3: {done} %, about {left} left" for done, left in ((30, "1 min"), (60, "40 s"), (90, "10 s"))
    ]
    printed = capsys.readouterr().err.splitlines()
    assert printed == ["WARNING a warning"] if has_log else [*expected, "WARNING a warning"]
    if has_log:
        assert log.read_text().splitlines()[:-1] == [*expected, "INFO not progress", "WARNING a warning"]


def test_the_time_left_is_not_estimated_from_the_first_items(clock, capsys, monkeypatch):
    monkeypatch.setattr(logging.root, "handlers", [])
    with reporting(), progress_bar("frames") as report:
        for clock[0], share in ((40.0, 0.005), (80.0, 0.4)):
            report(share)
    assert capsys.readouterr().err.splitlines() == ["INFO frames: 0 %", "INFO frames: 40 %, about 2 min left"]


def test_a_loop_yields_its_items_and_is_silent_if_it_is_short(clock, capsys):
    with reporting():
        assert list(track("abc", "letters")) == ["a", "b", "c"]
        assert list(track([], "nothing")) == []
    assert capsys.readouterr().err == ""


def test_a_terminal_has_a_bar(monkeypatch, capfd):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "50")
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    assert list(track(range(3), "views")) == [0, 1, 2]
    shown = capfd.readouterr().err
    assert "views" in shown
    assert "100%" in shown


def test_a_loop_inside_another_has_its_own_line(monkeypatch, capfd):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "50")
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    with progress_bar("drive") as report:
        for _ in track(range(2), "frames"):
            pass
        report(1.0)
    last = capfd.readouterr().err.rpartition("drive")[2]  # the bars are drawn in the order of their start
    assert "frames" in last
    assert last.count("100%") == 2
    assert list(track(range(2), "later")) == [0, 1]
    assert "frames" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "about 10 s"), (41, "about 50 s"), (51, "about 1 min"), (350, "about 6 min"), (9000, "about 2.5 h")],
)
def test_durations_are_rounded(seconds, text):
    assert about(seconds) == text
