"""A PDS4 bundle: pictures and maps of ids as raw arrays, tables, browse pictures, the card; a label beside each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import pds4, png
from polarsim.formats.pds4 import Column, Identity, Observed, node
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.publish import records, terms
from polarsim.publish.bundle import Bundle
from polarsim.publish.card import card
from polarsim.publish.catalogue import MAPS, Catalogue, Origin, Picture
from polarsim.publish.detection_sets import shown

NAMESPACE = "urn:local:polarsim"  # of all identifiers: only NASA assigns names below urn:nasa:pds
FRAMES = (
    "Frames: sandbox, origin at the terrain's centre on the ground, X to Sun azimuth 0, Y to 90, Z up; camera, x "
    "right, y down, z forward; metres. Pixels count from the picture's corner, their centres lie at integer + 0.5."
)
_ORIGINS: dict[Origin, str] = {
    "measured": "Every value is measured: a photo of NASA's POLAR data set.",
    "fitted": "Every value is fitted: computed from measurements.",
    "synthetic": "Every value is synthetic: made by a computer, not by a camera.",
}
_LEVELS: dict[Origin, str] = {"measured": "Raw", "fitted": "Derived", "synthetic": "Derived"}
_NAMES = {  # columns that name something or count it: no measurement
    "picture", "file", "domain", "key", "terrain", "position", "light", "azimuth", "camera", "width", "height",
    "sha256", "part", "origin", "label", "kind", "rock", "shadow_of", "source", "lamp", "mesh", "made_from", "method",
    "map", "shows", "unit", "step", "meaning",
}  # fmt: skip


def bytes_of(picture: Picture) -> int:
    return 5 * picture.width * picture.height + 8000  # picture and ids of two bytes, browse of one


@dataclass
class Collection:
    """Members of a collection while they are written."""

    name: str
    kind: str  # Data, Browse or Document
    title: str
    members: list[str] = field(default_factory=list)


class Archive:
    """The bundle's products while they are written."""

    def __init__(self, catalogue: Catalogue, bundle: Bundle) -> None:
        self.catalogue, self.bundle = catalogue, bundle
        self.lid = f"{NAMESPACE}:{_lid(catalogue.name)}"
        self.collections: list[Collection] = []

    def collection(self, name: str, kind: str, title: str) -> Collection:
        self.collections.append(Collection(name, kind, title))
        return self.collections[-1]

    def observed(self, level: str) -> Observed:
        return Observed(level, "Polar regolith analog, sandbox", "POLAR stereo rig or its twin", "polarsim")

    def array(
        self, collection: Collection, name: str, read: Callable[[], np.ndarray], sources: list[Path], **said: object
    ) -> None:
        """An array of a picture; `said` has title, description, unit, scale, level."""
        data = f"{collection.name}/{name}.img"
        self.bundle.make(data, lambda path: path.write_bytes(pds4.array_bytes(read())), sources)
        identity = self._identity(collection, name, str(said["title"]), str(said["description"]))
        shape, dtype = said["shape"], np.dtype(str(said.get("dtype", "u2")))
        area = pds4.array_area(
            self.bundle.path(data), f"{name}.img", shape, dtype, str(said.get("unit", "")), identity.description,  # type: ignore[arg-type]
            float(said.get("scale", 1.0)),  # type: ignore[arg-type]
        )  # fmt: skip
        observation = pds4.observation(identity, self.observed(str(said["level"])))
        self._label(collection, name, pds4.label("Product_Observational", identity, observation, area))

    def table(self, collection: Collection, name: str, table: pd.DataFrame, description: str) -> None:
        data = f"{collection.name}/{name}.csv"
        self.bundle.bytes(data, pds4.table_bytes(table))
        identity = self._identity(collection, name, f"Table of {name}", description)
        area = pds4.table_area(self.bundle.path(data), f"{name}.csv", table, _columns(table), description)
        observation = pds4.observation(identity, self.observed("Derived"))
        self._label(collection, name, pds4.label("Product_Observational", identity, observation, area))

    def browse(self, collection: Collection, picture: Picture) -> None:
        name = str(picture.key)
        file = f"{collection.name}/{name}.png"
        self.bundle.png(file, lambda: shown(picture), [picture.path])
        identity = self._identity(collection, name, f"Browse picture of {picture.name}", "Tone-mapped to 8 bits.")
        area = node(
            "File_Area_Browse",
            pds4.file_node(self.bundle.path(file), f"{name}.png"),
            node("Encoded_Image", node("offset", 0, unit="byte"), node("encoding_standard_id", "PNG")),
        )
        self._label(collection, name, pds4.label("Product_Browse", identity, area))

    def document(self, collection: Collection, name: str, text: str) -> None:
        file = f"{collection.name}/{name}.md"
        self.bundle.text(file, text)
        identity = self._cited(self._identity(collection, name, name.replace("_", " "), "Markdown, UTF-8."))
        edition = node(
            "Document_Edition",
            node("edition_name", "1"),
            node("language", "English"),
            node("files", 1),
            node("Document_File", node("file_name", f"{name}.md"), node("document_standard_id", "UTF-8 Text")),
        )
        area = node("Document", node("publication_date", self.catalogue.made_on), node("document_editions", 1), edition)
        self._label(collection, name, pds4.label("Product_Document", identity, area))

    def close(self) -> None:
        """Collections with their inventories, then the bundle."""
        for one in self.collections:
            self._close_collection(one)
        says = f"{terms.what_it_is(self.catalogue)} {FRAMES}"
        identity = self._cited(Identity(self.lid, terms.title(self.catalogue), says))
        entries = [
            node(
                "Bundle_Member_Entry",
                node("lid_reference", f"{self.lid}:{one.name}"),
                node("member_status", "Primary"),
                node("reference_type", f"bundle_has_{one.kind.lower()}_collection"),
            )
            for one in self.collections
        ]
        area = node("Bundle", node("bundle_type", "Archive"), node("description", identity.description))
        context = node("Context_Area", node("comment", identity.description))
        self.bundle.bytes("bundle.xml", pds4.label("Product_Bundle", identity, context, area, *entries))

    def _close_collection(self, one: Collection) -> None:
        lines = "".join(f"P,{member}::1.0\r\n" for member in one.members)
        file = f"{one.name}/collection.csv"
        self.bundle.bytes(file, lines.encode())
        identity = self._cited(Identity(f"{self.lid}:{one.name}", one.title, one.title))
        fields = [
            node("Field_Delimited", node("name", name), node("field_number", number), node("data_type", kind),
                 node("maximum_field_length", length, unit="byte"))
            for number, (name, kind, length) in enumerate(
                (("Member_Status", "ASCII_String", 1), ("LIDVID_LID", "ASCII_LIDVID_LID", 255)), 1)
        ]  # fmt: skip
        inventory = node(
            "File_Area_Inventory",
            pds4.file_node(self.bundle.path(file), "collection.csv"),
            node(
                "Inventory",
                node("offset", 0, unit="byte"),
                node("parsing_standard_id", "PDS DSV 1"),
                node("records", len(one.members)),
                node("record_delimiter", "Carriage-Return Line-Feed"),
                node("field_delimiter", "Comma"),
                node("Record_Delimited", node("fields", 2), node("groups", 0), *fields),
                node("reference_type", "inventory_has_member_product"),
            ),
        )
        area = node("Collection", node("collection_type", one.kind), node("description", one.title))
        self.bundle.bytes(f"{one.name}/collection.xml", pds4.label("Product_Collection", identity, area, inventory))

    def _cited(self, identity: Identity) -> Identity:
        return replace(identity, citation=(terms.CREATOR, self.catalogue.made_on[:4]))

    def _identity(self, collection: Collection, name: str, title: str, description: str) -> Identity:
        return Identity(f"{self.lid}:{collection.name}:{_lid(name)}", title, description)

    def _label(self, collection: Collection, name: str, content: bytes) -> None:
        self.bundle.bytes(f"{collection.name}/{name}.xml", content)
        collection.members.append(f"{self.lid}:{collection.name}:{_lid(name)}")


