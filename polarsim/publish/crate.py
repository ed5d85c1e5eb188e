"""An RO-Crate of the run: what it made, the workflow that made it, and which came from which."""

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
from polarsim.publish.catalogue import MAPS, Catalogue, Picture

NEEDS = ("rocrate",)
FILE = "ro-crate-metadata.json"
_CHECKOUT = Path(__file__).parents[2]
_FORMATS = {".parquet": "application/vnd.apache.parquet", ".csv": "text/csv", ".json": "application/json",
            ".obj": "model/obj", ".md": "text/markdown", ".png": "image/png"}  # fmt: skip


def bytes_of(picture: Picture) -> int:
    return picture.path.stat().st_size + 8000  # and what made it


def write(catalogue: Catalogue, bundle: Bundle) -> None:
    """`pictures/`, `data/*.parquet`, `tables/`, `meshes/`, `cameras/`, `workflow/`, and the crate's metadata."""
    said = _write_files(catalogue, bundle)
    bundle.json(FILE, _metadata(catalogue, bundle, said))


def _write_files(catalogue: Catalogue, bundle: Bundle) -> dict[str, str]:
    """All files but pictures: what each is, by name."""
    said: dict[str, str] = {}
    records.copy_pictures(catalogue, bundle)
    records.copy_maps(catalogue, bundle)
    for one in catalogue.pictures:
        if (sidecar := one.path.with_suffix(".json")).is_file() and not catalogue.is_photo(one):
            bundle.copy(f"pictures/{one.name}.json", sidecar)
    for name, table in records.all_tables(catalogue, bundle).items():
        bundle.make(f"data/{name}.parquet", partial(write_parquet, table=table))
        said[f"data/{name}.parquet"] = f"Table of {name}; column origin: measured, fitted or synthetic"
    for path in sorted((catalogue.run / "tables").glob("*.*")):
        if path.suffix in (".csv", ".parquet"):
            bundle.copy(f"tables/{path.name}", path)
            said[f"tables/{path.name}"] = f"Evaluation of the run: {path.stem}"
    for terrain in catalogue.terrains.values():
        for rock, path in terrain.meshes.items():
            bundle.copy(f"meshes/{terrain.name}/{path.name}", path)
            what = "ground" if rock == NO_ROCK else f"rock {rock}"
            said[f"meshes/{terrain.name}/{path.name}"] = f"Mesh of {what}, metres, sandbox frame; fitted"
        for path in sorted((catalogue.run / "cameras" / terrain.name).glob("*.json")):
            bundle.copy(f"cameras/{terrain.name}/{path.name}", path)
            said[f"cameras/{terrain.name}/{path.name}"] = "Poses and lenses of a rig, or places of lamps"
    for path in _workflow():
        name = path.relative_to(_CHECKOUT).as_posix()
        bundle.copy(f"workflow/{name}", path)
        said[f"workflow/{name}"] = "Part of the workflow that made the run"
    return said


def _workflow() -> list[Path]:
    """The workflow's own files, where polarsim runs from its checkout."""
    rules = sorted((_CHECKOUT / "workflow").glob("*/*.py")) + sorted((_CHECKOUT / "workflow").glob("rules/*.smk"))
    files = [_CHECKOUT / name for name in ("Snakefile", "workflow/Snakefile", "requirements.lock")]
    return [path for path in (*files, *rules) if path.is_file()]


def _metadata(catalogue: Catalogue, bundle: Bundle, said: dict[str, str]) -> Any:
    from rocrate.model.contextentity import ContextEntity
    from rocrate.rocrate import ROCrate

    crate = ROCrate()
    root = crate.root_dataset
    root["name"], root["description"] = terms.title(catalogue), terms.what_it_is(catalogue)
    root["datePublished"], root["version"] = catalogue.made_on, __version__
    # Those that are in the table of licences are known by their addresses; which is of what stands on the card.
    root["license"] = [
        crate.add(ContextEntity(crate, url, {"@type": "CreativeWork", "name": how, "description": what}))
        for what, how, url in {url: (what, how, url) for what, how, url in terms.licences(catalogue)}.values()
    ]
    author = crate.add(ContextEntity(crate, "#polarsim-developers", {"@type": "Organization", "name": terms.CREATOR}))
    root["author"] = author
    files = {}
    for name, text in sorted(said.items()):
        own = {"name": Path(name).name, "description": text, "sha256": bundle.sha256(name)}
        own |= {"contentSize": str(bundle.path(name).stat().st_size)}
        if kind := _FORMATS.get(Path(name).suffix):
            own["encodingFormat"] = kind
        if name == "workflow/Snakefile":
            files[name] = crate.add_workflow(dest_path=name, main=True, lang="snakemake", gen_cwl=False, properties=own)
        else:
            files[name] = crate.add_file(dest_path=name, properties=own)
    for name, text in ((CARD, "Data card"), (DATASHEET, "Datasheet"), (SUMS, "Checksums of all files")):
        crate.add_file(dest_path=name, properties={"name": name, "description": text})
    folders = [
        crate.add_directory(
            dest_path=f"pictures/{domain}",
            properties={
                "name": f"Pictures of domain {domain}",
                "description": f"16-bit PNG; {catalogue.picture_origin(catalogue.of_domain(domain)[0])}",
            },
        )
        for domain in catalogue.domains
    ]
    for kind in dict.fromkeys(name for name, _ in catalogue.maps()):
        own = {"name": f"Maps of {kind}", "description": MAPS[kind][2]}
        folders.append(crate.add_directory(dest_path=f"maps/{kind}", properties=own))
    results = [one for name, one in files.items() if name.startswith(("data/", "tables/", "meshes/", "cameras/"))]
    action = {
        "@type": "CreateAction",
        "name": f"Run {catalogue.name}",
        "description": f"polarsim {__version__}, source {catalogue.kind}, configuration {catalogue.config}",
    }
    made = crate.add(ContextEntity(crate, "#run", action))
    made["result"] = [*results, *folders]
    made["agent"] = author
    if "workflow/Snakefile" in files:
        made["instrument"] = files["workflow/Snakefile"]
    photos = [one for one in folders if one.id.rstrip("/").endswith(catalogue.photo_domain)]
    if photos:
        made["object"] = photos
    root["mentions"] = made
    return crate.metadata.generate()
