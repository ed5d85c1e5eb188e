"""Input files of a local source for Snakemake."""

from polarsim.acquire.inputs import raw_inputs
from polarsim.acquire.options import SeedOptions, SourceOptions
from polarsim.site import polar


def test_a_ground_that_was_added_to_a_release_is_an_input(tmp_path):
    folder = tmp_path / "TerrainMeshes/Terrain04"
    folder.mkdir(parents=True)
    (folder / "terrain04_rock2.obj").touch()
    source = SourceOptions(kind="release", root=tmp_path)
    assert raw_inputs(polar(), 4, source, SeedOptions()) == [folder / "terrain04_rock2.obj"]
    (folder / "terrain04_ground.obj").touch()
    assert folder / "terrain04_ground.obj" in raw_inputs(polar(), 4, source, SeedOptions())
