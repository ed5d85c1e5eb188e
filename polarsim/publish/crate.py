"""RO-Crate of a run: output files, workflow files, and provenance."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from polarsim import __version__
from polarsim.formats.tables import write_parquet
from polarsim.photo import NO_ROCK
from polarsim.publish import records, terms
from polarsim.publish.bundle import SUMS, Bundle
from polarsim.publish.card import CARD, DATASHEET
from polarsim.publish.catalogue import MAPS, Catalogue
from polarsim.run_files import walls

FILE = "ro-crate-metadata.json"
_CHECKOUT = Path(__file__).parents[2]
_FORMATS = {".parquet": "application/vnd.apache.parquet", ".csv": "text/csv", ".json": "application/json",
            ".obj": "model/obj", ".md": "text/markdown", ".png": "image/png"}  # fmt: skip


def write_crate(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `pictures/`, `data/*.parquet`, `tables/`, `meshes/`, `cameras/`, `workflow/`, and the crate's metadata."""
    descriptions = _write_files(catalogue, bundle)
    bundle.json(FILE, _metadata(catalogue, bundle, descriptions))


def _write_files(catalogue: Catalogue, bundle: Bundle) -> dict[str, str]:
    """Write all files; return the descriptions of the files, except images, by name."""
    descriptions: dict[str, str] = {}
    records.copy_images(catalogue, bundle)
    for picture in catalogue.pictures:
        if (sidecar := picture.path.with_suffix(".json")).is_file() and not catalogue.is_photo(picture):
            bundle.copy(f"pictures/{picture.name}.json", sidecar)
    for name, table in records.all_tables(catalogue, bundle).items():
        bundle.make(f"data/{name}.parquet", partial(write_parquet, table=table))
        descriptions[f"data/{name}.parquet"] = f"Table of {name}; column origin: measured, fitted or synthetic"
    for path in sorted((catalogue.run / "tables").glob("*.*")):
        if path.suffix in (".csv", ".parquet"):
            bundle.copy(f"tables/{path.name}", path)
            descriptions[f"tables/{path.name}"] = f"Evaluation of the run: {path.stem}"
    for terrain in catalogue.terrains.values():
        for rock, path in terrain.meshes.items():
            bundle.copy(f"meshes/{terrain.name}/{path.name}", path)
            part = "ground" if rock == NO_ROCK else f"rock {rock}"
            descriptions[f"meshes/{terrain.name}/{path.name}"] = f"Mesh of {part}, metres, sandbox frame; fitted"
        for path in sorted((catalogue.run / "meshes" / terrain.name).glob(walls.FILE)):
            bundle.copy(f"meshes/{terrain.name}/{path.name}", path)
            descriptions[f"meshes/{terrain.name}/{path.name}"] = "Inner faces and tops of the walls, metres; fitted"
        for path in sorted((catalogue.run / "cameras" / terrain.name).glob("*.json")):
            bundle.copy(f"cameras/{terrain.name}/{path.name}", path)
            descriptions[f"cameras/{terrain.name}/{path.name}"] = "Poses and lenses of a rig, or positions of lamps"
    for path in _workflow():
        name = path.relative_to(_CHECKOUT).as_posix()
        bundle.copy(f"workflow/{name}", path)
        descriptions[f"workflow/{name}"] = "Part of the workflow of the run"
    return descriptions


def _workflow() -> list[Path]:
    """Return the files of the workflow, if polarsim runs from a git checkout."""
    rules = sorted((_CHECKOUT / "workflow").glob("*/*.py")) + sorted((_CHECKOUT / "workflow").glob("rules/*.smk"))
    files = [_CHECKOUT / name for name in ("Snakefile", "workflow/Snakefile", "requirements.lock")]
    return [path for path in (*files, *rules) if path.is_file()]


def _metadata(catalogue: Catalogue, bundle: Bundle, descriptions: dict[str, str]) -> Any:
    from rocrate.model.contextentity import ContextEntity
    from rocrate.rocrate import ROCrate

    crate = ROCrate()
    root = crate.root_dataset
    root["name"], root["description"] = terms.title(catalogue), terms.summary(catalogue)
    root["datePublished"], root["version"] = catalogue.made_on, __version__
    # One entity per address of a licence; the data card lists the licence of each kind of data.
    root["license"] = [
        crate.add(ContextEntity(crate, url, {"@type": "CreativeWork", "name": licence, "description": content}))
        for content, licence, url in {row[2]: row for row in terms.licences(catalogue)}.values()
    ]
    author = crate.add(ContextEntity(crate, "#polarsim-developers", {"@type": "Organization", "name": terms.CREATOR}))
    root["author"] = author
    files = {}
    for name, text in sorted(descriptions.items()):
        properties = {"name": Path(name).name, "description": text, "sha256": bundle.sha256(name)}
        properties |= {"contentSize": str(bundle.path(name).stat().st_size)}
        if kind := _FORMATS.get(Path(name).suffix):
            properties["encodingFormat"] = kind
        arguments: dict[str, Any] = {"dest_path": name, "properties": properties}
        if name == "workflow/Snakefile":
            files[name] = crate.add_workflow(**arguments, main=True, lang="snakemake", gen_cwl=False)
        else:
            files[name] = crate.add_file(**arguments)
    for name, text in ((CARD, "Data card"), (DATASHEET, "Datasheet"), (SUMS, "Checksums of all files")):
        crate.add_file(dest_path=name, properties={"name": name, "description": text})
    folders = [
        crate.add_directory(
            dest_path=f"pictures/{domain}",
            properties={
                "name": f"Images of domain {domain}",
                "description": f"16-bit PNG; {catalogue.picture_origin(catalogue.of_domain(domain)[0])}",
            },
        )
        for domain in catalogue.domains
    ]
    for kind in dict.fromkeys(name for name, _ in catalogue.maps()):
        properties = {"name": f"Maps of {kind}", "description": MAPS[kind][2]}
        folders.append(crate.add_directory(dest_path=f"maps/{kind}", properties=properties))
    results = [file for name, file in files.items() if name.startswith(("data/", "tables/", "meshes/", "cameras/"))]
    action = {
        "@type": "CreateAction",
        "name": f"Run {catalogue.name}",
        "description": f"polarsim {__version__}, source {catalogue.kind}, configuration {catalogue.config}",
    }
    run = crate.add(ContextEntity(crate, "#run", action))
    run["result"] = [*results, *folders]
    run["agent"] = author
    if "workflow/Snakefile" in files:
        run["instrument"] = files["workflow/Snakefile"]
    photos = [folder for folder in folders if folder.id.rstrip("/").endswith(catalogue.photo_domain)]
    if photos:
        run["object"] = photos
    root["mentions"] = run
    return crate.metadata.generate()
