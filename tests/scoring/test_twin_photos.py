"""Comparison of twins and photos: selection, features, control, relation to fits."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.photo import BLACK_LEVEL, PhotoKey
from polarsim.run_files.fitted_photos import FittedPhotos
from polarsim.schemas.evaluation import HELD_OUT, IN_PLACE, NOT_FITTED
from polarsim.scoring.feature_agreement import agreement_of, compare_features, find_features
from polarsim.scoring.twin_photos import (
    NO_TERRAIN,
    ComparedPhoto,
    compare_twins,
    relation_to_fits,
    subject_of,
    twin_of_same_view,
    typical_photos,
)
from tests.support.polar_photos import HEIGHT, WIDTH

KEY = PhotoKey.parse("03_A_off_30_L_0256")
SAME_VIEW = replace(KEY, terrain=11)


def scene(seed: int) -> np.ndarray:
    """Return an image of sand with random rocks, 12 bits."""
    random = np.random.default_rng(seed)
    light = np.tile(1200 + 200 * np.sin(np.arange(WIDTH) / 300), (HEIGHT, 1))
    for _ in range(60):
        column, row, radius = (int(random.uniform(*sides)) for sides in ((250, 1700), (200, 800), (12, 40)))
        cv2.circle(light, (column, row), radius, random.uniform(200, 2500), -1)
    return (BLACK_LEVEL + light).astype(np.uint16)


@pytest.fixture(scope="module")
def images(tmp_path_factory):
    """Photo with its twin of half the brightness, and a twin of another terrain."""
    folder = tmp_path_factory.mktemp("images")
    photo = scene(1)
    twin = (BLACK_LEVEL + (photo.astype(int) - BLACK_LEVEL) // 2).astype(np.uint16)
    for name, image in (("photo", photo), ("twin", twin), ("other", scene(2))):
        png.write_png(folder / f"{name}.png", image)
    return folder


def test_a_photo_is_compared_with_its_twin_and_with_that_of_another_terrain(images):
    photos = {KEY: ComparedPhoto(images / "photo.png")}
    twins = {"hapke": {KEY: images / "twin.png"}, "principled": {}}
    rows = compare_twins(photos, twins, {"hapke": {SAME_VIEW: images / "other.png"}}, {})
    (row,) = rows.to_dict("records")
    assert (row["key"], row["model"], row["relation"], row["control_terrain"]) == (str(KEY), "hapke", NOT_FITTED, 11)
    assert row["ssim"] > 0.98 > 0.9 > row["control_ssim"]
    assert row["psnr_db"] > row["control_psnr_db"] + 10
    assert row["better_than_control"] == 1
    assert row["agreement"] > 0.9
    assert row["agreement_by_chance"] < 0.1
    assert row["log2_twin_over_photo"] == pytest.approx(-1, abs=0.01)


def test_the_twin_of_another_scene_is_not_better_than_the_control(images):
    photos = {KEY: ComparedPhoto(images / "photo.png")}
    other = {KEY: images / "other.png"}
    rows = compare_twins(photos, {"hapke": other}, {"hapke": {SAME_VIEW: images / "twin.png"}}, {})
    assert rows["better_than_control"].tolist() == [0]


def test_without_a_twin_of_the_same_view_there_is_no_control(images):
    photos = {KEY: ComparedPhoto(images / "photo.png")}
    others = {"hapke": {replace(SAME_VIEW, azimuth="180"): images / "other.png"}}
    (row,) = compare_twins(photos, {"hapke": {KEY: images / "twin.png"}}, others, {}).to_dict("records")
    assert row["control_terrain"] == NO_TERRAIN
    assert math.isnan(row["control_psnr_db"])
    assert math.isnan(row["better_than_control"])


def test_drawn_lines_of_a_published_photo_do_not_matter(images, tmp_path):
    photo = png.read_png(images / "photo.png")
    lines = np.zeros(photo.shape, np.uint8)
    lines[300:306, 300:1500] = 255
    png.write_png(tmp_path / "lined.png", np.where(lines > 0, 0, photo // 16).astype(np.uint8))
    png.write_png(tmp_path / "plain.png", (photo // 16).astype(np.uint8))
    png.write_png(tmp_path / "lines.png", lines)
    rows = [
        compare_twins(
            {KEY: ComparedPhoto(tmp_path / name, tmp_path / "lines.png")}, {"hapke": {KEY: images / "twin.png"}}, {}, {}
        )
        for name in ("lined.png", "plain.png")
    ]
    assert rows[0].equals(rows[1])
    assert rows[0]["ssim"].item() > 0.95


@pytest.mark.parametrize("wrong", ["twin", "mask"])
def test_a_twin_or_mask_of_another_size_is_an_error(images, tmp_path, wrong):
    png.write_png(tmp_path / f"{wrong}.png", np.zeros((10, 10), np.uint8))
    twin, mask = (tmp_path / "twin.png", None) if wrong == "twin" else (images / "twin.png", tmp_path / "mask.png")
    with pytest.raises(FormatError, match=rf"{wrong}\.png"):
        compare_twins({KEY: ComparedPhoto(images / "photo.png", mask)}, {"hapke": {KEY: twin}}, {}, {})


@pytest.mark.parametrize(
    ("fits", "relation"),
    [
        ([], NOT_FITTED),
        ([FittedPhotos(frozenset({"30", "180"}), frozenset({"A", "C"}))], IN_PLACE),
        ([FittedPhotos(frozenset({"180"}), frozenset({"A"}))], HELD_OUT),
        ([FittedPhotos(frozenset({"30"}), frozenset({"C"}))], HELD_OUT),
        ([FittedPhotos(frozenset({"30"}), frozenset({"A", "C"}))], IN_PLACE),
        (
            [FittedPhotos(frozenset({"180"}), frozenset({"A"})), FittedPhotos(frozenset({"30"}), frozenset({"A"}))],
            IN_PLACE,
        ),
    ],
)
def test_a_photo_is_in_place_if_it_took_part_in_any_fit(fits, relation):
    for key in (KEY, KEY.other_camera, KEY.with_exposure(1024)):
        assert relation_to_fits(key, fits) == relation


def test_photos_in_place_and_held_out_are_different_subjects():
    assert [subject_of("hapke", relation) for relation in (NOT_FITTED, IN_PLACE, HELD_OUT)] == [
        "hapke", "hapke, in place", "hapke, held out",
    ]  # fmt: skip


def test_the_control_has_the_nearest_exposure_of_the_same_view_and_lamps():
    keys = [SAME_VIEW.with_exposure(64), SAME_VIEW.with_exposure(512), replace(SAME_VIEW, light="on"), KEY]
    assert twin_of_same_view(KEY, dict.fromkeys(keys)) == SAME_VIEW.with_exposure(512)
    assert twin_of_same_view(KEY, {KEY: None}) is None


def test_typical_photos_are_of_middle_exposure_and_spread_over_the_sets():
    keys = [
        PhotoKey(3, position, "off", azimuth, "L", ms)
        for position in "AC"
        for azimuth in ("no", "30", "180")
        for ms in (64, 512, 1024)
    ]
    assert [str(key) for key in typical_photos(keys, 2, 256)] == ["03_A_off_180_L_0512", "03_C_off_30_L_0512"]
    assert len(typical_photos(keys, 9, 256)) == 4
    assert typical_photos(keys, 0, 256) == typical_photos([], 5, 256) == []


# features


def test_matches_agree_where_positions_coincide():
    """By hand: of the two matches one agrees; of the two exchanged pairs, one is within a pixel."""
    photo, twin = np.array([[0.0, 0], [10, 0]]), np.array([[0.6, 0.6], [0.0, 1.0]])
    result = agreement_of(photo, twin)
    assert (result.matches, result.agreement, result.agreement_by_chance) == (2, 0.5, 0.5)


def test_few_matches_have_no_share_by_chance():
    nothing, single = (agreement_of(np.zeros((n, 2)), np.zeros((n, 2))) for n in (0, 1))
    assert nothing.matches == 0
    assert math.isnan(nothing.agreement)
    assert single.agreement == 1
    assert math.isnan(single.agreement_by_chance)


def test_features_of_a_shifted_image_match_but_do_not_agree(rng):
    image = np.kron(rng.uniform(0, 255, (20, 50)), np.ones((8, 8))).astype(np.float32)
    valid = np.ones(image.shape, bool)
    features = find_features(image, valid)
    same = compare_features(features, features)
    assert same.agreement == 1
    shifted = compare_features(features, find_features(np.roll(image, 8, axis=1), valid))
    assert shifted.matches > 0.5 * same.matches
    assert shifted.agreement < 0.05


def test_values_at_invalid_pixels_do_not_change_features(rng):
    image = np.kron(rng.uniform(0, 255, (20, 50)), np.ones((8, 8))).astype(np.float32)
    valid = np.ones(image.shape, bool)
    valid[60:64] = False
    first, second = (find_features(np.where(valid, image, value), valid) for value in (0, 255))
    np.testing.assert_array_equal(first.pixels, second.pixels)
    np.testing.assert_array_equal(first.descriptors, second.descriptors)
    assert not ((first.pixels[:, 1] >= 60) & (first.pixels[:, 1] < 64)).any()
