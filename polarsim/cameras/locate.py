"""Localisation of all rigs of a terrain: by scans, by labels and meshes, or by the survey."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

from polarsim.cameras.localisation_result import LocalisationResult, localised_rig
from polarsim.cameras.locate_by_labels import locate_by_labels
from polarsim.cameras.locate_by_scans import locate_by_scans
from polarsim.cameras.options import LocalisationOptions
from polarsim.cameras.surveyed import expected_survey_pose
from polarsim.errors import RegistrationError, with_part
from polarsim.formats import colmap, tables
from polarsim.formats.files import writing_folder
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import Terrain, terrain_text
from polarsim.run_files.inventory import read_inventory
from polarsim.run_files.rigs import PITCH_SD, SURVEYED, LocalisedRig, read_rig, write_localised
from polarsim.site import Site
from polarsim.site_parts import Tripod

_NOT_LOCALISED = "localised neither by a scan, nor by labels and meshes, nor by the survey"
log = logging.getLogger("polarsim")


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
            located = locate_by_scans(source, scanned, rig, ranges, site, tripods)
        else:
            located = locate_by_labels(source, positions, rig, seeds, options, site, tripods)
        localised = _complete_positions(located, positions, rig, tripods)
    with writing_folder(cameras) as folder:
        for position in sorted(localised):
            write_localised(folder / f"Pos{position}.json", localised[position])
        colmap.write_model(folder / "colmap", localised)
        for name, table in located.details.items():
            write = tables.write_csv if name.endswith(".csv") else tables.write_parquet
            write(folder / name, table)


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
        complete[position] = localised_rig(rig, position, pose, SURVEYED, {PITCH_SD: pitch_sd}, tripods)
    if not complete:
        raise RegistrationError(f"positions {', '.join(positions)}: {_NOT_LOCALISED}")
    return complete
