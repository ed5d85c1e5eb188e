from dataclasses import replace

import numpy as np
import pytest

from polarsim.errors import ReconstructionError
from polarsim.geometry.contrast import local_contrast
from polarsim.geometry.meshes import Mesh
from polarsim.relief.heights import INVENTED, MEASURED
from polarsim.relief.pairs import Group, comparable_groups
from polarsim.relief.sweep import SweptScene, sweep_ground
from tests.relief.scenes import GRID, NO_MESH, level, relief, texture, view

TRUE = relief(*np.moveaxis(GRID.centres(), -1, 0))


@pytest.fixture(scope="module")
def views():
    """Views from A and C, left and right, under one lamp."""
    pattern = texture(0)
    return [view(position, side, "30", pattern) for position in "AC" for side in "LR"]


def swept(views, groups=None, rocks=NO_MESH):
    return sweep_ground(
        level(), SweptScene(views, comparable_groups(views) if groups is None else groups, rocks, NO_MESH)
    )


def errors(found) -> np.ndarray:
    known = found.kind == MEASURED
    return np.abs(found.height_m - TRUE)[known]


@pytest.fixture(scope="module")
def found(views):
    return swept(views)


def test_four_views_measure_the_relief(found):
    assert (found.kind == MEASURED).mean() > 0.9
    assert np.median(errors(found)) < 0.0008  # metres
    assert np.percentile(errors(found), 95) < 0.004


def test_the_standard_deviation_is_that_of_the_errors(found):
    known = found.kind == MEASURED
    share = (errors(found) < 2 * found.sd_m[known]).mean()
    assert share > 0.8
    assert np.isinf(found.sd_m[~known]).all()


def test_brightness_slow_light_and_the_order_of_views_do_not_matter(views, found):
    falloff = np.linspace(1, 2, views[0].picture.shape[1], dtype=np.float32)
    changed = [replace(one, picture=k * falloff * one.picture) for k, one in enumerate(views[::-1], start=1)]
    other = swept(changed)
    both = (other.kind == MEASURED) & (found.kind == MEASURED)
    assert both.mean() > 0.9
    assert np.median(np.abs(other.height_m - found.height_m)[both]) < 0.0003


def test_one_pair_measures_the_relief_less_accurately(views):
    found = swept([views[0], views[2]])
    assert (found.kind == MEASURED).mean() > 0.7
    assert np.median(errors(found)) < 0.003


def test_inverted_patterns_agree_with_a_negative_sign(views):
    inverted = replace(views[2], picture=200 - views[2].picture)
    group = Group({views[0].key: 1.0, inverted.key: -1.0})
    assert np.median(errors(swept([views[0], inverted], [group]))) < 0.003
    with pytest.raises(ReconstructionError):
        swept([views[0], inverted])


@pytest.mark.parametrize(("start_m", "side"), [(0.0, None), (0.07, "below"), (-0.07, "above")])
def test_ground_far_from_the_feet_of_rocks_is_refused(views, start_m, side):
    angle = np.linspace(0, 2 * np.pi, 20)
    ring = 0.08 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    feet = [ring + np.array([x, y, start_m]) for x, y in ((0.4, -0.4), (-0.4, 0.4), (0.0, 0.4))]
    start = replace(level(), height_m=level().height_m + start_m)
    scene = SweptScene(views, comparable_groups(views), NO_MESH, NO_MESH, feet)
    if side is None:
        assert (sweep_ground(start, scene).kind == MEASURED).mean() > 0.9
    else:
        with pytest.raises(ReconstructionError, match=f"{side} the feet"):
            sweep_ground(start, scene)


def test_photos_of_other_scenes_are_refused(views):
    other = view("C", "L", "30", texture(1))
    with pytest.raises(ReconstructionError, match="agree"):
        swept([views[0], other])


def test_views_without_a_comparable_lamp_are_refused(views):
    with pytest.raises(ReconstructionError, match="Sun"):
        swept([views[0]])


def test_ground_below_a_rock_is_not_measured(views):
    corners = np.array([[x, y, z] for z in (0.0, 0.2) for x, y in ((0, 0), (0.2, 0), (0.2, 0.2), (0, 0.2))], float)
    top = np.array([[4, 5, 6], [4, 6, 7]])
    found = swept(views, rocks=Mesh(corners, top))
    x, y = np.moveaxis(GRID.centres(), -1, 0)
    below = (x > 0) & (x < 0.2) & (y > 0) & (y < 0.2)
    assert (found.kind[below] == INVENTED).all()
    assert (found.kind[~below] == MEASURED).mean() > 0.7


def test_lamps_pair_views():
    pattern = np.ones((320, 320))
    first, similar, opposite, across = (
        view(p, "L", sun, pattern) for p, sun in zip("ACCC", ("30", "350", "180", "270"), strict=True)
    )
    (group,) = comparable_groups([first, similar])
    assert (list(group.signs.values()), group.shadows_hidden) == ([1.0, 1.0], {first.key, similar.key})
    (group,) = comparable_groups([first, opposite])
    assert list(group.signs.values()) == [1.0, -1.0]
    assert comparable_groups([first, across]) == []
    (group,) = comparable_groups([first, similar, view("C", "L", "30", pattern)])
    assert {key.azimuth for key in group.signs} == {"30"}


def test_contrast_ignores_offset_and_is_zero_where_unknown():
    values = np.random.default_rng(0).normal(size=(60, 60)).astype(np.float32)
    values[20:30] = np.nan
    contrast = local_contrast(values, 4.0, 0.01)
    np.testing.assert_allclose(local_contrast(values + 7, 4.0, 0.01), contrast, atol=1e-4)
    assert not contrast[20:30].any()
    assert 0.8 < contrast[40:].std() < 1.2
