"""Where the Sun lamps of a terrain stood: `lamps.json` beside its rig poses, azimuth -> [x, y, z] in the sandbox."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, about
from polarsim.formats.files import read_json, write_json
from polarsim.formats.readers import reader
from polarsim.photo import SUNS
from polarsim.run_files.rigs import LocalisedRig, lift_of
from polarsim.survey import lamp_position

FILE = "lamps.json"


def write_suns(folder: str | Path, suns: Mapping[str, np.ndarray]) -> None:
    """Positions (3,) by azimuth, metres; written to a tenth of a millimetre."""
    write_json(Path(folder) / FILE, {name: [round(float(x), 4) for x in suns[name]] for name in sorted(suns)})


@reader("lamps")
def read_suns(folder: str | Path, localised: Mapping[str, LocalisedRig]) -> dict[str, np.ndarray]:
    """Position (3,) of every Sun lamp: where it was found, else where the survey has it.

    Parameters
    ----------
    folder : Path
        Folder of a terrain's rig poses, with or without the file.
    localised : position -> LocalisedRig
        These poses; they tell how high the survey lies.

    Raises
    ------
    FormatError
        The file is broken.
    """
    return surveyed_suns(localised) | read_found_suns(folder)


@reader("lamps")
def read_found_suns(folder: str | Path) -> dict[str, np.ndarray]:
    """Position (3,) of the Sun lamps that photos localise, by azimuth; the others stand where the survey has them.

    Raises
    ------
    FormatError
        The file is broken.
    """
    suns: dict[str, np.ndarray] = {}
    path = Path(folder) / FILE
    if not path.exists():
        return suns
    content = read_json(path)
    with about(path):
        if not isinstance(content, dict) or set(content) - set(SUNS):
            raise FormatError(f"expected positions by azimuth ({', '.join(SUNS)})")
        for azimuth, point in content.items():
            try:
                suns[azimuth] = np.array(point, float).reshape(3)
                if not np.isfinite(suns[azimuth]).all():
                    raise ValueError("not finite")
            except (TypeError, ValueError) as error:
                raise FormatError(f"{azimuth}: {point!r} is no position, expected three numbers") from error
    return suns


def surveyed_suns(localised: Mapping[str, LocalisedRig]) -> dict[str, np.ndarray]:
    """Positions (3,) of the survey, as high as a terrain's rigs tell."""
    lift = lift_of(localised)
    return {azimuth: lamp_position(azimuth, lift) for azimuth in SUNS}
