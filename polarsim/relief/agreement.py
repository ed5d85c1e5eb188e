"""Check that photos show the given scene, before its ground is inferred from them.

Shape from shading explains any single photo. A photo belongs to the scene if it is dark where known rocks cast shadows,
more than at other places nearby. Otherwise, the relief that the other photos imply must predict the photo.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
from scipy import fft, ndimage

from polarsim.errors import ReconstructionError
from polarsim.geometry.rays import Caster
from polarsim.relief.equations import Problem, solve_step
from polarsim.relief.heights import PhotoView
from polarsim.relief.observations import ShadingObservation, log_model, observe, quad_points, rays_of, slopes_of
from polarsim.render.parameters import Parameters

MAX_OFFSET = 0.12  # metres: of the shadows of rocks, by errors of poses and of the ground
REACH = 0.5  # metres: to other places
MIN_AREA = 0.01  # square metres: of the visible shadows of rocks
MIN_MATCHING = 0.5  # minimum share of the photos with shadows of rocks that match them
MIN_CORRELATION = 0.2  # of a photo with its prediction from relief that is inferred from the other photos
_FLAT = 0.01  # range of the logarithm of photos of level ground
_WIDTH = 0.1  # metres: darkness is relative to the mean over this standard deviation
_BRIGHTEST, _DARKEST = 0.5, -1.5  # range of the logarithm that counts
log = logging.getLogger("polarsim")


def verified_views(
    problem: Problem, views: Sequence[PhotoView], occluders: Caster, parameters: Parameters
) -> list[PhotoView]:
    """Return the views that show the scene; log a warning for each other view.

    Raises
    ------
    ReconstructionError
        None of the views shows the scene, or there is nothing to check them by.
    """
    if not views:
        raise ReconstructionError("no photos of the ground with a Sun lamp")
    given = problem.given
    seen = [observe(view, problem.grid, given, given, problem.masked, occluders, parameters) for view in views]
    matches = [shadows_match(one, problem.grid.cell) for one in seen]
    tested, matching = sum(match is not None for match in matches), sum(match is True for match in matches)
    if matching < MIN_MATCHING * tested:
        raise ReconstructionError(
            f"{matching} of {tested} photos are dark where known rocks cast shadows, {views[0].key} for example; check "
            "photo keys, poses, lamps and meshes"
        )
    references = [match is True or not tested for match in matches]
    verified, reasons = [], []
    for number, view in enumerate(views):
        others = [one for index, one in enumerate(seen) if index != number and references[index] and one.lit.any()]
        reason = "" if matches[number] else _disagreement(problem, view, seen[number], others, parameters)
        if reason:
            reasons.append(f"{view.key}: {reason}")
            log.warning("%s: not used for the relief of the ground: %s", view.key, reason)
        else:
            verified.append(view)
    if not verified:
        raise ReconstructionError(
            f"no photo is known to show this ground ({reasons[0]}); check photo keys, poses and lamps, or add photos "
            "with other Suns"
        )
    return verified


def shadows_match(seen: ShadingObservation, cell: float) -> bool | None:
    """Return whether predicted shadows of rocks correlate with darkness, more than at any other place nearby.

    None: the photo shows no shadows of rocks.

    Of 12 published photos 11 match their own scene, and 4 of 60 match another scene; 3 of these have the same rocks.
    """
    visible = np.isfinite(seen.contrast) & ~seen.by_wall
    shaded = (seen.hidden_from_lamp & ~seen.by_wall).astype(float)
    if (shaded * visible).sum() * cell**2 < MIN_AREA:
        return None
    weight = visible.astype(float)
    dark = np.where(visible, -np.clip(np.nan_to_num(seen.contrast), _DARKEST, _BRIGHTEST), 0.0)
    dark, shaded = _without_mean(dark, weight, cell), _without_mean(shaded, np.ones_like(shaded), cell)
    reach = round(REACH / cell)
    size = [fft.next_fast_len(side + 2 * reach, real=True) for side in dark.shape]
    product = fft.irfft2(fft.rfft2(dark, size) * np.conj(fft.rfft2(shaded, size)), size)
    near = np.roll(product, (reach, reach), axis=(0, 1))[: 2 * reach + 1, : 2 * reach + 1]
    steps = np.arange(-reach, reach + 1) * cell
    expected = np.hypot(*np.meshgrid(steps, steps)) <= MAX_OFFSET
    best = float(near[expected].max())
    return best > 0 and best >= float(near[~expected].max())


def _without_mean(values: np.ndarray, weight: np.ndarray, cell: float) -> np.ndarray:
    total, summed = (ndimage.gaussian_filter(one, _WIDTH / cell) for one in (weight, values * weight))
    return np.where(weight > 0, values - summed / np.maximum(total, 1e-3), 0.0)


def _disagreement(
    problem: Problem,
    view: PhotoView,
    seen: ShadingObservation,
    others: Sequence[ShadingObservation],
    parameters: Parameters,
) -> str:
    """Return why a photo does not agree with the relief that the other photos imply; empty if it agrees."""
    if not seen.lit.any():
        return "the photo shows no lit ground"
    if not others:
        return "it is not dark where known rocks cast shadows, and there is no other photo to compare it with"
    implied = slopes_of(problem.grid, solve_step(problem, problem.given, others))
    given = slopes_of(problem.grid, problem.given)
    rays = rays_of(view, quad_points(problem.grid, problem.given))
    level, actual, predicted = (log_model(parameters, rays, slopes) for slopes in (0 * given, given, implied))
    predicted, actual = (predicted - level)[seen.lit], (actual - level + seen.residual)[seen.lit]
    if min(np.ptp(predicted), np.ptp(actual)) < _FLAT:
        return ""
    correlation = float(np.corrcoef(predicted, actual)[0, 1])
    if correlation > MIN_CORRELATION:
        return ""
    return f"correlation {correlation:.2f} with relief from the other photos, expected {MIN_CORRELATION:g}"
