"""PDS4 bundle: images and instance maps as raw arrays, tables, browse images, data card, and an XML label per file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import pds4, png
from polarsim.formats.pds4 import Column, Identity, Node, node
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.publish import records, terms
from polarsim.publish.bundle import Bundle
from polarsim.publish.card import card
from polarsim.publish.catalogue import MAPS, Catalogue, CatalogueImage, Origin
from polarsim.publish.detection_sets import tone_mapped
from polarsim.site import DEFAULT

NAMESPACE = "urn:local:polarsim"  # of all identifiers; urn:nasa:pds is reserved for NASA
FRAMES = (
    "Frames: sandbox, origin at the terrain's centre on the ground, X to Sun azimuth 0, Y to 90, Z up; camera, x "
    "right, y down, z forward; metres. Pixel origin: upper left corner of the image; pixel centres at integer + 0.5."
)
_ORIGINS: dict[Origin, str] = {
    "measured": "All values are measured: a photo of {data_set}.",
    "fitted": "All values are fitted: computed from measurements.",
    "synthetic": "All values are synthetic: simulated or rendered.",
}
_LEVELS: dict[Origin, str] = {"measured": "Raw", "fitted": "Derived", "synthetic": "Derived"}
_NAMES = {  # columns of names, keys and counts
    "picture", "file", "domain", "key", "terrain", "position", "light", "azimuth", "camera", "width", "height",
    "sha256", "part", "origin", "label", "kind", "rock", "shadow_of", "source", "lamp", "mesh", "made_from", "method",
    "map", "shows", "unit", "step", "meaning",
}  # fmt: skip


@dataclass
class Collection:
    """A collection and the identifiers of its members."""

    name: str
    kind: str  # Data, Browse or Document
    title: str
    members: list[str] = field(default_factory=list)


class Archive:
    """Writer of the products of a bundle."""

    def __init__(self, catalogue: Catalogue, bundle: Bundle) -> None:
        self.catalogue, self.bundle = catalogue, bundle
        self.lid = f"{NAMESPACE}:{_lid(catalogue.name)}"
        self.collections: list[Collection] = []

    def collection(self, name: str, kind: str, title: str) -> Collection:
        self.collections.append(Collection(name, kind, title))
        return self.collections[-1]

    def array(
        self, collection: Collection, name: str, read: Callable[[], np.ndarray], sources: list[Path], **facts: object
    ) -> None:
        """Write an array; `facts` are title, description, level, shape, and optionally dtype, unit and scale."""
        data = f"{collection.name}/{name}.img"
        self.bundle.make(data, lambda path: path.write_bytes(pds4.array_bytes(read())), sources)
        identity = self._identity(collection, name, str(facts["title"]), str(facts["description"]))
        shape, dtype = facts["shape"], np.dtype(str(facts.get("dtype", "u2")))
        area = pds4.array_area(
            self.bundle.path(data), f"{name}.img", shape, dtype, str(facts.get("unit", "")), identity.description,  # type: ignore[arg-type]
            float(facts.get("scale", 1.0)),  # type: ignore[arg-type]
        )  # fmt: skip
        self._observation(collection, name, identity, str(facts["level"]), area)

    def table(self, collection: Collection, name: str, table: pd.DataFrame, description: str) -> None:
        data = f"{collection.name}/{name}.csv"
        self.bundle.bytes(data, pds4.table_bytes(table))
        identity = self._identity(collection, name, f"Table of {name}", description)
        area = pds4.table_area(self.bundle.path(data), f"{name}.csv", table, _columns(table), description)
        self._observation(collection, name, identity, "Derived", area)

    def _observation(self, collection: Collection, name: str, identity: Identity, level: str, area: Node) -> None:
        cameras = "stereo rig" if self.catalogue.site.cameras.stereo else "camera"
        site = self.catalogue.site.name
        rig = f"{'POLAR' if site == DEFAULT else site} {cameras} or its twin"
        subject = ("Polar regolith analog, sandbox", rig, "polarsim")
        observation = pds4.observation(identity, level, *subject)
        self._label(collection, name, pds4.label("Product_Observational", identity, observation, area))

    def browse(self, collection: Collection, picture: CatalogueImage) -> None:
        name = str(picture.key)
        file = f"{collection.name}/{name}.png"
        self.bundle.png(file, lambda: tone_mapped(picture), [picture.path])
        identity = self._identity(collection, name, f"Browse image of {picture.name}", "Tone-mapped to 8 bits.")
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
        """Write the labels and inventories of the collections and the label of the bundle."""
        for collection in self.collections:
            self._close_collection(collection)
        description = f"{terms.summary(self.catalogue)} {FRAMES}"
        identity = self._cited(Identity(self.lid, terms.title(self.catalogue), description))
        entries = [
            node(
                "Bundle_Member_Entry",
                node("lid_reference", f"{self.lid}:{collection.name}"),
                node("member_status", "Primary"),
                node("reference_type", f"bundle_has_{collection.kind.lower()}_collection"),
            )
            for collection in self.collections
        ]
        area = node("Bundle", node("bundle_type", "Archive"), node("description", identity.description))
        context = node("Context_Area", node("comment", identity.description))
        self.bundle.bytes("bundle.xml", pds4.label("Product_Bundle", identity, context, area, *entries))

    def _close_collection(self, collection: Collection) -> None:
        lines = "".join(f"P,{member}::1.0\r\n" for member in collection.members)
        file = f"{collection.name}/collection.csv"
        self.bundle.bytes(file, lines.encode())
        identity = self._cited(Identity(f"{self.lid}:{collection.name}", collection.title, collection.title))
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
                node("records", len(collection.members)),
                node("record_delimiter", "Carriage-Return Line-Feed"),
                node("field_delimiter", "Comma"),
                node("Record_Delimited", node("fields", 2), node("groups", 0), *fields),
                node("reference_type", "inventory_has_member_product"),
            ),
        )
        area = node("Collection", node("collection_type", collection.kind), node("description", collection.title))
        label = pds4.label("Product_Collection", identity, area, inventory)
        self.bundle.bytes(f"{collection.name}/collection.xml", label)

    def _cited(self, identity: Identity) -> Identity:
        return replace(identity, citation=(terms.CREATOR, self.catalogue.made_on[:4]))

    def _identity(self, collection: Collection, name: str, title: str, description: str) -> Identity:
        return Identity(f"{self.lid}:{collection.name}:{_lid(name)}", title, description)

    def _label(self, collection: Collection, name: str, content: bytes) -> None:
        self.bundle.bytes(f"{collection.name}/{name}.xml", content)
        collection.members.append(f"{self.lid}:{collection.name}:{_lid(name)}")


def write_pds4(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `bundle.xml` and the collections `data_<domain>`, `ids_<domain>`, `browse_<domain>`, `maps`, `tables` and
    `document`.
    """
    archive = Archive(catalogue, bundle)
    for domain in catalogue.domains:
        _write_domain(archive, domain)
    _write_maps(archive)
    tables = archive.collection("tables", "Data", "Tables of images, labels, poses, lamps and rocks")
    for name, table in records.all_tables(catalogue).items():
        columns = table.drop(columns=["sha256", "file"], errors="ignore")
        description = f"{_TABLES[name]} Column origin: measured, fitted or synthetic. {FRAMES}"
        archive.table(tables, name, columns, description)
    document = archive.collection("document", "Document", "Description of the bundle")
    archive.document(document, "data_card", card(catalogue, "pds4", "PDS4 bundle."))
    archive.close()


