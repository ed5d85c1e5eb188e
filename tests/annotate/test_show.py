import numpy as np
import pytest

from polarsim.annotate.overlay import LINK, OverlayStyle, draw_labels
from polarsim.annotate.show import write_preview
from polarsim.errors import ConfigError, FormatError
from polarsim.formats import png
from polarsim.formats.tables import key_columns, label_table
from polarsim.photo import BLACK_LEVEL, COLOURS, PhotoKey
from polarsim.tone import display_white_level, to_8bit

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


def test_a_photo_is_shown_with_only_the_labels_of_the_photo(tmp_path):
    png.write_png(tmp_path / "photo.png", np.full((1216, 1936), 500, np.uint16))
    rows = [label(), label("shadow", box=(100, 300, 380, 500)), label(key=OTHER, box=(1000, 800, 1400, 1100))]
    write_preview(key=KEY, picture=tmp_path / "photo.png", labels=label_table(rows), out=tmp_path / "out.png")
    shown = png.read_png(tmp_path / "out.png")
    assert shown.dtype == np.uint8
    assert shown.shape[1] == 1936
    assert shown.shape[0] > 1216  # the legend is below, not on the picture
    assert tuple(shown[300, 600]) == tuple(shown[400, 400]) == COLOURS["rock"]
    assert tuple(shown[300, 200]) == COLOURS["shadow"]
    assert count(shown[700:1216], "rock") == 0


def test_only_masks_of_selected_kinds_are_tinted(tmp_path):
    png.write_png(tmp_path / "photo.png", np.full((1216, 1936), 500, np.uint16))
    rock, shadow = np.zeros((1216, 1936), bool), np.zeros((1216, 1936), bool)
    rock[600:700, 100:200], shadow[600:700, 300:400] = True, True
    arguments = {
        "key": KEY,
        "picture": tmp_path / "photo.png",
        "labels": label_table([]),
        "masks": {"rock": rock, "shadow": shadow},
    }
    write_preview(**arguments, out=tmp_path / "both.png")
    write_preview(**arguments, out=tmp_path / "rocks.png", kinds=("rock",))
    both, rocks = (png.read_png(tmp_path / name).astype(int) for name in ("both.png", "rocks.png"))
    plain = both[650, 1000]
    assert plain[0] == plain[1] == plain[2]
    for pixel, kind in ((both[650, 150], "rock"), (both[650, 350], "shadow")):
        assert (np.sign(pixel - plain) == np.sign(np.array(COLOURS[kind]) - plain)).all()  # on the way to the colour
    np.testing.assert_array_equal(rocks[:1216, :250], both[:1216, :250])
    np.testing.assert_array_equal(rocks[650, 350], plain)


def linked(*labels):
    """Return the mask (h, w) of the lines from shadows to rocks on a black image."""
    drawn = draw_labels(np.zeros((1216, 1936, 3), np.uint8), label_table(list(labels)), marks=OverlayStyle(links=True))
    return (drawn == LINK).all(axis=-1)


def test_a_line_joins_the_centres_of_a_shadow_and_its_rock():
    on = linked(label(box=(400, 300, 800, 500)), label("shadow", box=(1000, 700, 1200, 900)))
    for share in (0.02, 0.25, 0.5, 0.75):
        x, y = round(600 + share * 500), round(400 + share * 400)  # between (600, 400) and (1100, 800)
        assert on[y - 1 : y + 2, x - 1 : x + 2].any()
    assert not on[:380].any()
    assert not on[820:].any()


def test_the_line_ends_at_the_nearest_rock_with_the_id_of_the_shadow():
    on = linked(label(box=(0, 0, 100, 100)), label(box=(800, 0, 900, 100)), label("shadow", box=(1000, 0, 1100, 100)))
    assert on[50, 900:990].any()
    assert not on[:, :790].any()


def test_shadows_without_rock_have_no_line():
    assert not linked(label(rock=-1), label("shadow", rock=-1, box=(900, 700, 999, 800))).any()
    assert not linked(label(rock=7), label("shadow", rock=8, box=(900, 700, 999, 800))).any()


