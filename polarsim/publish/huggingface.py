"""Folders and Parquet files that Hugging Face's `datasets` reads; written without it, so that publishing needs no hub.

A configuration a domain, a split a part. Pictures keep their 16 bits; beside each stands a map of ids.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from polarsim.formats import png
from polarsim.formats.tables import key_columns
from polarsim.photo import BOX_CLASSES
from polarsim.publish import records, terms
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue, Picture
from polarsim.publish.detection_sets import UNASSIGNED

SPLITS = {"train": "train", "val": "validation", "test": "test", "": UNASSIGNED}
SHARD = 400 * 10**6  # bytes of pictures a Parquet file
_GROUP = 32  # pictures a row group: readers hold one in memory
_LABEL = {
    "bbox": "bbox", "category": "int64", "rock": "int64", "shadow_of": "int64", "source": "string",
    "confidence": "float64", "origin": "string", "mask_rle": "string", "amodal_rle": "string",
    "visible_share": "float64",
}  # fmt: skip
_PICTURE = {
    "key": "string", "domain": "string", "terrain": "int64", "position": "string", "light": "string",
    "azimuth": "string", "camera": "string", "exposure_ms": "int64", "origin": "string",
    "sandbox_from_camera": "matrix", "lens": "matrix",
}  # fmt: skip


def bytes_of(picture: Picture) -> int:
    return picture.path.stat().st_size + 40_000  # ids, and its line


def write_folder(catalogue: Catalogue, bundle: Bundle) -> None:
    """`<domain>/<split>/KEY.png`, its ids, and `metadata.parquet`, which the loader `imagefolder` joins to them.

    Parquet states the columns' types; of lines of JSON the loader guesses them, and finds splits that do not go
    together where no picture of one has a label.
    """
    for (domain, split), pictures in _splits(catalogue).items():
        lines = []
        for one in pictures:
            name, ids = f"{one.key}.png", f"ids/{one.key}.png"
            bundle.copy(f"{domain}/{split}/{name}", one.path)
            _write_ids(catalogue, bundle, one, f"{domain}/{split}/{ids}")
            lines.append({"file_name": name, "ids_file_name": ids, **row_of(catalogue, one)})
        bundle.make(f"{domain}/{split}/metadata.parquet", partial(_write_metadata, lines))


def write_parquet(catalogue: Catalogue, bundle: Bundle) -> None:
    """`<domain>/<split>-00000-of-00001.parquet` with the pictures' own bytes inside."""
    for (domain, split), pictures in _splits(catalogue).items():
        shards = _shards(pictures)
        for number, shard in enumerate(shards):
            name = f"{domain}/{split}-{number:05d}-of-{len(shards):05d}.parquet"
            bundle.make(name, partial(_write_shard, catalogue, shard), _sources(catalogue, shard))


def row_of(catalogue: Catalogue, picture: Picture) -> dict[str, Any]:
    """All that is said of a picture but its pixels."""
    camera = catalogue.camera(picture)
    pose = camera.world_from_camera.matrix.tolist() if camera else []
    lens = []
    if camera:
        one = camera.lens
        lens = [[one.fx, 0.0, one.cx], [0.0, one.fy, one.cy], list(one.distortion)]
    objects = [
        {
            "bbox": _bbox(row),
            "category": BOX_CLASSES.index(row["kind"]),
            **{name: row[name] for name in _LABEL if name not in ("bbox", "category")},
        }
        for row in records.label_rows(catalogue, picture)
    ]
    return {
        **key_columns(picture.key),
        "domain": picture.domain,
        "origin": catalogue.picture_origin(picture),
        "sandbox_from_camera": pose,
        "lens": lens,
        "objects": objects,
    }


def _bbox(row: Mapping[str, Any]) -> list[float]:
    """x, y, width, height."""
    return [row["x0"], row["y0"], round(row["x1"] - row["x0"], 3), round(row["y1"] - row["y0"], 3)]


def front(catalogue: Catalogue, parquet: bool) -> str:
    """The head of the card that the hub and the library read: which files are which configuration and split."""
    lines = [
        "---",
        "license: other" if "real" in catalogue.domains else "license: cc0-1.0",
        f"pretty_name: {terms.title(catalogue)}",
        "task_categories:",
        "- object-detection",
        "- image-segmentation",
        "- depth-estimation",
        "configs:",
    ]
    for domain in catalogue.domains:
        lines += [f"- config_name: {domain}", *([] if parquet else ["  drop_labels: true"]), "  data_files:"]
        for own, split in _splits(catalogue):
            if own == domain:
                lines += [f"  - split: {split}", f"    path: {domain}/{split}{'-*.parquet' if parquet else '/**'}"]
    return "\n".join([*lines, "---", "", ""])


