"""The packaged detectors are complete, small, and find lit lumps."""

import json

import numpy as np
import pytest
import typer.testing

from polarsim.cli import app
from polarsim.detect import detectors
from polarsim.detect.options import PACKAGED, PACKAGED_ROVER
from polarsim.formats import png
from polarsim.photo import BOX_CLASSES
from polarsim.rover.cameras.options import OnboardOptions
from tests.detect.lumps import CENTRES, lit_lumps


@pytest.mark.parametrize(("path", "widths"), [(PACKAGED, None), (PACKAGED_ROVER, {(960,)})])
def test_a_packaged_detector_is_small_and_has_widths_and_a_card(path, widths):
    assert path.stat().st_size < 10_000_000
    detector = detectors.read_detector(path)
    assert detector.model == "compact"
    assert len(detector.sizes) == len(BOX_CLASSES)
    assert widths in (None, {tuple(given) for given, _ in detector.sizes})
    assert len(detector.calibration) == (len(BOX_CLASSES) if path == PACKAGED else len(detector.calibration))
    assert path.with_suffix(".md").is_file()
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
