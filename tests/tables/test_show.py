import numpy as np
import pytest

from polarsim.errors import ConfigError, FormatError
from polarsim.formats import png
from polarsim.formats.tables import key_columns, label_table, write_parquet
from polarsim.photo import BLACK_LEVEL, PhotoKey
from polarsim.tables.overlay import COLOURS, draw_labels
from polarsim.tables.show import show
from polarsim.tables.tone import to_8bit, white_of

KEY = PhotoKey.parse("03_A_off_30_L_0256")
OTHER = PhotoKey.parse("03_A_off_30_R_0256")


def label(kind="rock", rock=7, key=KEY, confidence=1.0, box=(400, 300, 800, 500)):
    x0, y0, x1, y1 = map(float, box)
    row = {
        "kind": kind,
        "rock": rock,
        "source": "seed",
        "confidence": confidence,
        "x0": x0,
        "y0": y0,
        "x1": x1,
        "y1": y1,
    }
    return key_columns(key) | row


def count(pixels, kind):
    return int((pixels == COLOURS[kind]).all(axis=-1).sum())


def test_a_photo_is_shown_with_its_own_labels_and_no_others(tmp_path):
    png.write(tmp_path / "photo.png", np.full((1216, 1936), 500, np.uint16))
    rows = [label(), label("shadow", box=(100, 300, 380, 500)), label(key=OTHER, box=(1000, 800, 1400, 1100))]
    write_parquet(tmp_path / "labels.parquet", label_table(rows))
    show(key=KEY, picture=tmp_path / "photo.png", labels=tmp_path / "labels.parquet", out=tmp_path / "out.png")
    shown = png.read(tmp_path / "out.png")
    assert shown.dtype == np.uint8
    assert shown.shape[1] == 1936
    assert shown.shape[0] > 1216  # the legend is below, not on the picture
    assert tuple(shown[300, 600]) == tuple(shown[400, 400]) == COLOURS["rock"]
    assert tuple(shown[300, 200]) == COLOURS["shadow"]
    assert count(shown[700:1216], "rock") == 0


def test_rows_and_table_make_the_same_picture_twice_the_same_bytes(tmp_path):
    png.write(tmp_path / "photo.png", np.full((1216, 1936), 500, np.uint16))
    rows = [label(confidence=0.4), label("shadow")]
    write_parquet(tmp_path / "labels.parquet", label_table(rows))
    for name, labels in (("a.png", rows), ("b.png", tmp_path / "labels.parquet")):
        show(key=KEY, picture=tmp_path / "photo.png", labels=labels, out=tmp_path / name, scale=0.5)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert png.read(tmp_path / "a.png").shape[1] == 968


def test_only_the_wanted_kind_is_drawn(tmp_path):
    png.write(tmp_path / "photo.png", np.full((1216, 1936), 500, np.uint16))
    show(
        key=KEY,
        picture=tmp_path / "photo.png",
        labels=[label(), label("shadow", box=(900, 300, 980, 500))],
        out=tmp_path / "o.png",
        kinds=("shadow",),
    )
    shown = png.read(tmp_path / "o.png")
    assert count(shown, "rock") == 0
    assert count(shown, "shadow") > 0


def test_a_picture_of_half_size_gets_its_labels_where_they_belong():
    drawn = draw_labels(np.zeros((608, 968, 3), np.uint8), label_table([label()]))
    assert tuple(drawn[150, 300]) == COLOURS["rock"]
    assert tuple(drawn[200, 200]) == COLOURS["rock"]


def test_a_photo_without_labels_is_shown_all_the_same(tmp_path):
    png.write(tmp_path / "photo.png", np.full((1216, 1936), 16, np.uint16))
    show(key=KEY, picture=tmp_path / "photo.png", labels=[], out=tmp_path / "out.png")
    assert not png.read(tmp_path / "out.png")[:1216].any()


@pytest.mark.parametrize(
    ("change", "error", "reason"),
    [
        ({"kinds": ("crater",)}, ConfigError, "crater"),
        ({"scale": 0.01}, ConfigError, "scale"),
        ({"labels": [label("crater")]}, FormatError, "crater"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_line_and_nothing_is_written(tmp_path, change, error, reason):
    png.write(tmp_path / "photo.png", np.full((1216, 1936), 500, np.uint16))
    arguments = {"key": KEY, "picture": tmp_path / "photo.png", "labels": [label()], "out": tmp_path / "out.png"}
    with pytest.raises(error, match=reason) as caught:
        show(**{**arguments, **change})
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["photo.png"]


def test_a_missing_picture_is_named(tmp_path):
    with pytest.raises(FormatError, match=r"none\.png"):
        show(key=KEY, picture=tmp_path / "none.png", labels=[], out=tmp_path / "out.png")


def test_tone_keeps_black_black_and_maps_white_to_white():
    pixels = np.array([[BLACK_LEVEL, 0, BLACK_LEVEL + 1000, BLACK_LEVEL + 500, 4095]], np.uint16)
    shown = to_8bit(pixels, white=1000.0)[0, :, 0]
    assert shown.tolist() == [0, 0, 255, round(255 * 0.5 ** (1 / 2.2)), 255]


def test_a_photo_of_nothing_stays_dark_and_pictures_of_eight_bits_stay_as_they_are(rng):
    noise = (BLACK_LEVEL + rng.integers(0, 4, (50, 50))).astype(np.uint16)
    assert to_8bit(noise).max() < 90
    grey = rng.integers(0, 256, (5, 6)).astype(np.uint8)
    np.testing.assert_array_equal(to_8bit(grey)[..., 1], grey)
    assert white_of(grey) == 255
