"""Interrupt a run at random moments and check that the same command completes it with the same bytes.

    make chaos                                                20 moments of each kind on a small analog, hours
    .venv/bin/python -m benchmarks.chaos --quick --moments 20 the same on a workflow of quick jobs

Kinds: kill -9 of `polarsim run`, of snakemake (of a local job the parent), of a job; SIGTERM, SIGHUP and SIGINT; a disk
that becomes full at a random size (needs root); `scancel` and `scontrol requeue` of a running job on a SLURM of one
node (needs root and SLURM, otherwise skipped). After each interruption the same command must exit with code 0, leave no
process, no job and no file of a killed job, and produce the same bytes.

Last metrics: docs/howto/trouble.md.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from polarsim.running import processes
from tests.support.made_slurm import CORES, MEMORY_MB, Slurm, running_slurm, why_not
from tests.support.made_workflow import write_workflow

CHECKOUT = Path(__file__).parents[1]
SMALL = """
run: chaos
terrains: [1]
positions: [A]
source: {kind: analog, root: data/analog}
rocks: {rock_cell_mm: 12, ground_mesh_cell_mm: 40}
grid: {azimuths: ["30"], lights: ["off"], exposures_ms: [256]}
render: {models: [hapke]}
"""
KINDS = ("kill run", "kill snakemake", "kill job", "SIGTERM", "SIGHUP", "SIGINT", "full disk")
SLURM_KINDS = {"scancel": ("scancel",), "requeue": ("scontrol", "requeue")}  # command that gets the job
# The node is smaller than the node of the profile, and no time limit is longer than needed.
THROUGH_SLURM = (
    *("--profile", "config/profiles/slurm", "--cores", str(CORES), "--resources", f"mem_mb={MEMORY_MB}"),
    *("--latency-wait", "10", "--slurm-init-seconds-before-status-checks", "2"),
)
QUICK_GROUPS = ("--groups", "first=terrain", "second=terrain", "last=terrain")
NO_OUTPUTS = {"logs", "benchmarks"}


class ChaosError(Exception):
    """A resumed run differs from an undisturbed run."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--moments", type=int, default=20, help="number of moments of each kind")
    parser.add_argument("--kinds", nargs="+", choices=(*KINDS, *SLURM_KINDS), help="default: all possible kinds")
    parser.add_argument("--seed", type=int, default=32)
    parser.add_argument("--quick", action="store_true", help="a workflow of quick jobs instead of the analog")
    parser.add_argument("--minutes", type=float, default=1e9, help="time after which no moment starts")
    arguments = parser.parse_args()
    kinds = arguments.kinds or (*KINDS, *SLURM_KINDS)
    if SLURM_KINDS.keys() & set(kinds) and (reason := why_not()):
        if arguments.kinds:
            parser.error(reason)
        print(f"without {', '.join(SLURM_KINDS)}: {reason}", flush=True)
        kinds = KINDS
    until = time.monotonic() + 60 * arguments.minutes
    done = dict.fromkeys(kinds, 0)
    with tempfile.TemporaryDirectory(prefix="chaos ") as name, ExitStack() as context:  # a path with a space
        rng, folder = random.Random(arguments.seed), Path(name).resolve()
        suites: dict[str, Suite] = {}
        if local := [kind for kind in kinds if kind in KINDS]:
            suites |= dict.fromkeys(local, Suite(folder / "local", rng, quick=arguments.quick))
        if submitted := [kind for kind in kinds if kind in SLURM_KINDS]:
            slurm = context.enter_context(running_slurm())
            suites |= dict.fromkeys(submitted, SlurmSuite(folder / "slurm", rng, slurm, quick=arguments.quick))
        for number in range(arguments.moments):
            for kind in kinds:
                if time.monotonic() < until:
                    said = suites[kind].disturb(kind)
                    done[kind] += 1
                    print(f"{number + 1}: {kind}: {said}; the same bytes", flush=True)
    for kind, count in done.items():
        print(f"| {kind} | {count} | the same command: exit code 0, the same bytes, nothing left |")


