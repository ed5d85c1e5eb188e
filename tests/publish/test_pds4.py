import hashlib
import logging
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png
from polarsim.publish import records
from tests.publish.pds4_rules import PDS, broken_rules

pds4_tools = pytest.importorskip("pds4_tools")


@pytest.fixture(autouse=True)
def quiet():
    logging.getLogger("PDS4ToolsLogger").setLevel(logging.ERROR)


def opened(path):
    return pds4_tools.read(str(path), quiet=True)


def labels(folder):
    return sorted(folder.rglob("*.xml"))


def test_the_reader_opens_every_product(published, catalogue):
    folder = published("pds4")
    for path in labels(folder):
        assert opened(path).label is not None
    pictures = len(catalogue.pictures)
    maps, tables, card, collections, bundle = 4 + 2 + 2, 6, 1, 2 * 3 + 3, 1
    assert len(labels(folder)) == 3 * pictures + maps + tables + card + collections + bundle


def test_labels_conform_to_the_rules_of_the_schema(published):
    for path in labels(published("pds4")):
        assert list(broken_rules(path.read_bytes())) == [], path


@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        (b"Citation_Information>", b"Citation>", "Identification_Area contains"),
        (b"bundle_has_data_collection", b"bundle_has_dust", "reference_type is 'bundle_has_dust'"),
        (b"urn:local:polarsim:tiny<", b"urn:local:polarsim:tiny:more<", "logical_identifier"),
        (b"urn:local:polarsim:tiny<", b"urn:nasa:pds:tiny<", "logical_identifier"),
        (b"<version_id>1.0</version_id>", b"", "Identification_Area contains"),
    ],
)
def test_violations_of_the_rules_are_detected(published, old, new, rule):
    label = (published("pds4") / "bundle.xml").read_bytes()
    assert old in label
    assert any(rule in violation for violation in broken_rules(label.replace(old, new)))


def test_maps_of_depth_angles_and_normals_have_their_units(published, catalogue):
    folder, units = published("pds4") / "maps", {"depth": "mm", "incidence": "deg", "normal": None}
    for name, path in catalogue.maps():
        wanted = png.read_png(path)
        found = opened(folder / f"{name}_{path.stem}.xml")["image"]
        # The reader applies the factor of the label: hundredths of a degree become degrees.
        scale = 0.01 if name == "incidence" else 1
        values = np.moveaxis(wanted, 2, 0) if wanted.ndim == 3 else wanted
        np.testing.assert_allclose(np.asarray(found.data), values * scale, rtol=1e-12)
        element = ElementTree.parse(folder / f"{name}_{path.stem}.xml").find(f".//{PDS}Element_Array")
        assert element.findtext(f"{PDS}unit") == units[name]


def test_values_of_images_and_ids_are_read_back_exactly(published, catalogue):
    folder = published("pds4")
    for one in catalogue.pictures:
        for place, wanted in (("data", png.read_png(one.path)), ("ids", records.ids(catalogue, one))):
            found = opened(folder / f"{place}_{one.domain}/{one.key}.xml")["image"]
            np.testing.assert_array_equal(np.asarray(found.data), wanted)
        unit = ElementTree.parse(folder / f"data_{one.domain}/{one.key}.xml").find(f".//{PDS}Element_Array/{PDS}unit")
        assert unit.text == "DN"


def test_tables_are_read_back_with_units_and_origins(published, catalogue):
    folder = published("pds4")
    for name, table in records.all_tables(catalogue).items():
        found = opened(folder / f"tables/{name}.xml")["table"]
        assert len(found.data) == len(table)
        stated = ElementTree.parse(folder / f"tables/{name}.xml")
        fields = {field.findtext(f"{PDS}name"): field for field in stated.iter(f"{PDS}Field_Delimited")}
        assert set(fields) == set(table.columns) - {"sha256", "file"}
        assert set(found["origin"]) <= {"measured", "fitted", "synthetic"}
        for column, field in fields.items():
            description = field.findtext(f"{PDS}description")
            assert "see column origin" in description or "name, key or count" in description, column
            if column.endswith(("_m", "_mm", "_px", "_deg")) or column in ("x0", "y1"):
                assert field.findtext(f"{PDS}unit"), column
            values = pd.Series(np.asarray(found[column]))
            if table[column].dtype == float:
                missing = field.findtext(f".//{PDS}missing_constant")
                values = values.astype(float)
                values = values.mask(values == float(missing)) if missing else values
                np.testing.assert_array_equal(values, table[column], column)
            else:
                assert values.astype(str).tolist() == table[column].astype(str).tolist(), column


def test_tables_have_the_origin_of_values(published):
    poses = opened(published("pds4") / "tables/poses.xml")["table"]
    lamps = opened(published("pds4") / "tables/lamps.xml")["table"]
    assert set(poses["origin"]) == {"fitted"}
    assert dict(zip(lamps["lamp"], lamps["origin"], strict=True)) == {
        "30": "synthetic", "180": "fitted", "270": "synthetic", "350": "synthetic", "rover_A": "fitted",
    }  # fmt: skip
    text = (published("pds4") / "data_hapke/01_A_off_30_L_0256.xml").read_text()
    assert "values are synthetic" in text
    assert "Frames: sandbox" in text


def test_collections_list_all_products_and_checksums_are_correct(published):
    folder = published("pds4")
    for collection in sorted(folder.rglob("collection.csv")):
        rows = [line.split(",")[1].removesuffix("::1.0") for line in collection.read_text().split()]
        products = [path for path in labels(collection.parent) if path.name != "collection.xml"]
        lids = [ElementTree.parse(path).findtext(f".//{PDS}logical_identifier") for path in products]
        assert sorted(rows) == sorted(lids)
    for path in labels(folder):
        for file in ElementTree.parse(path).iter(f"{PDS}File"):
            content = (path.parent / file.findtext(f"{PDS}file_name")).read_bytes()
            assert hashlib.md5(content).hexdigest() == file.findtext(f"{PDS}md5_checksum")
            assert str(len(content)) == file.findtext(f"{PDS}file_size")
