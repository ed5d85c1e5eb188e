import numpy as np
from scipy import ndimage

from polarsim.rocks.splitting import told_apart

Y, X = np.mgrid[0:80, 0:120]


def dome(x, y, radius, height):
    return height * np.sqrt(np.clip(1 - ((X - x) ** 2 + (Y - y) ** 2) / radius**2, 0, 1))


def count(above):
    labels, _ = ndimage.label(above > 0.006)
    apart = told_apart(above, labels, np.ones_like(labels, bool), 0.015)
    assert ((apart > 0) == (labels > 0)).all()
    return len(np.unique(apart)) - 1


def test_two_touching_domes_are_two_rocks():
    assert count(np.maximum(dome(35, 40, 20, 0.10), dome(74, 40, 20, 0.08))) == 2


def test_a_dome_with_a_notch_in_its_top_is_one_rock():
    notch = np.exp(-(((X - 60) / 3) ** 2))
    assert count(dome(60, 40, 30, 0.12) * (1 - 0.5 * notch)) == 1


def test_rocks_apart_stay_apart():
    assert count(dome(25, 40, 15, 0.10) + dome(90, 40, 15, 0.02)) == 2


def test_a_hidden_strip_does_not_cut_a_rock_in_two():
    above = dome(60, 40, 30, 0.12)
    seen = np.ones_like(above, bool)
    seen[:55, 55:65] = False
    labels, _ = ndimage.label((above > 0.006) & seen)
    apart = told_apart(above, labels, seen, 0.015)
    assert len(np.unique(apart[seen])) == 2  # one rock, and what is none
    assert not apart[~seen].any()
