"""Table and figure of the appearance of twins."""

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png
from polarsim.formats.tables import key_columns, read_csv, typed, write_parquet
from polarsim.photo import BLACK_LEVEL, PhotoKey
from polarsim.report.appearance_table import (
    BETTER,
    REFUSED,
    appearance_rows,
    control_verdict,
    difference_rows,
    tabulate_appearance,
)
from polarsim.report.figures.appearance import draw_appearance, shown_photos
from polarsim.schemas.evaluation import APPEARANCE_PAIRS, HELD_OUT, IN_PLACE, NOT_FITTED
from polarsim.scoring.twin_photos import ComparedPhoto, compare_twins
from tests.support.polar_photos import HEIGHT, WIDTH

ORIGIN = {"run": "test", "source": "analog", "config": "0123"}
KEYS = [
    PhotoKey(terrain, position, "off", azimuth, camera, 256)
    for terrain in (3, 11)
    for position in "ABC"
    for azimuth in ("30", "180")
    for camera in "LR"
]


def pairs_of(gain: float, **relation_of_azimuth: str) -> pd.DataFrame:
    """Return 12 views under two Suns: PSNR 10 to 33 dB, the control is worse by `gain` dB."""
    random = np.random.default_rng(0)
    rows = [
        key_columns(key)
        | {
            "model": "hapke", "relation": relation_of_azimuth.get(f"sun{key.azimuth}", NOT_FITTED), "lit_px": 9,
            "psnr_db": 10.0 + number, "ssim": 0.5, "correlation": 0.8, "stops": 0.3,
            "features": 20, "matches": number % 3, "agreement": 0.5 if number % 3 else np.nan,
            "agreement_by_chance": 0.25 if number % 3 > 1 else np.nan, "control_terrain": 4,
            "control_psnr_db": 10.0 + number - gain + random.normal(0, 1), "control_ssim": 0.4,
            "control_correlation": 0.2, "better_than_control": 1.0,
        }
        for number, key in enumerate(KEYS)
    ]  # fmt: skip
    return typed(rows, APPEARANCE_PAIRS)


def test_metrics_are_medians_with_intervals_over_views():
    rows = appearance_rows(pairs_of(5)).set_index(["group", "value"])
    row = rows.loc["all", "all"]
    assert (row["photos"], row["views"], row["matches"]) == (24, 12, 24)
    assert row["psnr_db"] == 21.5  # of 10 to 33
    assert 10 < row["psnr_db_low"] < 21.5 < row["psnr_db_high"] < 33
    assert row["ssim"] == row["ssim_low"] == row["ssim_high"] == 0.5
    assert row["agreement"] == 0.5
    assert row["agreement_by_chance"] == 0.25
    assert rows.loc[("azimuth", "180"), "photos"] == 12
    assert rows.loc[("terrain", "11"), "psnr_db"] == 27.5  # of 22 to 33
    assert row["psnr_gain_db"] == pytest.approx(5, abs=0.5)


def test_photos_in_place_and_held_out_are_never_pooled():
    rows = appearance_rows(pairs_of(5, sun30=IN_PLACE, sun180=HELD_OUT))
    assert rows.loc[rows["group"] == "all", ["relation", "photos"]].to_numpy().tolist() == [
        [HELD_OUT, 12], [IN_PLACE, 12],
    ]  # fmt: skip
    assert (rows["photos"] <= 12).all()


@pytest.mark.parametrize(("gain", "expected"), [(5, BETTER), (0, REFUSED), (-5, REFUSED)])
def test_a_score_is_refused_if_the_twin_of_another_terrain_is_as_good(tmp_path, gain, expected):
    write_parquet(tmp_path / "pairs.parquet", pairs_of(gain))
    tabulate_appearance(
        pairs=[tmp_path / "pairs.parquet"],
        table=tmp_path / "appearance",
        differences=tmp_path / "differences",
        origin=ORIGIN,
    )
    rows = read_csv(tmp_path / "appearance.csv").set_index(["group", "value"])
    assert rows.loc[("all", "all"), "control"] == expected
    text = (tmp_path / "appearance.md").read_text()
    assert ("Refused, because" in text) == (expected == REFUSED)
    assert ("hapke, all photos" in text) == (expected == REFUSED)


@pytest.mark.parametrize(
    ("lows", "views", "expected"),
    [([1, 1, 1], 5, BETTER), ([1, 0, 1], 5, REFUSED), ([1, 1, 1], 4, ""), ([1, np.nan, 1], 9, "")],
)
def test_the_verdict_requires_all_gains_and_enough_views(lows, views, expected):
    assert control_verdict(lows, views) == expected