_TABLES = {
    "pictures": "A row per image.",
    "labels": "A row per rock or shadow in an image: box and masks.",
    "poses": "A row per camera: pose in the sandbox frame and lens.",
    "lamps": "A row per lamp of a terrain.",
    "rocks": "A row per rock of a terrain.",
    "maps": "A row per map of depth, normals or photometric angles.",
}


def _write_domain(archive: Archive, domain: str) -> None:
    catalogue = archive.catalogue
    data = archive.collection(f"data_{domain}", "Data", f"Images of domain {domain}")
    ids = archive.collection(f"ids_{domain}", "Data", f"Instance maps of rocks and shadows, domain {domain}")
    browse = archive.collection(f"browse_{domain}", "Browse", f"8-bit images of domain {domain}")
    for picture in catalogue.of_domain(domain):
        origin = catalogue.picture_origin(picture)
        of_origin = _ORIGINS[origin].format(data_set=catalogue.site.data_set)
        text = f"Grey values, black at {BLACK_LEVEL} DN, white at {WHITE_LEVEL} DN. {of_origin} {FRAMES}"
        shape = (picture.height, picture.width)
        archive.array(
            data, str(picture.key), partial(png.read_png, picture.path), [picture.path], title=f"Image {picture.name}",
            description=text, unit="DN", level=_LEVELS[origin], shape=shape,
        )  # fmt: skip
        # The table of labels has the origin of each label; labels of photos are propagated, except for the seeds.
        label_origin: Origin = "fitted" if catalogue.is_photo(picture) else "synthetic"
        meaning = (
            "1000 + k: rock k; 2000 + k: ground in the shadow of rock k; 65534 and 65535: rock or shadow without id; "
            f"0 background, 1 ground, 2 ground in other shadows, where distinguished. {_ORIGINS[label_origin]}"
        )
        archive.array(
            ids, str(picture.key), partial(records.ids, catalogue, picture), catalogue.sources(picture),
            title=f"Ids of {picture.name}", description=meaning, level="Derived", shape=shape,
        )  # fmt: skip
        archive.browse(browse, picture)


def _write_maps(archive: Archive) -> None:
    """Write depth, normals and photometric angles, if the run has them."""
    files = archive.catalogue.maps()
    if not files:
        return
    maps = archive.collection("maps", "Data", "Depth, normals and photometric angles of the meshes")
    for name, path in files:
        unit, scale, meaning = MAPS[name]
        text = f"{meaning} {_ORIGINS['fitted']} {FRAMES}"
        archive.array(
            maps, f"{name}_{path.stem}", partial(_bands, path), [path], title=f"{name} {path.stem}",
            description=text, unit=unit, scale=scale, level="Derived", shape=_bands(path).shape,
        )  # fmt: skip


def _bands(path: Path) -> np.ndarray:
    """Read an array (h, w), or (3, h, w) for normals."""
    values = png.read_png(path)
    return np.moveaxis(values, 2, 0) if values.ndim == 3 else values


def _columns(table: pd.DataFrame) -> Iterator[Column]:
    for name in table.columns:
        meaning, unit = records.meaning_of(table[name])
        kind = "A name, key or count." if name in _NAMES else "Measured, fitted or synthetic: see column origin."
        yield Column(
            name, unit.replace("px2", "pixel**2").replace("px", "pixel").replace("m3", "m**3"), f"{meaning} {kind}"
        )


def _lid(name: str) -> str:
    """Replace characters that are not allowed in identifiers (lower-case letters, digits, dash, dot, underscore)."""
    return "".join(sign if sign.isalnum() or sign in "-._" else "_" for sign in name.lower())
