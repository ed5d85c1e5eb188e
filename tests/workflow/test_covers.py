"""All rules of cover photos: from files to tables and page."""

import numpy as np
import pandas as pd
import pytest
import yaml

from polarsim.detect.detectors import read_detector
from polarsim.formats import obj, png, tables, yolo
from polarsim.formats.release import polygon_folder
from polarsim.geometry.meshes import Mesh
from polarsim.photo import POLYGON_CLASSES
from polarsim.render.surfaces import box_mesh
from polarsim.run_files import class_masks
from polarsim.scenes.strokes import COLOURS, draw_strokes
from tests.support.label_rows import label_row
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH

pytestmark = pytest.mark.slow
ROCK, SHADOW = [900.0, 500, 1000, 620], [1000.0, 520, 1200, 600]
TERRAINS = (1, 3)
REAL_RULES = (
    "real_tables", "read_covers", "carve_rocks", "render_scenes", "make_cover_dataset", "train_cover_detector",
    "pair_covers_with_twins", "convert_control", "cut_domain_windows", "make_twin_dataset", "train_domain_detector",
    "predict_domains", "compare_domains", "gather_domains", "report_real_tables", "draw_real_gap",
)  # fmt: skip
RULES = (
    "cover_photos", "read_covers", "carve_rocks", "render_scenes", "make_cover_dataset", "train_cover_detector",
    "cut_windows", "make_fine_tuning_dataset", "fine_tune_cover_detector",
    "predict_cover_photos", "choose_cover_widths", "merge_cover_detectors", "score_covers", "publish_detector",
    "report_covers", "write_results_page", "segment_covers", "score_masks", "tabulate_masks",
)  # fmt: skip


@pytest.fixture
def release(tmp_path):
    """Terrains with a cover photo of a rock and its shadow; terrain 3 has half the size, terrain 1 has polygons."""
    root = tmp_path / "release"
    for terrain in TERRAINS:
        photo = np.full((HEIGHT, WIDTH), 90, np.uint8)
        photo[520:600, 1000:1200] = 10
        photo[500:620, 900:1000] = 200
        cover = draw_strokes(photo, np.array([ROCK]) + np.array([-4, -4, 4, 4]), [1], COLOURS[0], 3, 26)
        cover = cover[::2, ::2] if terrain == 3 else cover
        png.write_png(root / "CoverPhotoOfIndices" / f"cover_photo_indexed_{terrain:02d}_A.png", cover)
        for azimuth in ("30", "180"):
            position = root / "Labels" / f"Terrain{terrain:02d}" / f"{terrain:02d}_A_off_{azimuth}_L_0256.txt"
            shadow = np.array(SHADOW) - (0 if azimuth == "30" else np.array([300, 0, 300, 0]))
            yolo.write_boxes(position, np.array([0, 1]), np.array([ROCK, shadow]), size=SIZE)
        if terrain == 1:
            things = {"ground": [0, 0, WIDTH, HEIGHT], "rock": ROCK, "shadow": SHADOW}
            outlines = [(POLYGON_CLASSES.index(name), ring(box)) for name, box in things.items()]
            yolo.write_polygons(polygon_folder(root, 1) / "01_A_off_30_L_0256.txt", outlines, size=SIZE)
        rock = root / "TerrainMeshes" / f"Terrain{terrain:02d}" / f"terrain{terrain:02d}_rock1.obj"
        rock.parent.mkdir(parents=True)
        rock.touch()  # replaced by the repaired copies
    return root


def ring(box):
    x0, y0, x1, y1 = box
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], float)


