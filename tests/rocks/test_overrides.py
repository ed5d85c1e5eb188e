import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.errors import FormatError
from polarsim.rocks.overrides import Cuboid, read_overrides, write_cuboids, write_positions

mm = st.integers(-2000, 2000).map(lambda value: value / 1000)


def read_text(tmp_path, text):
    path = tmp_path / "terrain03.yaml"
    path.write_text(text)
    return read_overrides(path)


@given(low=st.tuples(mm, mm, mm), sides=st.tuples(*[st.integers(1, 500)] * 3), rock=st.integers(1, 200))
def test_written_cuboids_are_an_override_file(tmp_path_factory, low, sides, rock):
    path = tmp_path_factory.mktemp("overrides") / "cuboids.yaml"
    cuboid = Cuboid(np.array(low), np.array(low) + np.array(sides) / 1000)
    write_cuboids(path, {rock: cuboid})
    back = read_overrides(path).cuboids
    assert list(back) == [rock]
    np.testing.assert_allclose(back[rock].low, cuboid.low, atol=1e-9)
    np.testing.assert_allclose(back[rock].high, cuboid.high, atol=1e-9)


@given(points=st.dictionaries(st.integers(1, 200), st.tuples(mm, mm), max_size=5))
def test_written_positions_are_an_override_file(tmp_path_factory, points):
    path = tmp_path_factory.mktemp("overrides") / "ids.yaml"
    write_positions(path, {rock: np.array(position) for rock, position in points.items()})
    back = read_overrides(path)
    assert back.cuboids == {}
    assert {rock: tuple(position) for rock, position in back.positions.items()} == points


def test_drops_and_cuboids_are_read(tmp_path):
    read = read_text(tmp_path, "- {rock: 3, min: [0, 0, 0], max: [1, 1, 1]}\n- drop: [7, 2, 7]\n")
    assert sorted(read.cuboids) == [3]
    assert read.drop == (2, 7)


@pytest.mark.parametrize("text", ["", "[]", "# nothing\n"])
def test_an_empty_file_changes_nothing(tmp_path, text):
    assert read_text(tmp_path, text).cuboids == {}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("rocks: 3", "expected a list"),
        ("- {rock: 3, min: [0, 0, 0]}", "entry 1: expected the keys"),
        ("- {rock: 0, min: [0, 0, 0], max: [1, 1, 1]}", "expected an id from 1 to 900"),
        ("- {rock: 901, at: [0, 0]}", "expected an id from 1 to 900"),
        ("- {rock: 3, min: [0, 0, 2], max: [1, 1, 1]}", "min is not below max"),
        ("- {rock: 3, min: [0, x, 0], max: [1, 1, 1]}", "x"),
        ("- {rock: 3, min: [0, 0, 0], max: [1, 1, .nan]}", "max is .*, expected x, y, z"),
        ("- {rock: 3, at: [0, 0, 0]}", "at is .*, expected x, y"),
        ("- {rock: 3, at: [0, 0], max: [1, 1, 1]}", "entry 1: expected the keys"),
        ("- {rock: 3, at: [0, 0]}\n- {rock: 3, min: [0,0,0], max: [1,1,1]}", "entry 2: rock 3"),
        ("- {rock: 3, min: [0,0,0], max: [1,1,1]}\n- {rock: 3, min: [0,0,0], max: [1,1,1]}", "entry 2: rock 3"),
        ("- drop: 7", "expected a list of rock ids"),
        ("- {rock: 3", "no readable YAML"),
    ],
)
def test_invalid_content_is_refused_in_one_line_with_the_file_name(tmp_path, text, reason):
    with pytest.raises(FormatError, match=reason) as error:
        read_text(tmp_path, text)
    assert "terrain03.yaml" in str(error.value)
    assert "\n" not in str(error.value)
