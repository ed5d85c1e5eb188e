"""Convex parts of the rocks of a world, and their file."""

from dataclasses import replace

import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.rover.world import rock_parts as rock_parts_module
from polarsim.rover.world.rock_parts import read_rock_parts, rock_parts, shape_table, write_rock_parts
from polarsim.rover.world.stitch import TerrainSolids, rough_world, stitch
from polarsim.rover.world.surface import World, bare_world
from tests.rover.made_world import SMALL, ball, plane


def world(x: float = 0.1, radius: float = 0.1) -> World:
    """Return two terrains with a rock each."""
    rock, other = {7: ball(x, 0.2, 0, radius)}, {3: ball(0, 0, 0)}
    return stitch([TerrainSolids(4, plane(0.0), rock), TerrainSolids(1, plane(0.0), other)], SMALL)


def test_all_rocks_of_a_world_have_hulls():
    ground = world()
    parts = rock_parts(ground)
    assert [part.rock for part in parts] == ground.rocks["rock"].tolist()
    assert [(shape["rock"], shape["parts"]) for shape in shape_table(parts)] == [(0, 1), (1, 1)]
    assert all(0 <= shape["deviation_m"] < 1e-4 for shape in shape_table(parts))
    centres = [part.corners.mean(axis=0)[:2] for part in parts]
    np.testing.assert_allclose(centres, ground.rocks[["x_m", "y_m"]], atol=2e-3)


def test_a_rock_with_other_parts_than_its_mesh_is_reported(caplog, monkeypatch):
    rock_parts(world())
    assert caplog.messages == []
    of_mesh = rock_parts_module.convex_parts
    monkeypatch.setattr(
        rock_parts_module, "convex_parts",
        lambda vertices, faces: [(corners, 0.0075) for corners, _ in of_mesh(vertices, faces)],
    )  # fmt: skip
    rock_parts(world())
    assert caplog.messages == [
        f"terrain {terrain}, rock {rock}: shape in the physics deviates by 7.5 mm from the mesh, expected at most 5 mm"
        for terrain, rock in ((4, 7), (1, 3))
    ]


@pytest.mark.parametrize("ground", [world(), bare_world(np.zeros((5, 5)), 0.1, 0.0, 0.0)], ids=["rocks", "no rocks"])
def test_parts_are_read_as_written_for_any_seed_of_the_ground(tmp_path, ground):
    written = rock_parts(ground)
    write_rock_parts(tmp_path / "parts.npz", written, ground)
    parts = read_rock_parts(tmp_path / "parts.npz", rough_world(ground, 0.001, 5))
    assert [(part.rock, part.deviation_m) for part in parts] == [(part.rock, part.deviation_m) for part in written]
    for part, other in zip(parts, written, strict=True):
        np.testing.assert_array_equal(part.corners, other.corners)


@pytest.mark.parametrize(
    "other",
    [world(x=0.101), world(radius=0.101), replace(world(), level=world().level[:, :60])],
    ids=["place", "shape", "grid with one rock"],
)
def test_parts_of_other_rocks_are_an_error(tmp_path, other):
    write_rock_parts(tmp_path / "parts.npz", rock_parts(world()), world())
    with pytest.raises(FormatError, match=r"parts\.npz"):
        read_rock_parts(tmp_path / "parts.npz", other)
