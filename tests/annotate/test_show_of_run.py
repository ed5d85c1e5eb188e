"""A run with a single station: photos under a single lamp, twins of a single model."""

import shutil

import numpy as np
import pandas as pd
import pytest

from polarsim.annotate.show import show_of_run
from polarsim.errors import FormatError, LabelError
from polarsim.formats import png, yolo
from polarsim.formats.files import write_json
from polarsim.formats.tables import PHOTO_COLUMNS, key_columns, label_table, write_parquet
from polarsim.photo import COLOURS, PhotoKey
from polarsim.report.figures.contact import draw_contact
from polarsim.run_files.run import Run
from polarsim.site import polar
from tests.support.polar_photos import SIZE

KEYS = [PhotoKey.parse(f"03_A_off_30_{camera}_{exposure}") for camera in "LR" for exposure in ("0064", "0256")]
LEFT = KEYS[1]
ROCK_AT, SHADOW_AT = (450, 600), (450, 1200)  # row and column inside the rock and the shadow below
REGIONS = [
    (2, np.array([[500.0, 400], [700, 400], [700, 500], [500, 500]])),
    (3, np.array([[1100.0, 400], [1300, 400], [1300, 500], [1100, 500]])),
]


def label(key, kind, box):
    row = {"kind": kind, "rock": 7, "source": "seed", "confidence": 1.0}
    return key_columns(key) | row | dict(zip(("x0", "y0", "x1", "y1"), map(float, box), strict=True))


@pytest.fixture
def run(tmp_path):
    """A run with left photos, and only twins for the right camera."""
    run, folder = tmp_path / "results/demo", "Terrain03"
    photos = []
    for key in KEYS:
        if key.camera == "L":
            png.write_png(tmp_path / f"{key}.png", np.full((1216, 1936), 500, np.uint16))
            photos.append(key_columns(key) | {"path": str(tmp_path / f"{key}.png")})
        png.write_png(run / f"renders/hapke/{folder}/{key}.png", np.full((1216, 1936), 500, np.uint16))
    write_parquet(run / f"acquire/{folder}/photos.parquet", pd.DataFrame(photos, columns=list(PHOTO_COLUMNS)))
    write_json(run / f"acquire/{folder}/inventory.json", {"terrain": 3, "kind": "analog"})
    rows = [label(key, "rock", (500, 400, 700, 500)) for key in KEYS]
    rows += [label(key, "shadow", (1100, 400, 1300, 500)) for key in KEYS]
    for stage in ("labels", "renders"):
        write_parquet(run / f"{stage}/tables/{folder}.parquet", label_table(rows))
    yolo.write_polygons(run / f"labels/polygons/{folder}/{LEFT}.txt", REGIONS, size=SIZE)
    ids = np.ones((1216, 1936), np.uint16)
    ids[400:500, 500:700], ids[400:500, 1100:1300] = 1007, 2007
    png.write_png(run / f"renders/instances/{folder}/03_A_off_30_L.png", ids)
    return run


@pytest.mark.parametrize("domain", ["photo", "hapke"])
def test_masks_are_polygons_for_photos_and_instances_for_twins(tmp_path, run, domain):
    for name, masks in (("plain", False), ("filled", True)):
        show_of_run(key=LEFT, run=Run(run), domain=domain, out=tmp_path / f"{name}.png", masks=masks)
    plain, filled = (png.read_png(tmp_path / f"{name}.png").astype(int) for name in ("plain", "filled"))
    grey = plain[1100, 1000]
    for position, kind in ((ROCK_AT, "rock"), (SHADOW_AT, "shadow")):
        dark = position[0] + 30, position[1] + 30  # next to the line from shadow to rock
        assert (plain[dark] == grey).all()
        assert (np.sign(filled[dark] - grey) == np.sign(np.array(COLOURS[kind]) - grey)).all()


def test_a_missing_photo_is_replaced_by_a_twin_not_by_a_cover_photo(tmp_path, run, caplog):
    right = next(key for key in KEYS if key.camera == "R")
    cover = tmp_path / "cover_photo_indexed_03_A.png"
    png.write_png(cover, np.zeros((1216, 1936, 3), np.uint8))
    inventory = {"terrain": 3, "kind": "release", "cover_photos": {right.position: str(cover)}}
    write_json(run / "acquire/Terrain03/inventory.json", inventory)
    show_of_run(key=right, run=Run(run), domain="photo", out=tmp_path / "out.png")
    assert (
        png.read_png(tmp_path / "out.png")[1100, 1000].min() > 0
    )  # not the black cover photo of another light and camera
    assert f"no photo {right}" in caplog.text
    (run / f"renders/hapke/Terrain03/{right}.png").unlink()
    caplog.clear()
    with pytest.raises(LabelError, match=f"no image {right}"):
        show_of_run(key=right, run=Run(run), domain="photo", out=tmp_path / "other.png")
    assert not caplog.records  # the error is enough


def test_missing_images_and_polygons_are_errors(tmp_path, run):
    with pytest.raises(LabelError):
        show_of_run(key=LEFT, run=Run(run), domain="lambert", out=tmp_path / "out.png")
    with pytest.raises(FormatError, match=f"{KEYS[0]}.txt"):
        show_of_run(key=KEYS[0], run=Run(run), domain="photo", out=tmp_path / "out.png", masks=True)
    assert not (tmp_path / "out.png").exists()


def test_a_contact_sheet_shows_photos_then_twins_then_grey(tmp_path, run):
    png.write_png(tmp_path / f"{LEFT}.png", np.full((1216, 1936), 4000, np.uint16))  # all white; twins below are dark
    for path in (run / "renders/hapke/Terrain03").glob("*.png"):
        png.write_png(path, np.full((1216, 1936), 16, np.uint16))
    photos, twins = run / "acquire/Terrain03/photos.parquet", run / "renders/hapke/Terrain03"
    labels = run / "labels/tables/Terrain03.parquet"
    corners = {}
    for points in ([photos, twins], [photos]):
        figure = tmp_path / f"{len(points)}.png"
        draw_contact(site=polar(), keys=KEYS, labels=labels, pictures=points, figure=figure, width=800)
        pixels = png.read_png(figure)
        left, right = pixels[200, 20], pixels[200, 780]  # of the tiles of the left and right camera
        corners[len(points)] = int(left[0]), int(right[0])
    assert corners[2] == (255, 0)
    assert corners[1][0] == 255
    assert 80 < corners[1][1] < 100


def test_the_legend_names_the_model_of_a_twin(tmp_path, run):
    shutil.copytree(run / "renders/hapke", run / "renders/principled")
    for domain in ("photo", "hapke", "principled"):
        show_of_run(key=LEFT, run=Run(run), domain=domain, out=tmp_path / f"{domain}.png")
    photo, hapke, principled = (
        png.read_png(tmp_path / f"{name}.png")[1216:] for name in ("photo", "hapke", "principled")
    )
    assert (hapke != principled).any()
    assert (hapke != photo).any()
