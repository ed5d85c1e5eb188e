import hashlib
import json

import pytest

from polarsim.publish import records

pytest.importorskip("rocrate")
from rocrate.rocrate import ROCrate


def test_entities_are_read_back_and_files_have_the_stated_checksums(published, catalogue):
    folder = published("ro-crate")
    crate = ROCrate(str(folder))
    stated = json.loads((folder / "ro-crate-metadata.json").read_text())["@graph"]
    assert {entity.id for entity in crate.get_entities()} == {entity["@id"] for entity in stated}
    files = {entity.id: entity for entity in crate.data_entities}
    for name, entity in files.items():
        assert (folder / name).exists(), name
        if "sha256" in entity:
            assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == entity["sha256"]
    assert {f"data/{name}.parquet" for name in records.all_tables(catalogue)} <= set(files)
    assert {"meshes/Terrain01/terrain01_rock4.obj", "cameras/Terrain01/PosA.json", "SHA256SUMS"} <= set(files)
    assert "meshes/Terrain01/walls.json" in files
    for domain in catalogue.domains:
        assert len(list((folder / f"pictures/{domain}").glob("*.png"))) == len(catalogue.of_domain(domain))


def test_the_run_links_workflow_photos_and_results(published, catalogue):
    crate = ROCrate(str(published("ro-crate")))
    assert crate.mainEntity.id == "workflow/Snakefile"
    run = crate.get("#run")
    assert run["instrument"] is crate.mainEntity
    assert [one.id.rstrip("/") for one in run["object"]] == ["pictures/analog"] or run["object"].id
    assert len(run["result"]) > 10
    assert crate.root_dataset["datePublished"] == catalogue.made_on
