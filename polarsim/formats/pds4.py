"""PDS4 products: raw arrays and delimited tables with their XML labels, as NASA's Planetary Data System archives them.

An array lies in its file row by row, highest byte first; a table is text with commas. A label states type, unit and
meaning of every value. Labels name no time of their making: same content, same bytes.
"""

from __future__ import annotations

import csv
import hashlib
import io
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
MISSING = -999999.0  # of a number that is not known; its field's label says so
Node = ElementTree.Element


@dataclass(frozen=True)
class Identity:
    """Who a product is."""

    lid: str  # logical identifier, without a version
    title: str
    description: str  # what it is, its frames, and whether its values were measured, fitted or made up
    citation: tuple[str, str] | None = None  # authors and year; bundles, collections and documents must have one


@dataclass(frozen=True)
class Column:
    """A column of a table, as its label states it."""

    name: str
    unit: str
    description: str


@dataclass(frozen=True)
class Observed:
    """Of what an observation tells, and with what."""

    level: str  # Raw, Calibrated or Derived
    target: str
    instrument: str
    investigation: str


def node(tag: str, *children: Node | str | int | float, **attributes: str) -> Node:
    """An element with elements or one text in it."""
    made = ElementTree.Element(tag, attributes)
    for child in children:
        if isinstance(child, Node):
            made.append(child)
        else:
            made.text = str(child)
    return made


def label(kind: str, identity: Identity, *areas: Node) -> bytes:
    """A product's label: its class, who it is, and what follows."""
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
    authors, year = identity.citation
    parts = (
        node("author_list", authors),
        node("publication_year", year),
        node("description", identity.description),
    )
    return [node("Citation_Information", *parts)]


def observation(identity: Identity, observed: Observed) -> Node:
    """What was observed; nobody states when."""
    return node(
        "Observation_Area",
        node("comment", identity.description),
        node(
            "Time_Coordinates",
            node("start_date_time", **{"xsi:nil": "true", "nilReason": "unknown"}),
            node("stop_date_time", **{"xsi:nil": "true", "nilReason": "unknown"}),
        ),
        node(
            "Primary_Result_Summary",
            node("purpose", "Science"),
            node("processing_level", observed.level),
            node("description", identity.description),
        ),
        node(
            "Investigation_Area",
            node("name", observed.investigation),
            node("type", "Individual Investigation"),
            _reference("urn:nasa:pds:context:investigation:individual.none", "data_to_investigation"),
        ),
        node(
            "Observing_System",
            node("Observing_System_Component", node("name", observed.instrument), node("type", "Instrument")),
        ),
        node("Target_Identification", node("name", observed.target), node("type", "Laboratory Analog")),
    )


def _reference(lid: str, kind: str) -> Node:
    return node("Internal_Reference", node("lid_reference", lid), node("reference_type", kind))


def file_node(path: Path, name: str, records: int | None = None) -> Node:
    """A file as its label states it: name, size and checksum."""
    content = path.read_bytes()
    parts = [
        node("file_name", name),
        node("file_size", len(content), unit="byte"),
        *([node("records", records)] if records is not None else []),
        node("md5_checksum", hashlib.md5(content, usedforsecurity=False).hexdigest()),  # PDS4 knows no other
    ]
    return node("File", *parts)


def array_bytes(values: np.ndarray) -> bytes:
    """(h, w) or (bands, h, w) values, highest byte first."""
    return values.astype(values.dtype.newbyteorder(">")).tobytes()


def array_area(
    path: Path, name: str, shape: Sequence[int], dtype: np.dtype, unit: str, description: str, scale: float = 1.0
) -> Node:
    """Where an array lies: axes from the slowest to the fastest; a value times `scale` is in `unit`."""
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
    """Comma between values, CR LF behind a row; `MISSING` where a number is not known: readers take nothing for 0."""
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\r\n")
    for row in table.itertuples(index=False):
        rows.writerow([MISSING if isinstance(value, float) and np.isnan(value) else value for value in row])
    return out.getvalue().encode("utf-8")


def table_area(path: Path, name: str, table: pd.DataFrame, columns: Iterable[Column], description: str) -> Node:
    """Where a table lies, and what its columns mean."""
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
