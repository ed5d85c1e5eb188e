"""Localisation of all positions of a terrain by seed boxes, most certain first, with translations of the rocks.

Published meshes were cut and placed by hand: most are accurate to millimetres, some are off by centimetres. The boxes
of a position improve the positions of the rocks, which helps to localise the next position.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from polarsim.cameras.labels import FINAL_NOISE, MIN_BOXES, LabelLocalisation, checked, localise_by_labels
from polarsim.cameras.options import LocalisationOptions
from polarsim.cameras.refine import BoxFit, check_pose, pose_of
from polarsim.cameras.surveyed import pose_beside
from polarsim.cameras.translations import Translations, fit_translations, no_translations, translated
from polarsim.errors import RegistrationError
from polarsim.geometry.lens import Lens
from polarsim.geometry.outlines import Outlines

log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Refusal:
    """Reason why labels do not localise a position, and the best pose if there is one."""

    reason: str
    best: LabelLocalisation | None


@dataclass(frozen=True)
class Localisations:
    """Localised positions, translations of rocks, and refused positions."""

    localised: dict[str, LabelLocalisation]
    translations: Translations
    refused: dict[str, Refusal]


def localise_all(
    seen: Mapping[str, np.ndarray], outlines: Outlines, lens: Lens, options: LocalisationOptions
) -> Localisations:
    """Localise every position whose boxes and meshes suffice.

    Parameters
    ----------
    seen : position -> (b, 4) float
        Rock boxes of the left photos, pixels.

    Returns
    -------
    Localisations
        Positions with too few boxes or meshes are neither localised nor refused.
    """
    usable = [position for position, boxes in seen.items() if min(len(boxes), len(outlines)) >= MIN_BOXES]
    found = Localisations({}, no_translations(outlines, options.rock_translation_sd_mm / 1000), {})
    alone = {position: _alone(position, seen[position], outlines, lens, options) for position in usable}
    surest_first = sorted(usable, key=lambda position: (-(one.share if (one := alone[position]) else 0.0), position))
    for position in surest_first:
        found = _with_position(found, position, seen[position], outlines, lens, options, alone[position])
    return found


def untranslated_fits(found: Localisations, outlines: Outlines, lens: Lens) -> list[BoxFit]:
    """Return fits of the boxes of the localised positions to the original meshes, at the same poses."""
    return [
        check_pose(one.fit.sandbox_from_left, outlines, one.boxes, lens, one.prior, FINAL_NOISE)
        for one in found.localised.values()
    ]


def _alone(
    position: str, boxes: np.ndarray, outlines: Outlines, lens: Lens, options: LocalisationOptions
) -> LabelLocalisation | None:
    """Localise a position without the boxes of other positions; None if no pose explains any box."""
    try:
        return localise_by_labels(boxes, outlines, lens, pose_beside(position, {}), options)
    except RegistrationError:
        return None


def _with_position(
    before: Localisations,
    position: str,
    boxes: np.ndarray,
    outlines: Outlines,
    lens: Lens,
    options: LocalisationOptions,
    alone: LabelLocalisation | None,
) -> Localisations:
    """Add a position and fit all poses and translations again, or refuse the position."""
    best = alone
    try:
        if alone is None or before.localised:  # the rocks have been moved since
            moved = translated(outlines, before.translations.metres)
            poses = {other: one.fit.sandbox_from_left for other, one in before.localised.items()}
            surveyed = pose_beside(position, poses)
            best = localise_by_labels(boxes, moved, lens, surveyed, options)
        assert best is not None
        after = _fitted({**before.localised, position: best}, before.translations, outlines, lens, options)
        checked(after.localised[position])
    except RegistrationError as error:
        return replace(before, refused={**before.refused, position: Refusal(error.reason, best)})
    return replace(after, refused=before.refused)


def _fitted(
    localised: Mapping[str, LabelLocalisation],
    start: Translations,
    outlines: Outlines,
    lens: Lens,
    options: LocalisationOptions,
) -> Localisations:
    """Fit all positions together with the translations of the rocks."""
    if not options.rock_translation_sd_mm:
        return Localisations(dict(localised), start, {})
    unknowns, translations = fit_translations(
        localised, outlines, lens, options.rock_translation_sd_mm / 1000, start.metres
    )
    moved = translated(outlines, translations.metres)
    after = {}
    for position, one in localised.items():
        fit = check_pose(pose_of(unknowns[position]), moved, one.boxes, lens, one.prior, FINAL_NOISE)
        after[position] = replace(one, fit=fit)
    return Localisations(after, translations, {})
