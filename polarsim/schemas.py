"""The columns of tables that one package writes and another one reads: type and unit of each, in order.

`docs/formats.md` ends with them; `markdown` makes that end.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain


@dataclass(frozen=True)
class Schema:
    """A table: where it lies below a run's results, and its columns."""

    path: str  # as `docs/formats.md` names it; `TT` stands for a terrain
    dtypes: dict[str, str]  # type of each column as pandas names it, by name and in order
    units: dict[str, str]  # unit of a column, by name: px, mm, degrees ...; one without a unit is not among them

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, in order."""
        return tuple(self.dtypes)


_TYPES = {"s": "str", "i": "int64", "f": "float64", "b": "bool"}
_KEY = "key:s terrain:i position:s light:s azimuth:s camera:s exposure_ms:i:ms"
_BOX = "x0:f:px y0:f:px x1:f:px y1:f:px"


def _schema(path: str, *columns: str) -> Schema:
    """A schema out of words `name:type` or `name:type:unit`."""
    words = [word.split(":") for word in chain.from_iterable(map(str.split, columns))]
    return Schema(
        path,
        {name: _TYPES[kind] for name, kind, *_ in words},
        {name: unit[0] for name, _, *unit in words if unit},
    )


PHOTOS = _schema("acquire/TerrainTT/photos.parquet", _KEY, "width:i:px height:i:px bits:i sha256:s path:s")
LABELS = _schema("labels/labels.parquet", _KEY, "kind:s rock:i source:s confidence:f", _BOX)
MATCHES = _schema(
    "cameras/TerrainTT/matches.parquet",
    "position:s rock:i seed_x0:f:px seed_y0:f:px seed_x1:f:px seed_y1:f:px",
    "mesh_x0:f:px mesh_y0:f:px mesh_x1:f:px mesh_y1:f:px iou:f dx_px:f:px dy_px:f:px",
)
ALIGNMENT = _schema("cameras/TerrainTT/alignment.csv", "pair:s fitness:f rmse_mm:f:mm points:i agreement:f")
ROCKS = _schema(
    "rocks/TerrainTT/rocks.parquet",
    "rock:i x:f:m y:f:m z:f:m size_m:f:m height_m:f:m volume_m3:f:m3 points:i points_by_scan:s visible_share:f",
    "scan_translation_mm:f:mm x0:f:m y0:f:m z0:f:m x1:f:m y1:f:m z1:f:m source:s confirmed:s",
)
PREDICTIONS = _schema(
    "detect/<split>/seed<seed>/predictions/<trained>_on_<evaluated>.parquet", "key:s kind:s confidence:f", _BOX
)
CURVES = _schema("detect/curves.parquet", "trained:s evaluated:s kind:s iou:f recall:f precision:f")
INSTANCES = _schema("detect/instances.parquet", "trained:s evaluated:s key:s kind:s rock:i iou:f area_px:f:px2")
COVER_FOUND = _schema(
    "covers/folds/FOLD/seedN/TRAINED/found.parquet",
    "key:s width:i:px kind:s confidence:f x0:f:px y0:f:px x1:f:px y1:f:px",
)
# Whose figures a row of cover scores has: one training's, the mean of all, those of all merged. These two have no seed.
ONE, MEAN, MERGED = "one", "mean", "merged"
# On what these detectors were trained: scenes alone, or labelled photos of other terrains after them.
RENDERED, FINE_TUNED = "rendered", "fine_tuned"
NO_SEED = -1
COVER_SCORES = _schema(
    "covers/TRAINED/scores.parquet",
    "trained:s terrain:s kind:s detectors:s seed:i detector:s start:s epochs:i folds:i pictures:i images:i labels:i",
    "map50:f map50_low:f map50_high:f map50_95:f iou_mean:f calibration_error:f",
)
MASK_SCORES = _schema(
    "covers/mask_scores.parquet", "key:s region:s kind:s photos:i pixels:i:px iou:f iou_low:f iou_high:f"
)
OFFSETS = _schema("evaluation/offsets_TerrainTT.parquet", "rock:i x:f:m y:f:m z:f:m offset_mm:f:mm")
LABEL_PAIRS = _schema(
    "evaluation/label_pairs_TerrainTT.parquet",
    _KEY,
    "task:s kind:s annotated:b hit:b iou:f iou_best:f truth_px:f:px label_px:f:px rock:i source:s confidence:f",
    _BOX,
    "true_x0:f:px true_y0:f:px true_x1:f:px true_y1:f:px against:s",
)
TWIN_PAIRS = _schema(
    "evaluation/twin_pairs_TerrainTT.parquet",
    _KEY,
    "model:s lit_px:i:px log2_twin_over_photo:f:stops log2_difference:f:stops ssim:f",
)
EVERY_DRIVE = _schema("rover/every_drive.parquet", "seed:i control:s ended:s metric:s unit:s value:f")
DRIVES = _schema("rover/drives.parquet", "control:s metric:s wheel:s unit:s seeds:i mean:f low:f high:f least:f most:f")
ONBOARD = _schema(
    "rover/onboard.parquet",
    "source:s model:s exposure_ms:f:ms metric:s height_m:f:m from_m:f:m to_m:f:m value:f low:f high:f rides:i count:f",
)
_DECIDES = "mode:s sun:s exposure:s lights:s model:s detector:s"
COLLISION, TOUCH, STOP = "collision", "touch", "stop"  # what an event is
HIGH_M = 0.10  # a touch of a rock above is a collision
AUTONOMY_EVENTS = _schema(
    "rover/autonomy/<drive>/events.parquet", "what:s time_s:f:s x_m:f:m y_m:f:m rock:i height_m:f:m"
)
EVERY_AUTONOMY = _schema("rover/every_autonomy.parquet", _DECIDES, "seed:i ended:s metric:s unit:s value:f")
AUTONOMY = _schema("rover/autonomy.parquet", _DECIDES, "metric:s unit:s drives:i seeds:i value:f low:f high:f")
AUTONOMY_EFFECTS = _schema(
    "rover/autonomy_effects.parquet",
    "mode:s axis:s level:s metric:s unit:s seeds:i value:f low:f high:f change:f change_low:f change_high:f",
)
AUTONOMY_DETECTORS = _schema(
    "rover/autonomy_detectors.parquet",
    "mode:s detector:s drives:i seeds:i ipd:f map50:f rock_f1:f collisions:f success:f rock_points:f",
)
AUTONOMY_RANK = _schema(
    "rover/autonomy_rank.parquet",
    "mode:s gap:s drive:s detectors:i drives:i units:i unit:s spearman:f spearman_low:f spearman_high:f",
    "kendall:f kendall_low:f kendall_high:f kendall_p:f says:s",
)
SOIL_LIMIT = _schema(
    "rover/soil_limit.parquet",
    "wheel:s soil:s cell_m:f:m slip:f sinkage_mm:f:mm sinkage_limit_mm:f:mm pull_n:f:N pull_limit_n:f:N",
    "torque_n_m:f:Nm torque_limit_n_m:f:Nm",
)
SOIL_MEASURED = _schema("rover/soil_measured.parquet", "rig:s soil:s slip:f slope_deg:f:degrees model_deg:f:degrees")
SOIL_CHECKS = _schema(
    "rover/soil_checks.parquet", "source:s quantity:s unit:s soil:s condition:s at:f expected:f model:f"
)
SCHEMAS = (
    PHOTOS, LABELS, MATCHES, ALIGNMENT, ROCKS, PREDICTIONS, CURVES, INSTANCES, COVER_FOUND, COVER_SCORES, MASK_SCORES,
    OFFSETS, LABEL_PAIRS, TWIN_PAIRS, EVERY_DRIVE, DRIVES, ONBOARD, AUTONOMY_EVENTS, EVERY_AUTONOMY, AUTONOMY,
    AUTONOMY_EFFECTS, AUTONOMY_DETECTORS, AUTONOMY_RANK, SOIL_LIMIT, SOIL_MEASURED, SOIL_CHECKS,
)  # fmt: skip


def markdown() -> str:
    """The columns of all tables, a table each, as `docs/formats.md` ends with them."""
    parts = []
    for schema in SCHEMAS:
        rows = [f"| `{name}` | {kind} | {schema.units.get(name, '')} |" for name, kind in schema.dtypes.items()]
        parts.append("\n".join([f"`{schema.path}`", "", "| column | type | unit |", "|---|---|---|", *rows]))
    return "\n\n".join(parts) + "\n"
