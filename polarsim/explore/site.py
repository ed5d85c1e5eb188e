"""The page of a run: all files by address, computed on request."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.explore.corrections import Corrections
from polarsim.explore.drives import drive_content, drive_pictures
from polarsim.explore.next_run import changed_labels
from polarsim.explore.pictures import jpeg, outlines_of_photos, outlines_of_twins, small_jpeg
from polarsim.explore.tables import facts_of_rocks, picture_table, shown_labels, shown_predictions
from polarsim.explore.terrain import terrain_setup, thinned_terrain
from polarsim.formats import arrow
from polarsim.formats.files import check_new_folder, writing_folder
from polarsim.photo import REFERENCE_WIDTH_PX, PhotoKey, Terrain, terrain_text
from polarsim.progress import track
from polarsim.run_files.run import PHOTO, Run

Files = dict[str, Callable[[], bytes]]  # by address below the page, without leading slash
CORRECTIONS = "data/corrections.json"
NEXT_RUN = "data/next_run.json"


def page_of_run(run: Run, width: int | None = None) -> Files:
    """Return all files of a run's page; the server answers no other addresses.

    `width` is the width of the images, px; None: `default_width`.
    """
    pictures = _pictures(run, width or default_width(run.site.images.width))
    return {**page_files(), **_tables(run), **_terrains(run), **pictures, **_drives(run)}


def default_width(photo_width: int) -> int:
    """Return half of a photo width, px, but at least half of the reference width; small photos are not enlarged."""
    return max(photo_width // 2, min(photo_width, REFERENCE_WIDTH_PX // 2))


def page_files() -> Files:
    """Return the static files: HTML, CSS, JavaScript modules, and a library with licence."""
    page = resources.files("polarsim.explore") / "page"
    vendor = {f"vendor/{part.name}": part for part in (page / "vendor").iterdir()}
    named = {part.name: part for part in page.iterdir()} | vendor
    return {name: part.read_bytes for name, part in sorted(named.items()) if part.is_file()}


def write_site(run: Run, folder: Path, width: int | None = None) -> int:
    """Write the page to a new folder for a static web server; return the number of files."""
    check_new_folder(folder)
    files = page_of_run(run, width)
    with writing_folder(folder) as temporary:
        for name, content in track(list(files.items()), "files"):
            target = temporary / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content())
    return len(files)


def overview(run: Run) -> dict[str, Any]:
    """Return the content of `data/run.json`: the available data."""
    return {
        "run": run.name,
        "terrains": list(run.terrains),
        "domains": list(run.domains),
        "width": run.site.images.width,
        "height": run.site.images.height,
        "suns": [name for name in run.site.suns if any(key.azimuth == name for _, key in run.pictures)],
        "rig_lamp": any(key.light == "on" and not key.has_sun for _, key in run.pictures),
        "meshes": [name for name in run.terrains if any(run.folder.glob(f"meshes/Terrain{terrain_text(name)}/*.obj"))],
        "predictions": list(run.predictions),
        "drives": [folder.name for folder in run.drives],
        "seeds": sorted(path.stem for path in run.folder.glob("acquire/Terrain*/seeds/*_*.txt")),
        "undone": sorted(path.stem for path in run.folder.glob("labels/undone/*.parquet")),
    }


def corrections_content(corrections: Corrections, token: str | None = None) -> bytes:
    """Return the content of `data/corrections.json`; without a token the page cannot save corrections."""
    saved = {"folder": str(corrections.folder), "photos": corrections.read(), "version": corrections.version()}
    return _json(lambda: saved | {"token": token})


def _json(content: Callable[..., Any], *arguments: Any) -> bytes:
    return json.dumps(content(*arguments), separators=(",", ":"), allow_nan=False).encode()


def _arrow(content: Callable[..., Any], *arguments: Any, **named: Any) -> bytes:
    return arrow.encode_arrow(content(*arguments, **named))


def _tables(run: Run) -> Files:
    files: Files = {
        "data/run.json": partial(_json, overview, run),
        "data/pictures.arrow": partial(_arrow, picture_table, run),
        CORRECTIONS: partial(corrections_content, Corrections(run)),
    }
    for terrain in run.terrains:
        for name, of_twins in (("photo", False), ("twins", True)):
            labels = partial(_arrow, shown_labels, run, terrain, of_twins=of_twins)
            files[f"data/labels/{name}/{terrain}.arrow"] = labels
        files[f"data/changes/{terrain}.arrow"] = partial(_arrow, changed_labels, run, terrain)
        files[f"data/rocks/{terrain}.arrow"] = partial(_arrow, facts_of_rocks, run, terrain)
    for name in run.predictions:
        files[f"data/predictions/{name}.arrow"] = partial(_arrow, shown_predictions, run, name)
    for path in sorted(run.folder.glob("labels/undone/*.parquet")):
        files[f"data/undone/{path.stem}.arrow"] = partial(_arrow, run.table, str(path.relative_to(run.folder)))
    return files


def _terrains(run: Run) -> Files:
    files: Files = {}
    for terrain in run.terrains:
        files[f"data/terrain/{terrain}.json"] = partial(_json, terrain_setup, run, terrain)
        if (run.folder / f"meshes/Terrain{terrain_text(terrain)}").exists():
            for part, name in enumerate(("vertices", "faces")):
                files[f"data/terrain/{terrain}/{name}.arrow"] = partial(_arrow, _mesh, run, terrain, part)
    return files


def _mesh(run: Run, terrain: Terrain, part: int) -> pd.DataFrame:
    tables = thinned_terrain(run, terrain)
    return tables[part] if tables else pd.DataFrame()


def _pictures(run: Run, width: int) -> Files:
    files: Files = {}
    for (domain, key), path in run.pictures.items():
        files[f"data/pictures/{domain}/{key}.jpg"] = partial(jpeg, path, width)
        files[f"data/small/{domain}/{key}.jpg"] = partial(small_jpeg, path)
        kind = "photo" if domain == PHOTO else "twins"
        name = f"data/outlines/{kind}/{str(key).rpartition('_')[0]}.json"
        files.setdefault(name, partial(_json, _outlines, run, kind, key))
    return files


def _outlines(run: Run, kind: str, key: PhotoKey) -> list[dict[str, Any]]:
    path = run.polygons(key) if kind == "photo" else run.instances(key)
    if not path.exists():
        return []
    return outlines_of_photos(path, run.site.images.size) if kind == "photo" else outlines_of_twins(path)


def _drives(run: Run) -> Files:
    files: Files = {}
    for folder in run.drives:
        files[f"data/drives/{folder.name}.json"] = partial(_json, drive_content, folder)
        pictures: Mapping[str, Callable[[], bytes]] = drive_pictures(folder)
        files.update((f"data/drives/{folder.name}/{name}", content) for name, content in pictures.items())
    return files
