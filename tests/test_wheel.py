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
import typer

from polarsim.cli import app
from polarsim.extras import EXTRA_OF
from polarsim.formats import coco, obj, png, rle, yolo
from polarsim.formats.coco_annotations import Annotation
from polarsim.geometry.meshes import Mesh
from polarsim.photo import PhotoKey
from polarsim.site import polar

CHECKOUT = Path(__file__).parent.parent
# Calls of the command in an installation of the core, as JSON: [exit code, stdout, stderr] of each call.
PROGRAM = f"""
import contextlib, importlib.util, io, json, sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {(*EXTRA_OF, "mitsuba", "polars")}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Absent())
find_spec = importlib.util.find_spec
def find_spec_or_none(name, package=None):
    with contextlib.suppress(ModuleNotFoundError):
        return find_spec(name, package)
importlib.util.find_spec = find_spec_or_none
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
pytestmark = pytest.mark.slow
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


KEY = "01_A_off_30_L_0256"
VIEWS = """
scenes: [{name: flat, meshes: runs/demo/meshes/Terrain01, terrain: 1}]
lens: {kind: pinhole, hfov_deg: 60, width_px: 64, height_px: 48}
cameras: [{kind: point, position_m: [0, 0, 1], look_at_m: [1, 0, 0]}]
lights: [{kind: sun, azimuth_deg: [30], elevation_deg: [20]}]
"""
WORKS = {  # calls that work in the core, each with a file that they write
    "brdf hapke --plot curves.png": "curves.png",
    "render views.yaml views": "views/contact.jpg",
    "rules": None,
    "check-site polar": None,
    "new-site raw --out site.yaml": "site.yaml",
    "schema": None,
    "score labels labels": None,
    "validate labels --json findings.json": "findings.json",
    "ipd labels predictions labels predictions --json ipd.json": "ipd.json",
    "masks polygons masks": f"masks/{KEY}.png",
    "outline coco.json outlines.json": "outlines.json",
    "import coco.json seeds": f"seeds/{KEY}.txt",
}
FAILS = {  # calls that fail, each with the exit code and the text of the error
    f"show {KEY} --results runs": (2, "polarsim[pipeline]"),
    f"undo {KEY} --results runs --configfile config/config.yaml": (2, "polarsim[pipeline]"),
    "export exported --results runs": (2, "polarsim[pipeline]"),
    "explore --results runs --no-browser": (2, "polarsim[pipeline]"),
    "compare demo --results runs": (2, "polarsim[pipeline]"),
    "publish demo published --format coco --results runs": (2, "polarsim[pipeline]"),
    "run": (2, "polarsim[pipeline]"),
    "report": (1, "results: no such folder"),
    "detect picture.png --weights x.pt --out new": (2, "polarsim[detect]"),
    "rocks cloud.las --out rocks.csv": (2, "polarsim[las]"),
    "drive --results runs": (2, "polarsim[rover]"),
    "render config/views.yaml out": (1, "the ground mesh is missing"),  # of a run
    "render views.yaml taichi_views --engine taichi": (2, "--engine does not apply"),
    "render runs/demo/meshes/Terrain01 taichi.png --engine taichi": (2, "polarsim[taichi]"),
}


@pytest.fixture
def work():
    """Folder outside the checkout, whose parents may contain a demo, with the files of the calls."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for terrain in (1, 3, 6, 11):
            mesh = folder / f"runs/demo/meshes/Terrain{terrain:02d}" / obj.ground_name(terrain)
            obj.write_obj(mesh, SQUARE, "ground")
        for table in ("acquire/Terrain01/photos.parquet", "rocks/Terrain01/rocks.parquet"):
            (folder / "runs/demo" / table).parent.mkdir(parents=True)
            (folder / "runs/demo" / table).write_bytes(b"PAR1")
        metrics = "stage,terrain,subject,metric,value,unit,n,against\ncameras,1,A,agreement,0.9,1,1,own\n"
        (folder / "runs/demo/evaluation").mkdir()
        (folder / "runs/demo/evaluation/cameras_Terrain01.csv").write_text(metrics)
        (folder / "runs/demo/acquire/Terrain01/seeds").mkdir()
        files = {"calibration": "", "ground": "", "clouds": {}, "cover_photos": {}, "meshes": {}, "range_maps": {}}
        inventory = json.dumps({"kind": "analog", "terrain": 1, **files})
        (folder / "runs/demo/acquire/Terrain01/inventory.json").write_text(inventory)
        boxes = "runs/demo/labels/boxes/Terrain01"
        for place, confidence in (
            ("runs/demo/acquire/Terrain01/seeds", ""),
            (boxes, ""),
            ("labels", ""),
            ("predictions", " 0.9"),
        ):
            (folder / place).mkdir(parents=True, exist_ok=True)
            (folder / place / f"{KEY}.txt").write_text(f"0 0.5 0.5 0.1 0.1{confidence}\n")
        png.write_png(folder / "picture.png", np.zeros((48, 64), np.uint8))
        for name in ("a_45_0040", "a_45_0160", "b_45_0040", "b_45_0160"):
            png.write_png(folder / f"raw/{name}.png", np.full((48, 64), 200, np.uint8))
        yolo.write_polygons(
            folder / f"polygons/{KEY}.txt", [(2, np.array([[10.0, 10], [30, 10], [30, 25]]))], size=polar().images.size
        )
        mask = rle.encode_rle(np.ones((15, 20)), polar().images.size, 100, 100)
        annotation = Annotation("rock", 4, np.array([100.0, 100, 120, 115]), mask)
        coco.write_coco(folder / "coco.json", {PhotoKey.parse(KEY): [annotation]}, polar(), polar().images.size)
        (folder / "views.yaml").write_text(VIEWS)
        (folder / "Snakefile").write_text("")
        yield folder


def test_every_command_of_the_core_works_or_names_an_extra_or_file_in_one_line(installed, work):
    calls = [call.split() for call in (*WORKS, *FAILS)]
    assert {call[0] for call in calls} == set(typer.main.get_command(app).commands)
    done = subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM, json.dumps(calls)], cwd=work, capture_output=True, text=True,
        env=os.environ | {"PYTHONPATH": str(installed)}, check=True,
    )  # fmt: skip
    results = dict(zip((*WORKS, *FAILS), json.loads(done.stdout), strict=True))
    for call, file in WORKS.items():
        assert results[call][0] == 0, (call, results[call])
        assert file is None or (work / file).stat().st_size > 0
    for call, (code, text) in FAILS.items():
        assert results[call][0] == code, (call, results[call])
        (line,) = results[call][2].splitlines()
        assert line.startswith("error: ")
        assert text in line
    assert "Numba is not installed" in results["render views.yaml views"][2]
    assert "pi f_r" in results["brdf hapke --plot curves.png"][1]
    assert png.read_png(work / "curves.png").shape[1] == 1600
