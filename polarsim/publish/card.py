"""The data card of a bundle and its datasheet: what it is, how it was made, how good this run is, what is wrong."""

from __future__ import annotations

from collections import Counter

import pandas as pd

from polarsim import __version__
from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.publish import terms
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue

CARD, DATASHEET = "README.md", "DATASHEET.md"
_FIGURES = ("stage", "subject", "metric", "unit", "against")
_MOST_ROWS = 24  # of a stage's figures on the card; the tables have all


def write_card(catalogue: Catalogue, bundle: Bundle, form: str, says: str, front: str = "") -> None:
    """Both pages; `front` is what a form wants to stand before the card."""
    bundle.text(CARD, front + card(catalogue, form, says))
    bundle.text(DATASHEET, datasheet(catalogue))


def card(catalogue: Catalogue, form: str, says: str) -> str:
    """Markdown."""
    licences = [f"| {what} | {how} | {url} |" for what, how, url in terms.licences(catalogue)]
    parts = [
        f"# {terms.title(catalogue)}",
        terms.what_it_is(catalogue),
        *catalogue.left_out,
        f"## This form: {form}",
        says,
        "## What is in it",
        _table(_counts(catalogue)),
        terms.split_of(catalogue),
        "Frames: the sandbox has its origin at the terrain's centre on the ground, X to Sun azimuth 0, Y to 90, Z up; "
        "cameras look along z, x right, y down; metres. Pixels count from the picture's corner, their centres lie at "
        "integer + 0.5. Photo keys read terrain, position, rover light, Sun azimuth, camera, exposure in ms.",
        "## How it was made",
        f"By polarsim {__version__}, run `{catalogue.name}`, source `{catalogue.kind}`, configuration "
        f"`{catalogue.config or 'unknown'}`. Scans became meshes, cameras were localised by scans, labels and photos; "
        "a few labels that people drew were propagated to every photo by geometry and light; twins were ray-traced on "
        "the meshes with the same cameras, lamps, lens and sensor.",
        "Every value is one of three: *measured* (photos, what a person drew, NASA's survey), *fitted* (poses, lamps "
        "found in photos, meshes, propagated labels), *synthetic* (twins and their labels, all of the analog).",
        _table(_origins(catalogue)),
        "## Evaluation of this run",
        _figures(catalogue),
        "## Known faults",
        "\n".join(f"- {fault}" for fault in terms.FAULTS),
        "## Licence",
        "\n".join(["| what | licence | terms |", "|---|---|---|", *licences]),
        "## Citation",
        f"```bibtex\n{terms.CITATION}```",
        f"`{DATASHEET}` answers the questions of a datasheet; `SHA256SUMS` has the checksum of every file "
        "(`sha256sum -c SHA256SUMS`).",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _counts(catalogue: Catalogue) -> pd.DataFrame:
    rows = []
    for domain in catalogue.domains:
        pictures = catalogue.of_domain(domain)
        kinds = Counter(one.kind for picture in pictures for one in catalogue.labels(picture))
        parts = Counter(picture.part or "none" for picture in pictures)
        rows.append(
            {
                "domain": domain,
                "pictures": len(pictures),
                "terrains": " ".join(str(number) for number in sorted({one.key.terrain for one in pictures})),
                "rocks": kinds[ROCK],
                "shadows": sum(kinds.values()) - kinds[ROCK],
                "split": ", ".join(f"{part} {count}" for part, count in sorted(parts.items())),
            }
        )
    return pd.DataFrame(rows)


def _origins(catalogue: Catalogue) -> pd.DataFrame:
    counts: Counter[tuple[str, str, str]] = Counter()
    for picture in catalogue.pictures:
        counts["pictures", picture.domain, catalogue.picture_origin(picture)] += 1
        for one in catalogue.labels(picture):
            counts["labels", one.source, catalogue.label_origin(one)] += 1
    for terrain in catalogue.terrains.values():
        for position, rig in terrain.rigs.items():
            counts["poses", rig.method, terrain.pose_origin(position)] += 1
        for azimuth in terrain.suns:
            counts[
                "Sun lamps", "photos" if azimuth in terrain.fitted_suns else "survey", terrain.sun_origin(azimuth)
            ] += 1
        counts["meshes", ", ".join(sorted(set(terrain.made_from.values()))) or "run", "fitted"] += len(terrain.meshes)
    rows = [
        {"what": what, "from": source, "origin": origin, "n": n} for (what, source, origin), n in counts.items() if n
    ]
    return pd.DataFrame(rows)


def _figures(catalogue: Catalogue) -> str:
    """The run's own evaluation: means over terrains, and what detectors reach."""
    said = []
    evaluation = catalogue.run / "tables" / "evaluation.parquet"
    if evaluation.is_file():
        table = read_parquet(evaluation, [*_FIGURES, "terrain", "value"])
        means = table.groupby(list(_FIGURES), sort=False, as_index=False).agg(
            mean=("value", "mean"), terrains=("terrain", "nunique")
        )
        shown = means[means["against"] != "own"].groupby("stage", sort=False).head(_MOST_ROWS)
        note = f"{len(shown)} of {len(means)} rows of the run's `tables/evaluation`: what is measured against others"
        said += [f"Means over terrains ({note}):", _table(shown)]
    detection = catalogue.run / "tables" / "detection.parquet"
    if detection.is_file():
        table = read_parquet(detection)
        names = ("detector", "training", "trained", "domain", "evaluated", "kind", "images", "map50", "map50_95")
        columns = [name for name in names if name in table.columns]
        said += ["Detectors of the run:", _table(table[columns].head(2 * _MOST_ROWS))]
    return "\n\n".join(said) or "This run was not evaluated: it has no `tables/evaluation`."


def _table(table: pd.DataFrame) -> str:
    """A Markdown table with numbers of four digits."""
    if not len(table):
        return ""
    head = ["| " + " | ".join(map(str, table.columns)) + " |", "|" + "---|" * len(table.columns)]
    rows = ["| " + " | ".join(_shown(value) for value in row) + " |" for row in table.itertuples(index=False)]
    return "\n".join([*head, *rows])


def _shown(value: object) -> str:
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    return text.replace("|", "/").replace("\n", " ")


def rai_answers(catalogue: Catalogue) -> dict[str, object]:
    """The fields of Croissant's vocabulary of responsible AI, by their names in mlcroissant."""
    twins = [domain for domain in catalogue.domains if domain != catalogue.photo_domain]
    return {
        "data_collection": terms.what_it_is(catalogue),
        "data_collection_type": ["Experiments", "Software Collection", "Manual Human Curator"],
        "data_collection_missing_data": "Photos that NASA did not take have no twin. Labels hidden whole are left out.",
        "data_collection_raw_data": "Stereo photos with 12 bits, terrestrial lidar scans, and a survey of tripods and "
        "lamps, of the POLAR data set; of an analog run made-up ones in the same layout.",
        "data_imputation_protocol": "Surfaces that no scan saw are filled in smoothly.",
        "data_preprocessing_protocol": ["Pictures are as taken: 12-bit values in 16 bits, not rectified."],
        "data_manipulation_protocol": f"Twins ({', '.join(twins) or 'none here'}) are ray-traced, not photographed.",
        "data_annotation_protocol": [
            "A person drew boxes of rocks and shadows in a few photos (source seed); geometry and light carried them "
            "to all others (fused, translated, projected, cast). Labels of twins are the renderer's own (rendered)."
        ],
        "data_annotation_platform": ["labelImg, CVAT or Label Studio for what people drew; polarsim for the rest"],
        "data_annotation_analysis": ["The evaluation of this run stands on its data card, README.md."],
        "annotations_per_item": "One",
        "annotator_demographics": ["One to a few people who know the data set; nothing else is known of them."],
        "machine_annotation_tools": [f"polarsim {__version__}"],
        "data_biases": list(terms.FAULTS[1:3]),
        "data_use_cases": ["Training and testing of detectors of rocks and shadows, stereo, and sim-to-real gaps"],
        "data_limitations": [*terms.FAULTS[:1], *terms.FAULTS[3:]],
        "data_social_impact": "Pictures of sand and stones: none that we know of. Hazard maps of a real lander need "
        "tests of their own.",
        "personal_sensitive_information": ["None: no person is in the pictures."],
        "data_release_maintenance_plan": "The run can be made again from its configuration; faults that are found are "
        "put right in polarsim and published as a new version.",
    }


_QUESTIONS = {  # of Gebru et al., Datasheets for Datasets, CACM 64 (2021) 86, with what answers them
    "Motivation: for what purpose was it created?": ("data_use_cases",),
    "Composition: what is it, is anything missing, what is raw?": (
        "data_collection", "data_collection_missing_data", "data_collection_raw_data",
    ),
    "Composition: does it hold what may be sensitive?": ("personal_sensitive_information",),
    "Collection: how were the data acquired?": ("data_collection_type",),
    "Preprocessing: what was done to them?": (
        "data_preprocessing_protocol", "data_imputation_protocol", "data_manipulation_protocol",
    ),
    "Labelling: who drew what, with which tools, and how often?": (
        "data_annotation_protocol", "data_annotation_platform", "machine_annotation_tools", "annotations_per_item",
        "annotator_demographics", "data_annotation_analysis",
    ),
    "Uses: which biases and limits are known, what may it do?": (
        "data_biases", "data_limitations", "data_social_impact",
    ),
    "Maintenance: who keeps it?": ("data_release_maintenance_plan",),
}  # fmt: skip


def datasheet(catalogue: Catalogue) -> str:
    """Markdown; the same answers as Croissant's RAI fields."""
    answers = rai_answers(catalogue)
    assert {name for names in _QUESTIONS.values() for name in names} == set(answers)
    parts = [f"# Datasheet of {terms.title(catalogue)}"]
    for question, names in _QUESTIONS.items():
        parts.append(f"## {question}")
        for name in names:
            answer = answers[name]
            parts += [str(one) for one in answer] if isinstance(answer, list) else [str(answer)]
    licences = [f"- {what}: {how} ({url})" for what, how, url in terms.licences(catalogue)]
    parts += ["## Distribution: under which terms?", "\n".join(licences)]
    return "\n\n".join(parts) + "\n"
