"""Folders and Parquet files for Hugging Face's `datasets`, written without this package.

There is a configuration per domain and a split per part. Images have 16 bits and an instance map each.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from polarsim.formats.tables import key_columns
from polarsim.photo import BOX_CLASSES, Terrain
from polarsim.publish import records, terms
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue, CatalogueImage
from polarsim.publish.detection_sets import UNASSIGNED

SPLITS = {"train": "train", "val": "validation", "test": "test", "": UNASSIGNED}
SHARD = 400 * 10**6  # maximum size of the images in a Parquet file, bytes
_GROUP = 32  # images per row group, the unit that readers load into memory
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


def write_folder(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write images `<domain>/<split>/KEY.png`, instance maps, and `metadata.parquet` for the loader `imagefolder`.

    Parquet stores the types of columns. With JSON lines, the loader infers types per split, which fails for a split
    without labels.
    """
    for (domain, split), pictures in _splits(catalogue).items():
        lines = []
        for picture in pictures:
            name, ids = f"{picture.key}.png", f"ids/{picture.key}.png"
            bundle.copy(f"{domain}/{split}/{name}", picture.path)
            exact = catalogue.instances(picture)
            sources = [exact] if exact else catalogue.sources(picture)
            bundle.make(f"{domain}/{split}/{ids}", partial(_write_ids, catalogue, picture), sources)
            lines.append({"file_name": name, "ids_file_name": ids, **row_of(catalogue, picture)})
        bundle.make(f"{domain}/{split}/metadata.parquet", partial(_write_metadata, lines))


def write_parquet_folder(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `<domain>/<split>-00000-of-00001.parquet` with the images included."""
    for (domain, split), pictures in _splits(catalogue).items():
        shards = _shards(pictures)
        for number, shard in enumerate(shards):
            name = f"{domain}/{split}-{number:05d}-of-{len(shards):05d}.parquet"
            sources = [path for picture in shard for path in catalogue.sources(picture)]
            bundle.make(name, partial(_write_shard, catalogue, shard), sources)


def row_of(catalogue: Catalogue, picture: CatalogueImage) -> dict[str, Any]:
    """Return the metadata of an image: key, origin, camera and labels."""
    camera = catalogue.camera(picture)
    pose = camera.world_from_camera.matrix.tolist() if camera else []
    matrix = []
    if camera:
        lens = camera.lens
        matrix = [[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], list(lens.distortion)]
    objects = [
        {
            "bbox": _bbox(row),
            "category": BOX_CLASSES.index(row["kind"]),
            **{name: row[name] for name in _LABEL if name not in ("bbox", "category")},
        }
        for row in records.image_label_rows(catalogue, picture)
    ]
    return {
        **key_columns(picture.key),
        "domain": picture.domain,
        "origin": catalogue.picture_origin(picture),
        "sandbox_from_camera": pose,
        "lens": matrix,
        "objects": objects,
    }


def _bbox(row: Mapping[str, Any]) -> list[float]:
    """Return x, y, width and height of a box."""
    return [row["x0"], row["y0"], round(row["x1"] - row["x0"], 3), round(row["y1"] - row["y0"], 3)]


def front(catalogue: Catalogue, parquet: bool) -> str:
    """Return the front matter of the data card: files by configuration and split."""
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
        for domain_of_split, split in _splits(catalogue):
            if domain_of_split == domain:
                lines += [f"  - split: {split}", f"    path: {domain}/{split}{'-*.parquet' if parquet else '/**'}"]
    return "\n".join([*lines, "---", "", ""])


def _splits(catalogue: Catalogue) -> dict[tuple[str, str], list[CatalogueImage]]:
    splits: dict[tuple[str, str], list[CatalogueImage]] = {}
    for picture in catalogue.pictures:
        splits.setdefault((picture.domain, SPLITS[picture.part]), []).append(picture)
    return dict(sorted(splits.items()))


def _write_ids(catalogue: Catalogue, picture: CatalogueImage, path: Path) -> None:
    path.write_bytes(records.encoded_ids(catalogue, picture))


def _shards(pictures: list[CatalogueImage]) -> list[list[CatalogueImage]]:
    shards: list[list[CatalogueImage]] = [[]]
    shard_size = 0
    for picture in pictures:
        size = picture.path.stat().st_size
        if shard_size and shard_size + size > SHARD:
            shards.append([])
            shard_size = 0
        shards[-1].append(picture)
        shard_size += size
    return shards


def _write_shard(catalogue: Catalogue, pictures: list[CatalogueImage], path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    schema = _schema(pictures[0].key.terrain)
    with parquet.ParquetWriter(path, schema, compression="none", write_statistics=False) as writer:
        for start in range(0, len(pictures), _GROUP):
            rows = list(_full_rows(catalogue, pictures[start : start + _GROUP]))
            writer.write_table(pa.Table.from_pylist(rows, schema))


def _full_rows(catalogue: Catalogue, pictures: list[CatalogueImage]) -> Iterator[dict[str, Any]]:
    for picture in pictures:
        ids = records.encoded_ids(catalogue, picture)
        yield {
            "image": {"bytes": picture.path.read_bytes(), "path": f"{picture.key}.png"},
            "ids": {"bytes": ids, "path": f"{picture.key}_ids.png"},
            **row_of(catalogue, picture),
        }


def _write_metadata(rows: list[dict[str, Any]], path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    fields = {"file_name": pa.string(), "ids_file_name": pa.string(), **_fields(rows[0]["terrain"])}
    table = pa.Table.from_pylist(rows, pa.schema(fields))
    parquet.write_table(table, path, compression="none", write_statistics=False)


def _picture(terrain: Terrain) -> dict[str, str]:
    """Return the types of the columns of an image; those of terrains are numbers or names like `terrain`."""
    return _PICTURE | ({"terrain": "string"} if isinstance(terrain, str) else {})


def _fields(terrain: Terrain) -> dict[str, Any]:
    """Return the Arrow types of `row_of`."""
    import pyarrow as pa

    label = pa.struct({name: _arrow(kind) for name, kind in _LABEL.items()})
    return {**{name: _arrow(kind) for name, kind in _picture(terrain).items()}, "objects": pa.list_(label)}


def _schema(terrain: Terrain) -> Any:
    """Return the Arrow schema with the features of `datasets` in the metadata."""
    import pyarrow as pa

    image = pa.struct({"bytes": pa.binary(), "path": pa.string()})
    fields = {"image": image, "ids": image, **_fields(terrain)}
    features = {
        "image": {"_type": "Image"},
        "ids": {"_type": "Image"},
        **{name: _feature(kind) for name, kind in _picture(terrain).items()},
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
