"""Croissant 1.1 with fields for responsible AI (RAI): tables in Parquet, images as files, readable by `mlcroissant`.

Croissant readers convert 16-bit images to 8-bit colour. The description therefore recommends reading the image files,
whose checksums are in the table of images.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import pandas as pd

from polarsim import __version__
from polarsim.errors import PolarsimError
from polarsim.formats.tables import write_parquet
from polarsim.publish import records, terms
from polarsim.publish.bundle import Bundle
from polarsim.publish.card import rai_answers
from polarsim.publish.catalogue import MAPS, Catalogue

FILE, GEO_FILE = "croissant.json", "geocroissant.json"
CONFORMS = ["http://mlcommons.org/croissant/1.1", "http://mlcommons.org/croissant/RAI/1.0"]
_KEY = "pictures/picture"  # field that identifies an image
# Engineering coordinate system in the notation of ISO 19162; the geographic position of the sandbox is not surveyed.
SANDBOX_WKT = (
    'ENGCRS["sandbox",EDATUM["Terrain\'s centre on the ground"],CS[Cartesian,3],'
    'AXIS["to Sun azimuth 0 (X)",unspecified],AXIS["to Sun azimuth 90 (Y)",unspecified],AXIS["up (Z)",up],'
    'LENGTHUNIT["metre",1]]'
)


def write_croissant(catalogue: Catalogue, bundle: Bundle) -> None:
    records.copy_images(catalogue, bundle)
    tables = records.all_tables(catalogue, bundle)
    for name, table in tables.items():
        bundle.make(f"{name}.parquet", partial(write_parquet, table=table))
    content = croissant_metadata(catalogue, tables, bundle)
    bundle.json(FILE, content)
    bundle.json(GEO_FILE, _geographic(content))


def croissant_metadata(catalogue: Catalogue, tables: dict[str, pd.DataFrame], bundle: Bundle) -> dict[str, Any]:
    """Return the JSON-LD, validated by mlcroissant."""
    import mlcroissant as mlc

    files = [
        mlc.FileObject(
            id=f"{name}.parquet",
            name=f"{name}.parquet",
            description=f"Table of {name}, one row each.",
            content_url=f"{name}.parquet",
            encoding_formats=["application/x-parquet"],
            sha256=bundle.sha256(f"{name}.parquet"),
        )
        for name in tables
    ]
    files += [
        mlc.FileSet(
            id=f"pictures-{domain}",
            name=f"pictures-{domain}",
            description=f"16-bit PNG of 12-bit values, domain {domain}; SHA-256 of each in pictures.parquet.",
            encoding_formats=["image/png"],
            includes=[f"pictures/{domain}/*.png"],
        )
        for domain in catalogue.domains
    ]
    for kind in dict.fromkeys(name for name, _ in catalogue.maps()):
        unit, step, meaning = MAPS[kind]
        text = f"{meaning} Unit: {unit or 'none'}, times {step:g}; 16-bit PNG, rows of the record set maps."
        name, includes = f"maps-{kind}", [f"maps/{kind}/*.png"]
        files.append(
            mlc.FileSet(id=name, name=name, description=text, encoding_formats=["image/png"], includes=includes)
        )
    sets = [_record_set(name, table) for name, table in tables.items()]
    sets += [_pictures_of(domain) for domain in catalogue.domains]
    content = mlc.Metadata(
        conforms_to=CONFORMS,
        name=terms.title(catalogue).replace(" ", "-"),
        description=f"{terms.summary(catalogue)} Images are 16-bit PNG: read the files, since Croissant readers may "
        "convert them to 8 bits; the record set pictures contains their SHA-256.",
        url=terms.URL,
        cite_as=terms.citation(catalogue),
        license=terms.licence_urls(catalogue),
        creators=[mlc.Organization(name=terms.CREATOR)],
        date_published=catalogue.made_on,
        version=__version__,
        distribution=files,
        record_sets=sets,
        **rai_answers(catalogue),
    )
    if content.ctx.issues.errors or content.ctx.issues.warnings:
        raise PolarsimError(content.issues.report().replace("\n", " "), path=bundle.path(FILE))
    return content.to_json()


def _geographic(content: dict[str, Any]) -> dict[str, Any]:
    """Add the fields of GeoCroissant that apply to photos of a sandbox: coordinate system and number of bands.

    Perspective images have no spatial resolution, and the sandbox has no geographic position.
    """
    band = {"@type": "geocr:BandConfiguration", "geocr:totalBands": 1, "geocr:bandNameList": ["grey"]}
    return {
        **content,
        "@context": {**content["@context"], "geocr": "http://mlcommons.org/croissant/geo/"},
        "conformsTo": [*CONFORMS, "http://mlcommons.org/croissant/geo/1.0"],
        "geocr:coordinateReferenceSystem": SANDBOX_WKT,
        "geocr:bandConfiguration": band,
    }


def _record_set(name: str, table: pd.DataFrame) -> Any:
    import mlcroissant as mlc

    fields = [
        mlc.Field(
            id=f"{name}/{column}",
            name=f"{name}/{column}",
            description=_description(table[column]),
            data_types=[_data_type(table[column])],
            source=mlc.Source(file_object=f"{name}.parquet", extract=mlc.Extract(column=column)),
            **({"references": mlc.Source(field=_KEY)} if f"{name}/{column}" == "labels/picture" else {}),
        )
        for column in table.columns
    ]
    return mlc.RecordSet(id=name, name=name, fields=fields, **({"key": [_KEY]} if name == "pictures" else {}))


def _pictures_of(domain: str) -> Any:
    """Return the record set of the images of a domain: file name and content."""
    import mlcroissant as mlc

    def field(name: str, description: str, kind: str, content: Any) -> Any:
        source = mlc.Source(file_set=f"pictures-{domain}", extract=mlc.Extract(file_property=content))
        name = f"images-{domain}/{name}"
        return mlc.Field(id=name, name=name, description=description, data_types=[kind], source=source)

    fields = [
        field("name", "File name of the image.", mlc.DataType.TEXT, mlc.FileProperty.filename),
        field("image", "Image; the file has 16 bits.", mlc.DataType.IMAGE_OBJECT, mlc.FileProperty.content),
    ]
    return mlc.RecordSet(id=f"images-{domain}", name=f"images-{domain}", fields=fields)


def _description(column: pd.Series) -> str:
    meaning, unit = records.meaning_of(column)
    return f"{meaning} Unit: {unit}." if unit else meaning


def _data_type(column: pd.Series) -> Any:
    import mlcroissant as mlc

    if pd.api.types.is_integer_dtype(column):
        return mlc.DataType.INTEGER
    return mlc.DataType.FLOAT if pd.api.types.is_float_dtype(column) else mlc.DataType.TEXT
