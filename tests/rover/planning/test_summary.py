"""Tables of drives in which the rover decides: what drives there are, means over seeds, ratios to blind, effects."""

from itertools import product
from typing import get_args

import numpy as np
import pandas as pd
import pytest

from polarsim.rover.cameras.options import CameraSuiteOptions, Light, lights_ahead
from polarsim.rover.perception.options import Mode
from polarsim.rover.planning.cases import AXES, cases, parsed
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.planning.summary import effects_of, summary, with_derived
from polarsim.schemas.rover import EVERY_AUTONOMY, MODES
from tests.rover import driven

NAMED = [*AXES, "seed", "metric", "unit", "value"]


def rows(*drives: tuple) -> pd.DataFrame:
    return pd.DataFrame(drives, columns=NAMED).assign(ended="finished")[list(EVERY_AUTONOMY.columns)]


def seen(mode: str, sun: str, seed: int, value: float, metric: str = "energy", **others: str) -> tuple:
    given = {"sun": sun, "exposure": "0256", "lights": "off", "model": "hapke", "detector": "any"} | others
    return mode, *(given[axis] for axis in AXES[1:]), seed, metric, "", value


EVERY = rows(
    ("blind", *["any"] * 5, 0, "energy", "", 100.0),
    ("blind", *["any"] * 5, 1, "energy", "", 200.0),
    seen("stereo", "1", 0, 150.0),
    seen("stereo", "1", 1, 240.0),
    seen("stereo", "3", 0, 110.0),
    seen("stereo", "3", 7, 500.0),  # no blind drive has this seed
)


def test_a_drive_is_made_for_every_value_of_what_it_depends_on_and_names_read_back():
    options = AutonomyOptions(modes=("truth", "stereo", "both"), headlights=("off", "on"))
    cameras = CameraSuiteOptions(suns=("1", "3"), exposures_ms=(64.0, 12.5))
    made = cases(options, cameras, (0, 3), ["packaged", "sun_mix-seed1"])
    assert len({case.name for case in made}) == len(made) == 2 * (1 + 16 + 16 * 2)
    assert [case.seed for case in made] == [0] * 49 + [3] * 49  # a table cut short has whole seeds
    assert [parsed(case.name) for case in made] == made
    auto = cases(options.model_copy(update={"auto_exposure": True}), cameras, (0,), ["a"])
    assert {case.exposure for case in auto} == {"any", "auto"}
    one = parsed("both_night_auto_on_principled_sun_mix-seed1_seed3")
    assert (one.mode, one.detector, one.seed) == ("both", "sun_mix-seed1", 3)
    vehicle = driven.vehicle()
    assert one.light(vehicle) == Light("night", "auto", lights_ahead(vehicle), "principled")
    assert parsed("stereo_1_0064_off_hapke_seed0").light(vehicle) == Light("1", 64.0)
    assert parsed("truth_seed3").axes == {"mode": "truth", **dict.fromkeys(AXES[1:], "any")}


def test_tables_know_all_modes():
    assert get_args(Mode) == MODES


def test_a_ratio_is_to_the_blind_drive_of_the_same_seed_and_maps_add_up():
    own = with_derived(EVERY)
    own = own[own["metric"] == "energy over the blind one's"].set_index(["sun", "seed"])["value"]
    assert own.to_dict() == {("1", 0): 1.5, ("1", 1): 1.2, ("3", 0): pytest.approx(1.1)}
    maps = rows(
        *(seen("stereo", "1", seed, 100.0 + seed, name) for seed in (0, 1) for name in ("rock map", "geometric map"))
    )
    both = with_derived(maps).query("metric == 'both maps'")
    assert both["value"].tolist() == [200.0, 202.0]


