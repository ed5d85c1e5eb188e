"""Every command with values that no work can come of: one line before the work begins, exit code 1 or 2, no file."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typer

import polarsim as package
from polarsim.cli import app
from polarsim.formats import coco, obj, png, rle, yolo
from polarsim.geometry.meshes import Mesh
from polarsim.photo import PhotoKey

KEY = "01_A_off_30_L_0256"
COMMANDS = sorted(typer.main.get_command(app).commands)
SQUARE = Mesh(np.array([[-2.0, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
VIEWS = """
scenes: [{name: flat, terrains: [{meshes: meshes, terrain: 1}]}]
lens: {kind: pinhole, hfov_deg: 60, width_px: 64, height_px: 48}
cameras: [{kind: point, position_m: [0, 0, HEIGHT], look_at_m: [1, 0, 0]}]
lights: [{kind: sun, azimuth_deg: [30], elevation_deg: [20]}]
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with one input of every command, in which the command is called."""
    monkeypatch.chdir(tmp_path)
    obj.write(Path("meshes") / obj.ground_name(1), SQUARE, "ground")
    yolo.write_boxes(Path("boxes") / f"{KEY}.txt", np.array([0]), np.array([[5.0, 5, 50, 60]]))
    yolo.write_polygons(Path("polygons") / f"{KEY}.txt", [(2, np.array([[10.0, 10], [30, 10], [30, 25]]))])
    mask = rle.encode(np.ones((15, 20)), 100, 100)
    coco.write_coco(
        Path("labels.json"),
        {PhotoKey.parse(KEY): [coco.Annotation("rock", 4, np.array([100.0, 100, 120, 115]), mask)]},
    )
    png.write(Path("picture.png"), np.zeros((48, 64), np.uint8))
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


# A call a line; what follows :: are its endings, one a call.
HOSTILE = """
:: nonsense | --nonsense
:: render | score boxes | masks polygons | outline labels.json | export | show | detect | compare | brdf | ipd boxes

render meshes out.png --yaw :: nan | inf | -inf | x | ''
render meshes out.png --pitch :: nan | inf | -inf | 91 | x
render meshes out.png --roll :: nan | inf | -inf | x
render meshes out.png --intensity :: nan | inf | -1
render meshes out.png --lamp-radius :: nan | inf | -1
render meshes out.png --exposure :: nan | inf | -1
render meshes out.png --camera :: nan 0 1 | 0 inf 1 | 0 0 1e9 | 0 0 -1 | 9 9 -1 | 0 0
render meshes out.png --lamp :: nan 0 1 | 0 inf 1 | 0 0 1e9 | 0 0 -1 | 9 9 -1 | 0 0
render meshes out.png --sun :: 30 95 | 30 0 | 30 -5 | nan 10 | 30 inf | 30
render meshes out.png --terrain :: 0 | 14 | 1.5 | nan | 7
render meshes out.png :: --threads 0 | --model marble | --engine cuda
render meshes out.png --option :: samples | samples=nan | samples=0 | nothing=1 | '' | = | blur_px=inf | blur_px=-1
render good.yaml views :: --limit 0 | --scale nan | --scale 0 | --scale 1e9 | --threads 0 | --exposure 3
render :: buried.yaml views | far.yaml views | no.yaml views | missing.yaml views
score boxes boxes --threshold :: nan | 0 | 2 | x
ipd boxes boxes boxes boxes :: --confidence nan | --confidence 2 | --pair-iou 0 | --pair-iou nan | --resamples 1
ipd boxes boxes boxes boxes :: --seed -1 | --unit rock | --missing maybe
brdf hapke :: --incidence nan | --incidence 91 | --emergence -1 | --azimuth inf | --azimuth 181 | --set basalt
brdf :: hapke --set '' | lambert --set chrono_lunar | marble
outline labels.json out.json --simplify-px :: nan | -1 | 11
detect picture.png --weights text.pt --out new :: --confidence nan | --confidence 0 | --threads 0 | --device tpu
detect picture.png --weights text.pt --out new :: --widths x | --widths nan | --widths 0 | --gates 30
show KEY :: --scale nan | --scale 0 | --scale -1 | --scale 1e9 | --kinds pebble | --domain marble
show :: 01_A | ''
validate boxes :: --workers 0 | --select X9 | --format xml
export new :: --terrain 0 | --tool paint | --keys '[' | --domain marble
:: report --cores 0 | drive --seed -1 | drive --threads 0

