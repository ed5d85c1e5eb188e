import numpy as np
from scipy import ndimage

from polarsim.rocks.splitting import cut_into_pieces, is_upright, join_slivers

Y, X = np.mgrid[0:80, 0:120]
CELL = 0.005  # metres


def dome(x, y, radius, height):
    return height * np.sqrt(np.clip(1 - ((X - x) ** 2 + (Y - y) ** 2) / radius**2, 0, 1))


def pieces_of(above, seen=None):
    seen = np.ones_like(above, bool) if seen is None else seen
    labels, _ = ndimage.label((above > 0.006) & seen)
    return cut_into_pieces(above, labels, seen, CELL), labels


def count(above):
    pieces, labels = pieces_of(above)
    assert ((pieces.numbers > 0) == (labels > 0)).all()
    return len(np.unique(pieces.rock))


def test_two_touching_domes_are_two_rocks():
    assert count(np.maximum(dome(35, 40, 20, 0.10), dome(74, 40, 20, 0.08))) == 2


def test_a_dome_with_a_notch_in_its_top_is_one_rock():
    groove = np.exp(-(((X - 60) / 3) ** 2))
    assert count(dome(60, 40, 30, 0.12) * (1 - 0.33 * groove)) == 1  # from side to side
    assert count(dome(60, 40, 30, 0.12) * (1 - 0.5 * groove * np.exp(-(((Y - 40) / 15) ** 2)))) == 1


def test_two_peaks_of_one_rock_are_two_pieces():
    pieces, _ = pieces_of(np.maximum(dome(50, 40, 20, 0.10), dome(70, 40, 20, 0.10)))
    assert pieces.rock.tolist() == [pieces.rock[0]] * 2
    assert pieces.numbers[40, 45] != pieces.numbers[40, 75]


def test_a_hidden_strip_does_not_cut_a_rock_in_two():
    above = dome(60, 40, 30, 0.12)
    seen = np.ones_like(above, bool)
    seen[:55, 55:65] = False
    pieces, _ = pieces_of(above, seen)
    assert len(pieces.rock) == 1
    assert (pieces.numbers[:55, 55:65] > 0).any()  # hidden cells belong to the rock


def sliver_beside(distance_cells, annotated=False):
    """Return the numbers of a boulder 40 cells wide and of a strip, 3 cells wide and 10 cm high, at a distance."""
    parts = np.zeros(X.shape, int)
    parts[20:60, 30:70] = 1
    parts[30:36, 70 + distance_cells : 73 + distance_cells] = 2
    above = np.where(parts > 0, 0.10, 0.0)
    return join_slivers(above, parts, 0.005, lambda mask: annotated)


def test_an_upright_strip_next_to_a_rock_is_joined():
    joined = sliver_beside(8)
    assert (joined[30:36, 78:81] == 1).all()
    assert (joined > 0).sum() == 40 * 40 + 6 * 3


def test_a_distant_or_annotated_upright_strip_is_not_joined():
    assert (sliver_beside(30) == 2).sum() == 6 * 3
    assert (sliver_beside(8, annotated=True) == 2).sum() == 6 * 3


def test_pebbles_are_not_upright():
    assert not is_upright(0.02, 0.01)
    assert is_upright(0.05, 0.04)
    assert not is_upright(0.05, 0.06)
