"""Commands: output on the terminal, invalid input as one line with exit code 1 or 2."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typer

from polarsim.arguments import join_wrapped
from polarsim.cli import app
from polarsim.formats import coco, obj, png, rle, yolo
from polarsim.formats.coco_annotations import Annotation
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import camera_pose
from polarsim.photo import GREY_VALUES, PhotoKey
from polarsim.run_files.rigs import LocalisedRig, write_localised
from polarsim.site import polar, read_site
from tests.support.polar_photos import SIZE
from tests.support.polar_rig import default_rig

ROCK_POLYGON = (2, np.array([[100.0, 100], [300, 100], [300, 250], [100, 250]]))
GROUND_POLYGON = (1, np.array([[0.0, 0], [1936, 0], [1936, 1216], [0, 1216]]))


def started(*arguments: object) -> subprocess.CompletedProcess:
    """Run the command in a separate process."""
    return subprocess.run(
        [sys.executable, "-m", "polarsim", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=300,
    )


def test_help_lists_every_command_in_a_panel_of_its_subject():
    panels = [command.rich_help_panel for command in app.registered_commands]
    subjects = [
        "Runs of the pipeline",
        "Own sandboxes",
        "Labels",
        "Rocks",
        "Rendering",
        "Detectors",
        "Rover",
        "For other tools",
    ]
    assert list(dict.fromkeys(panels)) == subjects
    assert panels == sorted(panels, key=subjects.index)


def test_every_command_is_called_in_a_test():
    text = "\n".join(path.read_text() for path in Path(__file__).parent.rglob("test_*.py"))
    called = set(re.findall(r'(?:call|polarsim|report_of|invoke)\((?:app, \[)?"([a-z-]+)"', text))
    assert set(typer.main.get_command(app).commands) <= called


def test_a_folder_scored_against_itself_is_perfect(polarsim, tmp_path):
    yolo.write_boxes(
        tmp_path / "01_A_off_30_L_0256.txt",
        np.array([0, 1]),
        np.array([[5, 5, 50, 60], [50, 5, 90, 60.0]]),
        size=SIZE,
    )
    done = polarsim("score", tmp_path, tmp_path, "--json", tmp_path / "scores.json")
    assert done.returncode == 0, done.stderr
    scores = json.loads((tmp_path / "scores.json").read_text())
    assert scores["classes"]["rock"]["f1"] == scores["classes"]["shadow"]["miou"] == 1


def test_a_broken_label_ends_in_one_line_with_file_and_number(tmp_path):
    truth, labels = tmp_path / "truth", tmp_path / "labels"
    for folder, text in ((truth, "0 0.5 0.5 0.1 0.1\n"), (labels, "0 0.5 0.5 0.1 0.1\n0 0.5 half 0.1 0.1\n")):
        folder.mkdir()
        (folder / "01_A_off_30_L_0256.txt").write_text(text)
    done = started("score", truth, labels)
    assert done.returncode == 1
    assert done.stderr.startswith("error: ")
    assert "01_A_off_30_L_0256.txt:2" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_masks_show_rocks_above_ground_in_any_order(polarsim, tmp_path):
    yolo.write_polygons(tmp_path / "in/01_A_off_30_L_0256.txt", [ROCK_POLYGON, GROUND_POLYGON], size=SIZE)
    done = polarsim("masks", tmp_path / "in", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    grey = png.read_png(tmp_path / "out/01_A_off_30_L_0256.png")
    assert grey[200, 200] == GREY_VALUES["rock"]
    assert grey[800, 800] == GREY_VALUES["ground"]


def test_outline_turns_masks_into_polygons(polarsim, tmp_path):
    mask = rle.encode_rle(np.ones((150, 200)), polar().images.size, 100, 100)
    labels = [Annotation("rock", 4, np.array([100.0, 100, 300, 250]), mask)]
    coco.write_coco(tmp_path / "in.json", {PhotoKey.parse("01_A_off_30_L_0256"): labels}, polar(), polar().images.size)
    done = polarsim("outline", tmp_path / "in.json", tmp_path / "out.json")
    assert done.returncode == 0, done.stderr
    (annotation,) = json.loads((tmp_path / "out.json").read_text())["annotations"]
    ((*points,),) = annotation["segmentation"]
    np.testing.assert_allclose([min(points[::2]), max(points[::2])], [100, 300])
    assert annotation["rock"] == 4


def test_render_writes_a_12_bit_picture_of_a_lit_plane(polarsim, tmp_path):
    corners = np.array([[-2.0, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]])
    obj.write_obj(tmp_path / obj.ground_name(1), Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])), "ground")
    done = polarsim("render", tmp_path, tmp_path / "twin.png", "--exposure", 128, "--model", "lambert")
    assert done.returncode == 0, done.stderr
    assert png.read_photo(tmp_path / "twin.png", None).max() > 100
    done = polarsim("render", tmp_path, tmp_path / "sun.png", "--sun", 30, 15, "--option", "blur_px=0.6")
    assert done.returncode == 0, done.stderr
    assert png.read_photo(tmp_path / "sun.png", None).max() > 100
    assert json.loads((tmp_path / "sun.json").read_text())["options"]["blur_px"] == 0.6


def test_a_render_of_a_site_without_a_common_calibration_names_the_option_of_the_lens(polarsim, tmp_path):
    done = polarsim("render", tmp_path, tmp_path / "yard.png", "--site", "yard")
    assert done.returncode == 1
    (line,) = done.stderr.strip().splitlines()
    assert "--cameras" in line


def test_the_camera_the_lamp_and_the_exposure_of_an_image_are_those_of_the_site(polarsim, tmp_path):
    """The sidecar has the first position and lamp, and the usual exposure, of a yard with other lenses."""
    corners = np.array([[-1.5, -3, 0], [1.5, -3, 0], [1.5, 3, 0], [-1.5, 3, 0]])
    name = "yard-a"
    obj.write_obj(tmp_path / obj.ground_name(name), Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])), "ground")
    write_localised(tmp_path / "PosA.json", LocalisedRig(default_rig(), camera_pose(np.zeros(3), 0.0, 0.0), "labels"))
    lens = ("--cameras", tmp_path / "PosA.json")  # the site has no calibration
    done = polarsim("render", tmp_path, tmp_path / "yard.png", "--site", "yard", *lens, "--model", "lambert")
    assert done.returncode == 0, done.stderr
    stated = json.loads((tmp_path / "yard.json").read_text())
    site = read_site("yard")
    pose = np.array(stated["sandbox_from_camera"])
    np.testing.assert_allclose(pose[:3, 3], site.tripods["gate"].camera_m)
    np.testing.assert_allclose(stated["lamps"]["sun"]["position"], site.lamps["45"].position_m)
    assert stated["exposure_ms"] == site.usual_exposure_ms


VIEWS = """
scenes: [{{name: flat, meshes: {meshes}, terrain: 1}}]
lens: {{kind: pinhole, hfov_deg: 60, width_px: 64, height_px: 48}}
cameras: [{{kind: orbit, radius_m: 1.5, height_m: 1, number: 2}}]
lights: [{{kind: sun, azimuth_deg: [30], elevation_deg: [20]}}]
exposures_ms: [64, auto]
render: {{models: [lambert], walls: false}}
"""


def test_render_takes_a_file_of_views(polarsim, tmp_path):
    corners = np.array([[-2.0, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]])
    obj.write_obj(tmp_path / obj.ground_name(1), Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])), "ground")
    (tmp_path / "views.yaml").write_text(VIEWS.format(meshes=tmp_path))
    done = polarsim("render", tmp_path / "views.yaml", tmp_path / "out", "--limit", 3, "--preview", "--threads", 2)
    assert done.returncode == 0, done.stderr
    assert "3 labelled pictures" in done.stdout
    pictures = sorted((tmp_path / "out/images").iterdir())
    assert [png.read_png(path).dtype for path in pictures] == [np.uint8] * 3
    assert max(png.read_png(path).max() for path in pictures) > 200


def test_the_schema_of_views_is_that_in_the_configuration_folder(polarsim):
    stored = (Path(__file__).parent.parent / "config/views.schema.json").read_text()
    assert polarsim("schema", "--views").stdout == stored, "run make schema"


def test_a_release_with_a_malformed_line_is_refused_by_validate(polarsim, tmp_path):
    folder = tmp_path / "Labels/Terrain01"
    folder.mkdir(parents=True)
    (folder / "01_A_off_30_L_0256.txt").write_text("0 0.5 0.5 0.1\n")
    done = polarsim("validate", tmp_path, "--json", tmp_path / "report.json")
    assert done.returncode == 1
    assert "Labels/Terrain01/01_A_off_30_L_0256.txt:1: F110 malformed" in done.stdout
    assert json.loads((tmp_path / "report.json").read_text())["findings"]
    (finding,) = json.loads(polarsim("validate", tmp_path, "--format", "json").stdout)["findings"]
    assert (finding["code"], finding["line"]) == ("F110", 1)
    assert polarsim("validate", tmp_path, "--ignore", "F1").returncode == 0
    assert polarsim("validate", tmp_path, "--select", "X9").returncode == 2
    assert polarsim("validate", tmp_path, "--fix", tmp_path / "inside").returncode == 1


def test_rules_are_listed_with_code_and_severity(polarsim):
    assert "V501  error    other_view" in polarsim("rules").stdout


def test_help_states_units(polarsim):
    text = polarsim("render", "--help").stdout
    assert all(unit in text for unit in ("deg", "ms", "m, sandbox"))


def test_brdf_prints_a_pinned_value(polarsim):
    done = polarsim("brdf", "hapke", "--incidence", 30, "--emergence", 0, "--azimuth", 0, "--set", "chrono_lunar")
    assert done.returncode == 0
    assert "f_r     0.0422483 1/sr" in done.stdout
    assert "pi f_r  0.132727" in done.stdout


def test_ipd_of_two_folders_is_printed_and_written(polarsim, tmp_path):
    for name, lines in (("a", "0 0.3 0.3 0.2 0.2"), ("b", "0 0.3 0.3 0.2 0.1")):
        for folder, text in ((f"labels_{name}", "0 0.3 0.3 0.2 0.2\n"), (f"found_{name}", f"{lines} 0.9\n")):
            (tmp_path / folder).mkdir()
            for picture in ("one", "two"):
                (tmp_path / folder / f"{picture}.txt").write_text(text)
    sets = [tmp_path / name for name in ("labels_a", "found_a", "labels_b", "found_b")]
    done = polarsim("ipd", *sets, "--json", tmp_path / "ipd.json")
    assert done.returncode == 0, done.stderr
    assert "0.5000 [0.5000, 0.5000]" in done.stdout
    assert "intervals over photos" in done.stdout
    rock = json.loads((tmp_path / "ipd.json").read_text())["classes"]["rock"]
    assert [rock[name] for name in ("pairs", "ipd", "iou_mean_a")] == pytest.approx([2, 0.5, 1], abs=1e-5)
    done = polarsim("ipd", *sets, "--unit", "view")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: 'one' is not a photo key")


def test_lines_of_help_end_with_a_sentence():
    """Docstrings are wrapped at the width of the code, and typer keeps the ends of lines."""
    joined = join_wrapped("A b.\n\n    C such as\n    d. E\n    f.\n    G:\n    h\n")
    assert joined == "A b.\n\nC such as d. E f.\nG:\nh"
    for name, command in typer.main.get_command(app).commands.items():
        lines = [line for line in command.help.splitlines() if line]
        assert all(line[-1] in ".:" for line in lines), name