class Suite:
    """Folder with a workflow, and the files of an undisturbed local run."""

    def __init__(self, folder: Path, rng: random.Random, *, quick: bool) -> None:
        self.folder, self.rng, self.results = folder / "a run", rng, folder / "a run/results"
        self.log = folder / "said.txt"  # output of the last call
        self.words: tuple[str, ...] = ()
        if quick:
            write_workflow(self.folder)
        else:
            for part in ("workflow", "config"):
                shutil.copytree(CHECKOUT / part, self.folder / part)
            shutil.copy(CHECKOUT / "Snakefile", self.folder)
            (self.folder / "config/chaos.yaml").write_text(SMALL)
            self.words = ("labels", "geometry", "--configfile", "config/chaos.yaml")
            self.finish()  # generates the raw data, which are kept
        self.clear()
        began = time.monotonic()
        self.finish()
        self.seconds, self.expected = time.monotonic() - began, self.digests()
        self.size = sum((self.results / name).stat().st_size for name in self.expected)
        print(f"undisturbed: {self.seconds:.0f} s, {len(self.expected)} files", flush=True)

    def start(self) -> subprocess.Popen[bytes]:
        """Start the command."""
        program = [sys.executable, "-c", "from polarsim.cli import main; main()"]
        environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
        with self.log.open("w") as log:
            words = [*program, "run", *self.words, "--min-free", "0"]
            return subprocess.Popen(words, cwd=self.folder, env=environment, stdout=log, stderr=subprocess.STDOUT)

    def finish(self) -> None:
        """Run the command to the end."""
        if code := self.start().wait():
            raise ChaosError(f"exit code {code}: {self.said()}")

    def said(self) -> str:
        return self.log.read_text(errors="replace")[-3000:]

    def clear(self) -> None:
        """Delete everything except the raw data."""
        for path in (self.results, self.folder / ".snakemake"):
            shutil.rmtree(path, ignore_errors=True)

    def digests(self) -> dict[str, str]:
        """Return the sha256 of all outputs and of all other files of the run."""
        return {
            str(path.relative_to(self.results)): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(self.results.rglob("*"))
            if path.is_file() and not NO_OUTPUTS.intersection(path.parts) and path.name != ".snakemake_timestamp"
        }

    def left(self) -> list[str]:
        """Return the processes that still run."""
        return [f"process {one.pid}" for one in processes.processes_of_run(self.folder)]

    def disturb(self, kind: str) -> str:
        """Disturb a new run once, complete it by the same command, compare, and return a description.

        Raises
        ------
        ChaosError
            The run has different bytes, or left a process or file.
        """
        self.clear()
        what = self.fill_up() if kind == "full disk" else self.stop(kind)
        self.finish()
        left, found = self.left(), self.digests()
        if self.results.is_mount():
            subprocess.run(["umount", str(self.results)], check=True)
        if left or found != self.expected:
            other = sorted(name for name in {*found, *self.expected} if found.get(name) != self.expected.get(name))
            raise ChaosError(f"{kind}, {what}: left {left}, files that are others: {other}")
        return what

    def stop(self, kind: str) -> str:
        """Disturb at a random moment, or when the target exists; repeat if the run ended before."""
        while True:
            began, moment, process = time.monotonic(), self.rng.uniform(0, self.seconds), self.start()
            time.sleep(moment)
            while process.poll() is None:
                if self.hit(kind, process):
                    moment = time.monotonic() - began
                    return f"{moment:.1f} s after the start, exit code {process.wait()}"
                time.sleep(0.05)
            if process.returncode:
                raise ChaosError(f"exit code {process.returncode}: {self.said()}")
            self.clear()

    def hit(self, kind: str, process: subprocess.Popen[bytes]) -> bool:
        """Kill the target, and return whether it existed."""
        marked = processes.processes_of_run(self.folder)
        snakemake = [one for one in marked if one.ppid() == process.pid]
        scripts = [one for one in marked if any("/.snakemake/scripts/" in word for word in one.cmdline())]
        there = {"kill snakemake": snakemake, "kill job": scripts}.get(kind, [process])
        for one in there[:1]:
            one.send_signal(signal.SIGKILL if kind.startswith("kill") else signal.Signals[kind])
        return bool(there)

    def fill_up(self) -> str:
        size = int(self.rng.uniform(0.02, 0.9) * self.size)
        self.results.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(self.results)], check=True)
        code = self.start().wait()
        if code != 1 or "No space left" not in self.log.read_text(errors="replace"):
            raise ChaosError(f"{size} bytes: exit code {code}: {self.said()}")
        subprocess.run(["mount", "-o", "remount,size=2g", str(self.results)], check=True)
        return f"{size} bytes, exit code {code}"


class SlurmSuite(Suite):
    """Suite with the profile of SLURM; its bytes must equal those of a local run."""

    def __init__(self, folder: Path, rng: random.Random, slurm: Slurm, *, quick: bool) -> None:
        super().__init__(folder, rng, quick=quick)
        self.slurm = slurm
        if quick:
            shutil.copytree(CHECKOUT / "config/profiles/slurm", self.folder / "config/profiles/slurm")
        self.words += (*THROUGH_SLURM, *(QUICK_GROUPS if quick else ()))
        self.clear()
        self.seconds = self.last_work()
        if self.digests() != self.expected:
            raise ChaosError("an undisturbed run through SLURM has different bytes")
        print(f"undisturbed through SLURM: {self.seconds:.0f} s until the last job's end", flush=True)

    def last_work(self) -> float:
        """Run undisturbed, and return the seconds until the end of the last job."""
        began, last, process = time.monotonic(), 0.0, self.start()
        while process.poll() is None:
            if self.slurm.at_work():
                last = time.monotonic() - began
            time.sleep(0.2)
        if process.returncode:
            raise ChaosError(f"exit code {process.returncode}: {self.said()}")
        return last

    def left(self) -> list[str]:
        jobs = self.slurm.ask("squeue", "-h", "-t", "PENDING,RUNNING,COMPLETING,SUSPENDED", "-o", "job %i %T")
        return [*super().left(), *jobs.splitlines()]

    def hit(self, kind: str, process: subprocess.Popen[bytes]) -> bool:  # noqa: ARG002
        """Stop a running job, and return whether there was one."""
        jobs = self.slurm.at_work()
        if not jobs:
            return False
        job = self.rng.choice(jobs)
        subprocess.run([*SLURM_KINDS[kind], job], capture_output=True, timeout=30, check=False)
        stopped = {"scancel": "JobState=CANCELLED", "requeue": "Restarts=1"}[kind]
        while stopped not in (said := self.slurm.ask("scontrol", "--oneliner", "show", "job", job)):
            if "JobState=COMPLETED" in said:
                return False
            time.sleep(0.1)  # its processes are ending
        return True


if __name__ == "__main__":
    main()
