"""Data sources: classes that implement the protocol, with a name."""

import re

import pytest

from polarsim.acquire.index import index_terrain
from polarsim.acquire.inputs import raw_inputs
from polarsim.acquire.options import SourceOptions
from polarsim.config import parse_config
from polarsim.formats.tables import read_parquet
from polarsim.run_files.inventory import Inventory, read_inventory
from polarsim.site import polar
from polarsim.sources.registry import SOURCES
from polarsim.sources.source import DataSource, TerrainContent, path_texts


class SandboxSource:
    """Sandbox of a user with a cloud for each position, without photos."""

    domain = "real"
    has_photos = False
    has_scans = True
    is_generated = False

    def layout(self, site):
        return re.compile("scans")

    def expected(self, site, terrain):
        return f"scans/{terrain}"

    def folders(self, site, root, terrain):
        return [root / self.expected(site, terrain)]

    def inputs(self, site, root, terrain):
        return sorted(self.folders(site, root, terrain)[0].glob("*.xyz"))

    def index(self, site, root, terrain, positions, grid):
        clouds = {path.stem: path for path in self.inputs(site, root, terrain) if path.stem in positions}
        return TerrainContent(Inventory(terrain, "sandbox", clouds=path_texts(clouds)), [])

    def truth(self, root, terrain):
        return None

    def unpacked(self, site, root, terrain):
        return None

    def arrange(self, unpacked, root):
        pass

    def check_fetched(self, site, root, terrain, files):
        pass


@pytest.fixture
def sandbox(monkeypatch, tmp_path) -> SourceOptions:
    monkeypatch.setitem(SOURCES, "sandbox", SandboxSource())
    for position in "AB":
        cloud = tmp_path / f"scans/5/{position}.xyz"
        cloud.parent.mkdir(parents=True, exist_ok=True)
        cloud.write_text("0 0 0\n")
    return SourceOptions(kind="sandbox", root=tmp_path)


def test_a_registered_source_is_indexed_and_has_inputs(sandbox, tmp_path):
    out = {name: tmp_path / "out" / name for name in ("photos", "calibration", "inventory", "seeds")}
    index_terrain(site=polar(), terrain=5, positions=["A"], source=sandbox, seed_options="none", **out)
    assert read_inventory(out["inventory"]).clouds == {"A": (tmp_path / "scans/5/A.xyz").as_posix()}
    assert len(read_parquet(out["photos"], ["key"])) == 0
    assert raw_inputs(polar(), 5, sandbox, "none") == [tmp_path / f"scans/5/{position}.xyz" for position in "AB"]


def test_a_configuration_has_the_properties_of_the_source(sandbox):
    config = parse_config({"source": sandbox.model_dump(mode="json"), "labels": {"seeds": "none"}})
    assert (config.photo_domain, config.domains) == ("real", ())


@pytest.mark.parametrize("kind", SOURCES)
def test_every_source_implements_the_protocol(kind, tmp_path):
    source: DataSource = SOURCES[kind]
    assert source.folders(polar(), tmp_path, 4) == source.inputs(polar(), tmp_path, 4) == []
    assert (source.truth(tmp_path, 4) is not None) == source.is_generated
    assert source.layout(polar()).fullmatch(source.expected(polar(), 4).split("/")[0].split(" ")[0].replace("*", "A"))
