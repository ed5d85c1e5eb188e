"""Tables of a drive on board."""

from polarsim.rover.onboard.measure import measure_drive
from tests.rover import driven


def test_a_map_made_of_labels_is_nearly_the_true_one(drive):
    folder, options = drive
    found = measure_drive(folder, driven.vehicle(), options, 3)
    assert (found["map"]["source"] == "truth").all()
    assert found["map"]["f1"].min() > 0.85
    assert found["map"]["within_5_cm"].min() > 0.97
    assert (found["stops"]["stops"] == 0).all()
    assert found["sightings"]["detected"].all()
    assert found["stable"].loc[found["stable"]["height_m"] > 0.1, "first_stable_m"].max() > 2
