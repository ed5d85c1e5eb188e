"""Walls measured in scans: synthetic boards of known position and height."""

import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.rocks.scans import ScanPoints
from polarsim.rocks.walls import measure_walls
from polarsim.run_files.walls import FILE, SIDES, read_walls, surveyed_walls, write_walls
from polarsim.site import polar
from tests.support.other_site import other_site
from tests.support.polar_survey import SANDBOX

FACES = {"-x": 2.02, "+x": 1.98, "-y": 2.05, "+y": 1.96}
TOPS = {"-x": 0.31, "+x": 0.28, "-y": 0.33, "+y": 0.29}
THICKNESS = 0.08


def board(side: str, rng: np.random.Generator, *, inner: bool, sag: float = 0.0) -> np.ndarray:
    """Return points (n, 3) of the top and of the inner or outer face of a wall, 0.5 mm noise."""
    count, sign, face, top = 60_000, -1.0 if side[0] == "-" else 1.0, FACES[side], TOPS[side]
    along = rng.uniform(-2, 2, count)
    edge = top + sag * along
    share = rng.uniform(0, 1, count)
    on_top = np.arange(count) % 2 == 0
    outward = np.where(on_top, face + THICKNESS * share, face if inner else face + THICKNESS)
    height = np.where(on_top, edge, edge * share)
    points = np.empty((count, 3))
    axis = "xy".index(side[1])
    points[:, axis], points[:, 1 - axis], points[:, 2] = sign * outward, along, height
    return points + rng.normal(0, 0.0005, points.shape)


def scans(*parts: np.ndarray) -> ScanPoints:
    points = np.concatenate(parts)
    return ScanPoints(points, np.zeros_like(points), np.ones(len(points)))


def sand(rng: np.random.Generator) -> np.ndarray:
    return np.column_stack([rng.uniform(-1.9, 1.9, (20_000, 2)), rng.normal(0, 0.005, 20_000)])


@pytest.mark.parametrize("inner", [True, False])
def test_face_and_top_of_every_side_are_measured(rng, inner):
    walls = measure_walls(1, SANDBOX, scans(sand(rng), *(board(side, rng, inner=inner) for side in SIDES)), level=0.0)
    assert walls.origin == "scans"
    for side, wall in walls.sides.items():
        assert wall.face_m == pytest.approx(FACES[side], abs=0.003)
        assert wall.top(np.linspace(-1.8, 1.8, 7)) == pytest.approx(TOPS[side], abs=0.002)
        assert wall.support > 0.9


def test_the_top_follows_a_sloping_wall(rng):
    walls = measure_walls(1, SANDBOX, scans(*(board(side, rng, inner=True, sag=0.005) for side in SIDES)), level=0.0)
    along = np.linspace(-1.8, 1.8, 7)
    assert walls.sides["+y"].top(along) == pytest.approx(TOPS["+y"] + 0.005 * along, abs=0.002)


def test_parts_without_a_visible_top_are_interpolated(rng):
    low = board("-x", rng, inner=True)
    cut = low[(np.abs(low[:, 1]) > 0.5) | (low[:, 2] < 0.2)]  # an object hides the upper part of the middle
    walls = measure_walls(1, SANDBOX, scans(cut, *(board(side, rng, inner=True) for side in SIDES[1:])), level=0.0)
    assert walls.sides["-x"].top(np.array([0.0])) == pytest.approx(TOPS["-x"], abs=0.003)
    assert walls.sides["-x"].support == pytest.approx(0.7, abs=0.06)


def test_missing_walls_are_nominal_and_reported(rng, caplog):
    walls = measure_walls(1, SANDBOX, scans(sand(rng), board("-x", rng, inner=True)), level=0.01)
    nominal = surveyed_walls(SANDBOX, 0.01)
    assert walls.sides["-x"].support > 0.9
    for side in SIDES[1:]:
        assert walls.sides[side].support == 0
        assert walls.sides[side].face_m == nominal.sides[side].face_m
        assert side in caplog.text
    assert measure_walls(1, SANDBOX, scans(sand(rng)), level=0.0).origin == "survey"


def test_a_sandbox_without_survey_has_no_walls(rng):
    assert measure_walls(13, polar().sandbox_of(13), scans(sand(rng)), level=0.0) is None


def test_walls_are_read_as_written(rng, tmp_path):
    walls = measure_walls(1, SANDBOX, scans(*(board(side, rng, inner=True) for side in SIDES)), level=0.0)
    write_walls(tmp_path, walls)
    read = read_walls(tmp_path)
    assert read.origin == walls.origin
    for side in SIDES:
        assert read.sides[side].face_m == pytest.approx(walls.sides[side].face_m, abs=1e-4)
        assert read.sides[side].top_m == pytest.approx(walls.sides[side].top_m, abs=1e-4)
    assert read_walls(tmp_path / "elsewhere") is None


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text.replace('"-x"', '"west"'),
        lambda text: text.replace('"top_m"', '"top"'),
        lambda text: text.replace('"survey"', '"guess"'),
        lambda text: text.replace("2.05,", "-2.05,", 1),
        lambda text: text.replace("-1.9,", "1.9,", 1),
        lambda text: text[: len(text) // 2],
    ],
)
def test_damaged_files_are_refused_with_their_path(tmp_path, damage):
    write_walls(tmp_path, surveyed_walls(SANDBOX, 0.0))
    text = (tmp_path / FILE).read_text()
    assert damage(text) != text
    (tmp_path / FILE).write_text(damage(text))
    with pytest.raises(FormatError) as error:
        read_walls(tmp_path)
    assert error.value.path == tmp_path / FILE


def test_walls_of_a_yard_are_measured_on_the_sides_that_the_site_states(rng):
    """Walls at 1.47 m and 3.04 m, 0.2 m high, in a yard of 3 m x 6 m without a wall at -y."""
    along_x, along_y = rng.uniform(-1.4, 1.4, 60_000), rng.uniform(-2.9, 2.9, 60_000)
    height = rng.uniform(0, 0.19, 60_000)
    boards = [np.column_stack([sign * np.full(60_000, 1.47), along_y, height]) for sign in (-1, 1)]
    boards += [np.column_stack([along_x, sign * np.full(60_000, 3.04), height]) for sign in (-1, 1)]  # a heap at -y
    flat = np.column_stack([rng.uniform(-1.4, 1.4, 20_000), rng.uniform(-2.9, 2.9, 20_000), np.zeros(20_000)])
    walls = measure_walls("yard-a", other_site().sandbox, scans(flat, *boards), level=0.0)
    assert {side: round(wall.face_m, 2) for side, wall in walls.sides.items()} == {"-x": 1.47, "+x": 1.47, "+y": 3.04}
    assert {side: len(wall.along_m) for side, wall in walls.sides.items()} == {"-x": 60, "+x": 60, "+y": 30}
    assert walls.open_m == {"-y": 3.0}
    np.testing.assert_allclose([wall.top(np.array([1.0]))[0] for wall in walls.sides.values()], 0.19, atol=0.01)
