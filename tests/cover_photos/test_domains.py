"""Metrics of detectors of cover photos and twins agree with hand calculations."""

import numpy as np
import pandas as pd
import pytest

from polarsim.cover_photos.domains import compare_domains, pool_folds, rendered_performance
from polarsim.detect.domain_evaluation import DomainEvaluation
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.errors import DetectError
from polarsim.formats import png, tables
from polarsim.report.figures.real_gap import draw_real_gap
from polarsim.report.real_tables import tabulate_real_tables
from polarsim.schemas.covers import PHOTO_IPD
from polarsim.schemas.detect import PREDICTIONS
from polarsim.schemas.report import REAL_DETECTION, REAL_IPD, REAL_PHOTOS
from tests.support.label_rows import label_row
from tests.support.polar_photos import SIZE

FOLDS = {"01": ["01_A_off_30_L_0256", "01_C_off_30_L_0256"], "03": ["03_A_off_30_R_0256"]}
KEYS = [key for keys in FOLDS.values() for key in keys]
DOMAINS = ("real", "principled", "hapke")
SHIFTS = {"real": 0, "principled": 20, "hapke": -40}  # of predictions, px: IoU 1, 80 / 120 and 60 / 140
IOUS = {"real": 1.0, "principled": 80 / 120, "hapke": 60 / 140}
BOX = (400, 300, 500, 400)
OPTIONS = ComparisonOptions(resampled="photo", resamples=100)


def predicted(keys, shift):
    box = np.array(BOX, float) + np.array([shift, 0, shift, 0])
    rows = [(key, "rock", 0.9, *box) for key in keys]
    return tables.typed(rows, PREDICTIONS)


def write_inputs(folder):
    """Write two folds: each detector predicts each rock shifted by a distance that depends on the domain."""
    predictions, datasets = [], []
    for fold, keys in FOLDS.items():
        pictures = pd.DataFrame([(key, "test") for key in keys] + [("04_w00", "train")], columns=["key", "part"])
        datasets.append(folder / fold / "dataset")
        tables.write_csv(datasets[-1] / "pictures.csv", pictures)
        for trained in DOMAINS:
            for evaluated in DOMAINS:
                path = folder / fold / f"{trained}_on_{evaluated}.parquet"
                tables.write_parquet(path, predicted(keys, SHIFTS[evaluated]))
                predictions.append(path)
    for domain in DOMAINS:
        rows = [label_row(key, rock=1, box=BOX) for key in KEYS]
        rows += [label_row(KEYS[0], rock=901, box=(900, 300, 950, 350))] if domain == "real" else []
        tables.write_parquet(folder / f"{domain}.parquet", tables.label_table(rows))
    return predictions, datasets


def compare(folder):
    predictions, datasets = write_inputs(folder)
    names = ("detection", "ipd", "differences")
    compare_domains(
        predictions=predictions, labels={domain: folder / f"{domain}.parquet" for domain in DOMAINS},
        datasets=datasets, photo_domain="real", tables_of={name: folder / f"{name}.parquet" for name in names},
        photos=folder / "photos.parquet", size=SIZE, options=OPTIONS, training=TrainingOptions(model="compact"),
        start="carved rocks", imgsz=512,
    )  # fmt: skip
    return {name: tables.read_parquet(folder / f"{name}.parquet") for name in (*names, "photos")}


def test_metrics_are_pooled_over_folds(tmp_path):
    made = compare(tmp_path)
    rocks = made["detection"][made["detection"]["kind"] == "rock"].set_index(["trained", "evaluated"])
    assert len(rocks) == 9
    assert set(rocks["images"]) == set(rocks["units"]) == {3}
    assert set(rocks["start"]) == {"carved rocks"}
    for (_, evaluated), row in rocks.iterrows():
        labels = 4 if evaluated == "real" else 3  # a rock without a mesh, which is not predicted
        assert row["labels"] == labels
        assert row["iou_mean"] == pytest.approx(IOUS[evaluated] * 3 / labels, abs=1e-6)


def test_ipd_excludes_rocks_without_a_mesh(tmp_path):
    ipd = compare(tmp_path)["ipd"]
    rocks = ipd[ipd["kind"] == "rock"]
    assert set(rocks["pairs"]) == {3}
    for row in rocks.to_dict("records"):
        expected = abs(IOUS[row["first"]] - IOUS[row["second"]])
        assert row["ipd"] == row["ipd_abs"] == pytest.approx(expected, abs=1e-6)


