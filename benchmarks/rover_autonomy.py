"""Drives in which the rover decides, one after the other, by the workflow's own functions: what they touch and cost.

`python benchmarks/rover_autonomy.py MESHES OUT --terrains 4 1 11 3 8 12 [--modes truth] [--seeds 40] [--minutes 60]`

A folder a drive, as the rule `drive_alone` makes it. Drives that are there are kept, so a call that ran out of its
minutes goes on with the next. Modes that take no pictures (truth, blind) drive once a seed, whatever the Suns.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import pandas as pd

from polarsim.formats import tables
from polarsim.formats.schemas import EVERY_AUTONOMY
from polarsim.rover.autonomy.cases import cases
from polarsim.rover.autonomy.options import AutonomyOptions
from polarsim.rover.autonomy.table import drive_case, summary
from polarsim.rover.cameras.options import OnboardOptions
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.world.options import WorldOptions

CONFIG = Path(__file__).parents[1] / "config"


def drives(asked: argparse.Namespace, options: AutonomyOptions) -> list[pd.DataFrame]:
    """Figures of all drives that there was time for."""
    begun, found = time.monotonic(), []
    for case in cases(options):
        folder = asked.out / case
        path = folder / "figures.parquet"
        if not path.exists():
            if time.monotonic() - begun > 60 * asked.minutes:
                continue
            drive_case(
                case=case,
                meshes=asked.meshes,
                folder=folder,
                world=WorldOptions(terrains=tuple(asked.terrains)),
                soil=SoilOptions(table=CONFIG / "soils.csv"),
                drive_options=DriveOptions(vehicle=CONFIG / "viper.yaml"),
                options=options,
                onboard=OnboardOptions(weights="packaged"),
            )
        own = tables.read_parquet(path, EVERY_AUTONOMY.columns)
        found.append(own)
        value = own.set_index("metric")["value"]
        print(
            f"{case}: {own['ended'].iloc[0]} after {value['time']:.1f} s, {value['collisions']:.0f} collisions, "
            f"closest {value['closest pass of a rock above 10 cm']:.3f} m, "
            f"{value['CPU for a second driven']:.2f} s of CPU a second",
            flush=True,
        )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--terrains", type=int, nargs="+", default=[3, 1, 11])
    parser.add_argument("--modes", nargs="+", default=["truth"])
    parser.add_argument("--suns", nargs="+", default=["3"])
    parser.add_argument(
        "--exposures", nargs="+", default=[256.0], type=lambda text: text if text == "auto" else float(text)
    )
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--minutes", type=float, default=60)
    asked = parser.parse_args()
    options = AutonomyOptions(
        modes=tuple(asked.modes),
        suns=tuple(asked.suns),
        exposures_ms=tuple(asked.exposures),
        seeds=tuple(range(asked.seeds)),
        longest_s=80 * len(asked.terrains),  # a terrain takes half a minute without stops
    )
    together = summary(pd.concat(drives(asked, options), ignore_index=True))
    print(together.to_string(index=False, float_format="%.4g"))


if __name__ == "__main__":
    main()
