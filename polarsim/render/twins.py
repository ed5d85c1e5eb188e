"""Twins of photos: every view rendered once, its OLAT images summed and exposed for every key, its ids made labels."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from polarsim.formats import coco, tables
from polarsim.geometry.camera import Camera
from polarsim.photo import HEIGHT, WIDTH, PhotoKey, PositionCamera
from polarsim.progress import track
from polarsim.render.gain import calibration_photos, with_fit
from polarsim.render.ground_truth import hidden_parts, label_row, label_view
from polarsim.render.lamps import Lamp, lamps_of, lit_by
from polarsim.render.maps import lamps_of_maps, maps_of, write_view_maps
from polarsim.render.olat import NO_LAMP, render_view
from polarsim.render.optics import through_lens
from polarsim.render.options import Model, RenderOptions
from polarsim.render.surfaces import Surfaces, surfaces_of
from polarsim.render.twin_writer import TwinWriter, sources_of
from polarsim.run_files.lamps import read_suns
from polarsim.run_files.materials import read_materials
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.run_files.scene import read_terrain

log = logging.getLogger("polarsim.render")


@dataclass(frozen=True)
class LabelPaths:
    """Where a terrain's rendered ground-truth labels go: folders of boxes `KEY.txt` and of ids, COCO file, table of
    label rows.

    `maps`: folder of the maps that the options ask for.
    """

    boxes: Path
    instances: Path
    annotations: Path
    table: Path
    maps: Path | None = None


def views_of(
    keys: Iterable[PhotoKey], rigs: Mapping[str, LocalisedRig], cameras: Path
) -> dict[PositionCamera, list[PhotoKey]]:
    """The keys of each view whose position has a proven pose; the others are named in a warning and left out."""
    views: dict[PositionCamera, list[PhotoKey]] = {}
    without = set()
    for key in sorted(keys):
        if key.position in rigs and not rigs[key.position].unproven:
            views.setdefault((key.position, key.camera), []).append(key)
        else:
            without.add(key.position)
    for position in sorted(without):
        log.warning("%s: no proven pose, nothing is rendered at position %s", cameras / f"Pos{position}.json", position)
    return views


def render_twins(
    *,
    terrain: int,
    keys: Sequence[PhotoKey],
    cameras: Path,
    meshes: Path,
    photos: Path | None,
    twins: Mapping[Model, Path],
    labels: LabelPaths,
    options: RenderOptions,
    threads: int,
    materials: Path | None = None,
    lamps: Path | None = None,
    only: Set[PhotoKey] | None = None,
) -> None:
    """Write KEY.png for every key into the folder of every model, 16-bit PNG of 12-bit values with black level 16.

    KEY.json beside it says what made it (`render.sidecar`). Rays are cast once for all models and for the labels.

    Parameters
    ----------
    cameras : Path
        Folder with the terrain's `PosX.json`; positions without one are a warning and a gap.
    meshes : Path
        Folder with the terrain's meshes.
    photos : Path or None
        `photos.parquet`; twins get the brightness of its photos. Without it, or without usable photos, NASA's best
        exposures set the brightness; a gain in the options goes before both.
    labels : LabelPaths
        Where the rendered ground-truth labels go.
    materials : Path or None
        Folder with the terrain's fitted materials and lamps; they go before the options.
    lamps : Path or None
        Folder with the Sun lamps' `lamps.json`, where it is not `cameras`.
    only : set of PhotoKey or None
        Those of the keys that are written; brightness is calibrated over all of them, so it stays what it was.

    Raises
    ------
    FormatError
        A mesh, pose or table is missing or broken.
    RenderError
        The engine cannot be loaded.
    """
    rigs = read_all_localised(cameras)
    suns = read_suns(lamps or cameras, rigs)
    views = views_of(keys, rigs, cameras)
    with ThreadPoolExecutor(max(1, threads)) as pool:
        sourced = pool.submit(sources_of, terrain, meshes, lamps or cameras, materials)
        mesh = read_terrain(meshes, terrain, pool)
        sources = sourced.result()
    fitted = None if materials is None else read_materials(materials, mesh)
    options = options.of(terrain)
    options, albedo = (options, {}) if fitted is None else with_fit(options, fitted)
    surfaces = surfaces_of(mesh, options, albedo)
    shown = list(chain.from_iterable(views.values()))
    calibrated = any(not options.gain.get(model) for model in twins)
    references = calibration_photos(photos, shown) if calibrated else {}
    first = {(key.position, key.camera) for key in references}
    writer = TwinWriter(terrain, twins, cameras, sources, references, fitted, options)
    for folder in (labels.boxes, labels.instances):  # there also where no key is written
        folder.mkdir(parents=True, exist_ok=True)
    found_labels: dict[PhotoKey, list[coco.Annotation]] = {}
    for view in track(sorted(views, key=lambda view: (view not in first, view)), f"twins of terrain {terrain:02d}"):
        rig, own = rigs[view[0]], [key for key in views[view] if only is None or key in only]
        if not own and view not in first:
            continue
        camera = rig.camera(view[1])
        active_lamps = _lamps(suns, rig, [*own, *(key for key in references if view in first)], options)
        shadow_lamps = sorted({lit_by(key)[0] for key in own if lit_by(key)})
        rendering = render_view(surfaces, camera, active_lamps, list(twins), shadow_lamps, options, threads)
        whole = through_lens(rendering.whole, active_lamps, surfaces, camera, options, threads)
        with ThreadPoolExecutor(max(1, threads)) as pool:
            labelled = pool.submit(_label, own, rendering.ids, surfaces, camera, labels, options)
            writer.write(own, whole, active_lamps, camera, pool)
            found_labels |= labelled.result()
        if options.maps and labels.maps:
            mapped = {name: active_lamps[name] for name in lamps_of_maps(options.maps, shadow_lamps)}
            write_view_maps(labels.maps, own, maps_of(surfaces, camera, mapped, options, threads), options.maps)
    pictures = next(iter(twins.values()))
    _write_labels(labels, found_labels, rigs, {key: pictures / f"{key}.png" for key in found_labels})


def _label(
    keys: Sequence[PhotoKey],
    ids: Mapping[str, np.ndarray],
    surfaces: Surfaces,
    camera: Camera,
    labels: LabelPaths,
    options: RenderOptions,
) -> dict[PhotoKey, list[coco.Annotation]]:
    """Write the boxes and ids of a view's twins; return their labels."""
    hidden = hidden_parts(surfaces, camera, ids[NO_LAMP])
    return label_view(keys, ids, hidden, labels.boxes, labels.instances, options)


def _write_labels(
    labels: LabelPaths,
    found: Mapping[PhotoKey, Sequence[coco.Annotation]],
    rigs: Mapping[str, LocalisedRig],
    pictures: Mapping[PhotoKey, Path],
) -> None:
    """Write the labels of all twins as COCO, which names the pictures of one model, and as a table."""
    sizes = {(rig.rig.left.width, rig.rig.left.height) for rig in rigs.values()} or {(WIDTH, HEIGHT)}
    coco.write_coco(labels.annotations, found, size=max(sizes), pictures=pictures)
    in_order = sorted(found, key=lambda key: (key.position, key.camera, key))
    rows = [label_row(key, label) for key in in_order for label in found[key]]
    tables.write_parquet(labels.table, tables.label_table(rows))


def _lamps(
    suns: Mapping[str, np.ndarray], rig: LocalisedRig, keys: Sequence[PhotoKey], options: RenderOptions
) -> dict[str, Lamp]:
    """The lamps that photos need."""
    needed = {name for key in keys for name in lit_by(key)}
    return {name: lamp for name, lamp in lamps_of(suns, rig, options.lamp_radius_m).items() if name in needed}
