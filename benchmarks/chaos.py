"""Kill a run at random moments: the same command ends it with the bytes of a run that nobody disturbed.

    make chaos                                                 20 moments of each kind on a small analog, hours
    .venv/bin/python benchmarks/chaos.py --quick --moments 20  the same on a workflow of quick jobs, minutes

Kinds: kill -9 of `polarsim run`, of snakemake (of a local job the parent), of a job; SIGTERM, SIGHUP and SIGINT; a disk
that is full at a random size (needs root). After each the same command must end with exit code 0, leave no process and
no file of a killed job, and have made the same bytes.

Last figures (two cores, load 10 to 19), --quick, seed 32: docs/howto/trouble.md.
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
from pathlib import Path

from made_workflow import write_workflow

from polarsim.running import processes

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
NO_OUTPUTS = {"logs", "benchmarks"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--moments", type=int, default=20, help="of each kind")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--seed", type=int, default=32)
    parser.add_argument("--quick", action="store_true", help="a workflow of quick jobs instead of the analog")
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no moment after that time")
    arguments = parser.parse_args()
    until = time.monotonic() + 60 * arguments.minutes
    with tempfile.TemporaryDirectory(prefix="chaos ") as name:  # a space in the name, as users have them
        suite = Suite(Path(name).resolve(), random.Random(arguments.seed), quick=arguments.quick)
        print(f"undisturbed: {suite.seconds:.0f} s, {len(suite.expected)} files", flush=True)
        done = dict.fromkeys(arguments.kinds, 0)
        for number in range(arguments.moments):
            for kind in arguments.kinds:
                if time.monotonic() < until:
                    suite.disturb(kind)
                    done[kind] += 1
                    print(f"{number + 1}: {kind}: the same bytes", flush=True)
    for kind, count in done.items():
        print(f"| {kind} | {count} | the same command: exit code 0, the same bytes, nothing left |")


class Suite:
    """A folder with a workflow, and what an undisturbed run of it makes."""

    def __init__(self, folder: Path, rng: random.Random, *, quick: bool) -> None:
        self.folder, self.rng, self.results = folder / "a run", rng, folder / "a run/results"
        if quick:
            write_workflow(self.folder)
            self.words: tuple[str, ...] = ()
        else:
            for part in ("workflow", "config"):
                shutil.copytree(CHECKOUT / part, self.folder / part)
            shutil.copy(CHECKOUT / "Snakefile", self.folder)
            (self.folder / "config/chaos.yaml").write_text(SMALL)
            self.words = ("labels", "geometry", "--configfile", "config/chaos.yaml")
            self.finish()  # generates the raw data, which stay
        self.clear()
        began = time.monotonic()
        self.finish()
        self.seconds, self.expected = time.monotonic() - began, self.digests()
        self.size = sum((self.results / name).stat().st_size for name in self.expected)

    def start(self) -> subprocess.Popen[str]:
        """The one command."""
        program = [sys.executable, "-c", "from polarsim.cli import main; main()"]
        words = ["run", *self.words, "--min-free", "0"]
        environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
        output = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        return subprocess.Popen([*program, *words], cwd=self.folder, env=environment, **output)

    def finish(self) -> None:
        """The same command, to the end."""
        process = self.start()
        said, _ = process.communicate()
        if process.returncode:
            sys.exit(f"exit code {process.returncode}: {said[-3000:]}")

    def clear(self) -> None:
        """Begin from the raw data."""
        for path in (self.results, self.folder / ".snakemake"):
            shutil.rmtree(path, ignore_errors=True)

    def digests(self) -> dict[str, str]:
        """sha256 of all that the run made, and of all that it left beside it."""
        return {
            str(path.relative_to(self.results)): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(self.results.rglob("*"))
            if path.is_file() and not NO_OUTPUTS.intersection(path.parts) and path.name != ".snakemake_timestamp"
        }

    def disturb(self, kind: str) -> None:
        """Disturb a run from the beginning once, end it by the same command, compare."""
        self.clear()
        if kind == "full disk":
            self.fill_up()
        else:
            self.stop(kind)
        self.finish()
        left = processes.marked(self.folder)
        found = self.digests()
        if self.results.is_mount():
            subprocess.run(["umount", str(self.results)], check=True)
        if left or found != self.expected:
            other = sorted(name for name in {*found, *self.expected} if found.get(name) != self.expected.get(name))
            sys.exit(f"{kind}: processes {left}, files that are others: {other}")

    def stop(self, kind: str) -> None:
        process = self.start()
        time.sleep(self.rng.uniform(0, self.seconds))
        marked = processes.marked(self.folder)
        snakemake = [pid for pid in processes.children(process.pid) if pid in marked]
        scripts = [pid for pid in marked if processes.runs_script(pid)]
        hit = {"kill snakemake": snakemake, "kill job": scripts}.get(kind, [process.pid])
        number = signal.SIGKILL if kind.startswith("kill") else signal.Signals[kind]
        processes.send(hit[:1], number)
        process.communicate()

    def fill_up(self) -> None:
        size = int(self.rng.uniform(0.02, 0.9) * self.size)
        self.results.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(self.results)], check=True)
        process = self.start()
        said, _ = process.communicate()
        if process.returncode != 1 or "No space left" not in said:
            sys.exit(f"{size} bytes: exit code {process.returncode}: {said[-3000:]}")
        subprocess.run(["mount", "-o", "remount,size=2g", str(self.results)], check=True)


if __name__ == "__main__":
    main()