def write(catalogue: Catalogue, bundle: Bundle) -> None:
    """`bundle.xml`, and a folder a collection: `data_<domain>`, `ids_<domain>`, `browse_<domain>`, `maps`, `tables`,
    `document`.
    """
    archive = Archive(catalogue, bundle)
    for domain in catalogue.domains:
        _write_domain(archive, domain)
    _write_maps(archive)
    tables = archive.collection("tables", "Data", "Pictures, labels, poses, lamps and rocks as tables")
    for name, table in records.all_tables(catalogue).items():
        own = table.drop(columns=["sha256", "file"], errors="ignore")
        archive.table(
            tables, name, own, f"{_TABLES[name]} Column origin tells measured, fitted and synthetic apart. {FRAMES}"
        )
    document = archive.collection("document", "Document", "What the bundle is")
    archive.document(document, "data_card", card(catalogue, "pds4", "A PDS4 bundle."))
    archive.close()


_TABLES = {
    "pictures": "A row a picture.",
    "labels": "A row a rock or shadow on a picture: box and masks.",
    "poses": "A row a camera: its pose in the sandbox and its lens.",
    "lamps": "A row a lamp of a terrain.",
    "rocks": "A row a rock of a terrain.",
    "maps": "A row a map of depth, normals or photometric angles.",
}


