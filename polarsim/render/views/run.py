"""Rendering of novel views to a folder of labelled images."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain, groupby
from pathlib import Path

import numpy as np

from polarsim.formats import png
from polarsim.formats.coco_annotations import Annotation
from polarsim.formats.files import check_new_folder, writing_folder
from polarsim.photo import BLACK_LEVEL
from polarsim.progress import track
from polarsim.render.gain import lit_pixels
from polarsim.render.ground_truth import annotate_view
from polarsim.render.lamps import ROVER
from polarsim.render.olat import render_view
from polarsim.render.optics import apply_lens, apply_lens_to_olat_images
from polarsim.render.sensor import expose, noise_generator
from polarsim.render.views.folder import Sheet, Tone, ViewsFolder, write_listing
from polarsim.render.views.options import AutoExposure, Views
from polarsim.render.views.plan import PlannedImage, plan
from polarsim.render.views.stars import Sky, build_sky, sky_images

_IMAGES = 24  # maximum OLAT images in memory
_EXPOSURES_MS = (1.0, 8192.0)  # limits of automatic exposures
LabelsByMap = dict[str, list[Annotation]]  # by the name of the instance map


def render_views(
    views: Views,
    out: Path,
    *,
    tone: Tone,
    limit: int | None = None,
    scale: float = 1.0,
    preview: bool = False,
    threads: int = 1,
) -> int:
    """Render the images of the grid, or the first `limit`, with labels to a new folder; return their number.

    Rays are cast once per camera; shading is computed once per light and model. The bytes do not depend on `threads`.

    `tone`: conversion from 12 to 8 bits, for the contact sheet and, with `preview`, for the images. `scale`: size of
    the images relative to the lens.
    """
    check_new_folder(out)
    chosen = plan(views, scale)[:limit]
    labels: LabelsByMap = {}
    exposures: list[float] = []
    sky = build_sky(views.stars.intensity) if views.stars else None
    with writing_folder(out) as made, ThreadPoolExecutor(threads) as pool:
        sheet = Sheet([picture.name for picture in chosen], chosen[0].size, tone)
        folder = ViewsFolder(views, made, preview, tone, sheet)
        for unit in track(render_units(chosen, len(views.render.models)), f"views in {out}"):
            exposures += pool.map(_render(folder, unit, sky, labels, threads), unit)
        entries = zip(chosen, exposures, (labels[picture.ground_truth] for picture in chosen), strict=True)
        write_listing(made, list(entries), out)
        sheet.write(made / "contact.jpg")
    return len(chosen)


def render_units(pictures: Sequence[PlannedImage], models: int) -> list[list[PlannedImage]]:
    """Group images to render together: one camera, as many lights as memory allows."""
    units: list[list[PlannedImage]] = []
    max_lights = max(1, _IMAGES // models)
    for _, of_camera in groupby(pictures, lambda picture: (picture.scene.name, picture.camera.name)):
        by_light = [list(same) for _, same in groupby(of_camera, lambda picture: picture.light.name)]
        for start in range(0, len(by_light), max_lights):
            units.append(list(chain.from_iterable(by_light[start : start + max_lights])))
    return units


def _render(
    folder: ViewsFolder, unit: Sequence[PlannedImage], sky: Sky | None, labels: LabelsByMap, threads: int
) -> Callable[[PlannedImage], float]:
    """Render the OLAT images of a unit, write the instance maps, and add the labels to `labels`.

    The returned function writes an image of the unit and returns the exposure time, ms.
    """
    views, scene, camera = folder.views, unit[0].scene, unit[0].camera
    lights = {picture.light.name: picture for picture in unit}
    lamps = {name: lamp for picture in unit for name, lamp in picture.lamps().items()}
    models = [model for model in views.render.reflectance_models if any(picture.model == model for picture in unit)]
    rendering = render_view(scene.surfaces, camera, lamps, models, list(lights), views.render, threads)
    for name, picture in lights.items():
        labels[picture.ground_truth] = annotate_view(scene.surfaces, camera, rendering.ids[name], views.render)
        png.write_png(folder.out / f"instances/{picture.ground_truth}.png", rendering.ids[name])
    olat_images = apply_lens_to_olat_images(rendering.whole, lamps, scene.surfaces, camera, views.render, threads)
    skies = {name: picture.light.sandbox_from_celestial for name, picture in lights.items()}
    stars = sky_images(sky, skies, scene.surfaces, camera, threads) if sky else {}
    stars = {name: apply_lens(olat_image, camera.lens, views.render) for name, olat_image in stars.items()}

    def write(picture: PlannedImage) -> float:
        name, gain = picture.light.name, scene.gain(picture.model)
        radiance = olat_images[picture.model, name]
        if picture.rover:
            radiance = radiance + olat_images[picture.model, ROVER]
        exposure_ms = picture.exposure_ms or auto_exposure(radiance, gain, views.auto_exposure)
        if name in stars:
            radiance = radiance + stars[name]
        noise = noise_generator(views.render, "views", picture.name)
        photo = expose(radiance, exposure_ms * gain, views.render, noise)
        folder.write(picture, photo, exposure_ms, labels[picture.ground_truth])
        return exposure_ms

    return write


def auto_exposure(radiance: np.ndarray, gain: float, options: AutoExposure) -> float:
    """Return the exposure, ms, at which the percentile of the lit pixels of radiance (h, w) has the grey value `grey`.

    An image without light gets the longest exposure. `gain`: DN per ms per unit radiance.
    """
    lit = radiance[lit_pixels(radiance)]
    if not len(lit):
        return _EXPOSURES_MS[1]
    exposure = (options.grey - BLACK_LEVEL) / (gain * float(np.percentile(lit, options.percentile)))
    return float(f"{np.clip(exposure, *_EXPOSURES_MS):.6g}")
