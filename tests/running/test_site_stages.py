"""What a run can do at its site."""

import numpy as np
import pytest
import yaml

from polarsim.config import parse_config
from polarsim.errors import ConfigError, FormatError
from polarsim.formats import png
from polarsim.running.found_files import found_files
from polarsim.running.inputs import check_paths
from polarsim.running.site_stages import plan_lines, stage_states
from tests.support.other_site import CONTENT, SIZE


def config(source=None, **changes):
    site = CONTENT | changes if changes else CONTENT
    return parse_config({"site": site, "source": {"kind": "files", "root": "data"} | (source or {})})


def states(chosen):
    return {state.stage: state for state in stage_states(chosen)}


WITHOUT_SCANS = {"files": CONTENT["files"] | {"clouds": None}}
ONE_CAMERA = {"cameras": {"stereo": False, "calibration": "lens.yaml"}}


def test_a_stereo_site_with_scans_does_all_stages():
    assert all(state.possible for state in states(config()).values())


@pytest.mark.parametrize(
    ("changes", "source", "impossible", "words"),
    [
        (ONE_CAMERA, {}, {"stereo"}, {"stereo": "one camera", "cameras": "from scans"}),
        (WITHOUT_SCANS, {}, set(), {"cameras": "measured in stereo photos"}),
        ({}, {"scans": False}, set(), {"cameras": "measured in stereo photos"}),
        (
            WITHOUT_SCANS | ONE_CAMERA, {}, {"cameras", "rocks", "labels", "render", "detect", "stereo", "rover"},
            {"cameras": "no scans and one camera"},
        ),
        ({"sandbox": {"half_width_m": [2, 2]}}, {}, set(), {"cameras": "no walls: origin and heading from tripods"}),
        ({"tripods": {}}, {}, set(), {"cameras": "no tripods"}),
        (
            {"tripods": {}, "sandbox": {"half_width_m": [2, 2]}}, {}, set(),
            {"cameras": "neither walls nor tripods", "labels": "no shadows"},
        ),
        ({"files": CONTENT["files"] | {"calibration": None}}, {}, {"acquire"}, {"acquire": "cameras.calibration"}),
        (
            {"terrains": {"yard-a": {"surveyed": False}, "yard-b": {}}}, {}, set(),
            {"labels": "no places of lamps in terrain yard-a"},
        ),
    ],
)  # fmt: skip
def test_what_a_site_lacks_is_the_reason(changes, source, impossible, words):
    found = states(config(source, **changes))
    assert {name for name, state in found.items() if not state.possible} == impossible
    for name, text in words.items():
        assert text in found[name].reason


def test_the_plan_of_another_site_states_what_is_not_possible_and_that_of_polar_nothing():
    lines = plan_lines(config(**ONE_CAMERA))
    assert lines == [
        "site yard: possible stages acquire, cameras, rocks, labels, render, detect, rover",
        "site yard: stereo: not possible, one camera",
    ]
    assert plan_lines(parse_config({"source": {"kind": "analog", "root": "data"}})) == []


def test_a_run_without_scans_and_with_one_camera_is_refused_with_the_remedy(tmp_path):
    with pytest.raises(ConfigError, match=r"files\.clouds"):
        check_paths(config({"root": str(tmp_path)}, **WITHOUT_SCANS | {"cameras": {"stereo": False}}))


