import shutil
from pathlib import Path

import pandas as pd
import pytest

from polarsim.detect.evaluate import evaluate, gather_tables
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.errors import DetectError
from polarsim.formats import tables
from polarsim.photo import PhotoKey
from polarsim.schemas.detect import CURVES, INSTANCES
from tests.support.polar_photos import HEIGHT, WIDTH

TESTED, TRAINED, DARK = "01_A_off_180_L_0256", "01_B_off_180_L_0256", "01_A_off_180_R_0256"
SPLIT = f"key,part\n{TRAINED},train\n01_B_off_180_R_0256,val\n{TESTED},test\n{DARK},test\n"


TABLES = ("detection", "breakdown", "curves", "false_positives", "ipd", "rocks", "instances", "differences")


def label(key: str, kind: str, rock: int, *box: float) -> dict[str, object]:
    corners = dict(zip(("x0", "y0", "x1", "y1"), box, strict=True))
    return tables.key_columns(PhotoKey.parse(key)) | {
        "kind": kind, "rock": rock, "source": "truth", "confidence": 1.0, **corners,
    }  # fmt: skip


def predictions(*rows: tuple) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=["key", "kind", "confidence", "x0", "y0", "x1", "y1"])


LABELS = tables.label_table(
    [
        label(TESTED, "rock", 1, 0, 0, 100, 100),
        label(TESTED, "rock", 2, 200, 0, 300, 100),
        label(TESTED, "shadow", 1, 100, 0, 200, 100),
        label(TRAINED, "rock", 1, 0, 0, 50, 50),
        label(DARK, "rock", 1, 0, 0, 50, 50),
    ]
)
GOOD = predictions(
    (TESTED, "rock", 0.9, 0, 0, 100, 80),
    (TESTED, "rock", 0.1, 200, 0, 300, 100),
    (TESTED, "shadow", 0.9, 100, 0, 200, 100),
)
BAD = predictions((TESTED, "rock", 0.9, 0, 0, 100, 50), (TESTED, "shadow", 0.9, 900, 0, 1000, 100))


def run(root: Path, by: str, out: Path | None = None, **options: object) -> pd.DataFrame:
    """Evaluate the detector of domain `real` on both domains; return the detection table."""
    evaluate(
        predictions=[root / "real_on_real.parquet", root / "real_on_hapke.parquet"],
        labels=dict.fromkeys(("real", "hapke"), root / "labels.parquet"),
        datasets={domain: root / domain for domain in ("real", "hapke")},
        split=root / "split.csv",
        by=by,
        tables_of={name: (out or root) / f"{name}.parquet" for name in TABLES},
        size=(WIDTH, HEIGHT),
        options=ComparisonOptions(**options),
        training=TrainingOptions(),
        imgsz=320,
    )
    return tables.read_parquet((out or root) / "detection.parquet")


@pytest.fixture(scope="module")
def tested(tmp_path_factory):
    """Two domains with equal labels: the detector is good in `real` and bad in `hapke`; one photo is missing."""
    tmp_path = tmp_path_factory.mktemp("evaluated")
    (tmp_path / "split.csv").write_text(SPLIT)
    for domain, found in (("real", GOOD), ("hapke", BAD)):
        (tmp_path / domain).mkdir()
        (tmp_path / domain / "pictures.csv").write_text(SPLIT.replace(f"{DARK},test\n", ""))
        tables.write_parquet(tmp_path / f"real_on_{domain}.parquet", found)
    tables.write_parquet(tmp_path / "labels.parquet", LABELS)
    run(tmp_path, "photo")
    return tmp_path


@pytest.fixture
def modified(tested, tmp_path):
    """Copy of `tested` for tests that change files."""
    return shutil.copytree(tested, tmp_path / "copy")


def test_metrics_of_a_domain_agree_with_a_calculation_by_hand(tested):
    table = tables.read_parquet(tested / "detection.parquet")
    real = table[table["evaluated"] == "real"].set_index("kind")
    assert not table["shares_views"].any()
    assert real["images"].tolist() == [1] * 3  # without the missing photo
    assert real["labels"].to_dict() == {"rock": 2, "shadow": 1, "all": 3}
    # The first box has IoU 0.8, correct up to threshold 0.8 (7 of 10); the second box is exact.
    assert real["map50"].to_dict() == pytest.approx({"rock": 1, "shadow": 1, "all": 1})
    beyond = 51 * 0.5 / 101  # the first box is false: precision 1/2 up to recall 1/2
    assert real.loc["rock", "map50_95"] == pytest.approx((7 * 1 + 3 * beyond) / 10, abs=1e-6)
    # The confidence of the second box is below `iou_confidence`, so the performance of its rock is 0.
    assert real["iou_mean"].to_dict() == pytest.approx({"rock": 0.4, "shadow": 1, "all": 0.7})


def test_the_ipd_is_the_mean_difference_of_paired_rocks(tested):
    table = tables.read_parquet(tested / "ipd.parquet").set_index("kind")
    assert table.loc["rock", ["trained", "first", "second"]].tolist() == ["real", "hapke", "real"]
    assert table["pairs"].to_dict() == {"rock": 2, "shadow": 1}
    assert table["ipd"].to_dict() == pytest.approx({"rock": (0.8 - 0.5) / 2, "shadow": 1})


