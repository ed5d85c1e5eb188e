import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from polarsim.rocks.folder import FULL_SUPPORT, Scanned, support, support_table

PATCH = Scanned(np.stack([*np.mgrid[0:20, 0:20], np.zeros((20, 20))], axis=-1).reshape(-1, 3) * 0.003, 0.003)


@given(first=st.floats(0, 0.03), second=st.floats(0, 0.03))
def test_support_does_not_increase_with_distance(first, second):
    near, far = sorted([first, second])
    values = support(np.array([[0.03, 0.03, near], [0.03, 0.03, far]]), PATCH)
    assert values[0] >= values[1]
    assert (near > FULL_SUPPORT * 0.003) or values[0] == 1


def test_the_table_has_every_vertex_of_every_mesh():
    table = support_table({"a.obj": np.array([1.0, 0.256]), "b.obj": np.array([0.0])})
    assert table["mesh"].tolist() == ["a.obj", "a.obj", "b.obj"]
    assert table["vertex"].tolist() == [0, 1, 0]
    np.testing.assert_allclose(table["support"], [1, 0.26, 0])
