import numpy as np
import pytest

from polarsim.rocks.clouds import alignment_translations
from polarsim.rocks.scans import ScanPoints, merge_scans

OFF = np.array([0.0015, -0.0020, 0.0010])  # metres


def scan(eye, count=8000, noise=0.002, seed=0, off=(0, 0, 0), flat=False):
    """Return a scan of a lumpy rock of 12 cm, or of a plate, with noise along its rays."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    radius = 0.06 * (1 + 0.1 * np.sin(7 * direction[:, :1]) * np.cos(5 * direction[:, 1:2]))
    points = direction * radius
    if flat:
        points = points * [1, 1, 0]
    to_scanner = np.array(eye) - points
    distance = np.linalg.norm(to_scanner, axis=1, keepdims=True)
    to_scanner /= distance
    seen = (to_scanner * direction).sum(axis=1) > 0.2
    points = points + noise * rng.normal(size=(count, 1)) * to_scanner + off
    return ScanPoints(points, to_scanner, distance[:, 0] ** -2).select(seen)


@pytest.mark.parametrize("seed", range(3))
def test_a_displaced_scan_is_aligned(seed):
    near, far = scan((2.0, -1.0, 1.5), seed=seed), scan((0.5, -3.0, 1.5), seed=seed + 10, off=OFF)
    translations = alignment_translations([near, far])
    assert translations is not None
    assert np.linalg.norm((translations[0] - translations[1]) - OFF) < 0.4e-3
    weights = np.array([near.weights.sum(), far.weights.sum()])
    assert weights @ translations == pytest.approx(0, abs=1e-6 * weights.sum())  # the rock is not moved


@pytest.mark.parametrize("seed", range(3))
def test_aligned_scans_are_not_moved(seed):
    translations = alignment_translations([scan((2.0, -1.0, 1.5), seed=seed), scan((0.5, -3.0, 1.5), seed=seed + 10)])
    assert translations is not None
    assert not translations.any()


def test_the_order_of_scans_and_points_hardly_matters():
    scans = [scan((2.0, -1.0, 1.5)), scan((0.5, -3.0, 1.5), seed=1, off=OFF)]
    translations = alignment_translations(scans)
    backwards = alignment_translations([part.select(np.arange(len(part))[::-1]) for part in reversed(scans)])
    assert backwards == pytest.approx(translations[::-1], abs=0.1e-3)


@pytest.mark.parametrize(
    "scans",
    [
        [scan((2.0, -1.0, 1.5))],
        [scan((2.0, -1.0, 1.5)), scan((0.5, -3.0, 1.5), count=80)],
        [scan((2.0, -1.0, 1.5), flat=True), scan((0.5, -3.0, 1.5), seed=1, flat=True)],
        [merge_scans([])],
        [],
    ],
    ids=["one scan", "few points of the other", "a plate", "no point", "no scan"],
)
def test_an_undetermined_direction_prevents_alignment(scans):
    assert alignment_translations(scans) is None