def _splits(catalogue: Catalogue) -> dict[tuple[str, str], list[Picture]]:
    found: dict[tuple[str, str], list[Picture]] = {}
    for one in catalogue.pictures:
        found.setdefault((one.domain, SPLITS[one.part]), []).append(one)
    return dict(sorted(found.items()))


def _write_ids(catalogue: Catalogue, bundle: Bundle, picture: Picture, name: str) -> None:
    exact = catalogue.instances(picture)
    if exact:
        bundle.copy(name, exact)
    else:
        bundle.png(name, lambda: records.id_map(catalogue, picture), catalogue.sources(picture))


def _sources(catalogue: Catalogue, pictures: list[Picture]) -> list[Path]:
    return [path for one in pictures for path in catalogue.sources(one)]


def _shards(pictures: list[Picture]) -> list[list[Picture]]:
    shards: list[list[Picture]] = [[]]
    held = 0
    for one in pictures:
        size = one.path.stat().st_size
        if held and held + size > SHARD:
            shards.append([])
            held = 0
        shards[-1].append(one)
        held += size
    return shards


def _write_shard(catalogue: Catalogue, pictures: list[Picture], path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    schema = _schema()
    with parquet.ParquetWriter(path, schema, compression="none", write_statistics=False) as writer:
        for start in range(0, len(pictures), _GROUP):
            rows = list(_full_rows(catalogue, pictures[start : start + _GROUP]))
            writer.write_table(pa.Table.from_pylist(rows, schema))


def _full_rows(catalogue: Catalogue, pictures: list[Picture]) -> Iterator[dict[str, Any]]:
    for one in pictures:
        exact = catalogue.instances(one)
        ids = exact.read_bytes() if exact else png.encode(records.id_map(catalogue, one))
        yield {
            "image": {"bytes": one.path.read_bytes(), "path": f"{one.key}.png"},
            "ids": {"bytes": ids, "path": f"{one.key}_ids.png"},
            **row_of(catalogue, one),
        }


def _write_metadata(rows: list[dict[str, Any]], path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    fields = {"file_name": pa.string(), "ids_file_name": pa.string(), **_fields()}
    table = pa.Table.from_pylist(rows, pa.schema(fields))
    parquet.write_table(table, path, compression="none", write_statistics=False)


def _fields() -> dict[str, Any]:
    """Arrow's types of what `row_of` says."""
    import pyarrow as pa

    label = pa.struct({name: _arrow(kind) for name, kind in _LABEL.items()})
    return {**{name: _arrow(kind) for name, kind in _PICTURE.items()}, "objects": pa.list_(label)}


def _schema() -> Any:
    """Arrow's, with what `datasets` calls features in its metadata."""
    import pyarrow as pa

    image = pa.struct({"bytes": pa.binary(), "path": pa.string()})
    fields = {"image": image, "ids": image, **_fields()}
    features = {
        "image": {"_type": "Image"},
        "ids": {"_type": "Image"},
        **{name: _feature(kind) for name, kind in _PICTURE.items()},
        "objects": {"feature": {name: _feature(kind) for name, kind in _LABEL.items()}, "_type": "List"},
    }
    features["objects"]["feature"]["category"] = {"names": list(BOX_CLASSES), "_type": "ClassLabel"}
    return pa.schema(fields, metadata={"huggingface": json.dumps({"info": {"features": features}})})


def _arrow(kind: str) -> Any:
    import pyarrow as pa

    if kind == "matrix":
        return pa.list_(pa.list_(pa.float64()))
    return pa.list_(pa.float64(), 4) if kind == "bbox" else pa.type_for_alias(kind)


def _feature(kind: str) -> dict[str, Any]:
    number = {"dtype": "float64", "_type": "Value"}
    if kind == "matrix":
        return {"feature": {"feature": number, "_type": "List"}, "_type": "List"}
    return {"feature": number, "length": 4, "_type": "List"} if kind == "bbox" else {"dtype": kind, "_type": "Value"}
