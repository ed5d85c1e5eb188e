"""Rocks that are millimetres off, corrected by boxes of three positions."""

from dataclasses import dataclass

import numpy as np
import pytest

from polarsim.cameras.localisations import Localisations, localise_all, untranslated_fits
from polarsim.cameras.options import LocalisationOptions
from polarsim.cameras.translations import MAX_TRANSLATION, fit_translations, translated, translation_table
from polarsim.geometry.outlines import Outlines, outlines_of
from polarsim.run_files.rock_translations import FILE, read_translations
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import RANGES, TRIPODS

from .conftest import TRUE_POSES, annotated_boxes

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("coarse_search")]
OPTIONS = LocalisationOptions(rock_translation_sd_mm=10)
LENS = default_rig().left
EDGE_PX = 0.7


@pytest.fixture(scope="module")
def annotated(labelled):
    """Boxes of the rocks at their true positions, annotated accurately."""
    rng = np.random.default_rng(3)
    return {p: annotated_boxes(labelled.meshes, default_rig(), pose, rng, EDGE_PX) for p, pose in TRUE_POSES.items()}


@dataclass(frozen=True)
class Solution:
    outlines: Outlines  # as published
    found: Localisations


def solved(labelled, annotated, off):
    """Localise all positions with meshes that are `off` (m, 3) metres from their true positions."""
    outlines = translated(outlines_of(labelled.meshes, 0.0, 0.0), off)
    seen = {p: boxes[np.isfinite(boxes).all(axis=1)] for p, boxes in annotated.items()}
    return Solution(outlines, localise_all(seen, outlines, LENS, OPTIONS, TRIPODS, 1.0, RANGES))


@pytest.fixture(scope="module")
def off():
    return np.random.default_rng(5).normal(scale=0.008, size=(15, 3))


@pytest.fixture(scope="module")
def solution(labelled, annotated, off):
    return solved(labelled, annotated, off)


def test_translations_correct_most_of_the_offsets(off, solution):
    translations = solution.found.translations
    seen = translations.boxes >= 2
    assert seen.sum() >= 12
    left = (off + translations.metres)[seen]
    left -= left.mean(axis=0)  # a common translation does not show in any box
    assert np.sqrt((left**2).mean()) < 0.4 * np.sqrt((off[seen] ** 2).mean())


def test_the_frame_is_not_moved(solution):
    translations = solution.found.translations
    assert np.abs(translations.metres.mean(axis=0)).max() < 0.001
    assert (translations.sd <= 0.010 + 1e-9).all()
    assert np.median(translations.sd[translations.boxes >= 2]) < 0.006


def test_a_stronger_prior_moves_rocks_less(solution):
    held = fit_translations(solution.found.localised, solution.outlines, LENS, 0.001, np.zeros((15, 3)))[1]
    assert np.linalg.norm(held.metres) < 0.7 * np.linalg.norm(solution.found.translations.metres)


def test_a_few_displaced_rocks_do_not_move_the_rest(labelled, annotated):
    off = np.zeros((15, 3))
    off[[2, 5, 8], 1] = 0.05
    off[3, 1] = 0.16  # more than the maximum
    found = solved(labelled, annotated, off).found
    assert set(found.localised) == set("ABC")
    for position, one in found.localised.items():
        assert np.linalg.norm(one.fit.sandbox_from_left.translation - TRUE_POSES[position].translation) < 0.02
    metres = np.linalg.norm(found.translations.metres, axis=1)
    assert metres.max() <= MAX_TRANSLATION
    determined = (found.translations.boxes >= 2) & (np.arange(15) != 3)
    left = np.linalg.norm(off + found.translations.metres, axis=1)[determined]
    assert np.median(left) < 0.003
    assert left.max() < 0.02


def test_a_refused_position_does_not_change_the_rest(labelled, annotated):
    outlines = outlines_of(labelled.meshes, 0.0, 0.0)
    seen = {p: boxes[np.isfinite(boxes).all(axis=1)] for p, boxes in annotated.items()}
    found = localise_all({**seen, "A": seen["B"]}, outlines, LENS, OPTIONS, TRIPODS, 1.0, RANGES)
    assert set(found.localised) == set("BC")
    assert set(found.refused) == {"A"}
    assert "2." in found.refused["A"].reason  # B is 2.5 m behind A: its boxes are explained perfectly by a pose at B
    np.testing.assert_allclose(
        found.localised["C"].fit.sandbox_from_left.translation, TRUE_POSES["C"].translation, atol=0.02
    )


def test_translations_are_read_from_the_table(tmp_path, solution):
    rocks, translations = solution.outlines.rocks, solution.found.translations
    before = untranslated_fits(solution.found, solution.outlines, LENS)
    after = [one.fit for one in solution.found.localised.values()]
    table = translation_table(rocks, translations, before, after)
    assert table["iou_after"].mean() > table["iou_before"].mean()
    table.to_csv(tmp_path / FILE, index=False)
    read = read_translations(tmp_path)
    assert sorted(read) == table["rock"].tolist()
    for rock, metres in zip(rocks, translations.metres, strict=True):
        np.testing.assert_allclose(read[int(rock)], metres, atol=1e-5)


def test_without_a_table_there_are_no_translations(tmp_path):
    assert read_translations(tmp_path) == {}
