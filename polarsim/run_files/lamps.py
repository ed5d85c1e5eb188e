"""Positions of the Sun lamps of a terrain: `lamps.json` next to the rig poses, azimuth -> [x, y, z], sandbox frame."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, with_path
from polarsim.formats.files import read_json, write_json
from polarsim.formats.readers import reader
from polarsim.photo import SUNS
from polarsim.run_files.rigs import LocalisedRig, lift_of
from polarsim.survey import lamp_position

FILE = "lamps.json"


def write_suns(folder: str | Path, suns: Mapping[str, np.ndarray]) -> None:
    """Write positions (3,) by azimuth, metres, rounded to 0.1 mm."""
    write_json(Path(folder) / FILE, {name: [round(float(x), 4) for x in suns[name]] for name in sorted(suns)})


@reader("lamps")
def read_suns(folder: str | Path, localised: Mapping[str, LocalisedRig]) -> dict[str, np.ndarray]:
    """Read the position (3,) of every Sun lamp. Lamps that are not localised have the surveyed position.

    Parameters
    ----------
    folder : Path
        Folder of the rig poses of a terrain, with or without the file.
    localised : position -> LocalisedRig
        The rig poses, from which the height of the survey is computed.
    """
    return surveyed_suns(localised) | read_localised_suns(folder)


@reader("lamps")
def read_localised_suns(folder: str | Path) -> dict[str, np.ndarray]:
    """Read the positions (3,) of the Sun lamps that were localised with photos, by azimuth."""
    suns: dict[str, np.ndarray] = {}
    path = Path(folder) / FILE
    if not path.exists():
        return suns
    content = read_json(path)
    with with_path(path):
        if not isinstance(content, dict) or set(content) - set(SUNS):
            raise FormatError(f"expected positions by azimuth ({', '.join(SUNS)})")
        for azimuth, point in content.items():
            try:
                suns[azimuth] = np.array(point, float).reshape(3)
                if not np.isfinite(suns[azimuth]).all():
                    raise ValueError("not finite")
            except (TypeError, ValueError) as error:
                raise FormatError(f"{azimuth}: the position is {point!r}, expected three numbers") from error
    return suns


def surveyed_suns(localised: Mapping[str, LocalisedRig]) -> dict[str, np.ndarray]:
    """Return the surveyed positions (3,), shifted to the height that the rigs of a terrain imply."""
    lift = lift_of(localised)
    return {azimuth: lamp_position(azimuth, lift) for azimuth in SUNS}
