"""Localisation of all positions of a terrain by seed boxes, most certain first, with translations of the rocks.

Published meshes were cut and placed by hand: most are accurate to millimetres, some are off by centimetres. The boxes
of a position improve the positions of the rocks, which helps to localise the next position.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from polarsim.cameras.labels import FINAL_NOISE, MIN_BOXES, LabelLocalisation, check_localisation, localise_by_labels
from polarsim.cameras.options import LocalisationOptions
from polarsim.cameras.refine import BoxFit, check_pose, pose_of_unknowns
from polarsim.cameras.search import SearchRanges
from polarsim.cameras.surveyed import offset_surveyed_pose
from polarsim.cameras.translations import Translations, fit_translations, no_translations, translated
from polarsim.errors import RegistrationError
from polarsim.geometry.lens import Lens
from polarsim.geometry.outlines import Outlines
from polarsim.geometry.poses import Pose
from polarsim.site_parts import Tripod

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
    seen: Mapping[str, np.ndarray],
    outlines: Outlines,
    lens: Lens,
    options: LocalisationOptions,
    tripods: Mapping[str, Tripod],
    max_error_m: float,
    ranges: SearchRanges,
) -> Localisations:
    """Localise positions by rock boxes (b, 4) of left photos; skip positions with too few boxes or meshes.

    `max_error_m`: maximum distance of a camera from its surveyed position, metres.
    """
    usable = [position for position, boxes in seen.items() if min(len(boxes), len(outlines)) >= MIN_BOXES]
    result = Localisations({}, no_translations(outlines, options.rock_translation_sd_mm / 1000), {})
    separately = {
        position: _localise_separately(
            seen[position], outlines, lens, offset_surveyed_pose(position, {}, tripods), ranges
        )
        for position in usable
    }
    surest_first = sorted(
        usable, key=lambda position: (-(one.share if (one := separately[position]) else 0.0), position)
    )
    for position in surest_first:
        poses = {other: localisation.fit.sandbox_from_left for other, localisation in result.localised.items()}
        surveyed = offset_surveyed_pose(position, poses, tripods)
        boxes, alone = seen[position], separately[position]
        result = _add_position(result, position, boxes, outlines, lens, options, alone, surveyed, max_error_m, ranges)
    return result


def untranslated_fits(result: Localisations, outlines: Outlines, lens: Lens) -> list[BoxFit]:
    """Return fits of the boxes of the localised positions to the original meshes, at the same poses."""
    return [
        check_pose(
            localisation.fit.sandbox_from_left, outlines, localisation.boxes, lens, localisation.prior, FINAL_NOISE
        )
        for localisation in result.localised.values()
    ]


def _localise_separately(
    boxes: np.ndarray,
    outlines: Outlines,
    lens: Lens,
    surveyed: Pose | None,
    ranges: SearchRanges,
) -> LabelLocalisation | None:
    """Localise a position without the boxes of other positions; None if no pose explains any box."""
    try:
        return localise_by_labels(boxes, outlines, lens, surveyed, ranges)
    except RegistrationError:
        return None


def _add_position(
    before: Localisations,
    position: str,
    boxes: np.ndarray,
    outlines: Outlines,
    lens: Lens,
    options: LocalisationOptions,
    separately: LabelLocalisation | None,
    surveyed: Pose | None,
    max_error_m: float,
    ranges: SearchRanges,
) -> Localisations:
    """Add a position and fit all poses and translations again, or refuse the position."""
    best = separately
    try:
        if separately is None or before.localised:  # the rocks have been moved since
            moved = translated(outlines, before.translations.metres)
            best = localise_by_labels(boxes, moved, lens, surveyed, ranges)
        assert best is not None
        after = _fit_jointly({**before.localised, position: best}, before.translations, outlines, lens, options)
        check_localisation(after.localised[position], max_error_m)
    except RegistrationError as error:
        return replace(before, refused={**before.refused, position: Refusal(error.reason, best)})
    return replace(after, refused=before.refused)


def _fit_jointly(
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
    for position, localisation in localised.items():
        fit = check_pose(
            pose_of_unknowns(unknowns[position]), moved, localisation.boxes, lens, localisation.prior, FINAL_NOISE
        )
        after[position] = replace(localisation, fit=fit)
    return Localisations(after, translations, {})
