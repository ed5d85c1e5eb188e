"""Plans and lint of the workflow in an environment that has Snakemake alone, as that of the workflow catalogue."""

import subprocess
import sys
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement

CHECKOUT = Path(__file__).parents[2]
# Hides modules, and the installation of polarsim in this environment; then runs Snakemake as a fork for each command.
# Snakemake is imported first, because it imports all of its plugins, and the one of SLURM imports pandas.
BARE = """
import os, sys
from snakemake.cli import main
hidden, commands = map(eval, sys.argv[1:])
class Hider:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in hidden:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
for name in [name for name in sys.modules if name.partition(".")[0] in hidden]:
    del sys.modules[name]
sys.meta_path = [Hider(), *(finder for finder in sys.meta_path if "__editable__" not in str(finder))]
sys.path = [folder for folder in sys.path if not os.path.isdir(os.path.join(folder or ".", "polarsim"))]
for words in commands:
    if (child := os.fork()) == 0:
        sys.argv = ["snakemake", *words]
        main()
    if code := os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
        sys.exit(f"{code}: snakemake {' '.join(words)}")
"""


def normal(name: str) -> str:
    return name.lower().replace("_", "-").replace(".", "-")


def required_by(*names: str) -> set[str]:
    """Return the names of the distributions that these need, with themselves."""
    found: set[str] = set()
    waiting = list(names)
    while waiting:
        name = normal(waiting.pop())
        if name in found:
            continue
        try:
            needed = map(Requirement, requires(name) or [])
        except PackageNotFoundError:  # of another platform
            continue
        found.add(name)
        waiting += [one.name for one in needed if one.marker is None or one.marker.evaluate({"extra": ""})]
    return found


@pytest.mark.slow
def test_snakemake_alone_plans_and_lints(checkout):
    (checkout / "polarsim").symlink_to(CHECKOUT / "polarsim")  # without installation
    present = required_by("snakemake", "snakefmt")
    hidden = {
        module
        for module, distributions in packages_distributions().items()
        if module != "polarsim" and not {normal(name) for name in distributions} & present
    }
    assert {"numpy", "pandas", "scipy", "pyarrow", "cv2", "torch", "open3d", "numba", "typer"} <= hidden
    assert not {"snakemake", "pydantic", "yaml", "jinja2"} & hidden
    files = ["config/config.yaml", *(f"config/overlays/{name}.yaml" for name in ("rover", "rover_autonomy", "gap"))]
    plan = ("all", "gap", "rover_autonomy", "--dry-run", "--cores", "1", "--configfile", *files)
    commands = [plan, ("--lint",)]
    call = [sys.executable, "-c", BARE, repr(hidden), repr(commands)]
    done = subprocess.run(call, cwd=checkout, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    output = done.stdout + done.stderr
    assert "rule render_twins:" in output
    assert "rule drive_alone:" in output
    assert "good condition" in output
