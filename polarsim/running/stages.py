"""Progress of the stages of a run: numbers of jobs, elapsed and remaining time, from the log of Snakemake."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from polarsim.progress import about
from polarsim.running.jobs import WorkflowJob, planned_jobs, read_jobs

_WEIGHT_S = 60.0  # of the speed assumed before the run: one second of work per second and core


@dataclass(frozen=True)
class StageProgress:
    """Jobs of a stage, time since the first job, and expected time left, seconds."""

    name: str
    jobs: int
    done: int
    failed: int
    running: tuple[str, ...]
    elapsed_s: float
    left_s: float

    def line(self) -> str:
        """Return one line for a terminal."""
        share = f"{self.done}/{self.jobs}"
        elapsed = clock(self.elapsed_s) if self.elapsed_s or self.done else ""
        left = "done" if self.done == self.jobs else f"{about(self.left_s)} left"
        failed = f"{self.failed} failed  " if self.failed else ""
        return f"{self.name:14}{share:>9}{elapsed:>9}   {left:18}{failed}{', '.join(self.running)}".rstrip()


class RunProgress:
    """Progress of a run.

    `stages` is the stage of each rule, `durations` the expected duration of a job of each rule in seconds. The measured
    speed of the run scales the expected durations.
    """

    def __init__(self, stages: Mapping[str, str], durations: Mapping[str, float], cores: int, start: float) -> None:
        self._stages, self._durations, self._cores = stages, durations, cores
        self._start = self._now = start
        self._started: dict[int, float] = {}
        self._ended: dict[int, float] = {}
        self.planned: Counter[str] = Counter()
        self.jobs: list[WorkflowJob] = []

    def update(self, log: str, now: float) -> None:
        """Read the log of Snakemake at a time in seconds."""
        lines = log.splitlines()
        self._now = now
        self.jobs = [job for job in read_jobs(lines) if job.rule in self._stages]
        started = Counter(job.rule for job in self.jobs)
        self.planned = Counter({rule: jobs for rule, jobs in planned_jobs(lines).items() if rule in self._stages})
        self.planned |= started
        for job in self.jobs:
            self._started.setdefault(job.number, now)
            if job.finished:
                self._ended.setdefault(job.number, now)

    @property
    def elapsed_s(self) -> float:
        return self._now - self._start

    @property
    def left_s(self) -> float:
        """Expected time until the end of the run: all remaining work, at least the longest running job."""
        running = [self._durations[job.rule] - self._work(job) for job in self.jobs if not job.finished]
        return max([sum(map(self._remaining, self.planned)) / self._speed(), *running])

    def total(self) -> StageProgress:
        """Return the progress of all stages together."""
        stages = self.stages()
        jobs, done, failed = (sum(getattr(one, name) for one in stages) for name in ("jobs", "done", "failed"))
        return StageProgress("total", jobs, done, failed, (), self.elapsed_s, self.left_s)

    def stages(self) -> list[StageProgress]:
        """Return the progress of each stage that has jobs, in the order of the workflow."""
        speed, found = self._speed(), []
        for name in dict.fromkeys(self._stages.values()):
            rules = [rule for rule in self.planned if self._stages[rule] == name]
            jobs = [job for job in self.jobs if job.rule in rules]
            running = [job for job in jobs if not (job.finished or job.failed)]
            first = min((self._started[job.number] for job in jobs), default=self._now)
            last = self._now if running else max((self._ended.get(job.number, first) for job in jobs), default=first)
            if rules:
                found.append(
                    StageProgress(
                        name,
                        sum(self.planned[rule] for rule in rules),
                        sum(job.finished for job in jobs),
                        sum(job.failed for job in jobs),
                        tuple(f"{job.rule} {job.terrain[-2:]}".strip() for job in running),
                        last - first,
                        sum(map(self._remaining, rules)) / speed,
                    )
                )
        return found

    def _remaining(self, rule: str) -> float:
        """Return the expected work of the unfinished jobs of a rule, seconds."""
        done = sum(self._work(job) for job in self.jobs if job.rule == rule)
        return self.planned[rule] * self._durations[rule] - done

    def _work(self, job: WorkflowJob) -> float:
        """Return the completed part of the expected duration of a started job, seconds."""
        expected = self._durations[job.rule]
        if job.finished:
            return expected
        return 0.0 if job.failed else min(expected, self._now - self._started[job.number])

    def _speed(self) -> float:
        """Return the speed, seconds of expected work per second: the assumed and the measured speed, weighted."""
        work = sum(map(self._work, self.jobs))
        return (work + self._cores * _WEIGHT_S) / (self.elapsed_s + _WEIGHT_S)


def clock(seconds: float) -> str:
    """Return a duration as `4:05` or `1:04:05`."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
