import numpy as np
import pytest

from polarsim.formats import coco, png, rle
from polarsim.photo import BOX_CLASSES
from polarsim.publish import huggingface, records
from polarsim.publish.run import publish_forms
from polarsim.site import polar
from tests.publish.tiny import KEYS, PARTS, SIZE, make_run, photo_labels

datasets = pytest.importorskip("datasets")


@pytest.fixture
def load(published, tmp_path, monkeypatch):
    monkeypatch.setattr(datasets.config, "HF_HUB_OFFLINE", True)

    def of(form: str, domain: str):
        return datasets.load_dataset(str(published(form)), domain, cache_dir=str(tmp_path / "cache"))

    return of


@pytest.mark.parametrize("form", ["hf", "parquet"])
def test_values_boxes_masks_and_ids_are_read_back_exactly(load, catalogue, form):
    for domain in catalogue.domains:
        found = {row["key"]: row for part in load(form, domain).values() for row in part}
        assert set(found) == {str(one.key) for one in catalogue.of_domain(domain)}
        for one in catalogue.of_domain(domain):
            row = found[str(one.key)]
            np.testing.assert_array_equal(np.array(row["image"]), png.read_png(one.path))
            np.testing.assert_array_equal(np.array(row["ids"]), records.ids(catalogue, one))
            for label, got in zip(catalogue.labels(one), row["objects"], strict=True):
                x, y, width, height = got["bbox"]
                np.testing.assert_allclose([x, y, x + width, y + height], label.box, atol=1e-3, rtol=0)
                assert (BOX_CLASSES[got["category"]], got["rock"]) == (label.kind, label.rock)
                np.testing.assert_array_equal(rle.from_text(got["mask_rle"], SIZE).mask(), label.mask.mask())
                whole = label.amodal.mask.counts if label.amodal else ""
                assert got["amodal_rle"] == whole
            np.testing.assert_array_equal(row["sandbox_from_camera"], catalogue.camera(one).world_from_camera.matrix)


def test_a_shadow_refers_to_the_rock_that_casts_it(load):
    objects = load("parquet", "analog")["train"][0]["objects"]
    assert [one["shadow_of"] for one in objects] == [-1, -1, 0, 1, -1]


def test_a_split_without_labels_has_the_same_column_types(tmp_path, monkeypatch):
    monkeypatch.setattr(datasets.config, "HF_HUB_OFFLINE", True)
    run = make_run(tmp_path)
    dark = {key: [] if PARTS[key] == "test" else photo_labels(key) for key in KEYS}
    coco.write_coco(run / "labels/coco/Terrain01.json", dark, polar(), SIZE)
    for form in ("hf", "parquet"):
        publish_forms(run, tmp_path / "out", [form])
        parts = datasets.load_dataset(str(tmp_path / "out" / form), "analog", cache_dir=str(tmp_path / "cache"))
        assert {name: {len(row["objects"]) for row in part} for name, part in parts.items()} == {
            "train": {5},
            "test": {0},
        }


def test_shards_have_a_maximum_size(catalogue, monkeypatch):
    pictures = catalogue.of_domain("analog")
    largest = max(one.path.stat().st_size for one in pictures)
    monkeypatch.setattr(huggingface, "SHARD", 2 * largest)
    shards = huggingface._shards(pictures)
    assert [len(shard) for shard in shards] == [2, 2]
    assert [one for shard in shards for one in shard] == pictures
