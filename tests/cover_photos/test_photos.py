"""Photo keys of cover photos of any size and bit depth."""

import logging

import cv2
import numpy as np
import pytest

from polarsim.cover_photos.photos import in_eight_bits, read_cover, read_covers, shadow_contrast
from polarsim.errors import DetectError
from polarsim.formats import png, release, tables
from polarsim.photo import PhotoKey
from tests.cover_photos.conftest import KEY, ROCKS, SAND, SHADE, SHADOWS
from tests.support.polar_photos import HEIGHT, WIDTH

NAME = "CoverPhotoOfIndices/cover_photo_indexed_01_A.png"


def read(root, keys=(), terrains=(1,)):
    read_covers(
        root=root, terrains=terrains, keys=keys, size=(WIDTH, HEIGHT), usual_exposure_ms=256,
        pictures=root / "photos", labels=root / "labels.parquet", pairing=root / "pairing.csv", drawn=root / "drawn",
    )  # fmt: skip
    return sorted(path.stem for path in (root / "photos").iterdir())


def test_a_cover_is_read_without_strokes_and_with_its_published_boxes(made_release):
    assert read(made_release) == [str(KEY)]
    photo = png.read_png(made_release / "photos" / f"{KEY}.png").astype(int)
    photo[300:400, 290:410] = SAND  # shadow and drawn box
    np.testing.assert_allclose(photo, SAND, atol=2)
    table = tables.read_parquet(made_release / "labels.parquet", tables.LABEL_COLUMNS)
    rocks = table.loc[table["kind"] == "rock", ["x0", "y0", "x1", "y1"]].to_numpy()
    np.testing.assert_allclose(rocks[np.argsort(rocks[:, 0])], ROCKS, atol=0.01)


@pytest.mark.parametrize("scale", [1, 0.5])
def test_the_mask_covers_every_stroke(made_release, cover, scale):
    small = cv2.resize(cover, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    png.write_png(made_release / NAME, small)
    read(made_release)
    mask = png.read_png(made_release / "drawn" / f"{KEY}.png")
    strokes = cover.max(axis=-1) != cover.min(axis=-1)
    assert set(np.unique(mask[strokes])) == {255} if scale == 1 else (mask[strokes] > 0).all()
    assert strokes.mean() <= (mask > 0).mean() < 4 * strokes.mean()


def test_camera_and_azimuth_follow_from_dark_shadows(made_release):
    """Rock boxes match the labels of both lamps; only shadows differ."""
    read(made_release)
    table = tables.read_csv(made_release / "pairing.csv").set_index("key")
    assert table.index[table["shown"]].tolist() == [str(KEY)]
    assert (table["named_by"] == "shadows").all()
    left = table[table.index.str.contains("_L_")]
    assert (left["drawn_iou"] > 0.8).all()
    assert (table.loc[table.index.str.contains("_R_"), "drawn_iou"] == 0).all()
    assert table.loc[str(KEY), "shadow_contrast"] > 0.5


def test_the_shadow_contrast_agrees_with_a_calculation_by_hand():
    """Expected: (90 - 10) / (90 + 10 + 1)."""
    photo = np.full((200, 300), SAND, np.uint8)
    photo[50:90, 100:160] = SHADE
    shadow = np.array([[100.0, 50, 160, 90]])
    assert shadow_contrast(photo, shadow, np.zeros((0, 4))) == pytest.approx(80 / 101)
    assert np.isnan(shadow_contrast(photo, shadow[:0], np.zeros((0, 4))))


def test_a_known_key_overrides_the_match_of_shadows(made_release):
    assert read(made_release, keys=["01_A_off_180_L_0256"]) == ["01_A_off_180_L_0256"]
    table = tables.read_csv(made_release / "pairing.csv")
    assert (table["named_by"] == "configuration").all()


@pytest.mark.parametrize("key", ["01_C_off_30_L_0256", "02_A_off_30_L_0256"])
def test_a_known_key_without_a_cover_photo_is_named(made_release, key):
    with pytest.raises(DetectError, match=key):
        read(made_release, keys=[key])


@pytest.mark.parametrize("scale", [0.5, 1.1])
def test_a_cover_of_another_size_gives_the_same_photo_and_boxes(made_release, cover, scale):
    whole = read_cover(made_release / NAME, (WIDTH, HEIGHT))
    small = cv2.resize(cover, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    png.write_png(made_release / NAME, small)
    found = read_cover(made_release / NAME, (WIDTH, HEIGHT))
    assert found.photo.shape == whole.photo.shape
    np.testing.assert_allclose(found.drawn, whole.drawn, atol=4)
    left, top, right, bottom = (int(edge) for edge in SHADOWS["30"])
    inside = (slice(top + 8, bottom - 8), slice(left + 12, right - 8))
    np.testing.assert_allclose(found.photo[inside].astype(int), SHADE, atol=3)


@pytest.mark.parametrize(("bits", "levels"), [(8, 255), (12, 4095), (16, 65535)])
def test_grey_of_any_depth_becomes_eight_bits(bits, levels):
    kind = np.uint8 if bits == 8 else np.uint16
    picture = np.array([[0, levels // 2, levels]], kind)
    np.testing.assert_array_equal(in_eight_bits(picture), [[0, 127, 255]])


def test_a_grey_cover_is_matched_by_shadows(made_release, cover):
    png.write_png(made_release / NAME, cover.min(axis=-1))
    assert not len(read_cover(made_release / NAME, (WIDTH, HEIGHT)).drawn)
    assert read(made_release) == [str(KEY)]


def test_an_invalid_cover_is_skipped_with_a_warning(made_release, cover, caplog):
    other = made_release / "CoverPhotoOfIndices" / "cover_photo_indexed_01_C.png"
    other.write_bytes(b"no picture")
    png.write_png(made_release / "CoverPhotoOfIndices" / "cover_photo_indexed_01_B.png", cover[:, :900])
    with caplog.at_level(logging.WARNING, "polarsim"):
        assert read(made_release) == [str(KEY)]
    assert [name for name in "ABC" if f"cover_photo_indexed_01_{name}.png" in caplog.text] == ["B", "C"]
    (made_release / NAME).unlink()
    with pytest.raises(DetectError):
        read(made_release)


def test_published_covers_have_the_keys_determined_by_hand(release_root, tmp_path):
    """Keys determined by eye from drawn boxes and shadows; three azimuths differ if only boxes are used."""
    known = {
        "01_A_off_30_L", "01_C_off_30_L", "11_A_off_30_L", "11_C_off_350_L", "12_A_off_30_R", "12_C_off_30_L",
    }  # fmt: skip
    read_covers(
        root=release_root, terrains=[1, 11, 12], keys=[], size=(WIDTH, HEIGHT), usual_exposure_ms=256,
        pictures=tmp_path / "photos", labels=tmp_path / "labels.parquet", pairing=tmp_path / "pairing.csv",
    )  # fmt: skip
    assert {path.stem.rsplit("_", 1)[0] for path in (tmp_path / "photos").iterdir()} == known
    assert all(PhotoKey.parse(path.stem) in release.label_files(release_root, int(path.stem[:2]))
               for path in (tmp_path / "photos").iterdir())  # fmt: skip
