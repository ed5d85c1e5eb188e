"""Products of NASA's Planetary Data System (PDS4): arrays and delimited tables with XML labels.

Arrays are stored row by row in big-endian order, tables as comma-separated text. The label states type, unit and
description of every value. Labels have no creation time, so that equal content makes equal bytes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd

NAMESPACE = "http://pds.nasa.gov/pds4/pds/v1"
MODEL_VERSION = "1.21.0.0"
_SCHEMA = "https://pds.nasa.gov/pds4/pds/v1/PDS4_PDS_1L00"
_HEAD = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    f'<?xml-model href="{_SCHEMA}.sch" schematypens="http://purl.oclc.org/dsdl/schematron"?>\n'
)
_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_TYPES = {"u1": "UnsignedByte", "u2": "UnsignedMSB2", "f4": "IEEE754MSBSingle"}
MISSING = -999999.0  # value of a missing number; declared in the label of the field
Node = ElementTree.Element


@dataclass(frozen=True)
class Identity:
    """Identifier, title, description and citation of a product."""

    lid: str  # logical identifier, without a version
    title: str
    description: str  # content, frames, and whether values are measured, fitted or simulated
    citation: tuple[str, str] | None = None  # authors and year; bundles, collections and documents must have one


@dataclass(frozen=True)
class Column:
    """Column of a table as stated in the label."""

    name: str
    unit: str
    description: str


def node(tag: str, *children: Node | str | int | float, **attributes: str) -> Node:
    """Return an XML element with child elements or a text."""
    element = ElementTree.Element(tag, attributes)
    for child in children:
        if isinstance(child, Node):
            element.append(child)
        else:
            element.text = str(child)
    return element


def label(kind: str, identity: Identity, *areas: Node) -> bytes:
    """Return the label of a product: class, identification area and further areas."""
    identification = node(
        "Identification_Area",
        node("logical_identifier", identity.lid),
        node("version_id", "1.0"),
        node("title", identity.title),
        node("information_model_version", MODEL_VERSION),
        node("product_class", kind),
        *_citation(identity),
    )
    root = node(kind, identification, *areas)
    root.set("xmlns", NAMESPACE)
    root.set("xmlns:xsi", _XSI)
    root.set("xsi:schemaLocation", f"{NAMESPACE} {_SCHEMA}.xsd")
    ElementTree.indent(root)
    return _HEAD.encode() + ElementTree.tostring(root, encoding="utf-8") + b"\n"


def _citation(identity: Identity) -> list[Node]:
    if identity.citation is None:
        return []
    authors, year = node("author_list", identity.citation[0]), node("publication_year", identity.citation[1])
    return [node("Citation_Information", authors, year, node("description", identity.description))]


def observation(identity: Identity, level: str, target: str, instrument: str, investigation: str) -> Node:
    """Return the observation area of a product of a level (Raw, Calibrated or Derived). The time is unknown."""
    return node(
        "Observation_Area",
        node("comment", identity.description),
        node(
            "Time_Coordinates",
            *(
                node(name, **{"xsi:nil": "true", "nilReason": "unknown"})
                for name in ("start_date_time", "stop_date_time")
            ),
        ),
        node(
            "Primary_Result_Summary",
            node("purpose", "Science"),
            node("processing_level", level),
            node("description", identity.description),
        ),
        node(
            "Investigation_Area",
            node("name", investigation),
            node("type", "Individual Investigation"),
            node(
                "Internal_Reference",
                node("lid_reference", "urn:nasa:pds:context:investigation:individual.none"),
                node("reference_type", "data_to_investigation"),
            ),
        ),
        node(
            "Observing_System",
            node("Observing_System_Component", node("name", instrument), node("type", "Instrument")),
        ),
        node("Target_Identification", node("name", target), node("type", "Laboratory Analog")),
    )


def file_node(path: Path, name: str, records: int | None = None) -> Node:
    """Return the element of a file: name, size and checksum."""
    content = path.read_bytes()
    parts = [
        node("file_name", name),
        node("file_size", len(content), unit="byte"),
        *([node("records", records)] if records is not None else []),
        node("md5_checksum", hashlib.md5(content, usedforsecurity=False).hexdigest()),  # the only checksum of PDS4
    ]
    return node("File", *parts)


def array_bytes(values: np.ndarray) -> bytes:
    """Return the big-endian bytes of values (h, w) or (bands, h, w)."""
    return values.astype(values.dtype.newbyteorder(">")).tobytes()


def array_area(
    path: Path, name: str, shape: Sequence[int], dtype: np.dtype, unit: str, description: str, scale: float = 1.0
) -> Node:
    """Return the file area of an array with axes from slowest to fastest. A value times `scale` is in `unit`."""
    names = ("Band", "Line", "Sample")[-len(shape) :]
    element = [node("data_type", _TYPES[f"{dtype.kind}{dtype.itemsize}"])]
    element += [node("unit", unit)] if unit else []
    element += [node("scaling_factor", repr(scale))] if scale != 1 else []
    axes = [
        node("Axis_Array", node("axis_name", axis), node("elements", size), node("sequence_number", number))
        for number, (axis, size) in enumerate(zip(names, shape, strict=True), 1)
    ]
    return node(
        "File_Area_Observational",
        file_node(path, name),
        node(
            f"Array_{len(shape)}D_Image",
            node("local_identifier", "image"),
            node("offset", 0, unit="byte"),
            node("axes", len(shape)),
            node("axis_index_order", "Last Index Fastest"),
            node("description", description),
            node("Element_Array", *element),
            *axes,
        ),
    )


def table_bytes(table: pd.DataFrame) -> bytes:
    """Return a table as comma-separated text. Missing numbers are `MISSING`, because readers parse empty text as 0."""
    return table.to_csv(header=False, index=False, lineterminator="\r\n", na_rep=str(MISSING)).encode("utf-8")


def table_area(path: Path, name: str, table: pd.DataFrame, columns: Iterable[Column], description: str) -> Node:
    """Return the file area of a table with the descriptions of the columns."""
    fields = []
    for number, column in enumerate(columns, 1):
        parts = [node("name", column.name), node("field_number", number), node("data_type", _type(table[column.name]))]
        parts += [node("unit", column.unit)] if column.unit else []
        parts.append(node("description", column.description))
        if table[column.name].isna().any():
            parts.append(node("Special_Constants", node("missing_constant", MISSING)))
        fields.append(node("Field_Delimited", *parts))
    return node(
        "File_Area_Observational",
        file_node(path, name, len(table)),
        node(
            "Table_Delimited",
            node("local_identifier", "table"),
            node("offset", 0, unit="byte"),
            node("parsing_standard_id", "PDS DSV 1"),
            node("description", description),
            node("records", len(table)),
            node("record_delimiter", "Carriage-Return Line-Feed"),
            node("field_delimiter", "Comma"),
            node("Record_Delimited", node("fields", len(fields)), node("groups", 0), *fields),
        ),
    )


def _type(column: pd.Series) -> str:
    if pd.api.types.is_bool_dtype(column):
        return "ASCII_Boolean"
    if pd.api.types.is_integer_dtype(column):
        return "ASCII_Integer"
    return "ASCII_Real" if pd.api.types.is_float_dtype(column) else "UTF8_String"
