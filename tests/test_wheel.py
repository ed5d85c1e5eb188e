"""The wheel without extras and clone: every command works or names the missing extra or file in one line."""

import json
import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

from polarsim.formats import obj, png
from polarsim.geometry.meshes import Mesh

CHECKOUT = Path(__file__).parent.parent
EXTRAS = (
    "torch", "torchvision", "ultralytics", "av", "gymnasium", "mcap", "mcap_ros2", "mujoco", "rasterio", "rosbags",
)  # fmt: skip
# Calls of the command without modules of extras, as JSON: [exit code, stdout, stderr] of each call.
PROGRAM = f"""
import contextlib, io, json, sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {EXTRAS}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Absent())
from polarsim.cli import main
results = []
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["polarsim", *arguments]
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as errors:
        try:
            main()
        except SystemExit as ended:
            results.append([ended.code or 0, out.getvalue(), errors.getvalue()])
print(json.dumps(results))
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


WITHOUT = {  # calls that fail, each with the text of the error
    ("detect", "picture.png", "--weights", "x.pt", "--out", "new"): "polarsim[detect]",
    ("drive", "--results", "runs"): "no stored configuration",
    ("drive", "--results", "runs", "--configfile", "config/overlays/rover.yaml"): "polarsim[rover]",  # in the wheel
    ("report",): "results: no such folder",
    ("render", "config/views.yaml", "out"): "the ground mesh is missing",  # of a run
}


def test_commands_work_or_name_missing_extras_and_files_in_one_line(installed):
    with tempfile.TemporaryDirectory() as name:  # outside the checkout, whose parents may contain a demo
        folder = Path(name)
        png.write_png(folder / "picture.png", np.zeros((48, 64), np.uint8))
        for terrain in (1, 3, 6, 11):
            mesh = folder / f"runs/demo/meshes/Terrain{terrain:02d}" / obj.ground_name(terrain)
            obj.write_obj(mesh, SQUARE, "ground")
        calls = [("brdf", "hapke", "--plot", "curves.png"), *WITHOUT]
        done = subprocess.run(
            [sys.executable, "-P", "-c", PROGRAM, json.dumps(calls)], cwd=folder, capture_output=True, text=True,
            env=os.environ | {"PYTHONPATH": str(installed)}, check=True,
        )  # fmt: skip
        (code, printed, errors), *refused = json.loads(done.stdout)
        assert (code, errors) == (0, "")
        assert "pi f_r" in printed
        assert png.read_png(folder / "curves.png").shape[1] == 1600
    for (code, _, errors), named in zip(refused, WITHOUT.values(), strict=True):
        assert code == 1
        (line,) = errors.splitlines()
        assert line.startswith("error: ")
        assert named in line
