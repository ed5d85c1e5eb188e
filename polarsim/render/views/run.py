"""Rendering of novel views to a folder of labelled images; existing up-to-date images are not rendered again."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np

from polarsim.formats import coco, png
from polarsim.photo import BLACK_LEVEL
from polarsim.progress import track
from polarsim.render.gain import lit_pixels
from polarsim.render.ground_truth import amodal_masks, annotate_ids, occluded_pixels
from polarsim.render.lamps import ROVER
from polarsim.render.olat import render_view
from polarsim.render.optics import apply_lens, apply_lens_to_olat_images
from polarsim.render.options import RenderOptions
from polarsim.render.sensor import expose, noise_generator
from polarsim.render.views.folder import Sheet, Tone, ViewsJob, write_listing
from polarsim.render.views.options import AutoExposure, Views
from polarsim.render.views.plan import PlannedImage, plan
from polarsim.render.views.stars import Sky, build_sky, sky_images

log = logging.getLogger("polarsim.render")
_IMAGES = 24  # maximum OLAT images in memory
LabelsByMap = dict[str, list[coco.Annotation]]  # by the name of the instance map


def render_views(
    views: Views,
    out: Path,
    *,
    tone: Tone,
    limit: int | None = None,
    scale: float = 1.0,
    preview: bool = False,
    threads: int = 1,
) -> tuple[int, int]:
    """Render the images of the grid, or the first `limit`, with labels; return the numbers of all and of new images.

    Existing images with an equal sidecar are kept. Rays are cast once per camera; shading is computed once per light
    and model. The bytes do not depend on `threads`.

    Parameters
    ----------
    tone
        Conversion from 12 to 8 bits, for the contact sheet and, with `preview`, for the images.
    scale
        Scale of the images relative to the lens.

    Raises
    ------
    ConfigError, FormatError, RenderError
        Impossible views, missing or invalid meshes, an engine that cannot be loaded.
    """
    grid = plan(views, scale)
    _warn_of_other_images(out, grid)
    chosen = grid[:limit]
    job = ViewsJob(views, out, preview, tone, Sheet([picture.name for picture in chosen], chosen[0].size, tone))
    exposures = {
        picture.name: exposure for picture in chosen if (exposure := job.existing_exposure(picture)) is not None
    }
    existing = set(exposures)
    units = render_units([picture for picture in chosen if picture.name not in existing], len(views.render.models))
    labels: LabelsByMap = {}
    pending: dict[str, Future[float]] = {}
    sky = build_sky(views.stars) if views.stars else None
    pool = ThreadPoolExecutor(threads)
    try:
        for picture in track(chosen, f"views in {out}"):
            name = picture.name
            if name in units:
                write = _render(job, units[name], sky, labels, threads)
                pending |= {each.name: pool.submit(write, each) for each in units[name]}
            if name in existing:
                _read_existing(job, picture, labels)
            else:
                exposures[name] = pending.pop(name).result()
    finally:
        pool.shutdown(cancel_futures=True)
    write_listing(out, [(picture, exposures[picture.name], labels[picture.ground_truth]) for picture in chosen])
    job.sheet.write(out / "contact.jpg")
    return len(chosen), len(chosen) - len(existing)


def render_units(pictures: Sequence[PlannedImage], models: int) -> dict[str, list[PlannedImage]]:
    """Group images to render together, by the name of the first: one camera, as many lights as memory allows."""
    units: dict[str, list[PlannedImage]] = {}
    max_lights = max(1, _IMAGES // models)
    current: tuple[str, str] | None = None
    lights: set[str] = set()
    for picture in pictures:
        camera = (picture.scene.name, picture.camera.name)
        if camera != current or (picture.light.name not in lights and len(lights) == max_lights):
            current, lights = camera, set()
            unit = units[picture.name] = []
        lights.add(picture.light.name)
        unit.append(picture)
    return units


def _render(
    job: ViewsJob, unit: Sequence[PlannedImage], sky: Sky | None, labels: LabelsByMap, threads: int
) -> Callable[[PlannedImage], float]:
    """Render the OLAT images of a unit, write the instance maps, and add the labels to `labels`.

    The returned function writes an image of the unit and returns the exposure time, ms.
    """
    views, scene, camera = job.views, unit[0].scene, unit[0].camera
    lights = {picture.light.name: picture for picture in unit}
    lamps = {name: lamp for picture in unit for name, lamp in picture.lamps(views).items()}
    models = [model for model in views.render.models if any(picture.model == model for picture in unit)]
    rendering = render_view(scene.surfaces, camera, lamps, models, list(lights), views.render, threads)
    for name, picture in lights.items():
        labels[picture.ground_truth] = _labels(picture, rendering.ids[name], views.render)
        job.write_instances(picture, rendering.ids[name])
    olat_images = apply_lens_to_olat_images(rendering.whole, lamps, scene.surfaces, camera, views.render, threads)
    skies = {name: picture.light.sandbox_from_celestial for name, picture in lights.items()}
    stars = sky_images(sky, skies, scene.surfaces, camera, threads) if sky else {}
    stars = {name: apply_lens(olat_image, camera.lens, views.render) for name, olat_image in stars.items()}

    def write(picture: PlannedImage) -> float:
        name, gain = picture.light.name, scene.parts[0].scene.gain(picture.model)
        radiance = olat_images[picture.model, name]
        if picture.rover:
            radiance = radiance + olat_images[picture.model, ROVER]
        exposure_ms = picture.exposure_ms or auto_exposure(radiance, gain, views.auto_exposure)
        if name in stars:
            radiance = radiance + stars[name]
        noise = noise_generator(views.render, "views", picture.name)
        photo = expose(radiance, exposure_ms * gain, views.render, noise)
        job.write(picture, photo, exposure_ms, labels[picture.ground_truth])
        return exposure_ms

    return write


def _labels(picture: PlannedImage, ids: np.ndarray, options: RenderOptions) -> list[coco.Annotation]:
    """Return the labels of an instance map (h, w), including amodal masks."""
    hidden = occluded_pixels(picture.scene.surfaces, picture.camera, ids)
    return annotate_ids(ids, options, amodal_masks(ids, hidden, options))


def _read_existing(job: ViewsJob, picture: PlannedImage, labels: LabelsByMap) -> None:
    """Add the labels of an existing image, from the instance map, and the image to the contact sheet."""
    if picture.ground_truth not in labels:
        ids = png.read_png(job.path("instances", picture.ground_truth))
        labels[picture.ground_truth] = _labels(picture, ids, job.views.render)
    if picture.name in job.sheet:
        job.sheet.add(picture.name, png.read_png(job.path("images", picture.name)), labels[picture.ground_truth])


def _warn_of_other_images(out: Path, grid: Sequence[PlannedImage]) -> None:
    names = {f"{picture.name}.png" for picture in grid}
    others = [path.name for path in sorted((out / "images").glob("*.png")) if path.name not in names]
    if others:
        log.warning("%s: %d images do not belong to these views, e.g. %s", out / "images", len(others), others[0])


def auto_exposure(radiance: np.ndarray, gain: float, options: AutoExposure) -> float:
    """Return the exposure, ms, at which the percentile of the lit pixels of radiance (h, w) has the grey value `grey`.

    An image without light gets `longest_ms`. `gain`: DN per ms per unit radiance.
    """
    lit = radiance[lit_pixels(radiance)]
    if not len(lit):
        return options.longest_ms
    exposure = (options.grey - BLACK_LEVEL) / (gain * float(np.percentile(lit, options.percentile)))
    return float(f"{np.clip(exposure, options.shortest_ms, options.longest_ms):.6g}")
