"""Commands with outputs of a small run and of other commands: polarsim reads all formats that it writes.

Each test checks the output of a command: numbers against tables of the run, images for content.
"""

import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from polarsim.annotate.export import TOOLS
from polarsim.explore.corrections import Corrections
from polarsim.explore.site import page_of_run
from polarsim.explore.tables import shown_predictions
from polarsim.formats import coco, png, yolo
from polarsim.geometry.boxes import area, clip, iou, match_by_iou
from polarsim.labels.seeds import read_corrections
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.run_files.run import Run
from polarsim.site import polar
from tests.rover.drives import SMALL as SMALL_DRIVE
from tests.rover.drives import configured
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH

pytestmark = pytest.mark.slow

EDGES = ["x0", "y0", "x1", "y1"]
KEY = "01_A_off_180_L_0256"
KEYS = "*_L_0256"  # four photos: two positions, two azimuths
READ_FORMS = ("yolo", "coco", "detectors")  # of published sets; tests/publish checks the rules of the others


@pytest.fixture(scope="module")
def place(small, make_checkout, tmp_path_factory) -> Path:
    """A writable checkout with the complete run; commands replace files, so hard links are safe."""
    folder = make_checkout(tmp_path_factory.mktemp("place"))
    (folder / "data").symlink_to(small / "data")
    shutil.copytree(small / "results", folder / "results", copy_function=os.link)
    shutil.copytree(small / ".snakemake/metadata", folder / ".snakemake/metadata")
    return folder


@pytest.fixture(autouse=True)
def here(place, monkeypatch) -> Path:
    """Folder of the run; the checkout is the working folder."""
    monkeypatch.chdir(place)
    return place / "results/small"


@pytest.fixture(scope="module")
def labels(small) -> pd.DataFrame:
    """Labels of the run, without labels outside the photo."""
    table = pd.read_parquet(small / "results/small/labels/labels.parquet")
    corners = clip(table[EDGES].to_numpy(float), 1936, 1216)
    return table.assign(**dict(zip(EDGES, corners.T, strict=True)))[area(corners) > 0]


