"""Invalid arguments of every command: one line before any work, exit code 1 or 2, no output file."""

import shlex
from pathlib import Path

import numpy as np
import pytest
import typer

import polarsim as package
from polarsim.cli import app
from polarsim.formats import coco, obj, png, rle, yolo
from polarsim.formats.coco_annotations import Annotation
from polarsim.geometry.meshes import Mesh
from polarsim.photo import PhotoKey
from polarsim.site import polar
from tests.support.polar_photos import SIZE

KEY = "01_A_off_30_L_0256"
COMMANDS = sorted(typer.main.get_command(app).commands)
SQUARE = Mesh(np.array([[-2.0, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
VIEWS = """
scenes: [{name: flat, meshes: meshes, terrain: 1}]
lens: {kind: pinhole, hfov_deg: 60, width_px: 64, height_px: 48}
cameras: [{kind: point, position_m: [0, 0, HEIGHT], look_at_m: [1, 0, 0]}]
lights: [{kind: sun, azimuth_deg: [30], elevation_deg: [20]}]
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """Working folder with an input file of every command."""
    monkeypatch.chdir(tmp_path)
    obj.write_obj(Path("meshes") / obj.ground_name(1), SQUARE, "ground")
    yolo.write_boxes(Path("boxes") / f"{KEY}.txt", np.array([0]), np.array([[5.0, 5, 50, 60]]), size=SIZE)
    yolo.write_polygons(Path("polygons") / f"{KEY}.txt", [(2, np.array([[10.0, 10], [30, 10], [30, 25]]))], size=SIZE)
    mask = rle.encode_rle(np.ones((15, 20)), polar().images.size, 100, 100)
    coco.write_coco(
        Path("labels.json"),
        {PhotoKey.parse(KEY): [Annotation("rock", 4, np.array([100.0, 100, 120, 115]), mask)]},
        polar(),
        polar().images.size,
    )
    png.write_png(Path("picture.png"), np.zeros((48, 64), np.uint8))
    for run in ("demo", "release"):
        Path("results", run).mkdir(parents=True)
    Path("file").write_text("a file\n")
    Path("text.pt").write_text("no weights\n")
    Path("folder/out.json").mkdir(parents=True)
    Path("buried.yaml").write_text(VIEWS.replace("HEIGHT", "-1"))
    Path("far.yaml").write_text(VIEWS.replace("HEIGHT", "1.0e9"))
    Path("good.yaml").write_text(VIEWS.replace("HEIGHT", "1"))
    Path("no.yaml").write_text("scenes: 3\n")
    return tmp_path


# One command per line; each ending after :: is a separate call.
HOSTILE = """
:: nonsense | --nonsense | show 01_A | export new | render | score boxes | show | detect | ipd boxes
render meshes out.png --yaw :: nan | inf | x
render meshes out.png --pitch :: nan | 91
render meshes out.png :: --intensity -1 | --lamp-radius nan | --exposure inf | --threads 0 | --model marble
render meshes out.png --camera :: nan 0 1 | 0 0 1e9 | 9 9 -1 | 0 0
render meshes out.png --lamp :: nan 0 1 | 0 0 -1
render meshes out.png --sun :: 30 95 | nan 10 | 30
render meshes out.png --terrain :: 0 | 1.5 | 7
render meshes out.png --limit :: 3
render meshes out.png --option :: samples | samples=nan | nothing=1 | '' | blur_px=-1
render meshes :: folder | out.jpg | file/out.png | folder/out.png | LONG.png | out.png --maps file/maps
render :: nowhere out.png | file out.png | buried.yaml views | far.yaml views | no.yaml views | good.yaml file/views
render good.yaml views :: --limit 0 | --scale nan | --exposure 3
score boxes boxes :: --threshold nan | --threshold 2 | --json folder
ipd boxes boxes boxes boxes :: --confidence 2 | --pair-iou nan | --resamples 1 | --seed -1 | --unit rock | --json folder
brdf hapke :: --incidence 91 | --azimuth inf | --set basalt | --plot x.xyz | --plot file/x.png
outline labels.json out.json --simplify-px :: nan | 11
outline :: folder out.json | labels.json folder
masks :: nowhere out | polygons file | folder out
detect picture.png --weights text.pt --out new :: --confidence 0 | --device tpu | --widths x | --gates 30
detect picture.png :: --weights missing --out new | --weights text.pt --out file
show KEY :: --scale nan | --scale 1e9 | --kinds pebble | --out folder | --run ../results
validate boxes :: --workers 0 | --select X9 | --format xml | --json folder | --fix boxes
export new :: --terrain 0 | --tool paint | --keys '[' | --results file
compare demo :: nowhere | --out folder
report :: --cores 0 | nowhere
drive :: --seed -1 | --threads 0 | --configfile no.yaml | --out file
publish demo new --format :: csv | coco,csv | coco --subset colour=red | coco --max-size much | coco --results file
import labels.json :: file | folder | new --format csv | new --as truth | new --name a=b
import :: missing.json new | picture.png new
explore demo :: --out file | --width 0 | --port 99999
undo KEY :: --run demo | --configfile no.yaml
"""


def calls(text: str) -> list[str]:
    """Return the calls of these lines."""
    parts = [line.partition("::") for line in text.replace("KEY", KEY).replace("LONG", "a" * 300).splitlines()]
    return [f"{start.strip()} {end.strip()}".strip() for start, _, ends in parts if ends for end in ends.split("|")]


def test_the_version_is_that_of_the_package(polarsim):
    for option in ("--version", "-V"):
        done = polarsim(option)
        assert (done.returncode, done.stdout) == (0, f"polarsim {package.__version__}\n")


@pytest.mark.parametrize(
    ("words", "completion"),
    [("polarsim ren", "render"), ("polarsim render --exp", "--exposure"), ("polarsim brdf hapke_", "hapke_chrono")],
)
def test_a_shell_completes_commands_options_and_values(polarsim, monkeypatch, words, completion):
    monkeypatch.setenv("_POLARSIM_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(words.count(" ")))
    assert polarsim().stdout.split() == [completion]


@pytest.mark.parametrize(
    "call",
    [
        ("show", KEY, "--run", "realease"),
        ("publish", "realease", "new", "--format", "coco"),
        ("explore", "realease"),
        ("undo", KEY, "--run", "realease"),
    ],
    ids=lambda call: call[0],
)
def test_a_mistyped_run_gets_the_runs_that_are_there_the_nearest_first(polarsim, here, call):
    (line,) = polarsim(*call).stderr.splitlines()
    assert line.index("realease") < line.index("release") < line.index("demo")


def test_ctrl_c_ends_a_call_in_one_line(polarsim, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("polarsim.render.goniometer.reflectance_at", stopped)
    done = polarsim("brdf", "hapke")
    assert (done.returncode, done.stderr) == (130, "stopped by the user\n")


def files(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "line", [*calls(HOSTILE), *(f"{name} --nonsense" for name in COMMANDS)], ids=lambda line: line[:80]
)
def test_invalid_arguments_are_one_line_and_write_no_file(polarsim, here, line):
    before = files(here)
    done = polarsim(*shlex.split(line))
    assert done.returncode in (1, 2)
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    assert "(polarsim" in line or done.returncode == 1 or "requires" in line
    assert files(here) == before
