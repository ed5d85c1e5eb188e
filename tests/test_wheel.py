"""The wheel without extras and clone: every command works or names the missing extra or file in one line."""

import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from polarsim.formats import obj, png
from polarsim.geometry.meshes import Mesh

CHECKOUT = Path(__file__).parent.parent
EXTRAS = (
    "torch",
    "torchvision",
    "ultralytics",
    "av",
    "gymnasium",
    "mcap",
    "mcap_ros2",
    "mujoco",
    "rasterio",
    "rosbags",
)
BLOCKED = f"""
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {EXTRAS}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Absent())
from polarsim.cli import main
main()
"""
SQUARE = Mesh(np.array([[-2.0, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """Folder with the content of the wheel, built from files under version control."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    parts = ("polarsim", "config", "pyproject.toml", "README.md", "LICENSE")
    subprocess.run(["cp", "-rP", *parts, str(source)], cwd=CHECKOUT, check=True)
    build = ("--no-deps", "--no-build-isolation", "-q", "-w", str(folder))
    subprocess.run([sys.executable, "-m", "pip", "wheel", str(source), *build], check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


@pytest.fixture
def tmp_path() -> Iterator[Path]:
    """Folder outside the checkout, whose parents may contain a demo."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


@pytest.fixture
def call(installed, tmp_path):
    """Call the command of the wheel without modules of extras in an empty folder."""

    def run(*arguments: object) -> subprocess.CompletedProcess:
        return subprocess.run(
            [sys.executable, "-P", "-c", BLOCKED, *map(str, arguments)], cwd=tmp_path, capture_output=True, text=True,
            env=os.environ | {"PYTHONPATH": str(installed)}, check=False,
        )  # fmt: skip

    return run


def test_configurations_are_in_the_wheel(installed):
    there = {path.name for path in (CHECKOUT / "config").glob("*.*")}
    assert there <= {path.name for path in (installed / "polarsim/configs").glob("*.*")}
    assert (installed / "polarsim/py.typed").exists()
    (metadata,) = installed.glob("*.dist-info/METADATA")
    text = metadata.read_text()
    for field in (
        "Author: ",
        "Classifier: Programming Language :: Python :: 3.13",
        "Project-URL: ",
        "License-Expression: ",
    ):
        assert field in text


def test_commands_work_without_extras_and_clone(call, tmp_path):
    done = call("brdf", "hapke", "--plot", "curves.png")
    assert done.returncode == 0, done.stderr
    assert "pi f_r" in done.stdout
    assert png.read_png(tmp_path / "curves.png").shape[1] == 1600


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("detect", "picture.png", "--weights", "x.pt", "--out", "new"), "polarsim[detect]"),
        (("drive", "--configfile", "config/overlays/rover.yaml"), "polarsim[rover]"),  # configuration in the wheel
        (("drive",), "no stored configuration"),
        (("report",), "results: no such folder"),
        (("render", "config/views.yaml", "out"), "the ground mesh is missing"),  # of a run
    ],
)
def test_missing_extras_and_files_are_named_in_one_line(call, tmp_path, arguments, named):
    png.write_png(tmp_path / "picture.png", np.zeros((48, 64), np.uint8))
    if arguments[0] == "drive":
        for terrain in range(1, 14):
            name = obj.ground_name(terrain)
            obj.write_obj(tmp_path / f"results/demo/meshes/Terrain{terrain:02d}" / name, SQUARE, "ground")
    done = call(*arguments)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    assert named in line