def test_labels_of_low_confidence_have_dashed_boxes():
    marks = OverlayStyle(doubtful_below=0.5)
    rows = [label(confidence=0.4), label(rock=8, confidence=0.6, box=(400, 600, 800, 800))]
    drawn = draw_labels(np.zeros((1216, 1936, 3), np.uint8), label_table(rows), marks=marks)
    doubtful, sure = ((drawn[y, 400:800] == COLOURS["rock"]).all(axis=-1) for y in (300, 600))
    assert sure.all()
    assert 0.4 < doubtful.mean() < 0.6


def test_ids_of_adjacent_rocks_do_not_overlap():
    rows = [label(rock=100 + n, box=(400 + 6 * n, 300, 440 + 6 * n, 340)) for n in range(4)]
    together = draw_labels(np.zeros((1216, 1936, 3), np.uint8), label_table(rows))
    alone = [draw_labels(np.zeros((1216, 1936, 3), np.uint8), label_table([row])) for row in rows]
    boxes = np.zeros((1216, 1936), bool)
    boxes[295:345, 395:465] = True

    def ink(picture):
        return int(((picture == COLOURS["rock"]).all(axis=-1) & ~boxes).sum())

    assert ink(together) > 0.9 * sum(map(ink, alone))


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"kinds": ("crater",)}, ConfigError),
        ({"scale": 0.01}, ConfigError),
        ({"labels": label_table([label("crater")])}, FormatError),
    ],
)
def test_an_invalid_input_is_a_one_line_error_without_output(tmp_path, change, error):
    png.write_png(tmp_path / "photo.png", np.full((1216, 1936), 500, np.uint16))
    arguments = {
        "key": KEY,
        "picture": tmp_path / "photo.png",
        "labels": label_table([label()]),
        "out": tmp_path / "out.png",
    }
    with pytest.raises(error) as caught:
        write_preview(**{**arguments, **change})
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["photo.png"]


def test_tone_keeps_black_black_and_maps_white_to_white():
    pixels = np.array([[BLACK_LEVEL, 0, BLACK_LEVEL + 1000, BLACK_LEVEL + 500, 4095]], np.uint16)
    shown = to_8bit(pixels, white=1000.0)[0, :, 0]
    assert shown.tolist() == [0, 0, 255, round(255 * 0.5 ** (1 / 2.2)), 255]


def test_a_dark_photo_remains_dark_and_8_bit_images_are_unchanged(rng):
    noise = (BLACK_LEVEL + rng.integers(0, 4, (50, 50))).astype(np.uint16)
    assert to_8bit(noise).max() < 90
    grey = rng.integers(0, 256, (5, 6)).astype(np.uint8)
    np.testing.assert_array_equal(to_8bit(grey)[..., 1], grey)
    assert display_white_level(grey) == 255


def test_only_the_selected_kind_is_drawn(tmp_path):
    png.write_png(tmp_path / "photo.png", np.full((1216, 1936), 500, np.uint16))
    write_preview(
        key=KEY,
        picture=tmp_path / "photo.png",
        labels=label_table([label(), label("shadow", box=(900, 300, 980, 500))]),
        out=tmp_path / "o.png",
        kinds=("shadow",),
    )
    shown = png.read_png(tmp_path / "o.png")
    assert count(shown, "rock") == 0
    assert count(shown, "shadow") > 0


def test_ids_in_a_crowd_stay_legible_and_off_the_rocks():
    """The texts of nine small rocks in a square hide at most a few pixels of each other and of the boxes."""
    rows = [
        label(rock=100 + n, confidence=0.5, box=(x := 600 + 60 * (n % 3), y := 300 + 40 * (n // 3), x + 24, y + 16))
        for n in range(9)
    ]
    black = np.zeros((1216, 1936, 3), np.uint8)
    together = draw_labels(black, label_table(rows))
    inked = (together == COLOURS["rock"]).all(axis=-1).sum()
    alone = sum((draw_labels(black, label_table([row])) == COLOURS["rock"]).all(axis=-1).sum() for row in rows)
    assert inked > 0.97 * alone


@pytest.mark.parametrize(("confidence", "stated"), [(0.85, True), (0.95, False)])
def test_only_low_confidences_are_stated(confidence, stated):
    black = np.zeros((1216, 1936, 3), np.uint8)
    drawn, certain = (draw_labels(black, label_table([label(confidence=c)])) for c in (confidence, 1.0))
    assert (drawn != certain).any() == stated