def test_means_over_seeds_of_each_light_and_over_all_lights_with_intervals():
    table = summary(EVERY).set_index(["mode", "sun"])
    assert table["value"].to_dict() == {
        ("blind", "any"): 150.0, ("stereo", "1"): 195.0, ("stereo", "3"): 305.0, ("stereo", "all"): 250.0,
    }  # fmt: skip
    assert table.loc["stereo", ["drives", "seeds"]].to_numpy().tolist() == [[2, 2], [2, 2], [4, 3]]
    low, high = table.loc[("stereo", "1"), ["low", "high"]].astype(float)
    assert (low, high) == (150.0, 240.0)  # of two drives the worst and the best resample are one of them twice
    low, high = table.loc[("stereo", "all"), ["low", "high"]].astype(float)
    assert (low, high) == (130.0, 500.0)  # seed 0 twice or seed 7 twice: its drives stay together
    alone = summary(EVERY[EVERY["seed"] == 7]).set_index("sun").loc["3"]
    assert np.isnan([alone["low"], alone["high"]]).all()  # one drive has no interval


def test_detectors_of_a_mode_have_means_of_their_own_and_together():
    every = rows(
        *(seen("both", "1", seed, value, detector=name) for seed in (0, 1) for name, value in (("a", 1), ("b", 3)))
    )
    table = summary(every).set_index(["sun", "detector"])["value"]
    assert table.loc["1"].to_dict() == table.loc["all"].to_dict() == {"a": 1.0, "b": 3.0, "all": 2.0}


def test_an_effect_is_of_the_same_seeds_so_what_a_seed_does_cancels():
    hits = {"1": 3.0, "3": 1.0, "4": 0.0}
    drives = [
        seen(mode, sun, seed, hits[sun] + 10 * seed, "collisions", exposure=ms)
        for mode in ("stereo", "both") for sun in hits for seed in (0, 1, 2) for ms in ("0064", "0256")
    ]  # fmt: skip
    drives = [
        drive for drive in drives if not (drive[0] == "both" and drive[6] == 2 and drive[2] == "0064")
    ]  # unfinished
    table = effects_of(rows(*drives)).set_index(["mode", "axis", "level"])
    one = table.loc[("stereo", "sun", "1")]
    assert (one["seeds"], one["value"], one["change"]) == (3, 13.0, 2.5)
    assert one["low"] < 10 < 20 < one["high"]  # seeds differ much
    assert (one["change_low"], one["change_high"]) == (2.5, 2.5)  # and not in this
    assert table.loc[("both", "sun", "4"), "seeds"] == 2
    assert table.loc[("all", "sun", "4"), "change"] == -2.0
    assert table.loc[("stereo", "exposure", "0064"), "change"] == 0
    assert set(table.index.get_level_values("axis")) == {"sun", "exposure"}  # one detector, lights off


def test_an_effect_compares_drives_that_are_alike_but_for_it():
    """One detector drove with lights on too, and it is the better one; exposures were driven with lights off alone."""
    hits = {"good": 1.0, "bad": 5.0}
    drives = [
        seen("detector", "1", seed, hits[name] - (lit == "on"), "collisions", lights=lit, detector=name, exposure=ms)
        for seed in (0, 1) for name, ms, lit in (
            *product(hits, ("0064", "0256"), ("off",)), ("good", "0256", "on"),
        )
    ]  # fmt: skip
    table = effects_of(rows(*drives)).set_index(["axis", "level"])
    assert table.loc[("lights", "on"), ["value", "change"]].tolist() == [0.0, -1.0]
    assert table.loc[("lights", "off"), "value"] == 1.0  # of the one that drove both ways
    assert table.loc[("exposure", "0256"), ["value", "change"]].tolist() == [3.0, 0.0]
    assert table.loc[("detector", "good"), ["value", "change"]].tolist() == [1.0, -4.0]
    stereo = [seen("stereo", "1", seed, 0.0, "collisions") for seed in (0, 1)]  # in one light: has no effects
    assert "all" not in set(effects_of(rows(*drives, *stereo))["mode"])
