"""All positions of a terrain placed by seed boxes, the surest first; rocks that stand off their places move along.

Published meshes were cut and placed by hand: most stand within millimetres, some off by centimetres. What the boxes of
a position tell of the rocks helps to place the next one.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from polarsim.cameras.labels import FINAL_NOISE, MIN_BOXES, LabelPlacement, checked, place_by_labels
from polarsim.cameras.options import PlacementOptions
from polarsim.cameras.refine import BoxFit, check_pose, pose_of
from polarsim.cameras.surveyed import pose_beside
from polarsim.cameras.translations import Translations, fit_translations, no_translations, translated
from polarsim.errors import RegistrationError
from polarsim.geometry.lens import Lens
from polarsim.geometry.outlines import Outlines

log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Placements:
    """Where positions stand, where rocks do, and why positions were refused."""

    placed: dict[str, LabelPlacement]
    translations: Translations
    refused: dict[str, str]  # position -> reason


def place_all(seen: Mapping[str, np.ndarray], outlines: Outlines, lens: Lens, options: PlacementOptions) -> Placements:
    """Place every position whose boxes and meshes suffice.

    Parameters
    ----------
    seen : position -> (b, 4) float
        Rock boxes of the left photos, pixels.

    Returns
    -------
    Placements
        Positions with too few boxes or meshes are neither placed nor refused.
    """
    usable = [position for position, boxes in seen.items() if min(len(boxes), len(outlines)) >= MIN_BOXES]
    found = Placements({}, no_translations(outlines, options.rock_shift_sd_mm / 1000), {})
    alone = {position: _alone(position, seen[position], outlines, lens, options) for position in usable}
    surest_first = sorted(usable, key=lambda position: (-(one.share if (one := alone[position]) else 0.0), position))
    for position in surest_first:
        found = _with_position(found, position, seen[position], outlines, lens, options, alone[position])
    return found


def untranslated_fits(found: Placements, outlines: Outlines, lens: Lens) -> list[BoxFit]:
    """What the boxes of the placed positions say of the meshes as they are, seen from the same poses."""
    return [
        check_pose(one.fit.sandbox_from_left, outlines, one.boxes, lens, one.prior, FINAL_NOISE)
        for one in found.placed.values()
    ]


def _alone(
    position: str, boxes: np.ndarray, outlines: Outlines, lens: Lens, options: PlacementOptions
) -> LabelPlacement | None:
    """A position by itself, without what others tell of rocks; None where nothing is explained."""
    try:
        return place_by_labels(boxes, outlines, lens, pose_beside(position, {}), options)
    except RegistrationError:
        return None


def _with_position(
    before: Placements,
    position: str,
    boxes: np.ndarray,
    outlines: Outlines,
    lens: Lens,
    options: PlacementOptions,
    alone: LabelPlacement | None,
) -> Placements:
    """One more position, and all poses and translations fitted anew; or one more that is refused."""
    try:
        if alone is None or before.placed:  # others have told of the rocks since
            moved = translated(outlines, before.translations.metres)
            poses = {other: one.fit.sandbox_from_left for other, one in before.placed.items()}
            surveyed = pose_beside(position, poses)
            alone = place_by_labels(boxes, moved, lens, surveyed, options)
        after = _fitted({**before.placed, position: alone}, before.translations, outlines, lens, options)
        checked(after.placed[position])
    except RegistrationError as error:
        return replace(before, refused={**before.refused, position: error.reason})
    return replace(after, refused=before.refused)


def _fitted(
    placed: Mapping[str, LabelPlacement], start: Translations, outlines: Outlines, lens: Lens, options: PlacementOptions
) -> Placements:
    """All positions placed together with translations of the rocks."""
    if not options.rock_shift_sd_mm:
        return Placements(dict(placed), start, {})
    unknowns, translations = fit_translations(placed, outlines, lens, options.rock_shift_sd_mm / 1000, start.metres)
    moved = translated(outlines, translations.metres)
    after = {}
    for position, one in placed.items():
        fit = check_pose(pose_of(unknowns[position]), moved, one.boxes, lens, one.prior, FINAL_NOISE)
        after[position] = replace(one, fit=fit)
    return Placements(after, translations, {})
