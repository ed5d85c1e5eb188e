"""Tables of autonomous drives: names, means over seeds, ratios to blind drives, and effects of axes."""

from itertools import product
from typing import get_args

import numpy as np
import pandas as pd
import pytest

from polarsim.rover.cameras.options import CameraSuiteOptions, ImagingCondition, lights_ahead
from polarsim.rover.perception.options import Mode
from polarsim.rover.planning.cases import AXES, cases, parse_case
from polarsim.rover.planning.options import AutonomyOptions, PoseSource
from polarsim.rover.planning.summary import drive_summary, effects_of, with_derived
from polarsim.schemas.rover import AUTONOMY_METRICS, MODES, POSES
from tests.rover import driven

NAMED = [*AXES, "seed", "metric", "unit", "value"]


def rows(*drives: tuple) -> pd.DataFrame:
    return pd.DataFrame(drives, columns=NAMED).assign(ended="finished")[list(AUTONOMY_METRICS.columns)]


def drive(mode: str, sun: str, seed: int, value: float, metric: str = "energy", **others: str) -> tuple:
    given = {"sun": sun, "exposure": "0256", "lights": "off", "model": "hapke", "detector": "any"}
    given |= {"pose": "truth"} | others
    return mode, *(given[axis] for axis in AXES[1:]), seed, metric, "", value


EVERY = rows(
    ("blind", *["any"] * 5, "truth", 0, "energy", "", 100.0),
    ("blind", *["any"] * 5, "truth", 1, "energy", "", 200.0),
    drive("stereo", "1", 0, 150.0),
    drive("stereo", "1", 1, 240.0),
    drive("stereo", "3", 0, 110.0),
    drive("stereo", "3", 7, 500.0),  # there is no blind drive with this seed
)


def test_there_is_a_drive_for_each_combination_and_names_read_back():
    assert get_args(Mode) == MODES
    options = AutonomyOptions(modes=("truth", "stereo", "both"), headlights=("off", "on"))
    cameras = CameraSuiteOptions(suns=("1", "3"), exposures_ms=(64.0, 12.5))
    made = cases(options, cameras, (0, 3), ["packaged", "sun_mix-seed1"])
    assert len({case.name for case in made}) == len(made) == 2 * (1 + 16 + 16 * 2)
    assert [case.seed for case in made] == [0] * 49 + [3] * 49  # a truncated table has complete seeds
    assert [parse_case(case.name) for case in made] == made
    auto = cases(options.model_copy(update={"auto_exposure": True}), cameras, (0,), ["a"])
    assert {case.exposure for case in auto} == {"any", "auto"}
    case = parse_case("both_night_auto_on_principled_sun_mix-seed1_seed3")
    assert (case.mode, case.detector, case.seed) == ("both", "sun_mix-seed1", 3)
    vehicle = driven.vehicle()
    assert case.light(vehicle) == ImagingCondition("night", "auto", lights_ahead(vehicle), "principled")
    assert parse_case("stereo_1_0064_off_hapke_seed0").light(vehicle) == ImagingCondition("1", 64.0)
    unlit = {"mode": "truth", **dict.fromkeys(AXES[1:], "any")}
    assert parse_case("truth_seed3").axes == unlit | {"pose": "truth"}
    assert parse_case("truth_odometry_seed3").axes == unlit | {"pose": "odometry"}


def test_poses_multiply_the_drives_and_fused_poses_need_pictures():
    assert get_args(PoseSource) == POSES
    options = AutonomyOptions(modes=("truth", "stereo", "both", "blind"), poses=POSES)
    cameras = CameraSuiteOptions(suns=("1", "3"), exposures_ms=(64.0,), models=("hapke",))
    made = cases(options, cameras, (0,), ["packaged", "mix-seed1"])
    names = [case.name for case in made]
    assert [parse_case(name) for name in names] == made
    assert len(set(names)) == len(names) == (1 + 1 + 2) + 3 * 2 + 3 * 4 + 2
    assert {case.name for case in made if case.mode == "blind"} == {"blind_seed0", "blind_odometry_seed0"}
    assert "truth_fused_1_0064_off_hapke_seed0" in names
    assert "both_odometry_3_0064_off_hapke_mix-seed1_seed0" in names
    assert [case.has_pictures for case in made[:4]] == [False, False, True, True]
    with pytest.raises(ValueError, match="fused"):
        AutonomyOptions(modes=("blind",), poses=("fused",))