def test_a_difference_is_that_of_the_two_metrics(tested):
    table = tables.read_parquet(tested / "differences.parquet").set_index("kind")
    sides = ["metric", "trained", "evaluated", "other_trained", "other_evaluated"]
    assert table.loc["rock", sides].tolist() == ["map50", "real", "real", "real", "hapke"]
    # In `hapke` one of two rocks is found, at an IoU of 0.5: precision 1 up to a recall of 1/2.
    assert table.loc["rock", ["value", "other_value"]].tolist() == pytest.approx([1, 51 / 101], abs=1e-6)
    assert table.loc["rock", "difference"] == pytest.approx(50 / 101, abs=1e-6)
    assert table.loc["shadow", "difference"] == pytest.approx(1)


def test_every_tested_label_has_a_row(tested):
    table = tables.read_parquet(tested / "instances.parquet")
    assert table.dtypes.astype(str).to_dict() == INSTANCES.dtypes
    assert tables.read_parquet(tested / "curves.parquet").dtypes.astype(str).to_dict() == CURVES.dtypes
    real = table[table["evaluated"] == "real"]
    assert real[["key", "kind", "rock", "iou"]].to_numpy().tolist() == [
        [TESTED, "rock", 1, 0.8],
        [TESTED, "rock", 2, 0.0],
        [TESTED, "shadow", 1, 1.0],
    ]


def test_corrupt_images_of_training_and_test_are_counted(modified):
    (modified / "real" / "left_out.csv").write_text("key,part\nx,train\ny,val\nz,test\n")
    (modified / "hapke" / "left_out.csv").write_text("key,part\nx,train\ny,test\nz,test\n")
    assert run(modified, "view").set_index("evaluated")["left_out"].to_dict() == {"real": 3, "hapke": 4}


def test_every_table_names_its_detector_and_its_domains(tested):
    for name in ("detection", "breakdown", "curves", "false_positives", "instances"):
        table = tables.read_parquet(tested / f"{name}.parquet", ["trained", "evaluated"])
        assert set(zip(table["trained"], table["evaluated"], strict=True)) == {("real", "real"), ("real", "hapke")}
    for name in ("ipd", "rocks"):
        table = tables.read_parquet(tested / f"{name}.parquet", ["trained", "first", "second"])
        assert table[["trained", "first", "second"]].drop_duplicates().to_numpy().tolist() == [
            ["real", "hapke", "real"]
        ]


def test_the_rock_table_has_the_mean_of_each_rock_in_both_domains(tested):
    table = tables.read_parquet(tested / "rocks.parquet").set_index(["kind", "rock"])
    assert table.loc[("rock", 1), ["terrain", "photos", "iou_first", "iou_second"]].tolist() == [1, 1, 0.5, 0.8]
    assert table.loc[("rock", 1), "difference"] == pytest.approx(-0.3)


def test_the_rules_of_the_options_are_applied_and_reported(tested):
    run(tested, "photo", tested / "other", resampled="photo", iou_confidence=0.05)
    table = tables.read_parquet(tested / "other/ipd.parquet").set_index("kind")
    assert table.loc["rock", ["undetected", "unpaired", "unit", "confidence"]].tolist() == [
        "zero", "left_out", "photo", 0.05,
    ]  # fmt: skip
    assert table.loc["rock", "pairs"] == 2


def test_every_row_says_its_split_and_seed(tmp_path):
    parts = []
    for number, value in enumerate((0.1, 0.2, 0.3)):
        parts.append(tmp_path / f"{number}.parquet")
        tables.write_parquet(parts[-1], pd.DataFrame({"ipd": [value]}))
    splits, seeds = ["photo", "photo", "terrain"], [0, 7, 0]
    gather_tables(parts={"ipd": parts}, gathered={"ipd": tmp_path / "all.parquet"}, splits=splits, seeds=seeds)
    table = tables.read_parquet(tmp_path / "all.parquet")
    assert table.to_dict("list") == {"split": splits, "seed": seeds, "ipd": [0.1, 0.2, 0.3]}


def test_an_existing_split_column_is_kept(tmp_path):
    tables.write_parquet(tmp_path / "a.parquet", pd.DataFrame({"trained": ["real"], "split": ["view"], "map50": [0.5]}))
    parts = {"detection": [tmp_path / "a.parquet"]}
    gather_tables(parts=parts, gathered={"detection": tmp_path / "all.parquet"}, splits=["view"], seeds=[3])
    assert list(tables.read_parquet(tmp_path / "all.parquet").columns) == ["trained", "split", "seed", "map50"]


def test_parts_with_other_columns_are_refused(tmp_path):
    first, second = tmp_path / "a.parquet", tmp_path / "b.parquet"
    tables.write_parquet(first, pd.DataFrame({"split": ["view"], "map50": [0.5]}))
    tables.write_parquet(second, pd.DataFrame({"split": ["view"], "map50": [0.5], "map": [0.3]}))
    written = {"detection": tmp_path / "all.parquet"}
    with pytest.raises(DetectError, match=r"b\.parquet: other columns"):
        gather_tables(parts={"detection": [first, second]}, gathered=written, splits=["view"] * 2, seeds=[0, 1])
    assert not written["detection"].exists()
