import hashlib
import json

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png
from polarsim.publish import records

mlc = pytest.importorskip("mlcroissant")


def read(folder) -> "mlc.Dataset":
    return mlc.Dataset(folder / "croissant.json")


def test_it_validates_without_warnings_and_has_rai_fields(published):
    metadata = read(published("croissant")).metadata
    assert not metadata.ctx.issues.errors
    assert not metadata.ctx.issues.warnings
    assert metadata.ctx.conforms_to.value == "http://mlcommons.org/croissant/1.1"
    content = json.loads((published("croissant") / "croissant.json").read_text())
    assert sum(name.startswith("rai:") for name in content) >= 18


def test_geocroissant_has_the_coordinate_system_and_the_same_records(published):
    content = json.loads((published("croissant") / "geocroissant.json").read_text())
    assert content["geocr:coordinateReferenceSystem"].startswith('ENGCRS["sandbox"')
    assert "http://mlcommons.org/croissant/geo/1.0" in content["conformsTo"]
    geographic = mlc.Dataset(published("croissant") / "geocroissant.json")
    assert not geographic.metadata.ctx.issues.errors
    assert list(geographic.records("lamps")) == list(read(published("croissant")).records("lamps"))


def test_records_equal_the_tables_of_the_catalogue(published, catalogue):
    folder = published("croissant")
    for name, table in records.all_tables(catalogue).items():
        rows = list(read(folder).records(name))
        assert len(rows) == len(table), name
        for column in set(table.columns) - {"sha256"}:
            values = [row[f"{name}/{column}"] for row in rows]
            values = [value.decode() if isinstance(value, bytes) else value for value in values]
            if table[column].dtype == float:
                np.testing.assert_array_equal(np.array(values, float), table[column])
            else:
                assert [value if value is not None else "" for value in values] == table[column].tolist(), column
    assert len(list((folder / "maps").rglob("*.png"))) == len(catalogue.maps()) == 8
    for domain in catalogue.domains:
        assert len(list(read(folder).records(f"images-{domain}"))) == len(catalogue.of_domain(domain))


def test_image_files_have_the_stated_checksums(published, catalogue):
    folder = published("croissant")
    table = pd.read_parquet(folder / "pictures.parquet")
    for row, picture in zip(table.to_dict("records"), catalogue.pictures, strict=True):
        content = (folder / row["file"]).read_bytes()
        assert hashlib.sha256(content).hexdigest() == row["sha256"]
        np.testing.assert_array_equal(png.read_png(folder / row["file"]), png.read_png(picture.path))
