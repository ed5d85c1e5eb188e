"""The detector that comes with polarsim is whole, small, and finds lit lumps."""

import json

import numpy as np
import pytest
import typer.testing

from polarsim.cli import app
from polarsim.detect import detectors
from polarsim.detect.options import PACKAGED
from polarsim.formats import png
from polarsim.photo import BOX_CLASSES


def test_it_is_small_calibrated_and_has_a_card():
    assert PACKAGED.stat().st_size < 10_000_000
    detector = detectors.read_detector(PACKAGED)
    assert detector.model == "compact"
    assert len(detector.sizes) == len(detector.calibration) == len(BOX_CLASSES)
    card = PACKAGED.with_suffix(".md").read_text(encoding="utf-8")
    assert "| all | rock |" in card
    assert "Where it fails" in card


@pytest.mark.slow
def test_it_finds_lit_lumps_with_shadows_without_being_named(tmp_path):
    """Twelve bright lumps on noisy grey sand, a black streak beside each, roughly as rocks and their shadows look."""
    random = np.random.default_rng(0)
    picture = 70 + 6 * random.standard_normal((608, 968))
    y, x = np.mgrid[:608, :968]
    centres = [(150 + 200 * column, 200 + 130 * row) for row in range(3) for column in range(4)]
    for cx, cy in centres:
        picture[((x - cx - 38) / 40) ** 2 + ((y - cy - 6) / 10) ** 2 < 1] = 6
        lump = ((x - cx) / 22) ** 2 + ((y - cy) / 18) ** 2 < 1
        picture[lump] = 150 + 60 * np.clip((cx - x[lump]) / 22, -1, 1)
    png.write(tmp_path / "sand.png", np.clip(picture, 0, 255).astype(np.uint8))
    done = typer.testing.CliRunner().invoke(app, ["detect", str(tmp_path / "sand.png"), "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "out/coco.json").read_text())
    rock = next(one["id"] for one in found["categories"] if one["name"] == "rock")
    boxes = np.array([one["bbox"] for one in found["annotations"] if one["category_id"] == rock])
    middle = boxes[:, :2] + boxes[:, 2:] / 2
    away = np.linalg.norm(middle[None] - np.array(centres)[:, None], axis=2).min(axis=1)
    assert (away < 15).sum() >= len(centres) / 2
