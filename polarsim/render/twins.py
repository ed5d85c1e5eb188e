"""Twins of photos: render each view once, expose sums of OLAT images for every photo key, and write the labels."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from polarsim.formats import coco, tables
from polarsim.formats.coco_annotations import Annotation
from polarsim.photo import PhotoKey, PositionCamera, Terrain, terrain_text
from polarsim.progress import track
from polarsim.render.gain import calibration_photos, with_fit
from polarsim.render.ground_truth import label_row, label_view
from polarsim.render.lamps import Lamp, field_reach_m, lamps_of_rig, lamps_on
from polarsim.render.maps import write_view_maps
from polarsim.render.models import Domain, model_of
from polarsim.render.olat import render_view
from polarsim.render.optics import apply_lens_to_olat_images
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sidecar import digest_of
from polarsim.render.surfaces import Surfaces, build_surfaces
from polarsim.render.twin_writer import TwinWriter, input_digests
from polarsim.run_files.lamps import read_suns
from polarsim.run_files.light_fields import read_light_fields, sun_coefficients
from polarsim.run_files.materials import FittedMaterials, files_of, read_materials
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.run_files.scene import TerrainMesh, read_terrain
from polarsim.site import Site

log = logging.getLogger("polarsim.render")


@dataclass(frozen=True)
class LabelPaths:
    """Output paths of the rendered labels of a terrain."""

    boxes: Path  # folder of `KEY.txt`
    instances: Path  # folder of id maps
    annotations: Path  # COCO file
    table: Path
    maps: Path | None = None  # folder of the maps selected by `RenderOptions.maps`


@dataclass(frozen=True)
class TwinGroup:
    """Twins of a terrain that are rendered together: the same options, light and surfaces."""

    twins: Mapping[Model, Path]
    options: RenderOptions
    surfaces: Surfaces
    fitted: FittedMaterials | None
    fields: Mapping[str, tuple[float, ...]]  # coefficients of light fields by azimuth
    sources: Mapping[str, str]  # digests of inputs, for sidecars
    site: Site

    def lamps(self, suns: Mapping[str, np.ndarray], rig: LocalisedRig) -> dict[str, Lamp]:
        """Return the lamps by name, with the light fields of the group."""
        lamps, reach = lamps_of_rig(suns, rig, self.site, self.options.lamp_radius_m), field_reach_m(self.site)
        return {
            name: replace(lamp, light_field=self.fields.get(name, ()), field_reach_m=reach)
            for name, lamp in lamps.items()
        }


def twin_groups(
    site: Site,
    twins: Mapping[Domain, Path],
    mesh: TerrainMesh,
    options: RenderOptions,
    materials: Path | None,
    light: Path | None,
    sources: Mapping[str, str],
    threads: int,
) -> list[TwinGroup]:
    """Return the twins with the options of the run, then those of each fitted domain.

    Fitted materials apply to the fitted domains, or to all twins if no domain is fitted.
    """
    domains = [domain for domain in twins if options.is_fitted(domain)]
    plain = {model_of(domain): path for domain, path in twins.items() if domain not in domains}
    fitted = None if materials is None else read_materials(materials, mesh)
    fields = read_light_fields(light) if light and domains else {}
    groups: list[TwinGroup] = []

    def add(paths: Mapping[Model, Path], of_domain: Domain | None = None) -> None:
        used = options if of_domain is None else options.as_fitted()
        applied = None if fitted is None or (of_domain is None and domains) else fitted
        if applied and of_domain:
            applied = applied.of_domain(of_domain, model_of(of_domain))
        used, albedo = (used, {}) if applied is None else with_fit(used, applied)
        surfaces = build_surfaces(mesh, used, albedo)
        if groups:
            groups[0].surfaces.prepare(shadows=True, threads=threads)
            surfaces = surfaces.sharing_rays(groups[0].surfaces)
        files = {"materials": files_of(materials)} if applied and materials else {}
        files |= {"light": [light]} if of_domain and light else {}
        digests = {name: digest_of(paths) for name, paths in files.items()}
        coefficients = sun_coefficients(fields.get(of_domain, {}), site.suns) if of_domain else {}
        groups.append(TwinGroup(paths, used, surfaces, applied, coefficients, {**sources, **digests}, site))

    if plain:
        add(plain)
    for domain in domains:
        add({model_of(domain): twins[domain]}, domain)
    if domains and not (fitted and fitted.models) and not fields:
        log.info("no fit to photos: fitted twins have disc lamps and vignetting only")
    return groups


def keys_by_view(
    keys: Iterable[PhotoKey], rigs: Mapping[str, LocalisedRig], cameras: Path
) -> dict[PositionCamera, list[PhotoKey]]:
    """Group the keys by view; omit positions without a proven pose and log a warning for each."""
    views: dict[PositionCamera, list[PhotoKey]] = {}
    unlocated = set()
    for key in sorted(keys):
        if key.position in rigs and not rigs[key.position].unproven:
            views.setdefault((key.position, key.camera), []).append(key)
        else:
            unlocated.add(key.position)
    for position in sorted(unlocated):
        log.warning("%s: no proven pose; position %s is not rendered", cameras / f"Pos{position}.json", position)
    return views


def render_twins(
    *,
    site: Site,
    terrain: Terrain,
    keys: Sequence[PhotoKey],
    cameras: Path,
    meshes: Path,
    photos: Path | None,
    twins: Mapping[Domain, Path],
    labels: LabelPaths,
    options: RenderOptions,
    threads: int,
    materials: Path | None = None,
    light: Path | None = None,
    lamps: Path | None = None,
    only: Set[PhotoKey] | None = None,
) -> None:
    """Render KEY.png for every key and domain, a 16-bit PNG of 12-bit values with black level 16, and write the labels.

    KEY.json records the inputs of the image (`render.sidecar`). Rays are cast once for all models with the options of
    the run and the labels, and once for each fitted domain.

    Parameters
    ----------
    cameras, meshes : Path
        Folders of the terrain. Positions without a proven pose are skipped with a warning.
    photos : Path or None
        `photos.parquet`; the gain is calibrated on the photos. Without usable photos, the gain is derived from the
        usual exposure of the site. A gain in the options has priority over both.
    materials : Path or None
        Folder with the fitted materials and lamps of the terrain; they override the options. See `twin_groups`.
    light : Path or None
        File with the light fields of the lamps, for fitted domains.
    lamps : Path or None
        Folder with `lamps.json` of the Sun lamps, if different from `cameras`.
    only : set of PhotoKey or None
        Keys to write; None: all. The gain is calibrated over all keys and does not depend on this selection.
    """
    rigs = read_all_localised(cameras)
    suns = read_suns(lamps or cameras, rigs, site, terrain)
    views = keys_by_view(keys, rigs, cameras)
    with ThreadPoolExecutor(max(1, threads)) as pool:
        sourced = pool.submit(input_digests, terrain, meshes, cameras, lamps or cameras)
        mesh = read_terrain(meshes, terrain, site.sandbox_of(terrain), pool, cameras)
        sources = sourced.result()
    groups = twin_groups(site, twins, mesh, options, materials, light, sources, threads)
    located = list(chain.from_iterable(views.values()))
    calibrated = any(not group.options.gain.get(model) for group in groups for model in group.twins)
    references = calibration_photos(photos, located, site) if calibrated else {}
    first = {(key.position, key.camera) for key in references}
    writers = [
        TwinWriter(site, terrain, group.twins, cameras, group.sources, references, group.fitted, group.options)
        for group in groups
    ]
    for folder in (labels.boxes, labels.instances):  # the folders must exist even if no key is written
        folder.mkdir(parents=True, exist_ok=True)
    all_labels: dict[PhotoKey, list[Annotation]] = {}
    for view in track(
        sorted(views, key=lambda view: (view not in first, view)), f"twins of terrain {terrain_text(terrain)}"
    ):
        rig, chosen = rigs[view[0]], [key for key in views[view] if only is None or key in only]
        if not chosen and view not in first:
            continue
        camera = rig.camera(view[1])
        needed = {name for key in [*chosen, *(references if view in first else ())] for name in lamps_on(key)}
        shadow_lamps = sorted({lamps_on(key)[0] for key in chosen if lamps_on(key)})
        for number, (group, writer) in enumerate(zip(groups, writers, strict=True)):
            active_lamps = {name: lamp for name, lamp in group.lamps(suns, rig).items() if name in needed}
            surfaces, shadows = group.surfaces, None if number else shadow_lamps
            rendering = render_view(surfaces, camera, active_lamps, list(group.twins), shadows, group.options, threads)
            olat_images = apply_lens_to_olat_images(
                rendering.whole, active_lamps, surfaces, camera, group.options, threads
            )
            with ThreadPoolExecutor(max(1, threads)) as pool:
                places = (labels.boxes, labels.instances)
                labelled = None
                if not number:
                    labelled = pool.submit(label_view, chosen, rendering.ids, surfaces, camera, *places, group.options)
                writer.write(chosen, olat_images, active_lamps, camera, pool)
                all_labels |= labelled.result() if labelled else {}
            if labels.maps and not number:
                write_view_maps(labels.maps, chosen, surfaces, camera, active_lamps, group.options, threads)
    images = next(iter(twins.values()))
    sizes = {(rig.rig.left.width, rig.rig.left.height) for rig in rigs.values()} or {site.images.size}
    _write_labels(site, labels, all_labels, max(sizes), {key: images / f"{key}.png" for key in all_labels})


def _write_labels(
    site: Site,
    labels: LabelPaths,
    all_labels: Mapping[PhotoKey, Sequence[Annotation]],
    size: tuple[int, int],
    images: Mapping[PhotoKey, Path],
) -> None:
    """Write the labels of all twins as a COCO file, with the image paths of one model, and as a table."""
    coco.write_coco(labels.annotations, all_labels, site, size, pictures=images)
    in_order = sorted(all_labels, key=lambda key: (key.position, key.camera, key))
    rows = [label_row(key, label) for key in in_order for label in all_labels[key]]
    tables.write_parquet(labels.table, tables.label_table(rows))
