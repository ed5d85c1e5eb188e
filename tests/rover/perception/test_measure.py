"""Tables of the perception on a drive."""

from polarsim.rover.perception import contrast
from polarsim.rover.perception.measure import measure_drive
from tests.rover import driven


def test_a_map_from_labels_is_almost_the_true_map_and_fewer_labels_are_visible(drive, monkeypatch):
    folder, options = drive
    measured = measure_drive(folder, driven.vehicle(), options, None, 3)
    assert {*measured["map"]["source"]} == {"truth", "visible"}
    truth, visible = (
        {name: table[table["source"] == source] for name, table in measured.items()} for source in ("truth", "visible")
    )
    assert truth["map"]["f1"].min() > 0.85
    assert truth["map"]["within_5_cm"].min() > 0.97
    assert (truth["stops"]["stops"] == 0).all()
    assert truth["sightings"]["detected"].all()
    assert truth["stable"].loc[truth["stable"]["height_m"] > 0.1, "first_stable_m"].max() > 2
    detected = visible["sightings"]["detected"]
    assert len(detected) == len(truth["sightings"])
    assert 0.3 * len(detected) < detected.sum() < len(detected)
    monkeypatch.setattr(contrast, "MIN_CONTRAST", 0.0)
    measured = measure_drive(folder, driven.vehicle(), options.model_copy(update={"suns": ("2",)}), None, 3)
    assert measured["sightings"]["detected"].all()
