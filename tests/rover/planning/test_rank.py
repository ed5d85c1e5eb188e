"""Rank correlations of detectors: coefficients equal SciPy's, and no claims from few detectors or by chance."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from polarsim.errors import RoverError
from polarsim.formats.tables import write_parquet
from polarsim.rover.planning.rank import detector_drives, gap_metrics, kendall, rank_detectors, rank_table, spearman
from polarsim.schemas.rover import AUTONOMY_METRICS

NAMES = [f"{domain}-seed{seed}" for domain in ("analog", "principled", "hapke") for seed in (0, 1)]


def every(hits: dict[str, list[float]], rock_map: float = 150.0) -> pd.DataFrame:
    """Return drives of detectors, one per seed, with these numbers of collisions."""
    found = [
        ("detector", "3", "0256", "off", "hapke", name, "truth", seed, "finished", metric, "", value)
        for name, values in hits.items()
        for seed, hit in enumerate(values)
        for metric, value in (
            ("collisions", hit),
            ("success", float(hit == 0)),
            ("rock map", rock_map - 10 * hit + seed),
        )
    ]
    return pd.DataFrame(found, columns=list(AUTONOMY_METRICS.columns))


def gaps(ipd: list[float]) -> pd.DataFrame:
    return pd.DataFrame({"ipd": ipd, "map50": 0.5}, index=pd.Index(NAMES[: len(ipd)]))


def ranks(hits: dict[str, list[float]], ipd: list[float]) -> pd.DataFrame:
    return rank_table(detector_drives(every(hits), "hapke"), gaps(ipd)).set_index(["gap", "drive"])


def test_coefficients_equal_scipys_with_ties():
    random = np.random.default_rng(0)
    one, other = random.integers(0, 4, (20, 7)), random.integers(0, 4, (20, 7))
    for own, theirs in ((spearman, stats.spearmanr), (kendall, stats.kendalltau)):
        expected = [theirs(a, b).statistic for a, b in zip(one, other, strict=True)]
        np.testing.assert_allclose(own(one, other), expected, atol=1e-12)
    assert np.isnan(spearman(np.ones((1, 4)), other[:1, :4])).all()  # all equal: no order


def test_a_smaller_gap_with_better_drives_has_a_positive_coefficient_and_a_verdict_with_enough_detectors():
    hits = {name: [number + 2.0, number + 2.0, number + 3.0] for number, name in enumerate(NAMES)}
    table = ranks(hits, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    row = table.loc[("ipd", "collisions")]
    assert (row["detectors"], row["drives"], row["units"], row["unit"]) == (6, 18, 3, "seed")
    assert row[["spearman", "spearman_low", "kendall", "kendall_high"]].tolist() == [1, 1, 1, 1]
    assert row["kendall_p"] == pytest.approx(2 / 720)
    assert row["says"] == "better"
    assert table.loc[("ipd", "success"), "says"] == "nothing to order by"  # no drive succeeds
    assert table.loc[("map50", "collisions"), "says"] == "nothing to order by"  # all detectors have the same value
    turned = ranks(hits, [0.6, 0.5, 0.4, 0.3, 0.2, 0.1]).loc[("ipd", "collisions")]
    assert (turned["spearman"], turned["says"]) == (-1, "worse")
    assert ("rock_f1", "rock_points") not in table.index  # the same metric twice
    row = ranks({name: hits[name] for name in NAMES[:4]}, [0.1, 0.2, 0.3, 0.4]).loc[("ipd", "collisions")]
    assert row[["kendall", "kendall_low", "kendall_high", "says"]].tolist() == [1, 1, 1, "too few detectors"]


def test_an_order_that_depends_on_the_seed_is_not_shown():
    hits = {name: [number + 0.0, 6.0 - number] for number, name in enumerate(NAMES)}
    row = ranks(hits, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]).loc[("ipd", "collisions")]
    assert (row["kendall_low"], row["kendall_high"]) == (-1, 1)
    one_seed = ranks({name: values[:1] for name, values in hits.items()}, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert one_seed.loc[("ipd", "collisions"), "unit"] == "light"
    assert np.isnan(one_seed.loc[("ipd", "collisions"), "kendall_low"])  # one drive per detector


def test_gaps_are_those_of_rocks_between_photos_and_pictures_of_the_rover(tmp_path):
    common = {"trained": "hapke", "seed": 1, "split": "position"}
    cells = [("rock", "hapke", 0.6), ("rock", "principled", 0.7), ("shadow", "hapke", 0.1)]
    detection = pd.DataFrame([common | {"kind": kind, "evaluated": on, "map50": value} for kind, on, value in cells])
    pairs = [("hapke", "analog", 0.2), ("hapke", "principled", 0.05)]
    ipd = pd.DataFrame([common | {"kind": "rock", "first": a, "second": b, "ipd": value} for a, b, value in pairs])
    for name, table in (("detection", detection), ("ipd", ipd)):
        write_parquet(tmp_path / f"{name}.parquet", table)
    found = gap_metrics(tmp_path / "detection.parquet", tmp_path / "ipd.parquet", ("analog", "hapke"), None)
    assert found.to_dict("index") == {"hapke-seed1": {"ipd": 0.2, "map50": 0.6}}
    write_parquet(tmp_path / "every.parquet", every({"hapke-seed1": [0.0, 1.0], "packaged": [1.0, 1.0]}))
    files = {name: tmp_path / f"{name}.parquet" for name in ("detection", "ipd", "by_detector", "ranks")}
    rank_detectors(each=tmp_path / "every.parquet", **files)
    by_detector = pd.read_parquet(files["by_detector"]).set_index("detector")
    assert by_detector["collisions"].to_dict() == {"hapke-seed1": 0.5, "packaged": 1.0}
    assert np.isnan(by_detector.loc["packaged", "ipd"])
    table = pd.read_parquet(files["ranks"]).set_index(["gap", "drive"])
    assert table.loc[("ipd", "collisions"), "detectors"] == 1
    assert table.loc[("rock_f1", "collisions"), "detectors"] == 2  # all detectors have a score of the map


def test_no_drive_by_a_detector_is_an_error(tmp_path):
    write_parquet(tmp_path / "every.parquet", every({"a": [0.0]}).assign(mode="stereo"))
    with pytest.raises(RoverError, match=r"every\.parquet"):
        rank_detectors(
            each=tmp_path / "every.parquet", by_detector=tmp_path / "by.parquet", ranks=tmp_path / "ranks.parquet"
        )


def test_a_detector_that_drove_in_easier_light_has_no_advantage():
    """With lights on, driven by a single detector, there are no collisions."""
    drives = every({name: [2.0, 2.0] for name in NAMES})
    easy = every({NAMES[0]: [0.0, 0.0]}).assign(lights="on")
    kept = detector_drives(pd.concat([drives, easy]), "hapke")
    assert len(kept) == 2 * len(NAMES)
    assert set(kept["lights"]) == {"off"}