@pytest.mark.parametrize("scans", [True, False])
def test_a_terrain_without_scans_is_refused_before_the_first_job_unless_the_run_reads_no_scans(tmp_path, scans):
    for name in ("yard-a/gate.ply", "Labels/Terrainyard-a/yard-a_gate_off_45_L_0040.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("0 0.5 0.5 0.1 0.1\n")
    label = tmp_path / "Labels/Terrainyard-b/yard-b_gate_off_45_L_0040.txt"
    label.parent.mkdir()
    label.write_text("0 0.5 0.5 0.1 0.1\n")
    checked = config({"root": str(tmp_path), "scans": scans})
    if not scans:
        check_paths(checked)
        return
    with pytest.raises(FormatError, match=r"yard-b.*source\.scans: false") as caught:
        check_paths(checked)
    assert caught.value.path == tmp_path


@pytest.mark.parametrize("name", ["polar", "yard"])
def test_shipped_sites_are_checked_by_name(polarsim, name):
    result = polarsim("check-site", name)
    assert result.returncode == 0
    assert f"Site {name}" in result.stdout
    assert "cameras" in result.stdout


def write_photo(tmp_path, name, pixels=None):
    """Write a photo below the folder `raw` and return its path."""
    path = tmp_path / "raw" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    png.write_png(path, np.full(SIZE[::-1], 10, np.uint8) if pixels is None else pixels)
    return path


def check_photos(polarsim, tmp_path, **images):
    """Return the result of `check-site` for the photos below `raw`, with another image format of the site."""
    (tmp_path / "site.yaml").write_text(yaml.safe_dump(CONTENT | {"images": CONTENT["images"] | images}))
    return polarsim("check-site", tmp_path / "site.yaml", "--root", tmp_path / "raw")


def test_files_below_a_folder_are_counted(polarsim, tmp_path):
    (tmp_path / "site.yaml").write_text(yaml.safe_dump(CONTENT))
    photo = write_photo(tmp_path, "yard-b/gate/dark-on/left_0640.png")
    (photo.parent / "other.png").touch()
    result = polarsim("check-site", tmp_path / "site.yaml", "--root", tmp_path / "raw")
    assert result.returncode == 0
    rows = [line.replace("│", " ").split() for line in result.stdout.splitlines() if "yard-b" in line]
    assert rows[0] == ["yard-b", "1", "of", "56", "8", "bits,", "grey", "1", "none", "none"]
    assert "yard-b: 1 file skipped, such as yard-b/gate/dark-on/other.png" in " ".join(result.stdout.split())


@pytest.mark.parametrize("camera", ["left", "right"])
@pytest.mark.parametrize(
    ("images", "pixels", "found", "expected"),
    [
        ({"width": 612}, np.zeros((480, 640), np.uint8), "640 x 480", "612 x 480"),
        ({"height": 500}, np.zeros((480, 640, 3), np.uint8), "640 x 480", "640 x 500"),
        ({"bits": 12}, np.zeros((480, 640), np.uint8), "8 bits", "expected 12"),
        ({"bits": 8}, np.full((480, 640), 3000, np.uint16), "value 3000", "at most 255"),
        ({"bits": 12, "black": 16}, np.zeros((480, 640, 3), np.uint16), "(480, 640, 3)", "single channel"),
        ({"bits": 12, "black": 16}, np.full((480, 640), 5000, np.uint16), "value 5000", "12 bits"),
    ],
    ids=["width", "height", "8 instead of 12 bits", "12 instead of 8 bits", "colour of used photos", "14 bits"],
)  # fmt: skip
def test_a_photo_of_another_size_or_depth_is_a_one_line_error(
    polarsim, tmp_path, camera, images, pixels, found, expected
):
    photo = write_photo(tmp_path, f"yard-b/gate/lamp45-off/{camera}_0040.png", pixels)
    result = check_photos(polarsim, tmp_path, **images)
    assert result.returncode == 1
    (line,) = result.stderr.strip().splitlines()
    assert line.startswith(f"error: {photo}: ")
    assert found in line
    assert expected in line


def test_the_format_of_each_camera_is_stated(tmp_path):
    for name in ("yard-a/gate/lamp45-off/left_0040.png", "yard-b/gate/lamp45-off/left_0040.png"):
        write_photo(tmp_path, name)
    write_photo(tmp_path, "yard-b/gate/lamp45-off/right_0040.png", np.full((*SIZE[::-1], 3), 10, np.uint8))
    formats = [found.format for found in found_files(config({"root": str(tmp_path / "raw")}))]
    assert formats == ["8 bits, grey", "L: 8 bits, grey; R: 8 bits, colour, converted to grey"]


@pytest.mark.parametrize(
    ("largest", "images", "noted"),
    [(4095, {"bits": 14}, True), (4000, {"bits": 14}, True), (4095, {"bits": 14, "white": 4095}, False)],
)
def test_saturation_below_the_white_level_of_the_site_is_named(tmp_path, largest, images, noted):
    ramp = np.tile(np.linspace(64, 4500, SIZE[0]).astype(np.uint16), (SIZE[1], 1))
    photo = write_photo(tmp_path, "yard-a/gate/lamp45-off/left_0160.png", np.minimum(ramp, largest))
    changed = CONTENT["images"] | images
    (found, _) = found_files(config({"root": str(tmp_path / "raw")}, images=changed))
    expected = f"{photo} is saturated at {largest}, expected 16383 (images.bits and images.white of the site)"
    assert found.notes == ((expected,) if noted else ())


def test_a_photo_without_saturated_pixels_has_no_note(tmp_path):
    ramp = np.tile(np.linspace(64, 4000, SIZE[0]).astype(np.uint16), (SIZE[1], 1))
    write_photo(tmp_path, "yard-a/gate/lamp45-off/left_0160.png", ramp)
    (found, _) = found_files(config({"root": str(tmp_path / "raw")}, images=CONTENT["images"] | {"bits": 14}))
    assert found.notes == ()


def test_one_photo_of_each_terrain_and_camera_is_read(tmp_path):
    for camera in ("left", "right"):
        write_photo(tmp_path, f"yard-a/mast/lamp45-off/{camera}_0160.png")
        for other in ("lamp45-off", "lamp45-on", "dark-off"):
            for time in ("0010", "0040", "0640"):
                path = tmp_path / f"raw/yard-a/gate/{other}/{camera}_{time}.png"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(b"no image")
    (found, _) = found_files(config({"root": str(tmp_path / "raw")}))
    assert found.format == "8 bits, grey"
    assert found.photos == 2 + 2 * 5  # lamps have no exposure of 640 ms, other photos no exposures of 10 and 40 ms


def test_marked_values_are_listed_with_exit_code_1(polarsim, tmp_path):
    marked = CONTENT | {"sandbox": {"half_width_m": ["FILL_IN: half the width, m", 2]}}
    (tmp_path / "site.yaml").write_text(yaml.safe_dump(marked))
    result = polarsim("check-site", tmp_path / "site.yaml")
    assert result.returncode == 1
    assert "sandbox.half_width_m" in result.stdout
    assert "half the width, m" in result.stdout


@pytest.mark.parametrize("argument", ["nowhere", "nowhere.yaml", "list.yaml", "wrong.yaml"])
def test_an_invalid_site_is_a_one_line_error(polarsim, tmp_path, monkeypatch, argument):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "list.yaml").write_text("[1]\n")
    (tmp_path / "wrong.yaml").write_text(yaml.safe_dump(CONTENT | {"lamps": 3}))
    result = polarsim("check-site", argument)
    assert result.returncode == 1
    assert len(result.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    "changes", [{"terrains": ["Höfe", "yard-b"]}, {"positions": ["gate 1", "mast"]}, {"lamps": {"früh": {}}}]
)
def test_an_invalid_name_is_attributed_to_the_site_file_of_a_configuration(polarsim, tmp_path, changes):
    (tmp_path / "site.yaml").write_text(yaml.safe_dump(CONTENT | changes))
    configuration = {"site": str(tmp_path / "site.yaml"), "source": {"kind": "files", "root": "raw"}}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(configuration))
    result = polarsim("check-site", tmp_path / "mine.yaml")
    assert result.returncode == 1
    (line,) = result.stderr.strip().splitlines()
    assert line.startswith(f"error: {tmp_path / 'site.yaml'}: {next(iter(changes))}")
    assert "files.spelling" in line