def test_models_are_compared_on_the_same_photos():
    """The first model is better by 1 dB at 30 and by 3 dB at 180 degrees, and one photo has no twin of it."""
    second = pairs_of(5)
    first = second.assign(model="fitted", psnr_db=second["psnr_db"] + np.where(second["azimuth"] == "30", 1.0, 3.0))
    first["relation"] = np.where(first["azimuth"] == "30", HELD_OUT, IN_PLACE)
    rows = difference_rows(pd.concat([first[1:], second], ignore_index=True))
    assert set(rows["second"]) == {"hapke"}
    rows = rows.set_index(["first", "group", "value"])
    held_out, in_place = (rows.loc[(f"fitted, {relation}", "all", "all")] for relation in (HELD_OUT, IN_PLACE))
    assert (held_out["photos"], in_place["photos"]) == (11, 12)
    assert held_out["psnr_db"] == pytest.approx(1)
    assert in_place["psnr_db_low"] == in_place["psnr_db_high"] == pytest.approx(3)
    assert in_place["ssim"] == 0
    assert rows.loc[(f"fitted, {HELD_OUT}", "azimuth", "30"), "psnr_db"] == pytest.approx(1)


def test_a_single_model_has_no_differences():
    assert len(difference_rows(pairs_of(5))) == 0


def test_a_run_without_photos_has_an_empty_table_and_figure(tmp_path):
    write_parquet(tmp_path / "pairs.parquet", pairs_of(5)[:0])
    tabulate_appearance(
        pairs=[tmp_path / "pairs.parquet"],
        table=tmp_path / "appearance",
        differences=tmp_path / "differences",
        origin=ORIGIN,
    )
    assert len(read_csv(tmp_path / "appearance.csv")) == 0
    assert "no photos" in (tmp_path / "appearance.md").read_text()
    draw_appearance(
        pairs=[tmp_path / "pairs.parquet"], photos=[], twins=[], drawn=None, figure=tmp_path / "figure.png", width=400
    )
    assert png.size(tmp_path / "figure.png") == (400, 300)


def test_shown_photos_range_from_the_best_to_the_worst():
    table = pd.DataFrame({"key": list("abcdefg"), "ssim": [0.3, 0.9, 0.1, np.nan, 0.5, 0.2, 0.4]})
    assert shown_photos(table, 3) == ["b", "g", "c"]
    assert shown_photos(table, 2) == ["b", "c"]
    assert shown_photos(table[:0]) == []


def drawn_figure(tmp_path, terrains: tuple[str, ...]) -> np.ndarray:
    """Return the figure of a photo of terrain 3 that its twin equals; the control is a twin of terrain 11."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    light = 800 + 600 * np.sin(x / 61) * np.cos(y / 83)
    key, other = KEYS[0], KEYS[12]
    images = {"photo.png": light, f"hapke/Terrain03/{key}.png": light, f"hapke/Terrain11/{other}.png": light[::-1]}
    for name, image in images.items():
        png.write_png(tmp_path / name, (BLACK_LEVEL + image).astype(np.uint16))
    photos = tmp_path / "photos"
    png.write_png(photos / f"{key}.png", png.read_png(tmp_path / "photo.png"))
    twins = {"hapke": {key: tmp_path / f"hapke/Terrain03/{key}.png"}}
    others = {"hapke": {other: tmp_path / f"hapke/Terrain11/{other}.png"} if "11" in terrains else {}}
    write_parquet(
        tmp_path / "pairs.parquet", compare_twins({key: ComparedPhoto(photos / f"{key}.png")}, twins, others, {})
    )
    draw_appearance(
        pairs=[tmp_path / "pairs.parquet"], photos=[photos],
        twins=[tmp_path / f"hapke/Terrain{terrain}" for terrain in terrains], drawn=None,
        figure=tmp_path / "figure.png", width=800,
    )  # fmt: skip
    return png.read_png(tmp_path / "figure.png")[..., :3].astype(int)


def test_the_figure_says_if_there_is_no_control(tmp_path):
    grey = drawn_figure(tmp_path, ("03",)).mean(axis=-1)
    lower = grey[int(0.41 * len(grey)) : int(0.7 * len(grey)), :390]  # below the photo
    assert 0.001 < (lower < 128).mean() < 0.1  # text, no image


def test_the_figure_shows_photo_twin_control_and_difference(tmp_path):
    figure = drawn_figure(tmp_path, ("03", "11"))
    coloured = np.ptp(figure, axis=-1) > 60
    rows = np.flatnonzero(coloured.any(axis=1))
    assert rows.min() > 0.7 * figure.shape[0]  # only the bar has colour, since the twin equals the photo
    grey = figure.mean(axis=-1)
    upper, lower = grey[: len(grey) // 2], grey[len(grey) // 2 : int(0.7 * len(grey))]
    assert min(part[:, :400].std() for part in (upper, lower)) > 20  # photo and control
    assert upper[:, 400:].std() > 20  # twin
    assert (lower[40:, 420:780] > 245).mean() > 0.9  # white: no difference