render meshes :: folder | out.jpg | out | file/out.png | folder/out.png | '' | LONG.png
render meshes out.png :: --maps file | --maps file/maps | --cameras folder | --cameras file | --cameras missing
render :: missing out.png | file out.png | boxes out.png | good.yaml file | good.yaml file/views | folder views
brdf hapke --plot :: x.xyz | folder | file/x.png | plain
score :: missing boxes | boxes missing | file boxes | boxes file | folder boxes
score boxes boxes --json :: folder | file/x.json
ipd :: missing boxes boxes boxes | boxes file boxes boxes | boxes boxes text.pt boxes | boxes boxes boxes folder
ipd boxes boxes boxes boxes :: --json folder
masks :: missing out | file out | folder out | polygons file | polygons file/out
outline :: missing out.json | folder out.json | file out.json
outline labels.json :: folder | file/out.json
show KEY :: --out folder | --out x.jpg | --run nowhere | --run '' | --run ../results | --results missing |
export :: file | folder | new --run nowhere | new --results file | new
compare demo :: | demo | nowhere | --out folder | --out file/x | --results missing
report :: nowhere | demo
drive :: --config missing | --config file | --config folder | --config no.yaml | --out file
validate :: missing | file | folder | boxes --json folder | boxes --fix file | boxes --fix boxes
detect picture.png :: --weights missing --out new | --weights folder --out new
detect picture.png :: --weights text.pt --out new | --weights text.pt --out file
publish demo new --format :: coco | csv | '' | coco,csv
publish demo new --format coco :: --subset colour=red | --subset terrain=1e9
publish demo new --format coco :: --max-size much | --max-size -1 | --max-size nan
publish :: nowhere new --format coco | demo file --format coco | demo file/new --format coco | demo new
publish demo new --format coco --results :: missing | file
import labels.json :: file | folder | file/new | new --format csv | new --as truth | new --name boulder | new --name a=b
import :: missing new | missing.json new | missing.xml new | file new | picture.png new
import :: folder new | no.yaml new | '' new
explore :: nowhere | demo | demo --out file | demo --out folder | demo --width 0 | demo --width nan | demo --port -1
explore :: demo --port 99999 | demo --results missing
rerun :: nowhere 01_A | demo 01_A | demo A | demo 01_A --out folder | demo 01_A --out x.png | demo 01_A --out file/x.rrd
fiftyone :: nowhere new | demo new | demo file | demo folder | demo new --width 1e9 | demo new --domain marble
undo KEY :: --run nowhere | --run demo | --configfile missing | --configfile folder | --configfile no.yaml
undo :: 01_A | ''
detect :: missing --weights text.pt --out new | folder --weights text.pt --out new | file --weights text.pt --out new
"""


def calls(text: str) -> list[str]:
    """The calls of such lines."""
    parts = [line.partition("::") for line in text.replace("KEY", KEY).replace("LONG", "a" * 300).splitlines()]
    return [f"{start.strip()} {end.strip()}".strip() for start, _, ends in parts if ends for end in ends.split("|")]


def completed(words: str) -> list[str]:
    """What a Bash shell offers after these words."""
    count = str(len(words.split(" ")) - 1)
    told = {"_POLARSIM_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": count}
    call = [sys.executable, "-c", "from polarsim.cli import main; main()"]
    return subprocess.run(call, env=os.environ | told, capture_output=True, text=True, check=True).stdout.split()


def test_the_version_is_that_of_the_package(polarsim):
    for option in ("--version", "-V"):
        done = polarsim(option)
        assert (done.returncode, done.stdout) == (0, f"polarsim {package.__version__}\n")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_its_help_in_short_too(polarsim, command):
    short, long = polarsim(command, "-h"), polarsim(command, "--help")
    assert short.returncode == 0
    assert f"Usage: polarsim {command}" in short.stdout
    assert short.stdout == long.stdout


def test_help_loses_no_word_to_markup(polarsim):
    for command in typer.main.get_command(app).commands.values():
        assert "[" not in (command.help or "")  # Rich takes what stands in brackets for a style
    assert "Needs the extra `rerun`." in " ".join(polarsim("rerun", "-h").stdout.split())


def test_a_shell_completes_commands_options_and_values():
    assert completed("polarsim ren") == ["render"]
    assert "--exposure" in completed("polarsim render --exp")
    assert completed("polarsim brdf hapke_") == ["hapke_chrono"]


def test_without_a_command_the_commands_are_listed(polarsim):
    done = polarsim()
    assert done.returncode == 2
    assert all(command in done.stdout for command in COMMANDS)


@pytest.mark.parametrize(
    "call",
    [
        ("show", KEY, "--run", "realease"),
        ("publish", "realease", "new", "--format", "coco"),
        ("explore", "realease"),
        ("rerun", "realease", "01_A"),
        ("fiftyone", "realease", "new"),
        ("undo", KEY, "--run", "realease"),
    ],
    ids=lambda call: call[0],
)
def test_a_mistyped_run_gets_the_runs_that_are_there_the_nearest_first(polarsim, here, call):
    told = polarsim(*call).stderr
    assert told == "error: results: no run 'realease'; there are release, demo\n"


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
def test_a_hostile_call_ends_in_one_line_and_writes_nothing(polarsim, here, line):
    before = files(here)
    done = polarsim(*shlex.split(line))
    assert done.returncode in (1, 2)
    assert done.stdout == ""
    (told,) = done.stderr.splitlines()
    assert told.startswith("error: ")
    assert "(polarsim" in told or done.returncode == 1 or "requires" in told
    assert files(here) == before
