"""The packaged detectors are complete, small, and find lit lumps."""

import json

import numpy as np
import pytest
import typer.testing

from polarsim.cli import app
from polarsim.detect import detectors
from polarsim.detect.detectors.compact.weights import has_masks
from polarsim.detect.options import PACKAGED, PACKAGED_FIELD, PACKAGED_ROVER
from polarsim.formats import png
from polarsim.photo import BOX_CLASSES
from polarsim.rover.cameras.options import OnboardOptions
from tests.detect.lumps import CENTRES, lit_lumps


def test_packaged_detectors_are_small_and_have_widths_and_a_card():
    for path in (PACKAGED, PACKAGED_ROVER, PACKAGED_FIELD):
        assert path.stat().st_size < 10_000_000
        assert detectors.read_detector(path).model == "compact"
        assert path.with_suffix(".md").is_file()
    detector, of_rover = map(detectors.read_detector, (PACKAGED, PACKAGED_ROVER))
    of_field = detectors.read_detector(PACKAGED_FIELD)
    for complete in (detector, of_field):
        assert len(complete.sizes) == len(complete.calibration) == len(BOX_CLASSES)
        assert has_masks(complete.state)  # `polarsim detect --masks` requires both
    assert [tuple(widths) for widths, _ in of_rover.sizes] == [(960,)] * len(BOX_CLASSES)
    assert OnboardOptions(weights="packaged_rover").weights_file == PACKAGED_ROVER


@pytest.mark.slow
def test_the_default_detector_finds_lit_lumps_with_shadows(tmp_path):
    png.write_png(tmp_path / "sand.png", lit_lumps())
    done = typer.testing.CliRunner().invoke(app, ["detect", str(tmp_path / "sand.png"), "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "out/coco.json").read_text())
    rock = next(one["id"] for one in found["categories"] if one["name"] == "rock")
    boxes = np.array([one["bbox"] for one in found["annotations"] if one["category_id"] == rock])
    middle = boxes[:, :2] + boxes[:, 2:] / 2
    away = np.linalg.norm(middle[None] - CENTRES[:, None], axis=2).min(axis=1)
    assert (away < 15).sum() >= len(CENTRES) / 2


@pytest.mark.parametrize("look", ["dark", "bright"])
def test_the_default_detectors_write_masks_of_any_image(tmp_path, polarsim, look):
    """A dark scene is searched by the detector of photos, a bright one by the detector of field scenes."""
    pixels = np.full((96, 128), 180, np.uint8)
    if look == "dark":
        pixels[:60] = 0
    png.write_png(tmp_path / "image.png", pixels)
    done = polarsim(
        "detect", tmp_path / "image.png", "--out", tmp_path / "out", "--masks", "--no-draw", "--widths", 320
    )
    assert done.returncode == 0, done.stderr
    mask = png.read_png(tmp_path / "out/masks/image.png")
    assert mask.shape == pixels.shape[:2]
    assert set(np.unique(mask)) <= {0, 1, 2}
    used = json.loads((tmp_path / "out/coco.json").read_text())["images"][0]["detector"]
    assert used == (PACKAGED if look == "dark" else PACKAGED_FIELD).name


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (("--widths", "abc"), ["--widths:", "abc"]),
        (("--widths", "5"), ["--widths:", "32"]),
        (("--widths", "640,320"), ["--gates:", "1"]),
        (("--widths", "640,320", "--gates", "x"), ["--gates:", "x"]),
        (("--gates", "30"), ["--gates:", "0 --widths"]),
        (("--device", "tpu"), ["--device:", "tpu"]),
    ],
)
def test_an_invalid_prediction_option_is_a_usage_error_that_names_the_option(tmp_path, polarsim, options, named):
    png.write_png(tmp_path / "image.png", np.zeros((96, 128), np.uint8))
    done = polarsim("detect", tmp_path / "image.png", "--out", tmp_path / "out", *options)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert all(text in line for text in named), line
    assert "_px" not in line
