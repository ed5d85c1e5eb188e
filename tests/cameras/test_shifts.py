"""Rocks that were placed millimetres off, and boxes of three positions that know better."""

import numpy as np
import pytest

from polarsim.cameras.labels import place_by_labels, with_shifts
from polarsim.cameras.options import CamerasOptions
from polarsim.cameras.shifts import shift_table, shifted
from polarsim.cameras.surveyed import surveyed_pose
from polarsim.formats.rigs import PlacedRig
from polarsim.formats.rock_shifts import FILE, read_shifts
from polarsim.geometry import boxes as box_geometry
from polarsim.geometry.outlines import outlines_of
from polarsim.geometry.stereo import stated_rig

from .conftest import TRUE_POSES, drawn_boxes

OPTIONS = CamerasOptions(rock_shift_sd_mm=10)
LENS = stated_rig().left
EDGE_PX = 0.7


@pytest.fixture(scope="module")
def drawn(labelled):
    """Boxes of the rocks where they are, drawn well."""
    rng = np.random.default_rng(3)
    return {p: drawn_boxes(labelled.meshes, stated_rig(), pose, rng, EDGE_PX) for p, pose in TRUE_POSES.items()}


def solved(labelled, drawn, off, options=OPTIONS):
    """Placements without and with shifts when the meshes lie `off` (m, 3) metres from where they belong."""
    outlines = shifted(outlines_of(labelled.meshes, 0.0, 0.0), off)
    seen = {p: boxes[np.isfinite(boxes).all(axis=1)] for p, boxes in drawn.items()}
    before = {p: place_by_labels(boxes, outlines, LENS, surveyed_pose(p), OPTIONS) for p, boxes in seen.items()}
    after, shifts = with_shifts(before, seen, outlines, LENS, options)
    return outlines, before, after, shifts


@pytest.fixture(scope="module")
def off():
    return np.random.default_rng(5).normal(scale=0.008, size=(15, 3))


@pytest.fixture(scope="module")
def solution(labelled, drawn, off):
    return solved(labelled, drawn, off)


def iou_in_right_photos(labelled, outlines, placements):
    """Mean IoU with the boxes of the right photos, which take no part in any fit."""
    rig, true = stated_rig(), outlines_of(labelled.meshes, 0.0, 0.0)
    found = []
    for position, placement in placements.items():
        cameras = [
            PlacedRig(rig, left).sandbox_from("R") for left in (TRUE_POSES[position], placement.fit.sandbox_from_left)
        ]
        wanted, projected = (
            box_geometry.clip(rocks.project(rig.right, camera))
            for rocks, camera in zip((true, outlines), cameras, strict=True)
        )
        seen = box_geometry.area(wanted) > 100
        found += np.diag(box_geometry.iou(projected[seen], wanted[seen])).tolist()
    return np.mean(found)


def test_shifts_take_back_most_of_what_rocks_are_off(off, solution):
    _, _, _, shifts = solution
    seen = shifts.boxes >= 2
    assert seen.sum() >= 12
    left = (off + shifts.metres)[seen]
    left -= left.mean(axis=0)  # a motion of everything shows in no box
    assert np.sqrt((left**2).mean()) < 0.4 * np.sqrt((off[seen] ** 2).mean())


def test_the_right_photos_agree_better_too(labelled, solution):
    outlines, before, after, shifts = solution
    plain = iou_in_right_photos(labelled, outlines, before)
    corrected = iou_in_right_photos(labelled, shifted(outlines, shifts.metres), after)
    assert corrected > plain + 0.03


def test_the_frame_stays_where_it_is(solution):
    shifts = solution[3]
    assert np.abs(shifts.metres.mean(axis=0)).max() < 0.001
    assert (shifts.sd <= 0.010 + 1e-9).all()
    assert np.median(shifts.sd[shifts.boxes >= 2]) < 0.006


def test_rocks_that_lie_right_stay(labelled, drawn):
    _, _, _, shifts = solved(labelled, drawn, np.zeros((15, 3)))
    assert np.median(np.linalg.norm(shifts.metres, axis=1)) < 0.003


def test_a_stronger_prior_shifts_less(labelled, drawn, off, solution):
    _, _, _, held = solved(labelled, drawn, off, OPTIONS.model_copy(update={"rock_shift_sd_mm": 1.0}))
    assert np.linalg.norm(held.metres) < 0.7 * np.linalg.norm(solution[3].metres)


def test_the_table_gives_back_the_shifts(tmp_path, solution):
    outlines, before, after, shifts = solution
    table = shift_table(outlines.rocks, shifts, [p.fit for p in before.values()], [p.fit for p in after.values()])
    assert table["iou_after"].mean() > table["iou_before"].mean()
    table.to_csv(tmp_path / FILE, index=False)
    read = read_shifts(tmp_path)
    assert sorted(read) == table["rock"].tolist()
    for rock, metres in zip(outlines.rocks, shifts.metres, strict=True):
        np.testing.assert_allclose(read[int(rock)], metres, atol=1e-5)


def test_no_table_is_no_shift(tmp_path):
    assert read_shifts(tmp_path) == {}