def test_drives_are_compared_with_the_blind_drive_with_a_known_pose():
    others = rows(
        ("blind", *["any"] * 5, "odometry", 0, "energy", "", 50.0), drive("stereo", "1", 0, 75.0, pose="fused")
    )
    ratios = with_derived(pd.concat([EVERY, others])).set_index(["metric", "pose"])["value"]
    assert ratios.loc[[("energy over the blind one's", "fused")]].tolist() == [0.75]
    assert len(drive_summary(others)) == 3  # a kind without light, a kind with light, and its pool


def test_ratios_are_relative_to_the_blind_drive_of_the_seed_and_maps_are_summed():
    ratios = with_derived(EVERY)
    ratios = ratios[ratios["metric"] == "energy over the blind one's"].set_index(["sun", "seed"])["value"]
    assert ratios.to_dict() == {("1", 0): 1.5, ("1", 1): 1.2, ("3", 0): pytest.approx(1.1)}
    maps = rows(
        *(drive("stereo", "1", seed, 100.0 + seed, name) for seed in (0, 1) for name in ("rock map", "geometric map"))
    )
    both = with_derived(maps).query("metric == 'both maps'")
    assert both["value"].tolist() == [200.0, 202.0]


def test_points_are_the_sum_of_four_parts_and_without_rocks_there_is_no_total():
    parts = {"geometric map": 200.0, "rock map": 150.0, "productivity": 250.0, "localisation": 150.0}
    scored = rows(*(drive("stereo", "1", 0, value, name) for name, value in parts.items()))
    total = with_derived(scored).query("metric == 'points'")
    assert (total["value"].item(), total["unit"].item()) == (750.0, "points of 1000")
    without_rocks = scored.assign(value=scored["value"].where(scored["metric"] != "rock map"))
    assert not len(with_derived(without_rocks).query("metric == 'points'"))


def test_means_over_seeds_for_each_and_all_lights_and_detectors_have_intervals():
    table = drive_summary(EVERY).set_index(["mode", "sun"])
    assert table["value"].to_dict() == {
        ("blind", "any"): 150.0, ("stereo", "1"): 195.0, ("stereo", "3"): 305.0, ("stereo", "all"): 250.0,
    }  # fmt: skip
    assert table.loc["stereo", ["drives", "seeds"]].to_numpy().tolist() == [[2, 2], [2, 2], [4, 3]]
    low, high = table.loc[("stereo", "1"), ["low", "high"]].astype(float)
    assert (low, high) == (150.0, 240.0)  # with two drives, extreme resamples contain a drive twice
    low, high = table.loc[("stereo", "all"), ["low", "high"]].astype(float)
    assert (low, high) == (130.0, 500.0)  # seed 0 twice or seed 7 twice, since drives of a seed stay together
    single = drive_summary(EVERY[EVERY["seed"] == 7]).set_index("sun").loc["3"]
    assert np.isnan([single["low"], single["high"]]).all()  # a single drive has no interval
    detectors = rows(*(drive("both", "1", n, v, detector=d) for n in (0, 1) for d, v in (("a", 1), ("b", 3))))
    table = drive_summary(detectors).set_index(["sun", "detector"])["value"]
    assert table.loc["1"].to_dict() == table.loc["all"].to_dict() == {"a": 1.0, "b": 3.0, "all": 2.0}


