"""Data card and datasheet of a bundle: content, method, evaluation of the run, limitations, licence."""

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
_METRIC = ("stage", "subject", "metric", "unit", "against")
_MAX_ROWS = 24  # metrics of a stage on the card; the tables contain all


def write_card(catalogue: Catalogue, bundle: Bundle, form: str, description: str, front: str = "") -> None:
    """Write the data card and the datasheet; `front` is the front matter of the card."""
    bundle.text(CARD, front + card(catalogue, form, description))
    bundle.text(DATASHEET, datasheet(catalogue))


def card(catalogue: Catalogue, form: str, description: str) -> str:
    """Return the data card in Markdown."""
    licences = [f"| {content} | {licence} | {url} |" for content, licence, url in terms.licences(catalogue)]
    parts = [
        f"# {terms.title(catalogue)}",
        terms.summary(catalogue),
        *catalogue.left_out,
        f"## Format: {form}",
        description,
        "## Content",
        _table(_counts(catalogue)),
        terms.split_of(catalogue),
        "Frames: the sandbox frame has the origin at the terrain's centre on the ground, X to Sun azimuth 0, Y to 90, "
        "Z up; the camera frame has x right, y down, z forward; metres. The origin of pixel coordinates is the upper "
        "left corner of the image, pixel centres are at integer + 0.5. Photo keys: terrain, position, rover light, Sun "
        "azimuth, camera, exposure in ms.",
        "## Method",
        f"Software: polarsim {__version__}, run `{catalogue.name}`, source `{catalogue.kind}`, configuration "
        f"`{catalogue.config or 'unknown'}`. Meshes were computed from scans; cameras were localised with scans, "
        "labels and photos; a few human annotations were propagated to every photo by geometry and light; twins were "
        "ray-traced on the meshes with the same cameras, lamps, lens and sensor.",
        f"Origin of values: *measured* (photos, human annotations, {terms.survey(catalogue)}), *fitted* (poses, lamps "
        "located in photos, meshes, propagated labels) or *synthetic* (twins and rendered labels, all data of the "
        "analog).",
        _table(_origins(catalogue)),
        "## Evaluation of this run",
        _evaluation(catalogue),
        "## Limitations",
        "\n".join(f"- {fault}" for fault in terms.faults(catalogue)),
        "## Licence",
        "\n".join(["| content | licence | terms |", "|---|---|---|", *licences]),
        "## Citation",
        f"```bibtex\n{terms.citation(catalogue)}```",
        f"`{DATASHEET}` is the datasheet; `SHA256SUMS` contains the checksum of every file "
        "(`sha256sum -c SHA256SUMS`).",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _counts(catalogue: Catalogue) -> pd.DataFrame:
    rows = []
    for domain in catalogue.domains:
        pictures = catalogue.of_domain(domain)
        kinds = Counter(label.kind for picture in pictures for label in catalogue.labels(picture))
        parts = Counter(picture.part or "none" for picture in pictures)
        rows.append(
            {
                "domain": domain,
                "pictures": len(pictures),
                "terrains": " ".join(str(number) for number in sorted({picture.key.terrain for picture in pictures})),
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
        for label in catalogue.labels(picture):
            counts["labels", label.source, catalogue.label_origin(label)] += 1
    for terrain in catalogue.terrains.values():
        for position, rig in terrain.rigs.items():
            counts["poses", rig.method, terrain.pose_origin(position)] += 1
        for azimuth in terrain.suns:
            counts[
                "Sun lamps", "photos" if azimuth in terrain.fitted_suns else "survey", terrain.sun_origin(azimuth)
            ] += 1
        counts["meshes", ", ".join(sorted(set(terrain.made_from.values()))) or "run", "fitted"] += len(terrain.meshes)
    rows = [
        {"what": kind, "from": source, "origin": origin, "n": n} for (kind, source, origin), n in counts.items() if n
    ]
    return pd.DataFrame(rows)


def _evaluation(catalogue: Catalogue) -> str:
    """Return the evaluation of the run in Markdown: means over terrains, and scores of detectors."""
    parts = []
    evaluation = catalogue.run / "tables" / "evaluation.parquet"
    if evaluation.is_file():
        table = read_parquet(evaluation, [*_METRIC, "terrain", "value"])
        means = table.groupby(list(_METRIC), sort=False, as_index=False).agg(
            mean=("value", "mean"), terrains=("terrain", "nunique")
        )
        shown = means[means["against"] != "own"].groupby("stage", sort=False).head(_MAX_ROWS)
        note = f"{len(shown)} of {len(means)} rows of the run's `tables/evaluation`, without self-consistency"
        parts += [f"Means over terrains ({note}):", _table(shown)]
    detection = catalogue.run / "tables" / "detection.parquet"
    if detection.is_file():
        table = read_parquet(detection)
        names = ("detector", "training", "trained", "domain", "evaluated", "kind", "images", "map50", "map50_95")
        columns = [name for name in names if name in table.columns]
        parts += ["Detectors of the run:", _table(table[columns].head(2 * _MAX_ROWS))]
    return "\n\n".join(parts) or "Not evaluated: the run has no `tables/evaluation`."


def _table(table: pd.DataFrame) -> str:
    """Return a Markdown table; numbers have four significant digits."""
    if not len(table):
        return ""
    head = ["| " + " | ".join(map(str, table.columns)) + " |", "|" + "---|" * len(table.columns)]
    rows = ["| " + " | ".join(_shown(value) for value in row) + " |" for row in table.itertuples(index=False)]
    return "\n".join([*head, *rows])


def _shown(value: object) -> str:
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    return text.replace("|", "/").replace("\n", " ")


def rai_answers(catalogue: Catalogue) -> dict[str, object]:
    """Return the fields of Croissant's vocabulary for responsible AI by name in mlcroissant."""
    twins = [domain for domain in catalogue.domains if domain != catalogue.photo_domain]
    faults = terms.faults(catalogue)
    return {
        "data_collection": terms.summary(catalogue),
        "data_collection_type": ["Experiments", "Software Collection", "Manual Human Curator"],
        "data_collection_missing_data": f"{terms.missing_photos(catalogue)} have no twin. Fully occluded rocks and "
        "shadows have no label.",
        "data_collection_raw_data": f"{terms.raw_data(catalogue)}; for analog runs, simulated data in the same layout.",
        "data_imputation_protocol": "Surfaces without scan points are interpolated smoothly.",
        "data_preprocessing_protocol": ["Images are raw: 12-bit values in 16 bits, not rectified."],
        "data_manipulation_protocol": f"Twins ({', '.join(twins) or 'none in this bundle'}) are ray-traced images.",
        "data_annotation_protocol": [
            "A person annotated boxes of rocks and shadows in a few photos (source seed); these were propagated to all "
            "photos by geometry and light (fused, translated, projected, cast). Labels of twins are computed by the "
            "renderer (rendered)."
        ],
        "data_annotation_platform": ["labelImg, CVAT or Label Studio for human annotations; polarsim for propagation"],
        "data_annotation_analysis": ["See the evaluation of this run in the data card, README.md."],
        "annotations_per_item": "1",
        "annotator_demographics": ["A few people familiar with the data set; no further information."],
        "machine_annotation_tools": [f"polarsim {__version__}"],
        "data_biases": faults[1:3],
        "data_use_cases": ["Training and testing of detectors of rocks and shadows, stereo, and sim-to-real gaps"],
        "data_limitations": [*faults[:1], *faults[3:]],
        "data_social_impact": "None known for images of sand and rocks. Hazard maps for a real lander need separate "
        "tests.",
        "personal_sensitive_information": ["None: the images show no persons."],
        "data_release_maintenance_plan": "The run can be repeated from the configuration; errors are corrected in "
        "polarsim and published as a new version.",
    }


_QUESTIONS = {  # of Gebru et al., Datasheets for Datasets, CACM 64 (2021) 86, and the RAI fields that answer them
    "Motivation: for which purpose was the data set created?": ("data_use_cases",),
    "Composition: which data are included, missing, raw?": (
        "data_collection", "data_collection_missing_data", "data_collection_raw_data",
    ),
    "Composition: are there sensitive data?": ("personal_sensitive_information",),
    "Collection: how were the data acquired?": ("data_collection_type",),
    "Preprocessing: how were the data processed?": (
        "data_preprocessing_protocol", "data_imputation_protocol", "data_manipulation_protocol",
    ),
    "Labelling: who annotated the data, how, and with which tools?": (
        "data_annotation_protocol", "data_annotation_platform", "machine_annotation_tools", "annotations_per_item",
        "annotator_demographics", "data_annotation_analysis",
    ),
    "Uses: which biases, limits and impacts are known?": (
        "data_biases", "data_limitations", "data_social_impact",
    ),
    "Maintenance: how is the data set maintained?": ("data_release_maintenance_plan",),
}  # fmt: skip


def datasheet(catalogue: Catalogue) -> str:
    """Return the datasheet in Markdown with the answers of Croissant's RAI fields."""
    answers = rai_answers(catalogue)
    assert {name for names in _QUESTIONS.values() for name in names} == set(answers)
    parts = [f"# Datasheet of {terms.title(catalogue)}"]
    for question, names in _QUESTIONS.items():
        parts.append(f"## {question}")
        for name in names:
            answer = answers[name]
            parts += [str(part) for part in answer] if isinstance(answer, list) else [str(answer)]
    licences = [
        f"- {content}: {licence}" + (f" ({url})" if url else "") for content, licence, url in terms.licences(catalogue)
    ]
    parts += ["## Distribution: under which terms?", "\n".join(licences)]
    return "\n\n".join(parts) + "\n"
