import numpy as np
import pytest

from polarsim.analog.annotator import annotate, annotate_rock
from polarsim.analog.light import DiscLamp, visibility
from polarsim.analog.regions import VisibleRegion, region_contrast, rock_regions, shadow_regions

BALL_RADIUS, BALL_HEIGHT = 0.15, 0.10  # metres, of the ball that conftest puts into the scene

LAMP = DiscLamp(np.array([0.0, 3.5, 0.9]), np.zeros(3), 0.03)


def square(rock, x0, y0, size):
    return VisibleRegion(rock, (x0, y0, x0 + size, y0 + size), np.ones((size, size), bool))


def test_the_region_of_a_rock_is_its_tight_box(ball_view):
    (region,) = rock_regions(ball_view)
    rows, columns = np.nonzero(ball_view.objects == 1)
    assert region.rock == 1
    assert region.box == (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
    assert region.pixels == len(rows)


def test_a_cast_shadow_is_the_sand_whose_rays_to_the_lamp_hit_the_rock(ball_scene, ball_caster, ball_view, rng):
    seen = visibility(ball_view, ball_caster, LAMP, rng)
    (region,) = shadow_regions(ball_scene, ball_caster, ball_scene.rock_caster(), ball_view, LAMP, seen)
    x0, y0, x1, y1 = region.box
    points = ball_view.points[y0:y1, x0:x1][region.mask]
    to_lamp = LAMP.position - points
    to_lamp /= np.linalg.norm(to_lamp, axis=1, keepdims=True)
    to_ball = np.array([0, 0, BALL_HEIGHT]) - points
    along = np.einsum("ij,ij->i", to_ball, to_lamp)
    # Rays start slightly above the sand.
    assert (np.linalg.norm(to_ball - along[:, None] * to_lamp, axis=1) < BALL_RADIUS + 0.003).all()
    away, up = LAMP.position[1], LAMP.position[2]
    tangent = np.arctan2(up - BALL_HEIGHT, away) - np.arcsin(BALL_RADIUS / np.hypot(away, up - BALL_HEIGHT))
    # The shadow ends at the ray over the top of the ball.
    assert points[:, 1].min() == pytest.approx(away - up / np.tan(tangent), rel=0.05)


def test_sand_shaded_by_a_wall_and_scenes_without_rocks_have_no_rock_shadow(ball_scene, ball_caster, ball_view, rng):
    low = DiscLamp(np.array([0.0, 3.5, 0.34]), np.zeros(3), 0.03)  # below the wall top of 0.31: all sand is shaded
    seen = visibility(ball_view, ball_caster, low, rng)
    for rocks in (ball_scene.rock_caster(), None):
        assert shadow_regions(ball_scene, ball_caster, rocks, ball_view, low, seen) == []


def test_contrast_is_the_difference_to_the_surroundings():
    photo = np.full((1216, 1936), 500, np.uint16)
    photo[100:140, 200:240] = 100
    assert region_contrast(square(1, 200, 100, 40), photo) == pytest.approx(-400)
    photo[0:40, 0:40] = 900
    assert region_contrast(square(1, 0, 0, 40), photo) == pytest.approx(400)  # also at the corner of the photo


BRIGHT = np.full((1216, 1936), 800, np.uint16)
BRIGHT[500:590, 500:590] = 1500  # a rock brighter than the sand


def test_annotated_boxes_are_integers_with_the_scatter_of_the_published_labels():
    rng = np.random.default_rng(1)
    boxes = np.array(
        [b for b in (annotate_rock(square(1, 500, 500, 65), BRIGHT, rng) for _ in range(900)) if b is not None]
    )
    assert (boxes == np.round(boxes)).all()
    off = boxes - [500, 500, 565, 565]
    robust = 1.4826 * np.median(np.abs(off - np.median(off, axis=0)), axis=0)
    np.testing.assert_allclose(robust, [4.3, 2.6, 4.7, 4.3], rtol=0.35)  # labels 50 to 80 px large
    np.testing.assert_allclose(off.mean(axis=0), 0, atol=0.6)


def test_errors_of_annotations_are_proportional_to_the_size_of_the_photo():
    def off(scale):
        rng, photo = np.random.default_rng(1), BRIGHT.repeat(scale, axis=0).repeat(scale, axis=1)
        region = square(1, 500 * scale, 500 * scale, 65 * scale)
        boxes = [annotate_rock(region, photo, rng) for _ in range(20)]
        return np.array(
            [np.full(4, np.nan) if box is None else box / scale - np.array(region.box) / scale for box in boxes]
        )

    np.testing.assert_allclose(off(2), off(1), atol=1)  # edges are rounded to pixels


def test_small_and_dark_rocks_are_missed_more_often():
    rng = np.random.default_rng(2)
    dark = np.full((1216, 1936), 20, np.uint16)

    def missed(size, photo):
        return np.mean([annotate_rock(square(1, 500, 500, size), photo, rng) is None for _ in range(250)])

    assert missed(90, BRIGHT) < 0.03
    assert 0.3 < missed(12, BRIGHT) < 0.7
    assert missed(90, dark) > 0.5


def test_shadows_are_annotated_on_request_and_only_with_their_rocks():
    photo = BRIGHT.copy()
    photo[600:660, 500:560] = 100
    rocks, shadows = [square(1, 500, 500, 90)], [square(1, 500, 600, 60), square(2, 900, 600, 60)]
    rng = np.random.default_rng(3)
    without, _ = annotate(rocks, shadows, photo, rng, with_shadows=False)
    both = [annotate(rocks, shadows, photo, rng, with_shadows=True)[0].tolist() for _ in range(30)]
    assert set(without) <= {0}
    assert max(classes.count(1) for classes in both) == 1  # rock 2 was not annotated
    assert sum(classes == [0, 1] for classes in both) > 20


def test_the_width_of_a_region_is_the_side_of_its_largest_square():
    line = VisibleRegion(1, (5, 5, 45, 6), np.ones((1, 40), bool))
    assert line.width_px == 1
    wide = np.zeros((9, 40), bool)
    wide[4], wide[2:7, 10:15] = True, True
    assert VisibleRegion(1, (5, 5, 45, 14), wide).width_px == 5
