"""Cover photos are paired with twins of the same key, and human boxes get the rock ids of the run."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.cover_photos.twins import convert_control, pair_covers_with_twins, with_rock_ids
from polarsim.detect.tone import to_8_bits
from polarsim.errors import DetectError
from polarsim.formats import png, tables
from polarsim.photo import NO_ROCK, PhotoKey
from tests.support.label_rows import label_row
from tests.support.polar_photos import HEIGHT, WIDTH

KEYS = ["01_A_off_30_L_0256", "01_C_off_30_R_0256", "03_A_off_180_L_0256"]
MODELS = ("principled", "hapke")


def test_boxes_get_the_id_of_the_same_photo_and_kind():
    box, near, far = (100, 100, 200, 200), (110, 100, 210, 200), (140, 140, 260, 260)
    human = pd.DataFrame([label_row(KEYS[0], kind, rock=NO_ROCK, box=box) for kind in ("rock", "shadow")])
    known = pd.DataFrame([
        label_row(KEYS[0], "rock", rock=7, box=near), label_row(KEYS[0], "shadow", rock=8, box=far),
        label_row(KEYS[2], "shadow", rock=9, box=box),
    ])  # fmt: skip
    assert with_rock_ids(human, known)["rock"].tolist() == [7, NO_ROCK]


@given(order=st.permutations(range(6)), known_order=st.permutations(range(6)))
def test_ids_do_not_depend_on_the_order_of_boxes(order, known_order):
    corners = [(200 * n, 100, 200 * n + 120, 220) for n in range(6)]
    human = pd.DataFrame([label_row(KEYS[0], rock=NO_ROCK, box=corners[n]) for n in order])
    known = pd.DataFrame([label_row(KEYS[0], rock=n + 1, box=corners[n]) for n in known_order])
    assert with_rock_ids(human, known)["rock"].tolist() == [n + 1 for n in order]


@pytest.fixture
def made(tmp_path):
    """Return a function that pairs three cover photos with twins of the given keys and returns the folder."""

    def pair(keys):
        brightness = {key: 40 * (n + 1) for n, key in enumerate(KEYS)}
        for key in KEYS:
            png.write_png(tmp_path / "photos" / f"{key}.png", np.full((HEIGHT, WIDTH), brightness[key], np.uint8))
        for model in MODELS:
            for key in keys:
                twin = np.linspace(16, 3000, HEIGHT * WIDTH).reshape(HEIGHT, WIDTH).astype(np.uint16)
                terrain = PhotoKey.parse(key).terrain
                png.write_png(tmp_path / model / f"Terrain{terrain:02d}" / f"{key}.png", twin)
        for name, source in (("annotated", "annotated"), ("propagated", "seed"), ("rendered", "rendered")):
            rock = NO_ROCK if name == "annotated" else 3
            rows = [label_row(key, rock=rock, source=source) for key in [*KEYS, "04_A_off_30_L_0256"]]
            tables.write_parquet(tmp_path / f"{name}.parquet", tables.label_table(rows))
        pair_covers_with_twins(
            photos=tmp_path / "photos",
            annotated=tmp_path / "annotated.parquet",
            propagated=tmp_path / "propagated.parquet",
            twins={model: tmp_path / model for model in MODELS},
            rendered=tmp_path / "rendered.parquet",
            photo_domain="real",
            pictures={domain: tmp_path / "pictures" / domain for domain in ("real", *MODELS)},
            labels={domain: tmp_path / "labels" / f"{domain}.parquet" for domain in ("real", *MODELS)},
        )
        return tmp_path

    return pair


def test_domains_have_the_photos_with_twins(made, caplog):
    folder = made([KEYS[0], KEYS[2]])
    for domain in ("real", *MODELS):
        names = sorted(path.stem for path in (folder / "pictures" / domain).iterdir())
        labels = tables.read_parquet(folder / "labels" / f"{domain}.parquet")
        assert names == sorted(labels["key"]) == [KEYS[0], KEYS[2]]
        assert labels["rock"].tolist() == [3, 3]
        assert set(labels["source"]) == {"annotated" if domain == "real" else "rendered"}
    assert [record.message for record in caplog.records if KEYS[1] in record.message] == [
        f"{KEYS[1]}: cover photo without a principled twin, skipped"
    ]
    assert (png.read_png(folder / "pictures/real" / f"{KEYS[2]}.png") == 120).all()
    twin = png.read_png(folder / "hapke/Terrain03" / f"{KEYS[2]}.png")
    np.testing.assert_array_equal(png.read_png(folder / "pictures/hapke" / f"{KEYS[2]}.png"), to_8_bits(twin))


def test_photos_of_one_terrain_are_an_error_without_outputs(made, tmp_path):
    with pytest.raises(DetectError, match="photos"):
        made(KEYS[:2])
    assert not (tmp_path / "pictures").exists()
    assert not (tmp_path / "labels").exists()


def test_a_control_without_the_twin_of_a_photo_is_an_error(made, tmp_path):
    made([KEYS[0], KEYS[2]])
    paths = {"photos": tmp_path / "pictures/real", "rendered": tmp_path / "rendered.parquet"}
    outputs = {"pictures": tmp_path / "control", "labels": tmp_path / "control.parquet"}
    convert_control(**paths, twins=tmp_path / "hapke", **outputs)
    assert sorted(path.stem for path in outputs["pictures"].iterdir()) == [KEYS[0], KEYS[2]]
    assert sorted(tables.read_parquet(outputs["labels"])["key"]) == [KEYS[0], KEYS[2]]
    (tmp_path / "hapke/Terrain03" / f"{KEYS[2]}.png").unlink()
    with pytest.raises(DetectError, match=KEYS[2]):
        convert_control(**paths, twins=tmp_path / "hapke", **outputs)
