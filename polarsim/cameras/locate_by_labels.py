"""Localisation of the rigs of labelled positions of a terrain with meshes, and tables of the fits."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.cameras.labels import LabelLocalisation, is_plausible
from polarsim.cameras.localisation_result import LocalisationResult, localised_rig
from polarsim.cameras.localisations import Localisations, localise_all, untranslated_fits
from polarsim.cameras.options import LocalisationOptions
from polarsim.cameras.search import SearchRanges
from polarsim.cameras.translations import translation_table
from polarsim.formats import obj
from polarsim.formats.yolo import read_rock_boxes
from polarsim.geometry.consensus import consensus_boxes
from polarsim.geometry.outlines import outlines_of
from polarsim.geometry.stereo import StereoRig
from polarsim.run_files.inventory import Inventory
from polarsim.run_files.rigs import UNCERTAIN_LABELS, LocalisedRig
from polarsim.run_files.rock_translations import FILE as TRANSLATION_FILE
from polarsim.schemas.stages import MATCHES
from polarsim.site import Site
from polarsim.site_parts import Tripod

log = logging.getLogger("polarsim")


def locate_by_labels(
    source: Inventory,
    positions: Sequence[str],
    rig: StereoRig,
    seeds: Path,
    options: LocalisationOptions,
    site: Site,
    tripods: Mapping[str, Tripod],
) -> LocalisationResult:
    """Localise the rigs whose rock boxes in `seeds` fit the published meshes of the terrain."""
    meshes = {rock: obj.read_obj(path) for rock, path in source.rock_meshes().items()}
    outlines = outlines_of(meshes)
    annotated = read_rock_boxes(seeds, source.terrain, (rig.left.width, rig.left.height))
    seen = {position: consensus_boxes(annotated.get(position, [])) for position in positions}
    ranges, max_error_m = SearchRanges.of(site.sandbox_of(source.terrain), tripods), site.max_survey_error_m
    result = localise_all(seen, outlines, rig.left, options, tripods, max_error_m, ranges)
    _warn_refused(result)
    details = {}
    if options.rock_translation_sd_mm and result.localised:
        before = untranslated_fits(result, outlines, rig.left)
        fits = [localisation.fit for localisation in result.localised.values()]
        details[TRANSLATION_FILE] = translation_table(outlines.rocks, result.translations, before, fits)

    def rig_of(position: str, localisation: LabelLocalisation, method: str) -> LocalisedRig:
        pose, metrics = localisation.fit.sandbox_from_left, _label_metrics(localisation, len(outlines))
        return localised_rig(rig, position, pose, method, metrics, tripods)

    localised = {
        position: rig_of(position, localisation, "labels")
        for position, localisation in sorted(result.localised.items())
    }
    unconfirmed = {
        position: rig_of(position, guess, UNCERTAIN_LABELS)
        for position, refusal in sorted(result.refused.items())
        if (guess := refusal.best) is not None and is_plausible(guess, max_error_m)
    }
    rows = [
        row
        for position, localisation in result.localised.items()
        for row in _match_rows(position, localisation, outlines.rocks)
    ]
    rows.sort(key=itemgetter(0, 1))
    matches = pd.DataFrame(rows, columns=list(MATCHES.columns))
    return LocalisationResult(localised, {**details, "matches.parquet": matches}, unconfirmed)


def _warn_refused(result: Localisations) -> None:
    """Log a warning for each position that labels do not localise."""
    for position, refusal in sorted(result.refused.items()):
        log.warning("position %s: %s", position, refusal.reason)
    if result.refused and not result.localised:
        log.warning("labels and meshes localise no position: check that they belong to the same terrain")


def _label_metrics(localisation: LabelLocalisation, meshes: int) -> dict[str, float]:
    fit = localisation.fit
    offset = _offsets(localisation)
    sd = np.sqrt(np.diag(fit.covariance))
    return {
        "boxes": float(len(localisation.boxes)),
        "meshes": float(meshes),
        "matched": float(len(fit.iou)),
        "mean_iou": float(fit.iou.mean()),
        "median_dx_px": float(np.median(np.abs(offset[:, 0]))),
        "median_dy_px": float(np.median(np.abs(offset[:, 1]))),
        "share": localisation.share,
        "runner_up": localisation.runner_up,
        "sd_mm": float(1000 * np.linalg.norm(sd[:3])),
        "sd_deg": float(np.degrees(np.linalg.norm(sd[3:]))),
    }


def _match_rows(position: str, localisation: LabelLocalisation, rocks: np.ndarray) -> list[tuple[Any, ...]]:
    """Return a row of `MATCHES` for each pair; `rocks` (m,) are the rock numbers of the outlines."""
    fit = localisation.fit
    seeds, meshes = localisation.boxes[fit.box], fit.projected[fit.outline]
    pairs = zip(rocks[fit.outline].tolist(), seeds, meshes, fit.iou, _offsets(localisation), strict=True)
    return [(position, rock, *seed, *mesh, overlap, *off) for rock, seed, mesh, overlap, off in pairs]


def _offsets(localisation: LabelLocalisation) -> np.ndarray:
    """Return offsets (n, 2) from the centres of annotated boxes to the centres of projected boxes, pixels."""
    mesh, seed = localisation.fit.projected[localisation.fit.outline], localisation.boxes[localisation.fit.box]
    return np.asarray((mesh[:, :2] + mesh[:, 2:] - seed[:, :2] - seed[:, 2:]) / 2)
