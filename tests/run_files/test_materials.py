import json
from dataclasses import replace

import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.photo import NO_ROCK
from polarsim.run_files.materials import (
    ALBEDO_FILE,
    TABLE_FILE,
    FittedMaterial,
    FittedMaterials,
    read_materials,
    rock_of_vertex,
    write_materials,
)
from polarsim.run_files.scene import TerrainMesh

MESH = TerrainMesh(
    np.arange(24.0).reshape(8, 3), np.array([[0, 1, 2], [3, 4, 5], [4, 5, 6]]), np.array([NO_ROCK, 7, 7])
)
FIT = FittedMaterial(
    {"albedo": 0.2}, {"30": 1.5, "rover": 12.25}, {7: 1.25}, np.linspace(0.5, 1.2, 8, dtype=np.float32), {"a": 1}
)
FOUND = FittedMaterials({"lambert": FIT}, np.arange(8), ("180", "rover"), ("A", "C"))


def test_a_fit_reads_back(tmp_path):
    write_materials(tmp_path / "fit", MESH, FOUND)
    again = read_materials(tmp_path / "fit", MESH)
    assert (again.azimuths, again.positions, list(again.models)) == (("180", "rover"), ("A", "C"), ["lambert"])
    np.testing.assert_array_equal(again.models["lambert"].albedo, FIT.albedo)
    np.testing.assert_array_equal(again.looks, np.arange(8))
    assert replace(again.models["lambert"], albedo=FIT.albedo) == FIT


def test_an_empty_fit_reads_back(tmp_path):
    write_materials(tmp_path / "fit", MESH, FittedMaterials({}, np.zeros(8, int)))
    assert read_materials(tmp_path / "fit", MESH).models == {}


def test_vertices_without_face_belong_to_the_ground():
    assert rock_of_vertex(MESH).tolist() == [NO_ROCK] * 3 + [7] * 4 + [NO_ROCK]


def test_a_fit_for_other_meshes_is_an_error(tmp_path):
    write_materials(tmp_path / "fit", MESH, FOUND)
    other = TerrainMesh(MESH.vertices[:7], MESH.faces, MESH.rock_of_face)
    with pytest.raises(FormatError, match=ALBEDO_FILE):
        read_materials(tmp_path / "fit", other)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda content: content.pop("azimuths"),
        lambda content: content["models"]["lambert"].pop("lamps"),
        lambda content: content["models"].update(hapke=content["models"]["lambert"]),
        lambda content: content.update(models=[]),
    ],
)
def test_an_invalid_table_is_an_error(tmp_path, spoil):
    write_materials(tmp_path / "fit", MESH, FOUND)
    path = tmp_path / "fit" / TABLE_FILE
    content = json.loads(path.read_text())
    spoil(content)
    path.write_text(json.dumps(content))
    with pytest.raises(FormatError):
        read_materials(tmp_path / "fit", MESH)