def test_the_influence_of_a_seed_cancels_in_effects():
    hits = {"1": 3.0, "3": 1.0, "4": 0.0}
    drives = [
        drive(mode, sun, seed, hits[sun] + 10 * seed, "collisions", exposure=ms)
        for mode in ("stereo", "both") for sun in hits for seed in (0, 1, 2) for ms in ("0064", "0256")
    ]  # fmt: skip
    # An unfinished table.
    drives = [row for row in drives if not (row[0] == "both" and row[7] == 2 and row[2] == "0064")]
    table = effects_of(rows(*drives)).set_index(["mode", "axis", "level"])
    effect = table.loc[("stereo", "sun", "1")]
    assert (effect["seeds"], effect["value"], effect["change"]) == (3, 13.0, 2.5)
    assert effect["low"] < 10 < 20 < effect["high"]  # large differences between seeds
    assert (effect["change_low"], effect["change_high"]) == (2.5, 2.5)  # which cancel
    assert table.loc[("both", "sun", "4"), "seeds"] == 2
    assert table.loc[("all", "sun", "4"), "change"] == -2.0
    assert table.loc[("stereo", "exposure", "0064"), "change"] == 0
    assert set(table.index.get_level_values("axis")) == {"sun", "exposure"}  # a single detector, lights off


def test_levels_have_ranks_with_intervals_and_each_source_of_the_pose_has_effects_of_its_own():
    """Sun 1 has the fewest collisions of each seed; Suns 3 and 4 differ by seed."""
    hits = {"1": (0, 0, 0), "3": (1, 2, 5), "4": (2, 1, 1)}
    drives = [
        drive("stereo", sun, seed, value + (sun == "1" and pose == "fused") * 9, "collisions", pose=pose)
        for sun, values in hits.items() for seed, value in enumerate(values) for pose in ("truth", "fused")
    ]  # fmt: skip
    table = effects_of(rows(*drives)).set_index(["pose", "axis", "level"])
    ranks = table.loc[("truth", "sun"), ["rank", "rank_low", "rank_high"]]
    assert ranks.loc["1"].tolist() == [1, 1, 1]
    assert ranks.loc["3"].tolist() == [3, 2, 3]
    assert table.loc[("fused", "sun", "1"), "rank"] == 3
    assert table.loc[("all", "sun", "1"), "value"] == 4.5  # pooled
    assert set(table.loc["all"].index.get_level_values("axis")) == {"sun", "pose"}
    assert "pose" not in set(table.loc["fused"].index.get_level_values("axis"))
    equal = effects_of(rows(*(drive("stereo", sun, 0, 1.0, "stops") for sun in "13")))
    assert equal["rank"].tolist() == [1.5, 1.5]
    assert equal["rank_low"].isna().all()  # a single seed


def test_an_effect_compares_drives_that_differ_in_the_axis_only():
    """The better detector also drove with lights on; other exposures were driven with lights off only."""
    hits = {"good": 1.0, "bad": 5.0}
    drives = [
        drive("detector", "1", seed, hits[name] - (lit == "on"), "collisions", lights=lit, detector=name, exposure=ms)
        for seed in (0, 1) for name, ms, lit in (
            *product(hits, ("0064", "0256"), ("off",)), ("good", "0256", "on"),
        )
    ]  # fmt: skip
    table = effects_of(rows(*drives)).set_index(["axis", "level"])
    assert table.loc[("lights", "on"), ["value", "change"]].tolist() == [0.0, -1.0]
    assert table.loc[("lights", "off"), "value"] == 1.0  # of the detector that drove with both states
    assert table.loc[("exposure", "0256"), ["value", "change"]].tolist() == [3.0, 0.0]
    assert table.loc[("detector", "good"), ["value", "change"]].tolist() == [1.0, -4.0]
    stereo = [drive("stereo", "1", seed, 0.0, "collisions") for seed in (0, 1)]  # a single light, so no effects
    assert "all" not in set(effects_of(rows(*drives, *stereo))["mode"])
