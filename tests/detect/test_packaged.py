"""The packaged detectors are complete, small, and find lit lumps."""

import json

import numpy as np
import pytest
import typer.testing

from polarsim.cli import app
from polarsim.detect import detectors
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
