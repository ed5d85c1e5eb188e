"""Localisation of the rigs of scanned positions: registered scans in the frame of the sandbox."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.cameras.localisation_result import LocalisationResult, localised_rig
from polarsim.cameras.sandbox_frame import SandboxFrame, find_sandbox_frame
from polarsim.cameras.scans import Network, place_scans, register_scans
from polarsim.cameras.search_area import SearchArea
from polarsim.cameras.small_box import small_box_frame
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig
from polarsim.geometry.vectors import cross_matrices
from polarsim.run_files.inventory import Inventory
from polarsim.run_files.rigs import FRAME_OF_SURVEY, STEREO, read_all_localised
from polarsim.run_files.scans import read_scan
from polarsim.run_files.survey import surveyed_poses
from polarsim.schemas.stages import ALIGNMENT
from polarsim.site import Site
from polarsim.site_parts import Sandbox, Tripod

log = logging.getLogger("polarsim")


def locate_by_scans(
    source: Inventory,
    positions: list[str],
    rig: StereoRig,
    ranges: Path | None,
    site: Site,
    tripods: Mapping[str, Tripod],
) -> LocalisationResult:
    """Localise the rigs at scanned positions; `ranges`: see `locate.locate_cameras`."""
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
        localised[position] = localised_rig(rig, position, pose, method, metrics, tripods)
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
    moves = np.hstack([-cross_matrices(position[None])[0], np.eye(3)])
    return {
        "sd_mm": float(1000 * np.sqrt(np.trace(moves @ covariance @ moves.T))),
        "sd_deg": float(np.degrees(np.sqrt(np.trace(covariance[:3, :3])))),
    }
