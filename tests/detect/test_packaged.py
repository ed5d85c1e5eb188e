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


def test_the_packaged_detector_is_small_calibrated_and_has_a_card():
    assert PACKAGED.stat().st_size < 10_000_000
    detector = detectors.read_detector(PACKAGED)
    assert detector.model == "compact"
    assert len(detector.sizes) == len(detector.calibration) == len(BOX_CLASSES)
    card = PACKAGED.with_suffix(".md").read_text(encoding="utf-8")
    assert "| all | rock |" in card
    assert "Limitations" in card


def test_the_rover_detector_is_small_and_has_a_card():
    assert PACKAGED_ROVER.stat().st_size < 10_000_000
    detector = detectors.read_detector(PACKAGED_ROVER)
    assert detector.model == "compact"
    card = PACKAGED_ROVER.with_suffix(".md").read_text(encoding="utf-8")
    assert {tuple(widths) for widths, _ in detector.sizes} == {(960,)}
    assert "960 px" in card
    assert "| analog 3, 1, 11 |" in card
    assert "Limitations" in card
    assert OnboardOptions(weights="packaged_rover").weights_file == PACKAGED_ROVER
    assert f"{OnboardOptions().confidence:g}, the default" in card


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
