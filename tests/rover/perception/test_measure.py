"""Tables of a drive on board."""

from polarsim.rover.perception import contrast
from polarsim.rover.perception.measure import measure_drive
from tests.rover import driven


def test_a_map_made_of_labels_is_nearly_the_true_one(drive):
    folder, options = drive
    measured = measure_drive(folder, driven.vehicle(), options, None, 3)
    assert {*measured["map"]["source"]} == {"truth", "visible"}
    found = {name: table[table["source"] == "truth"] for name, table in measured.items()}
    assert found["map"]["f1"].min() > 0.85
    assert found["map"]["within_5_cm"].min() > 0.97
    assert (found["stops"]["stops"] == 0).all()
    assert found["sightings"]["detected"].all()
    assert found["stable"].loc[found["stable"]["height_m"] > 0.1, "first_stable_m"].max() > 2


def test_what_the_picture_shows_of_the_labels_is_no_more_than_these(drive, monkeypatch):
    folder, options = drive
    measured = measure_drive(folder, driven.vehicle(), options, None, 3)["sightings"]
    shown, all_labels = (measured[measured["source"] == source] for source in ("visible", "truth"))
    assert len(shown) == len(all_labels)  # looks at rocks
    assert 0.3 * len(shown) < shown["detected"].sum() < len(shown)
    monkeypatch.setattr(contrast, "LEAST_CONTRAST", 0.0)
    measured = measure_drive(folder, driven.vehicle(), options, None, 3)["sightings"]
    assert measured["detected"].all()
