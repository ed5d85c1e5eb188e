"""Localisation of all rigs of a terrain: by scans, by labels and meshes, or by the survey."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.cameras.labels import LabelLocalisation, is_plausible
from polarsim.cameras.localisations import Localisations, localise_all, untranslated_fits
from polarsim.cameras.options import LocalisationOptions
from polarsim.cameras.rounding import rounded, rounded_metrics
from polarsim.cameras.sandbox_frame import SandboxFrame, find_sandbox_frame
from polarsim.cameras.scans import Network, place_scans, register_scans
from polarsim.cameras.search import SearchRanges
from polarsim.cameras.search_area import SearchArea
from polarsim.cameras.small_box import small_box_frame
from polarsim.cameras.surveyed import expected_survey_pose
from polarsim.cameras.translations import translation_table
from polarsim.errors import RegistrationError, with_part
from polarsim.formats import colmap, obj, tables
from polarsim.formats.files import writing_folder
from polarsim.formats.yolo import read_rock_boxes
from polarsim.geometry.consensus import consensus_boxes
from polarsim.geometry.outlines import outlines_of
from polarsim.geometry.poses import Pose, yaw_pitch_roll
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import Terrain, terrain_text
from polarsim.run_files.inventory import Inventory, read_inventory
from polarsim.run_files.rigs import (
    FRAME_OF_SURVEY,
    PITCH_SD,
    STEREO,
    SURVEYED,
    UNCERTAIN_LABELS,
    LocalisedRig,
    read_all_localised,
    read_rig,
    write_localised,
)
from polarsim.run_files.rock_translations import FILE as TRANSLATION_FILE
from polarsim.run_files.scans import read_scan
from polarsim.run_files.survey import surveyed_pose, surveyed_poses
from polarsim.schemas.stages import ALIGNMENT, MATCHES
from polarsim.site import Site
from polarsim.site_parts import Sandbox, Tripod

_NOT_LOCALISED = "localised neither by a scan, nor by labels and meshes, nor by the survey"
log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class LocalisationResult:
    """Localised rigs, and tables of their quality by file name."""

    localised: dict[str, LocalisedRig]
    details: dict[str, pd.DataFrame]
    unconfirmed: Mapping[str, LocalisedRig] = field(default_factory=dict)  # unconfirmed poses of further positions


def locate_cameras(
    *,
    site: Site,
    terrain: Terrain,
    positions: Sequence[str],
    inventory: Path,
    calibration: Path,
    seeds: Path,
    cameras: Path,
    options: LocalisationOptions,
    ranges: Path | None = None,
) -> None:
    """Localise the rigs of a terrain and write the folder `cameras`: `PosX.json`, `colmap/` and tables of quality.

    The seed labels of the left camera are used if there are no scans. `ranges`: folder of range maps from photos, with
    the relative poses of positions that show the same ground.
    """
    source, rig = read_inventory(inventory), read_rig(calibration)
    tripods = site.tripods_of(terrain)
    scanned = [position for position in positions if position in source.scanned]
    with with_part(f"Terrain{terrain_text(terrain)}"):
        if scanned:
            located = _locate_by_scans(source, scanned, rig, ranges, site, tripods)
        else:
            located = _locate_by_labels(source, positions, rig, seeds, options, site, tripods)
        localised = _complete_positions(located, positions, rig, tripods)
    with writing_folder(cameras) as folder:
        for position in sorted(localised):
            write_localised(folder / f"Pos{position}.json", localised[position])
        colmap.write_model(folder / "colmap", localised)
        for name, table in located.details.items():
            write = tables.write_csv if name.endswith(".csv") else tables.write_parquet
            write(folder / name, table)


def _locate_by_scans(
    source: Inventory,
    positions: list[str],
    rig: StereoRig,
    ranges: Path | None,
    site: Site,
    tripods: Mapping[str, Tripod],
) -> LocalisationResult:
    scans = {position: read_scan(source, position, rig, site.files) for position in positions}
    surveyed, sandbox = surveyed_poses(tripods), site.sandbox_of(source.terrain)
    area = SearchArea.of(site, source.terrain)
    placed = {} if ranges is None else read_all_localised(ranges)
    if set(scans) <= set(placed):
        network = place_scans(scans, {name: placed[name].sandbox_from_left for name in scans}, area)
    else:
        network = register_scans(scans, surveyed, area)
    for reason in network.refused:
        log.warning("%s; the scan is excluded", reason)
    frame = _frame(network, surveyed, sandbox)
    localised = {}
    for position, level_from_left in network.level_from_left.items():
        pose = frame.sandbox_from_level @ level_from_left
        mine = [pair for pair in network.pairs if position in (pair.fixed, pair.moving)]
        metrics = {"walls": float(frame.walls), "points": float(len(scans[position]))}
        if mine:
            metrics |= {
                "fitness": max(pair.alignment.fitness for pair in mine),
                "rmse_mm": 1000 * min(pair.alignment.rmse for pair in mine),
                "agreement": max(pair.agreement for pair in mine),
                **_formal_errors(network.covariances[position], level_from_left.translation),
            }
        method = "scans" if ranges is None else STEREO
        method += "" if frame.walls else FRAME_OF_SURVEY
        localised[position] = _rounded_rig(rig, position, pose, method, metrics, tripods)
    rows = []
    for pair in network.pairs:
        alignment = pair.alignment
        rows.append(
            (f"{pair.fixed}-{pair.moving}", alignment.fitness, 1000 * alignment.rmse, alignment.points, pair.agreement)
        )
    return LocalisationResult(localised, {"alignment.csv": pd.DataFrame(rows, columns=list(ALIGNMENT.columns))})


def _frame(network: Network, surveyed: Mapping[str, Pose], sandbox: Sandbox) -> SandboxFrame:
    """Return the sandbox frame by a raised box, by walls, or by the survey, see `find_sandbox_frame`."""
    if sandbox.raised:
        points = np.concatenate([network.points[position] for position in sorted(network.points)])
        pose = small_box_frame(points, np.array(sandbox.half_width_m), network.level_from_left.values())
        if pose is not None:
            return SandboxFrame(pose, 4)
        size = " x ".join(f"{2 * half:g}" for half in sandbox.half_width_m)
        log.warning("the scans show no box of sand of %s m on the floor", size)
    frame = find_sandbox_frame(network.points, network.normals, network.level_from_left, surveyed, sandbox)
    if not surveyed:
        reason = "+X points to the camera of the first position" if frame.walls else "origin and heading are arbitrary"
        log.warning("%s, because no tripod of this terrain was surveyed", reason)
    elif not frame.walls and any(sandbox.walls_m.values()):
        log.warning("the scans do not show the walls that define origin and heading: both are taken from the survey")
    elif not frame.walls:
        log.info("the sandbox has no walls: origin and heading are fitted to the surveyed tripods")
    return frame


def _formal_errors(covariance: np.ndarray, position: np.ndarray) -> dict[str, float]:
    """Return the standard deviations of a tripod at `position` (3,), from the covariance (6, 6) of rotation and
    translation about the origin.

    They are relative to the mean of all scans; the error of the frame from walls or survey is not included.
    """
    x, y, z = position
    lever = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])  # of the rotation's cross product with the position
    moves = np.hstack([lever, np.eye(3)])
    return {
        "sd_mm": float(1000 * np.sqrt(np.trace(moves @ covariance @ moves.T))),
        "sd_deg": float(np.degrees(np.sqrt(np.trace(covariance[:3, :3])))),
    }


def _locate_by_labels(
    source: Inventory,
    positions: Sequence[str],
    rig: StereoRig,
    seeds: Path,
    options: LocalisationOptions,
    site: Site,
    tripods: Mapping[str, Tripod],
) -> LocalisationResult:
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

    def localised_rig(position: str, localisation: LabelLocalisation, method: str) -> LocalisedRig:
        pose, metrics = localisation.fit.sandbox_from_left, _label_metrics(localisation, len(outlines))
        return _rounded_rig(rig, position, pose, method, metrics, tripods)

    localised = {
        position: localised_rig(position, localisation, "labels")
        for position, localisation in sorted(result.localised.items())
    }
    unconfirmed = {
        position: localised_rig(position, guess, UNCERTAIN_LABELS)
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


def _complete_positions(
    located: LocalisationResult, positions: Sequence[str], rig: StereoRig, tripods: Mapping[str, Tripod]
) -> dict[str, LocalisedRig]:
    """Add the most likely pose for each position without a confirmed pose.

    It is the pose suggested by labels or, without labels, the surveyed pose with the mean offset of the terrain's
    localised positions. The survey does not include some positions of terrain 13: photos may localise them later.
    """
    complete = dict(located.localised)
    poses = {position: other.sandbox_from_left for position, other in located.localised.items()}
    for position in positions:
        if position in complete:
            continue
        if position in located.unconfirmed:
            log.warning("position %s: its pose is suggested by labels and meshes, but not confirmed", position)
            complete[position] = located.unconfirmed[position]
            continue
        likely = expected_survey_pose(position, poses, tripods)
        if likely is None:
            log.warning("position %s: %s; photos may localise it", position, _NOT_LOCALISED)
            continue
        log.warning("position %s has neither a scan nor enough labels and meshes: its surveyed pose is used", position)
        pose, pitch_sd = likely
        complete[position] = _rounded_rig(rig, position, pose, SURVEYED, {PITCH_SD: pitch_sd}, tripods)
    if not complete:
        raise RegistrationError(f"positions {', '.join(positions)}: {_NOT_LOCALISED}")
    return complete


def _rounded_rig(
    rig: StereoRig,
    position: str,
    pose: Pose,
    method: str,
    metrics: Mapping[str, float],
    tripods: Mapping[str, Tripod],
) -> LocalisedRig:
    offsets = _survey_offsets(position, pose, tripods)
    return LocalisedRig(rig, rounded(pose), method, rounded_metrics({**metrics, **offsets}))


def _survey_offsets(position: str, pose: Pose, tripods: Mapping[str, Tripod]) -> dict[str, float]:
    """Return distance and heading difference between a tripod and its surveyed pose."""
    if position not in tripods:
        return {}
    surveyed = surveyed_pose(tripods[position])
    yaw = np.degrees(yaw_pitch_roll(pose)[0] - yaw_pitch_roll(surveyed)[0])
    return {
        "off_survey_m": float(np.linalg.norm(pose.translation - surveyed.translation)),
        "off_survey_deg": float((yaw + 180) % 360 - 180),
    }
