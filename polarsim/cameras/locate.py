"""Where every rig of a terrain stood: from scans, else from labels and meshes, else from the survey."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.cameras.labels import LabelPlacement
from polarsim.cameras.options import PlacementOptions
from polarsim.cameras.placements import Placements, place_all, untranslated_fits
from polarsim.cameras.rounding import rounded, rounded_figures
from polarsim.cameras.sandbox_frame import find_sandbox_frame
from polarsim.cameras.scans import register_scans
from polarsim.cameras.surveyed import pose_beside, surveyed_pose
from polarsim.cameras.translations import translation_table
from polarsim.errors import RegistrationError, within
from polarsim.formats import colmap, obj, tables
from polarsim.formats.files import writing_folder
from polarsim.formats.inventory import Inventory, read_inventory
from polarsim.formats.rigs import SURVEYED, PlacedRig, read_rig, write_placed
from polarsim.formats.rock_shifts import FILE as SHIFT_FILE
from polarsim.formats.scans import read_scan
from polarsim.formats.schemas import ALIGNMENT, MATCHES
from polarsim.formats.yolo import read_rock_boxes
from polarsim.geometry.consensus import consensus_boxes
from polarsim.geometry.outlines import outlines_of
from polarsim.geometry.poses import Pose, yaw_pitch_roll
from polarsim.geometry.stereo import StereoRig

log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Located:
    """What a way of placing rigs found, and the tables that show how well; file name -> table."""

    placed: dict[str, PlacedRig]
    details: dict[str, pd.DataFrame]


def locate_cameras(
    *,
    terrain: int,
    positions: Sequence[str],
    inventory: Path,
    calibration: Path,
    seeds: Path,
    cameras: Path,
    options: PlacementOptions,
    threads: int,
) -> None:
    """Place the rigs of a terrain and write the folder `cameras`: `PosX.json`, `colmap/`, and how well it went.

    Parameters
    ----------
    inventory, calibration : Path
        What the source has, and the rig's lenses.
    seeds : Path
        Folder of seed labels; those of the left camera are used, where there are no scans.
    threads : int
        Cores for Open3D.

    Raises
    ------
    RegistrationError
        Scans disagree, labels and meshes contradict each other, or nothing is known of a position.
    FormatError
        A file is not what it should be.
    """
    os.environ["OMP_NUM_THREADS"] = str(threads)  # read by Open3D's OpenMP when it is first loaded
    known, rig = read_inventory(inventory), read_rig(calibration)
    scanned = [position for position in positions if position in known.scanned]
    with within(f"Terrain{terrain:02d}"):
        if scanned:
            located = _locate_by_scans(known, scanned, rig)
        else:
            located = _locate_by_labels(known, positions, rig, seeds, options)
        placed = _completed(located.placed, positions, rig)
    with writing_folder(cameras) as folder:
        for position in sorted(placed):
            write_placed(folder / f"Pos{position}.json", placed[position])
        colmap.write_model(folder / "colmap", placed)
        for name, table in located.details.items():
            write = tables.write_csv if name.endswith(".csv") else tables.write_parquet
            write(folder / name, table)


def _locate_by_scans(known: Inventory, positions: list[str], rig: StereoRig) -> Located:
    scans = {position: read_scan(known, position, rig) for position in positions}
    network = register_scans(scans)
    for reason in network.refused:
        log.warning("%s; the scan is left out", reason)
    frame = find_sandbox_frame(network.points, network.normals, network.level_from_left)
    if not frame.walls:
        log.warning("no two walls of the box are seen in the scans: origin and heading are the survey's")
    placed = {}
    for position, level_from_left in network.level_from_left.items():
        pose = frame.sandbox_from_level @ level_from_left
        mine = [pair for pair in network.pairs if position in (pair.fixed, pair.moving)]
        quality = {"walls": float(frame.walls), "points": float(len(scans[position])), **_off_survey(position, pose)}
        if mine:
            quality |= {
                "fitness": max(pair.alignment.fitness for pair in mine),
                "rmse_mm": 1000 * min(pair.alignment.rmse for pair in mine),
                "agreement": max(pair.agreement for pair in mine),
                **_formal_errors(network.covariances[position], level_from_left.translation),
            }
        placed[position] = _placed(rig, pose, "scans", quality)
    rows = []
    for pair in network.pairs:
        laid = pair.alignment
        rows.append((f"{pair.fixed}-{pair.moving}", laid.fitness, 1000 * laid.rmse, laid.points, pair.agreement))
    return Located(placed, {"alignment.csv": pd.DataFrame(rows, columns=list(ALIGNMENT.columns))})


def _formal_errors(covariance: np.ndarray, place: np.ndarray) -> dict[str, float]:
    """Standard deviations of a tripod at `place` (3,), from the covariance (6, 6) of rotation and translation about the
    origin.

    They are relative to the mean of the terrain's scans, whose common frame rests on the walls or on the survey.
    """
    x, y, z = place
    lever = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])  # of the rotation's cross product with the place
    moves = np.hstack([lever, np.eye(3)])
    return {
        "sd_mm": float(1000 * np.sqrt(np.trace(moves @ covariance @ moves.T))),
        "sd_deg": float(np.degrees(np.sqrt(np.trace(covariance[:3, :3])))),
    }


def _locate_by_labels(
    known: Inventory, positions: Sequence[str], rig: StereoRig, seeds: Path, options: PlacementOptions
) -> Located:
    meshes = {rock: obj.read(path) for rock, path in known.rock_meshes().items()}
    outlines = outlines_of(meshes)
    annotated = read_rock_boxes(seeds, known.terrain)
    seen = {position: consensus_boxes(annotated.get(position, [])) for position in positions}
    found = place_all(seen, outlines, rig.left, options)
    _tell_refused(found)
    details = {}
    if options.rock_shift_sd_mm and found.placed:
        before = untranslated_fits(found, outlines, rig.left)
        fits = [one.fit for one in found.placed.values()]
        details[SHIFT_FILE] = translation_table(outlines.rocks, found.translations, before, fits)
    placed, rows = {}, []
    for position, placement in sorted(found.placed.items()):
        pose = placement.fit.sandbox_from_left
        quality = {**_label_quality(placement, len(outlines)), **_off_survey(position, pose)}
        placed[position] = _placed(rig, pose, "labels", quality)
        rows += _match_rows(position, placement, outlines.rocks)
    rows.sort(key=itemgetter(0, 1))
    return Located(placed, {**details, "matches.parquet": pd.DataFrame(rows, columns=list(MATCHES.columns))})


def _tell_refused(found: Placements) -> None:
    """Warn of positions that labels do not place; one view may be hopeless.

    Raises
    ------
    RegistrationError
        All are refused: these are other labels or other meshes.
    """
    reasons = [f"position {position}: {reason}" for position, reason in sorted(found.refused.items())]
    if reasons and not found.placed:
        raise RegistrationError(reasons[0])
    for reason in reasons:
        log.warning("%s", reason)


def _label_quality(placement: LabelPlacement, meshes: int) -> dict[str, float]:
    fit = placement.fit
    offset = _offsets(placement)
    sd = np.sqrt(np.diag(fit.covariance))
    return {
        "boxes": float(len(placement.boxes)),
        "meshes": float(meshes),
        "matched": float(len(fit.iou)),
        "mean_iou": float(fit.iou.mean()),
        "median_dx_px": float(np.median(np.abs(offset[:, 0]))),
        "median_dy_px": float(np.median(np.abs(offset[:, 1]))),
        "share": placement.share,
        "runner_up": placement.runner_up,
        "sd_mm": float(1000 * np.linalg.norm(sd[:3])),
        "sd_deg": float(np.degrees(np.linalg.norm(sd[3:]))),
    }


def _match_rows(position: str, placement: LabelPlacement, rocks: np.ndarray) -> list[tuple[Any, ...]]:
    """A row of `MATCHES` a pair; `rocks` (m,) are the numbers of the outlines."""
    fit = placement.fit
    seeds, meshes = placement.boxes[fit.box], fit.projected[fit.outline]
    pairs = zip(rocks[fit.outline].tolist(), seeds, meshes, fit.iou, _offsets(placement), strict=True)
    return [(position, rock, *seed, *mesh, overlap, *off) for rock, seed, mesh, overlap, off in pairs]


def _offsets(placement: LabelPlacement) -> np.ndarray:
    """(n, 2) of the projected boxes' centres from the annotated ones, pixels."""
    mesh, seed = placement.fit.projected[placement.fit.outline], placement.boxes[placement.fit.box]
    return np.asarray((mesh[:, :2] + mesh[:, 2:] - seed[:, :2] - seed[:, 2:]) / 2)