def in_process_of_its_own(*arguments: object) -> subprocess.CompletedProcess:
    """Run a command in a separate process, because `polarsim run` ends all child processes."""
    words = [sys.executable, "-m", "polarsim", *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    return subprocess.run(words, capture_output=True, text=True, env=environment, check=False)


@pytest.fixture
def call(polarsim):
    """Call a command that must succeed; return the output."""

    def run(*arguments: object, code: int = 0) -> str:
        done = in_process_of_its_own(*arguments) if arguments[0] == "run" else polarsim(*arguments)
        assert done.returncode == code, (done.stderr, done.stdout[-2000:])
        assert "stray" not in done.stderr, done.stderr  # all files of polarsim are known
        return done.stdout

    return run


@pytest.fixture
def exported(call, tmp_path):
    """Return a function that exports the four photos for a labelling tool."""

    def write(tool: str) -> Path:
        call("export", tmp_path / tool, "--run", "small", "--keys", KEYS, "--tool", tool)
        return tmp_path / tool

    return write


@pytest.fixture(scope="module")
def found_once(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("found")


@pytest.fixture
def found(exported, call, found_once) -> Path:
    """Detections of the packaged detector in the four photos, shared by all tests."""
    folder = found_once / "found"
    if not folder.exists():
        shutil.copytree(exported("labelimg"), found_once / "pictures")
        call("detect", found_once / "pictures", "--out", folder)
    return folder


def of_keys(table: pd.DataFrame, pattern: str = KEYS) -> pd.DataFrame:
    return table[table["key"].str.endswith(pattern.lstrip("*"))]


def in_coco(*paths: Path) -> pd.DataFrame:
    """Return the boxes of COCO files: key, kind, x0, y0, x1, y1."""
    rows = [
        (str(key), label.kind, *label.box)
        for path in paths
        for key, labels in coco.read_coco(path, polar().images.size, PhotoKey.parse).items()
        for label in labels
    ]
    return pd.DataFrame(rows, columns=["key", "kind", *EDGES])


def same_boxes(folder: Path, wanted: pd.DataFrame) -> None:
    """Check that label files hold the boxes of a table (key, kind, x0, y0, x1, y1).

    Tables of detections have one decimal.
    """
    files = {path.stem: path for path in folder.rglob("??_*.txt")}
    assert set(files) == set(wanted["key"])
    for key, rows in wanted.groupby("key"):
        classes, boxes = yolo.read_boxes(files[key], size=SIZE)
        for number, kind in enumerate(BOX_CLASSES):
            own, other = boxes[classes == number], rows.loc[rows["kind"] == kind, EDGES].to_numpy(float)
            assert len(own) == len(other), (key, kind)
            if len(own):
                pairs = match_by_iou(iou(own, other), 0.5)
                assert len(pairs[0]) == len(own)
                np.testing.assert_allclose(own[pairs[0]], other[pairs[1]], atol=0.06)


def has_content(path: Path, *, least: int = 40) -> np.ndarray:
    """Return the pixels of an image after checking that the image has enough grey values and contrast."""
    import cv2

    pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert pixels is not None, path
    grey = pixels if pixels.ndim == 2 else pixels[..., :3].astype(int).sum(axis=2)
    assert len(np.unique(grey)) >= least, path
    assert grey.std() > 0.01 * grey.max(), path
    return pixels


def report_of(call, tmp_path: Path, *arguments: object, code: int = 0) -> dict:
    call(*arguments, "--json", tmp_path / "report.json", code=code)
    return json.loads((tmp_path / "report.json").read_text())


@pytest.mark.parametrize("tool", TOOLS)
def test_an_export_is_imported(call, exported, labels, tmp_path, tool):
    folder = exported(tool)
    pictures = sorted(folder.rglob("*.png"))
    assert len(pictures) == 4
    for path in pictures:
        assert has_content(path).shape[:2] == (HEIGHT, WIDTH)
    sources = {
        "labelimg": [folder],
        "cvat": [folder, folder / "annotations/instances_default.json"],
        "label-studio": [folder / "tasks.json"],
    }[tool]
    for number, source in enumerate(sources):
        printed = call("import", source, tmp_path / f"back{number}")
        assert f"{len(of_keys(labels))} boxes in 4 photos" in printed
        same_boxes(tmp_path / f"back{number}", of_keys(labels))


def test_labels_of_the_run_are_imported_and_outlined(call, here, labels, tmp_path):
    call("import", here / "labels/boxes", tmp_path / "boxes")
    same_boxes(tmp_path / "boxes", labels)
    source = here / "labels/coco/Terrain01.json"
    shown = in_coco(source)
    call("import", source, tmp_path / "coco")
    same_boxes(tmp_path / "coco", shown)
    assert len(shown) > 0.9 * len(labels)  # labels that are hidden whole are left out
    printed = call("outline", source, tmp_path / "outlined.json")
    assert printed.startswith(f"{len(shown)} outlines on 8 photos")
    outlined = coco.read_coco(tmp_path / "outlined.json", polar().images.size, PhotoKey.parse)
    for key, rows in coco.read_coco(source, polar().images.size, PhotoKey.parse).items():
        pixels = sum(one.mask.area for one in rows)
        assert sum(one.mask.area for one in outlined[key]) == pytest.approx(pixels, rel=0.05)
    call("import", tmp_path / "outlined.json", tmp_path / "outlines")
    same_boxes(tmp_path / "outlines", shown)


@pytest.mark.parametrize("below", ["", "/Terrain01"])
def test_polygons_of_the_run_are_painted_as_its_masks(call, here, tmp_path, below):
    printed = call("masks", f"{here}/labels/polygons{below}", tmp_path / "masks")
    assert printed.startswith("8 class masks")
    painted = {path.stem: path for path in (tmp_path / "masks").rglob("*.png")}
    wanted = sorted((here / "labels/masks/Terrain01").glob("*.png"))
    assert len(wanted) == len(painted) == 8
    for path in wanted:
        different = png.read_png(painted[path.stem]) != png.read_png(path)
        assert different.mean() < 2e-4  # on edges: the files have 6 decimals
        assert {43, 86, 128} <= set(np.unique(png.read_png(path)))


@pytest.mark.parametrize("kind", ["boxes", "polygons"])
def test_labels_of_the_run_are_scored(call, here, labels, tmp_path, kind):
    report = report_of(call, tmp_path, "score", here / "labels/boxes", here / f"labels/{kind}")
    for name, row in report["classes"].items():
        assert row["files"] == 8
        assert row["truth_boxes"] == (labels["kind"] == name).sum()
        assert row["label_boxes"] >= 0.9 * row["truth_boxes"]
        assert row["f1"] == 1 if kind == "boxes" else row["f1"] > 0.8
    truth = Path("data/analog/truth/labels/boxes")
    if truth.exists():
        report = report_of(call, tmp_path, "score", truth, here / "labels/boxes")
        assert 0.5 < report["classes"]["rock"]["f1"] < 1


def test_twins_labels_are_scored_and_compared(call, here, tmp_path):
    folders = [here / f"{stage}/boxes/Terrain01" for stage in ("labels", "renders")]
    report = report_of(call, tmp_path, "score", *folders)
    assert 0.7 < report["classes"]["rock"]["f1"] <= 1
    tables = [here / f"{stage}/labels.parquet" for stage in ("labels", "renders")]
    predictions = here / "detect/position/seed0/predictions"
    seen = [predictions / f"hapke_on_{domain}.parquet" for domain in ("analog", "hapke")]
    report = report_of(call, tmp_path, "ipd", tables[0], seen[0], tables[1], seen[1], "--resamples", 100)
    assert report["paired_by"]
    assert set(report["classes"]) >= {"rock", "shadow"}


@pytest.mark.parametrize("root", ["labels", "labels/boxes", "labels/polygons", "renders/boxes"])
def test_labels_of_the_run_are_validated(call, here, tmp_path, root):
    report = report_of(call, tmp_path, "validate", here / root, "--select", "error")
    (content,) = report["contents"].values()
    assert 8 in content.values(), content  # label files
    assert report["errors"] == 0


def test_detections_are_scored_compared_imported_and_validated(call, found, here, labels, tmp_path):
    table = pd.read_csv(found / "detections.csv")
    assert len(table) > 20
    truth = tmp_path / "truth"
    for path in (here / "labels/boxes/Terrain01").glob(KEYS + ".txt"):
        truth.mkdir(exist_ok=True)
        shutil.copy(path, truth)
    scores = report_of(call, tmp_path, "score", truth, found / "labels")
    for name, row in scores["classes"].items():
        assert row["label_boxes"] == (table["kind"] == name).sum()
        assert row["truth_boxes"] == (of_keys(labels)["kind"] == name).sum()
    assert scores["classes"]["rock"]["tp"] > 5
    same = report_of(call, tmp_path, "ipd", truth, found / "labels", truth, found / "labels", "--resamples", 100)
    assert same["classes"]["rock"]["ipd"] == 0
    assert same["classes"]["rock"]["iou_mean_a"] > 0.2
    wanted = table.assign(key=table["picture"].str.removesuffix(".png"))
    for number, source in enumerate((found / "labels", found / "coco.json")):
        printed = call("import", source, tmp_path / f"taken{number}")
        assert f"{len(table)} boxes in 4 photos" in printed
        same_boxes(tmp_path / f"taken{number}", wanted)
    trained = tmp_path / "set"  # layout of training sets
    shutil.copytree(found.parent / "pictures", trained / "images", ignore=shutil.ignore_patterns("*.txt"))
    shutil.copytree(found / "labels", trained / "labels")
    report = report_of(call, tmp_path, "validate", trained, "--select", "error")
    assert report["contents"]["folder"] == {"pictures": 4, "label_files": 4, "boxes": len(table)}
    assert report["errors"] == 0


def test_pictures_of_detections_show_photo_and_boxes(found):
    drawn = sorted((found / "pictures").iterdir())
    assert len(drawn) == 4
    for path in drawn:
        pixels = has_content(path).astype(int)
        assert (np.ptp(pixels, axis=2) > 60).sum() > 500, "no coloured line"
        grey = has_content(found.parent / "pictures" / f"{path.stem}.png").astype(int)
        legend = len(pixels) - len(grey)
        assert 0 < legend < 100
        assert np.median(np.abs(pixels[: len(grey)].mean(axis=2) - grey)) < 12, "not the photo"


def test_published_sets_are_read(call, here, labels, tmp_path):
    out = tmp_path / "out"
    call("publish", "small", out, "--format", ",".join(READ_FORMS))
    for domain, stage in (("analog", "labels"), ("hapke", "renders")):
        wanted = in_coco(here / stage / "coco/Terrain01.json")  # labels without visible pixels are not published
        assert len(wanted) > 0.9 * len(labels)
        call("import", out / "yolo" / domain, tmp_path / f"yolo_{domain}")
        same_boxes(tmp_path / f"yolo_{domain}", wanted)
        report = report_of(call, tmp_path, "validate", out / "yolo" / domain, "--select", "error")
        assert report["contents"]["folder"] == {"pictures": 8, "label_files": 8, "boxes": len(wanted)}
        parts = sorted((out / "coco/annotations").glob(f"{domain}_*.json"))
        assert len(in_coco(*parts)) == len(wanted)
        for path in parts:
            call("import", path, tmp_path / path.stem)
            same_boxes(tmp_path / path.stem, in_coco(path))
    scores = report_of(call, tmp_path, "score", here / "labels/boxes", tmp_path / "yolo_analog")
    assert scores["classes"]["rock"]["f1"] > 0.95
    weights = out / "detectors/position/seed0/hapke.pt"
    picture = out / f"coco/images/hapke/{KEY}.png"  # 16 bits
    assert has_content(picture).dtype == np.uint16
    call("detect", picture, "--out", tmp_path / "seen", "--weights", weights, "--confidence", 0.001)
    assert (tmp_path / "seen/detections.csv").read_text().startswith("picture,kind,confidence")


def test_an_import_is_corrections_of_the_run(call, exported, labels, place, here, tmp_path):
    """`labels.corrections` reads imported labels and the corrections of the explorer."""
    call("import", exported("labelimg"), tmp_path / "corrections")
    assert set(map(str, read_corrections(tmp_path / "corrections", polar(), 1))) == set(of_keys(labels)["key"])
    corrections = Corrections(Run.at(here))
    rows = labels[labels["key"] == KEY]
    corrections.save(KEY, rows[["kind", *EDGES]].to_dict("records"))
    report = report_of(call, tmp_path, "score", tmp_path / "corrections", here / "corrections")
    assert report["classes"]["rock"]["label_boxes"] == (rows["kind"] == "rock").sum()
    call("import", here / "corrections", tmp_path / "again")
    same_boxes(tmp_path / "again", rows)
    found = call("undo", KEY, "--configfile", with_corrections(place, here / "corrections"))
    undone = pd.read_parquet(here / f"labels/undone/{KEY}.parquet")
    assert f"{undone['key'].nunique()} photos with labels derived from {KEY}" in found
    assert len(undone) > 0
    assert set(undone.columns) >= {"key", "kind", "rock", "change"}
    corrections.drop(KEY)
    assert list((here / "corrections").iterdir()) == []


def with_corrections(place: Path, folder: Path) -> Path:
    content = yaml.safe_load((place / "config/small.yaml").read_text())
    target = place / "config/corrected.yaml"
    target.write_text(yaml.safe_dump(content | {"labels": {"corrections": str(folder)}}))
    return target


@pytest.mark.parametrize("more", [(), ("--domain", "hapke", "--masks")], ids=["photo", "twin"])
def test_show_draws_the_labels_over_the_picture(call, here, labels, tmp_path, more):
    call("show", KEY, "--run", "small", "--out", tmp_path / "bare.png", *more, "--kinds", "rock")
    call("show", KEY, "--run", "small", "--out", tmp_path / "shown.png", *more)
    shown, bare = (has_content(tmp_path / name).astype(int) for name in ("shown.png", "bare.png"))
    assert (shown != bare).any(axis=2).sum() > 500  # the shadows
    coloured = np.ptp(shown[..., :3], axis=2) > 40
    for row in labels[(labels["key"] == KEY) & (labels["kind"] == "rock")].to_dict("records"):
        x0, y0, x1, y1 = (round(row[edge]) for edge in EDGES)
        assert coloured[max(0, y0 - 4) : y1 + 5, max(0, x0 - 4) : x1 + 5].any(), row
    domain = "hapke" if "hapke" in more else "photo"
    picture = png.read_png(Run(here).pictures_of(domain, 1)[PhotoKey.parse(KEY)]).astype(float)
    grey = shown[:HEIGHT, :WIDTH, :3].mean(axis=2)
    plain = ~coloured[:HEIGHT, :WIDTH]
    assert np.corrcoef(np.sqrt(picture[plain]), grey[plain])[0, 1] > 0.8  # the image is visible under the labels


def test_the_page_of_the_run_has_pictures_and_labels(call, here, labels, tmp_path):
    call("explore", "small", "--out", tmp_path / "page", "--width", 240)
    about = json.loads((tmp_path / "page/data/run.json").read_text())
    assert about["terrains"] == [1]
    assert about["domains"] == ["photo", "hapke"]
    pictures = sorted((tmp_path / "page/data/pictures").rglob("*.jpg"))
    assert len(pictures) == 16
    for path in pictures:
        has_content(path, least=20)
    outlines = json.loads((tmp_path / f"page/data/outlines/photo/{KEY.rpartition('_')[0]}.json").read_text())
    assert len(outlines) > 5
    run = Run.at(here)
    assert len(about["predictions"]) == 6
    table = pd.read_parquet(here / "detect/false_positives.parquet")
    for name in about["predictions"]:
        seen = shown_predictions(run, name)
        trained, evaluated = name.rpartition("/")[2].split("_on_")
        rows = table[(table["trained"] == trained) & (table["evaluated"] == evaluated)]
        count = seen.loc[seen["confidence"] >= 0.25, "false_positive"].sum()
        assert count == rows["false_positives"].sum(), name


@pytest.mark.usefixtures("snakemake_of_commands")
def test_the_report_is_of_the_run(call, here):
    printed = call("report", "small", "--configfile", "config/small.yaml").splitlines()
    page = here / "report.html"
    assert "results/small/report.html" in printed
    assert printed[-1] == "results/small/results.html"
    content = page.read_text(errors="ignore")
    figures = sorted((here / "figures").glob("*.png"))
    assert len(figures) > 5
    for path in figures:
        assert f"results/small/figures/{path.name}" in content
        has_content(path, least=10)
    assert "results/demo" not in content


def test_a_run_that_is_complete_plans_no_job(call, here):
    before = {path: path.stat().st_mtime_ns for path in sorted((here / "labels").rglob("*.txt"))}
    call("run", "labels", "--configfile", "config/small.yaml")
    assert {path: path.stat().st_mtime_ns for path in before} == before


VIEWS = """
scenes: [{{name: one, meshes: {meshes}, terrain: 1}}]
lens: {{kind: pinhole, hfov_deg: 60, width_px: 160, height_px: 120}}
cameras: [{{kind: orbit, radius_m: 2.5, height_m: 1.2, number: 2}}]
lights: [{{kind: lamp, azimuth_deg: [30], elevation_deg: [20], distance_m: 4}}]
exposures_ms: [256]
render: {{models: [hapke]}}
"""


def test_meshes_of_the_run_are_rendered_and_the_pictures_are_read(call, here, tmp_path):
    meshes = here / "meshes/Terrain01"
    twin = tmp_path / f"{KEY}.png"
    call("render", meshes, twin, "--maps", tmp_path / "maps", "--cameras", here / "cameras/Terrain01/PosA.json")
    assert has_content(twin).dtype == np.uint16
    depth = png.read_png(tmp_path / "maps/depth.png")
    assert 1000 < np.median(depth[depth > 0]) < 8000  # mm
    ids = png.read_png(tmp_path / "maps/ids.png")
    assert len(np.unique(ids)) > 5  # rocks
    call("detect", twin, "--out", tmp_path / "found")
    assert len(pd.read_csv(tmp_path / "found/detections.csv")) > 3
    (tmp_path / "views.yaml").write_text(VIEWS.format(meshes=meshes))
    call("render", tmp_path / "views.yaml", tmp_path / "views")
    pictures = sorted((tmp_path / "views/images").rglob("*.png"))
    assert len(pictures) == 2
    for path in (*pictures, tmp_path / "views/contact.jpg"):
        has_content(path, least=20)
    report = report_of(call, tmp_path, "validate", tmp_path / "views", "--select", "error")
    assert report["contents"]["folder"]["label_files"] == 2
    assert report["contents"]["folder"]["boxes"] > 0
    scores = report_of(call, tmp_path, "score", tmp_path / "views/labels", tmp_path / "views/labels")
    assert scores["classes"]["rock"]["f1"] == 1
    call("detect", tmp_path / "views/images", "--out", tmp_path / "seen", "--no-draw")


@pytest.mark.skipif(find_spec("mujoco") is None, reason="mujoco is not installed")
def test_a_drive_over_the_meshes_of_the_run(call, place, here, tmp_path):
    options = {**SMALL_DRIVE, "drive": {**SMALL_DRIVE["drive"], "longest_s": 1.0}}
    options["world"] = {**SMALL_DRIVE["world"], "terrains": [1]}
    content = configured(**options) | {"run": "small", "terrains": [1]}
    (tmp_path / "drive.yaml").write_text(yaml.safe_dump(content))
    printed = call(
        "drive", "--configfile", tmp_path / "drive.yaml", "--results", place / "results", "--no-pictures",
        "--out", here / "rover/seed0",
    )  # fmt: skip
    assert "offset, RMS" in printed
    trace = pd.read_parquet(here / "rover/seed0/trace.parquet")
    assert len(trace) > 50
    assert np.isfinite(trace[["x_m", "y_m", "z_m"]].to_numpy()).all()
    drive = json.loads(page_of_run(Run.at(here))["data/drives/seed0.json"]())
    assert drive["length_m"] > 0.01
    assert len(drive["path"]) > 1
    call("publish", "small", tmp_path / "bags", "--format", "tum")
    lines = (next((tmp_path / "bags/tum").rglob("groundtruth.txt"))).read_text().splitlines()
    assert len(lines) > 5
    shutil.rmtree(here / "rover")
