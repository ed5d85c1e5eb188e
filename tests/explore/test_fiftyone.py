"""FiftyOne data set in the format of `LegacyFiftyOneDatasetImporter`, checked with version 1.22.1."""

import json

import numpy as np
import pytest

from polarsim.errors import ConfigError
from polarsim.explore.fiftyone import write_fiftyone
from polarsim.formats import png
from polarsim.photo import HEIGHT, WIDTH
from polarsim.run_files.run import Run

from .made_run import KEYS, SEED, boxes_of


@pytest.fixture(scope="module")
def samples(made, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fiftyone") / "set"
    assert write_fiftyone(Run.at(made), folder, pattern="03_A_off_*", width=242) == len(own()) * 3
    return folder, json.loads((folder / "samples.json").read_text())["samples"]


def own():
    return [key for key in KEYS if key.light == "off"]


def test_every_sample_has_an_image_and_metadata(samples):
    folder, rows = samples
    first = next(row for row in rows if (row["key"], row["domain"]) == (str(KEYS[0]), "photo"))
    assert (first["tags"], first["score"], first["exposure_ms"]) == (["dark"], 0.9, KEYS[0].exposure_ms)
    assert {row["_media_type"] for row in rows} == {"image"}
    for row in rows[:3]:
        assert png.read_png(folder / row["filepath"]).shape[1] == 242
    about = json.loads((folder / "metadata.json").read_text())
    assert (about["media_type"], about["info"]["run"]) == ("image", "made")


def test_boxes_are_relative_to_the_image_size(samples):
    row = next(row for row in samples[1] if (row["key"], row["domain"]) == (str(SEED), "photo"))
    found = row["ground_truth"]["detections"]
    assert row["ground_truth"]["_cls"] == "Detections"
    big = next(one for one in found if (one["label"], one["rock"]) == ("rock", 1))
    x, y, w, h = big["bounding_box"]
    np.testing.assert_allclose(
        np.array([x, y, x + w, y + h]) * [WIDTH, HEIGHT, WIDTH, HEIGHT], boxes_of(SEED)["rock", 1], atol=0.01
    )
    assert (big["_cls"], big["confidence"], big["source"]) == ("Detection", 0.99, "seed")


def test_predictions_are_fields_of_test_photos(samples):
    with_field = [row for row in samples[1] if "photo_seed0_analog_on_analog" in row]
    assert {row["key"] for row in with_field} == {str(key) for key in KEYS[:6]}
    assert {row["domain"] for row in with_field} == {"photo"}
    detections = with_field[0]["photo_seed0_analog_on_analog"]["detections"]
    assert [one["false_positive"] for one in detections] == [False, True, False]


def test_non_empty_folders_and_unmatched_keys_are_errors(made, tmp_path):
    (tmp_path / "mine").write_text("")
    with pytest.raises(ConfigError):
        write_fiftyone(Run.at(made), tmp_path)
    with pytest.raises(ConfigError):
        write_fiftyone(Run.at(made), tmp_path / "new", pattern="09_*")
    assert not (tmp_path / "new").exists()


def test_the_command_prints_how_to_open_the_folder(polarsim, made, tmp_path):
    arguments = ("--results", made.parent, "--keys", str(SEED), "--domain", "photo", "--width", 242)
    done = polarsim("fiftyone", "made", tmp_path / "set", *arguments)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("1 samples in")
    assert "from_dir" in done.stdout