def test_photos_have_signed_differences(tmp_path):
    photos = compare(tmp_path)["photos"]
    assert tuple(photos.columns) == PHOTO_IPD.without("split", "seed")
    assert sorted(set(photos["key"])) == KEYS
    for row in photos.to_dict("records"):
        assert row["difference"] == pytest.approx(1 - IOUS[row["twin"]], abs=1e-6)
        assert (row["pairs"], row["iou_photo"]) == (1, 1)
        assert row["ipd_abs"] == row["difference"]
        assert row["label_iou"] == 1


def test_rendered_boxes_have_a_performance_in_photos():
    """Half of the human box has IoU 0.5; a rock without a rendered box has IoU 0."""
    human = [label_row(KEYS[0], rock=1, box=BOX), label_row(KEYS[0], rock=2, box=(900, 300, 950, 350))]
    rendered = [label_row(KEYS[0], rock=1, box=(400, 300, 450, 400)), label_row(KEYS[0], "shadow", box=BOX)]
    photo, twin = (
        DomainEvaluation(KEYS[:1], pd.DataFrame(rows), predicted([], 0), OPTIONS, SIZE) for rows in (human, rendered)
    )
    assert rendered_performance(photo, twin)["label_iou"].tolist() == [0.5, 0]


def test_a_photo_of_two_folds_is_an_error(tmp_path):
    for fold in ("01", "03"):
        tables.write_parquet(tmp_path / fold / "real_on_hapke.parquet", predicted(KEYS[:1], 0))
    with pytest.raises(DetectError, match=KEYS[0]):
        pool_folds([tmp_path / fold / "real_on_hapke.parquet" for fold in ("01", "03")])


def test_tables_have_the_values_of_the_paper_and_intervals(tmp_path):
    made = compare(tmp_path)
    paths = {}
    for name, table in made.items():
        seeds = [
            table.assign(seed=seed) if "split" in table else table.assign(split="terrain", seed=seed) for seed in (0, 1)
        ]
        if name == "detection":
            seeds[1]["map50"] = seeds[1]["map50"] - 0.1
        paths[name] = tmp_path / f"all_{name}.parquet"
        tables.write_parquet(paths[name], pd.concat(seeds, ignore_index=True))
    origin = {"run": "real_tables", "source": "release", "config": "1a2b"}
    random = np.random.default_rng(0)
    for key in KEYS:
        photo = random.integers(0, 256, (304, 484)).astype(np.uint8).repeat(4, 0).repeat(4, 1)
        png.write_png(tmp_path / "photos" / f"{key}.png", photo)
        png.write_png(tmp_path / "drawn" / f"{key}.png", np.zeros_like(photo))
        for model in ("principled", "hapke"):  # hapke: the photo after a tone curve; principled: another image
            twin = photo.astype(np.uint16) ** 2 // 20 if model == "hapke" else photo[::-1].astype(np.uint16)
            png.write_png(tmp_path / model / f"Terrain{key[:2]}" / f"{key}.png", twin)
    tabulate_real_tables(
        **paths, pictures=tmp_path / "photos", drawn=tmp_path / "drawn",
        twins={model: tmp_path / model for model in ("principled", "hapke")},
        tables=tmp_path / "tables", origin=origin,
    )  # fmt: skip
    photos = tables.read_parquet(tmp_path / "tables/real_photos.parquet", REAL_PHOTOS.columns)
    ssim = photos.groupby("twin")["ssim"].mean()
    assert ssim["hapke"] > 0.99  # no matter how much worse the detections are
    assert ssim["principled"] < 0.2
    draw_real_gap(photos=tmp_path / "tables/real_photos.parquet", figure=tmp_path / "gap.png", width=800)
    assert png.read_png(tmp_path / "gap.png").shape[1] == 800
    text = (tmp_path / "tables/real_detection.md").read_text()
    assert "0.987 / 0.805 / 0.849" in text  # the paper's detector of photos on photos
    assert "0.950 / " in text  # mean over seeds of 1 and 0.9
    assert "95 % intervals" in text
    assert "0.3152" in (tmp_path / "tables/real_ipd.md").read_text()
    assert "+0.333" in (tmp_path / "tables/real_photos.md").read_text()
    detection = tables.read_csv(tmp_path / "tables/real_detection.csv", REAL_DETECTION.columns)
    assert len(detection) == 2 * len(made["detection"])
    assert tuple(tables.read_csv(tmp_path / "tables/real_ipd.csv").columns)[3:] == REAL_IPD.columns