def _write_domain(archive: Archive, domain: str) -> None:
    catalogue = archive.catalogue
    data = archive.collection(f"data_{domain}", "Data", f"Pictures of domain {domain}")
    ids = archive.collection(f"ids_{domain}", "Data", f"Which rock or shadow a pixel shows, domain {domain}")
    browse = archive.collection(f"browse_{domain}", "Browse", f"Pictures of domain {domain} in 8 bits")
    for one in catalogue.of_domain(domain):
        origin = catalogue.picture_origin(one)
        said = f"Grey values, black at {BLACK_LEVEL} DN, white at {WHITE_LEVEL} DN. {_ORIGINS[origin]} {FRAMES}"
        shape = (one.height, one.width)
        archive.array(
            data, str(one.key), partial(png.read, one.path), [one.path], title=f"Picture {one.name}",
            description=said, unit="DN", level=_LEVELS[origin], shape=shape,
        )  # fmt: skip
        # The labels of photos were propagated; a label that a person drew is told apart in the table of labels.
        own: Origin = "fitted" if catalogue.is_photo(one) else "synthetic"
        meaning = (
            "1000 + k: rock k; 2000 + k: ground in its shadow; 65534 and 65535: of a rock without a number; 0 "
            f"background, 1 ground, 2 ground in another shadow, as far as they are told apart. {_ORIGINS[own]}"
        )
        archive.array(
            ids, str(one.key), partial(records.ids, catalogue, one), catalogue.sources(one), title=f"Ids of {one.name}",
            description=meaning, level="Derived", shape=shape,
        )  # fmt: skip
        archive.browse(browse, one)


def _write_maps(archive: Archive) -> None:
    """Depth, normals and photometric angles, where the run made them."""
    found = archive.catalogue.maps()
    if not found:
        return
    maps = archive.collection("maps", "Data", "Depth, normals and photometric angles of the meshes")
    for name, path in found:
        unit, scale, meaning = MAPS[name]
        said = f"{meaning} {_ORIGINS['fitted']} {FRAMES}"
        archive.array(
            maps, f"{name}_{path.stem}", partial(_bands, path), [path], title=f"{name} {path.stem}",
            description=said, unit=unit, scale=scale, level="Derived", shape=_bands(path).shape,
        )  # fmt: skip


def _bands(path: Path) -> np.ndarray:
    """(h, w), or (3, h, w) of normals."""
    values = png.read(path)
    return np.moveaxis(values, 2, 0) if values.ndim == 3 else values


def _columns(table: pd.DataFrame) -> Iterator[Column]:
    for name in table.columns:
        meaning, unit = records.COLUMNS[name]
        whence = "A name, key or count." if name in _NAMES else "Measured, fitted or synthetic: as column origin says."
        yield Column(
            name, unit.replace("px2", "pixel**2").replace("px", "pixel").replace("m3", "m**3"), f"{meaning} {whence}"
        )


def _lid(name: str) -> str:
    """Lower-case letters, digits, dashes, dots and underscores: identifiers hold no others."""
    return "".join(sign if sign.isalnum() or sign in "-._" else "_" for sign in name.lower())
