"""Positions of the Sun lamps of a terrain: `lamps.json` next to the rig poses, azimuth -> [x, y, z], sandbox frame."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, with_path
from polarsim.formats.files import read_json, write_json
from polarsim.formats.readers import reader
from polarsim.photo import Terrain
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.survey import survey_lift
from polarsim.site import Site
from polarsim.site_parts import FAR_M

FILE = "lamps.json"
USUAL_DISTANCE_M = 4.0  # of lamps from the centre; errors of positions at this distance define those of directions


def is_directional(lamp: np.ndarray) -> bool:
    """Return whether a position (3,) in the sandbox frame, metres, stands for a direction, see `site.FAR_M`."""
    return float(np.linalg.norm(lamp)) > FAR_M / 2


def error_scale(lamp: np.ndarray) -> float:
    """Return the factor of errors of a lamp's position, metres: 1 for a lamp near the sandbox.

    A directional lamp has the angular errors of a lamp at the usual distance.
    """
    return float(np.linalg.norm(lamp)) / USUAL_DISTANCE_M if is_directional(lamp) else 1.0


def write_suns(folder: str | Path, suns: Mapping[str, np.ndarray]) -> None:
    """Write positions (3,) by azimuth, metres, rounded to 0.1 mm."""
    write_json(Path(folder) / FILE, {name: [round(float(x), 4) for x in suns[name]] for name in sorted(suns)})


@reader("lamps")
def read_suns(
    folder: str | Path, localised: Mapping[str, LocalisedRig], site: Site, terrain: Terrain
) -> dict[str, np.ndarray]:
    """Read the position (3,) of every Sun lamp of the site. Lamps that are not localised have the surveyed position.

    Parameters
    ----------
    folder : Path
        Folder of the rig poses of a terrain, with or without the file.
    localised : position -> LocalisedRig
        The rig poses, from which the height of the survey is computed.
    """
    found = read_localised_suns(folder)
    if unknown := sorted(set(found) - set(site.lamps)):
        known = ", ".join(site.lamps) or "none"
        raise FormatError(f"lamp {unknown[0]!r}, expected {known} of the site {site.name}", path=Path(folder) / FILE)
    return surveyed_suns(localised, site, terrain) | found


@reader("lamps")
def read_localised_suns(folder: str | Path) -> dict[str, np.ndarray]:
    """Read the positions (3,) of the Sun lamps that were localised with photos, by azimuth."""
    suns: dict[str, np.ndarray] = {}
    path = Path(folder) / FILE
    if not path.exists():
        return suns
    content = read_json(path)
    with with_path(path):
        if not isinstance(content, dict):
            raise FormatError("expected positions by the name of a lamp")
        for azimuth, point in content.items():
            try:
                suns[azimuth] = np.array(point, float).reshape(3)
                if not np.isfinite(suns[azimuth]).all():
                    raise ValueError("not finite")
            except (TypeError, ValueError) as error:
                raise FormatError(f"{azimuth}: the position is {point!r}, expected three numbers") from error
    return suns


def surveyed_suns(localised: Mapping[str, LocalisedRig], site: Site, terrain: Terrain) -> dict[str, np.ndarray]:
    """Return the surveyed positions (3,) of the lamps, shifted to the height that the rigs of a terrain imply."""
    lift = survey_lift(localised, site.tripods_of(terrain), site.max_survey_error_m)
    return {name: np.array(lamp.point) + np.array([0.0, 0.0, lift]) for name, lamp in site.lamps.items()}