def _completed(placed: dict[str, PlacedRig], positions: Sequence[str], rig: StereoRig) -> dict[str, PlacedRig]:
    """Positions that neither scans nor labels place stand where the survey has them, moved as the others are."""
    complete = dict(placed)
    poses = {position: one.sandbox_from_left for position, one in placed.items()}
    for position in positions:
        if position in placed:
            continue
        pose = pose_beside(position, poses)
        if pose is None:
            raise RegistrationError(
                f"position {position} has no scan, no labels and meshes that place it, and no survey"
            )
        log.warning("position %s has neither a scan nor labels and meshes that place it: the survey does", position)
        complete[position] = _placed(rig, pose, SURVEYED, _off_survey(position, pose))
    return complete


def _placed(rig: StereoRig, pose: Pose, method: str, quality: Mapping[str, float]) -> PlacedRig:
    return PlacedRig(rig, rounded(pose), method, rounded_figures(dict(quality)))


def _off_survey(position: str, pose: Pose) -> dict[str, float]:
    """How far a tripod stands from its surveyed place, and its heading from the nominal one."""
    surveyed = surveyed_pose(position)
    if surveyed is None:
        return {}
    yaw = np.degrees(yaw_pitch_roll(pose)[0] - yaw_pitch_roll(surveyed)[0])
    return {
        "off_survey_m": float(np.linalg.norm(pose.translation - surveyed.translation)),
        "off_survey_deg": float((yaw + 180) % 360 - 180),
    }
