"""Tables of drives in which the rover decides: one case a mode, light and seed, means over them, ratios to blind."""

import numpy as np
import pandas as pd
import pytest

from polarsim.formats.schemas import EVERY_AUTONOMY
from polarsim.rover.autonomy.cases import cases, parsed
from polarsim.rover.autonomy.options import AutonomyOptions
from polarsim.rover.autonomy.table import summary, with_ratios


def rows(*drives: tuple) -> pd.DataFrame:
    named = ["mode", "sun", "exposure", "seed", "metric", "unit", "value"]
    return pd.DataFrame(drives, columns=named).assign(ended="finished")[list(EVERY_AUTONOMY.columns)]


EVERY = rows(
    ("blind", "any", "any", 0, "energy", "J", 100.0),
    ("blind", "any", "any", 1, "energy", "J", 200.0),
    ("stereo", "1", "0256", 0, "energy", "J", 150.0),
    ("stereo", "1", "0256", 1, "energy", "J", 240.0),
    ("stereo", "3", "0256", 0, "energy", "J", 110.0),
    ("stereo", "3", "0256", 7, "energy", "J", 500.0),  # no blind drive has this seed
)


def test_modes_without_pictures_drive_once_a_seed_and_names_read_back():
    options = AutonomyOptions(modes=("truth", "both"), suns=("1", "night"), exposures_ms=(64.0, "auto"), seeds=(0, 3))
    names = cases(options)
    assert len(names) == len(set(names)) == 2 + 2 * 2 * 2
    mode, light, seed = parsed("both_night_auto_seed3")
    assert (mode, light.sun, light.exposure_ms, seed) == ("both", "night", "auto", 3)
    assert parsed("both_1_0064_seed0")[1].exposure_ms == 64.0
    assert {parsed(name)[0] for name in names} == {"truth", "both"}


def test_a_ratio_is_to_the_blind_drive_of_the_same_seed():
    own = with_ratios(EVERY)
    own = own[own["metric"] == "energy over the blind one's"].set_index(["sun", "seed"])["value"]
    assert own.to_dict() == {("1", 0): 1.5, ("1", 1): 1.2, ("3", 0): pytest.approx(1.1)}


def test_means_over_seeds_of_each_light_and_over_all_lights_with_intervals():
    table = summary(EVERY).set_index(["mode", "sun"])
    assert table["value"].to_dict() == {
        ("blind", "any"): 150.0, ("stereo", "1"): 195.0, ("stereo", "3"): 305.0, ("stereo", "all"): 250.0,
    }  # fmt: skip
    assert table["drives"].to_dict() == {
        ("blind", "any"): 2, ("stereo", "1"): 2, ("stereo", "3"): 2, ("stereo", "all"): 4,
    }  # fmt: skip
    low, high = table.loc[("stereo", "1"), ["low", "high"]].astype(float)
    assert (low, high) == (150.0, 240.0)  # of two drives the worst and the best resample are one of them twice
    assert table.loc[("stereo", "all"), "low"] < 250 < table.loc[("stereo", "all"), "high"]
    alone = summary(EVERY[EVERY["seed"] == 7]).set_index("sun").loc["3"]
    assert np.isnan([alone["low"], alone["high"]]).all()  # one drive has no interval