def test_cover_photos_become_tables_a_figure_and_a_page(checkout, snakemake, release):
    for terrain in TERRAINS:
        vertices, faces, _ = box_mesh(np.zeros(3), np.array([0.2, 0.15, 0.1 * terrain]))
        copies = checkout / f"results/covers/repaired/Terrain{terrain:02d}"
        (checkout / f"results/covers/cameras/located/Terrain{terrain:02d}").mkdir(
            parents=True
        )  # without located positions
        ground = checkout / f"results/covers/meshes/Terrain{terrain:02d}/terrain{terrain:02d}_ground.obj"
        obj.write_obj(ground, Mesh(vertices, faces), "ground")
        obj.write_obj(copies / f"terrain{terrain:02d}_rock1.obj", Mesh(vertices, faces), "rock")
    content = yaml.safe_load((checkout / "config/covers.yaml").read_text()) | {"terrains": list(TERRAINS)}
    content["covers"] |= {"folds": [], "carved_scenes": 4, "carved_epochs": 1, "widths": [96, 128]}
    content["covers"]["scenes"] = {"number": 2, "lamps": 5, "scale": 0.1}
    content["covers"]["fine_tuning"] = {"windows": 2, "epochs": 1}
    content["detect"] = {
        "seeds": [0, 1], "training": {"model": "compact", "epochs": 2, "masks": True}, "pictures": {"imgsz": 96},
        "comparison": {"resamples": 100},
    }  # fmt: skip
    (checkout / "small.yaml").write_text(yaml.safe_dump(content))
    done = snakemake(
        checkout, "cover_photos", "--configfile", "small.yaml", "--rerun-triggers", "mtime", "--allowed-rules", *RULES,
        POLAR_SIM_ROOT=str(release),
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    run = checkout / "results/covers"
    table = pd.read_csv(run / "tables/covers.csv", dtype={"terrain": str})
    for trained in ("rendered", "fine_tuned"):
        shown = table[(table["kind"] == "rock") & (table["detectors"] == "merged") & (table["trained"] == trained)]
        assert shown["terrain"].tolist() == ["all", "01", "03"]
    assert set(zip(table["detectors"], table["seed"], strict=True)) == {
        ("one", 0), ("one", 1), ("mean", -1), ("merged", -1)
    }  # fmt: skip
    assert (table.loc[table["terrain"] == "all", "labels"] == 2).all()
    detector = read_detector(run / "covers/detector.pt")
    assert (detector.start, detector.epochs) == ("detector.pt", 1)  # fine-tuned
    assert [path.name for path in (run / "covers/folds/carved").glob("seed*")] == ["seed0"]  # shared by both seeds
    assert len(detector.calibration) == len(detector.sizes) == 2
    assert "2 published cover photos" in (run / "covers/detector.md").read_text()
    pairing = pd.read_csv(run / "covers/pairing.csv")
    assert pairing.loc[pairing["shown"], "key"].tolist() == ["01_A_off_30_L_0256", "03_A_off_30_L_0256"]
    source = {path.stat().st_ino: path.parts[-3] for path in (run / "covers/scenes").glob("*/images/*.png")}
    for fold, other in (("01", "03"), ("03", "01")):
        dataset = run / f"covers/folds/{fold}/dataset/images"
        behind = {source[path.stat().st_ino] for part in ("train", "val") for path in (dataset / part).iterdir()}
        assert behind == {f"Terrain{other}"}
        assert [path.name[:2] for path in (dataset / "test").iterdir()] == [fold]
        tuned = (run / f"covers/folds/{fold}/fine_tuning/images").glob("*/*_w*.png")
        assert [path.name[:2] for path in tuned] == [other] * 2
    masks = pd.read_csv(run / "tables/masks.csv")
    assert set(masks["key"]) == {"01_A_off_30_L_0256", "all"}
    assert masks.loc[masks["kind"] == "rock", "pixels"].eq(100 * 120).all()
    assert class_masks.read_class_mask(run / "covers/folds/03/masks/03_A_off_30_L_0256.png").shape == (HEIGHT, WIDTH)
    assert [png.read_png(run / f"figures/{name}.png").shape[1] for name in ("covers", "scenes")] == [1600, 1600]
    page = (run / "results.html").read_text()
    assert "Real cover photos of held-out terrains" in page
    assert "IoU of class masks" in page
    assert "<h2>Domains</h2>" not in page  # this run has no domains


def test_covers_and_twins_become_the_tables_of_the_paper(checkout, snakemake, release):
    run = checkout / "results/real_tables"
    keys = [f"{terrain:02d}_A_off_30_L_0256" for terrain in TERRAINS]
    for terrain, key in zip(TERRAINS, keys, strict=True):
        name = f"Terrain{terrain:02d}"
        vertices, faces, _ = box_mesh(np.zeros(3), np.array([0.2, 0.15, 0.1]))
        obj.write_obj(run / f"meshes/{name}/terrain{terrain:02d}_ground.obj", Mesh(vertices, faces), "ground")
        (run / f"cameras/located/{name}").mkdir(parents=True)  # without located positions
        for twins in ("renders/principled", "renders/hapke", "renders/fitted", "covers/control/pictures"):
            twin = np.full((HEIGHT, WIDTH), 900, np.uint16)
            twin[500:620, 900:1000], twin[520:600, 1000:1200] = 3000, 20
            png.write_png(run / f"{twins}/{name}/{key}.png", twin)
    rows = [label_row(key, kind, rock=2, box=box) for key in keys for kind, box in (("rock", ROCK), ("shadow", SHADOW))]
    for stage in ("labels", "renders", "covers/control"):
        tables.write_parquet(run / stage / "labels.parquet", tables.label_table(rows))
    content = yaml.safe_load((checkout / "config/real_tables.yaml").read_text()) | {"terrains": list(TERRAINS)}
    content["covers"] |= {"folds": [], "carved_scenes": 4, "carved_epochs": 1, "scenes": {"lamps": 2, "scale": 0.1}}
    content["covers"]["fine_tuning"] = {"windows": 10, "epochs": 1}
    content["detect"] |= {"seeds": [0], "pictures": {"imgsz": 96}}
    content["detect"]["prediction"] = {"widths": [96], "confidence": 0.01}
    content["detect"]["comparison"] = {"resampled": "photo", "resamples": 100}
    (checkout / "small.yaml").write_text(yaml.safe_dump(content))
    done = snakemake(
        checkout, "real_tables", "--configfile", "small.yaml", "--rerun-triggers", "mtime", "--allowed-rules",
        *REAL_RULES, POLAR_SIM_ROOT=str(release),
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    detection = pd.read_csv(run / "tables/real_detection.csv")
    domains = {"real", "principled", "hapke"}
    rocks = detection[detection["kind"] == "rock"]
    evaluated = {*domains, "fitted", "control"}
    assert set(zip(rocks["trained"], rocks["evaluated"], strict=True)) == {(a, b) for a in domains for b in evaluated}
    assert set(detection["images"]) == {2}
    assert set(detection["start"]) == {"carved rocks"}
    ipd = pd.read_csv(run / "tables/real_ipd.csv")
    assert set(ipd.loc[ipd["kind"] == "rock", "pairs"]) == {2}
    assert ipd.groupby("trained").size().to_dict() == dict.fromkeys(domains, 20)  # ten pairs of domains, two kinds
    assert set(pd.read_csv(run / "tables/real_photos.csv")["key"]) == set(keys)
    figures = [png.read_png(run / f"figures/real_{name}.png") for name in ("ipd", "pairs", "gap")]
    assert [figure.shape[1] for figure in figures] == [1600] * 3
    labels = tables.read_parquet(run / "covers/domains/labels/real.parquet")
    assert set(zip(labels["source"], labels["rock"], strict=True)) == {("annotated", 2)}
    for fold, other in (("01", "03"), ("03", "01")):
        for domain in domains:
            trained = (run / f"covers/folds/{fold}/domains/{domain}/images").glob("t*/*_w*.png")
            assert {path.name[:2] for path in trained} == {other}
