"""Table `rocks.parquet` with a row per rock, for scanned and for published meshes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import pandas as pd

from polarsim.formats.tables import typed
from polarsim.rocks.overrides import Cuboid
from polarsim.schemas.stages import ROCKS


def row(
    rock: int,
    cuboid: Cuboid,
    *,
    size: float,
    height: float,
    volume: float,
    source: str,
    points: Mapping[str, int] | None = None,
    visible_share: float = math.nan,
    scan_translation: float = math.nan,
    confirmed: Sequence[str] = (),
) -> dict[str, object]:
    """Return the row of a rock.

    `cuboid`: its centre is the centre of the rock.
    `points`, position -> int: points of each scan; empty for published meshes.
    `visible_share`: share of its plan that was scanned.
    `scan_translation`: maximum translation of a scan in the alignment on this rock, metres; NaN without alignment.
    `confirmed`: positions with a seed box that matches the rock.
    """
    x, y, z = (cuboid.low + cuboid.high) / 2
    points = points or {}
    return {
        "rock": rock, "x": x, "y": y, "z": z,
        "size_m": size, "height_m": height, "volume_m3": volume, "points": sum(points.values()),
        "points_by_scan": " ".join(f"{position}:{count}" for position, count in sorted(points.items())),
        "visible_share": visible_share, "scan_translation_mm": 1000 * scan_translation,
        **dict(zip(("x0", "y0", "z0", "x1", "y1", "z1"), (*cuboid.low, *cuboid.high), strict=True)),
        "source": source, "confirmed": " ".join(confirmed),
    }  # fmt: skip


def rock_table(rows: Sequence[Mapping[str, object]]) -> pd.DataFrame:
    """Rows in the order of ids, to a tenth of a millimetre; also when there are none."""
    table = typed(rows, ROCKS)
    rounded = {name: 4 for name, kind in ROCKS.dtypes.items() if kind == "float64" and name != "volume_m3"}
    return table.round({**rounded, "volume_m3": 7}).sort_values("rock", ignore_index=True)
