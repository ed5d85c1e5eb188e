"""What is around the sand covers neither sand nor rocks, and is as bright as stated."""

import numpy as np
import pytest

from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import looking
from polarsim.scenes.hall import draw_hall, furnish
from polarsim.scenes.options import HallOptions

SHAPE = (60, 90)
POSE = looking(np.array([-2.5, 0.0, 1.5]), 0.0, np.deg2rad(20))
LENS = Lens(70, 70, 45, 30, width=90, height=60)
BARE = HallOptions(brightness=(0, 0), folds_sd=(0, 0), most_cards=0, most_glares=0)


def project(points):
    """Seen from above the centre of the near wall towards the far one."""
    return LENS.project(POSE.inverse().apply(points))


def furnished(rng, around, radiance=1.0, **options):
    bare = np.zeros(SHAPE, bool)
    bare[:10] = True
    pixels = np.full(SHAPE, radiance, np.float32)
    pixels[bare] = 0
    return furnish(pixels, around, bare & around, (2.0, 0.3), project, BARE.model_copy(update=options), rng)


@pytest.fixture
def around():
    position = np.zeros(SHAPE, bool)
    position[:20] = True
    return position


def test_nothing_asked_for_changes_nothing(rng, around):
    found = furnished(rng, around)
    assert (found[:10] == 0).all()
    assert (found[10:] == 1).all()


def test_the_hall_is_as_bright_as_stated(rng, around):
    for _ in range(10):
        hall = draw_hall(SHAPE, rng)
        assert hall.mean() == pytest.approx(1)
        assert hall.min() >= 0
    found = furnished(rng, around, brightness=(0.3, 0.3))
    assert 0 < found[:10].mean() < 1
    assert (found[10:] == 1).all()


def test_folds_are_on_the_walls_alone(rng, around):
    found = furnished(rng, around, folds_sd=(0.5, 0.5))
    assert found[10:20].std() > 0.1
    assert (found[20:] == 1).all()


def test_cards_have_a_frame_and_cover_no_sand(rng, around):
    seen = [furnished(rng, around, most_cards=4, card_m=(0.8, 1.2), card=(5, 9)) for _ in range(120)]
    assert all((found[20:] == 1).all() for found in seen)
    shades = [len(np.unique(found[found >= 5])) for found in seen]
    assert 0 in shades
    assert 2 in shades  # a card and its frame
    assert max(shades) <= 8


def test_glare_is_soft_and_everywhere(rng, around):
    seen = np.max([furnished(rng, around, most_glares=2, glare=(0.5, 0.5)) for _ in range(30)], axis=0)
    assert seen[20:].max() > 1.3
    assert seen.max() < 2.1
