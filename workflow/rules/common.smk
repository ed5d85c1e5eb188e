"""The checked configuration, wildcards, and all functions that name files."""

import functools
import hashlib
import operator
import re
import sys
from math import log2
from pathlib import Path

from polarsim.acquire.inputs import raw_inputs
from polarsim.acquire.options import describe_seeds
from polarsim.cover_photos.options import CARVED
from polarsim.detect.options import PACKAGED
from polarsim.digest import script_digest
from polarsim.errors import PolarsimError
from polarsim.formats.release import (
    cover_photos,
    label_files,
    label_folder,
    mesh_files,
    polygon_folder,
)
from polarsim.schemas import FINE_TUNED, RENDERED
from polarsim.formats.yaml_files import read_yaml
from polarsim.grid import selected_grid
from polarsim.photo import USUAL_EXPOSURE_MS, WIDTH
from polarsim.photo import positions as positions_of_terrain
from polarsim.publish.options import FORM_NAMES
from polarsim.running.configuration import base_of, check_config, store_config
from polarsim.running.inputs import check_paths

CONFIG_FILES = workflow.config_settings.configfiles
try:
    BASE_FILES = base_of(CONFIG_FILES)
except PolarsimError as error:
    sys.exit(f"error: {error}")

if BASE_FILES:  # overlays only, or no file: they are applied to the demo's configuration

    configfile: "config/config.yaml"


try:
    for _file in workflow.configfiles:  # Snakemake's reader accepts repeated keys and octal numbers, ours does not
        read_yaml(_file)
    CONFIG = check_config(config, [*BASE_FILES, *CONFIG_FILES], workflow.config_settings.config)
    if workflow.is_main_process:  # jobs need not check again
        check_paths(CONFIG)
except PolarsimError as error:
    sys.exit(f"error: {error}")

RUN = CONFIG.run
KIND = CONFIG.source.kind
ROOT = CONFIG.source.root
TERRAINS = [f"{terrain:02d}" for terrain in CONFIG.terrains]
DOMAINS = list(CONFIG.domains)
TRAINED = list(CONFIG.training_domains)
SPLITS, SEEDS = list(CONFIG.detect.splits), list(CONFIG.detect.seeds)
OTHERS = CONFIG.detect.others if DOMAINS else {}
DETECTION_OF_OTHERS = "results/{run}/detect/others.parquet" if OTHERS else []
MIXES = {name: dict(weights) for name, weights in CONFIG.detect.mixes.items()}
MODELS = list(CONFIG.render.models)
STEREO = CONFIG.detect.stereo.run and bool(DOMAINS)
# Twins that stand in for missing photos; the analog misses none, so its labels can be looked at before twins are made.
STAND_INS = [] if KIND == "analog" else MODELS[:1]
# Trainings are the longest jobs: what they wait for goes first, figures and scores fill the gaps.
TRAINING_WAITS, TWINS_WAIT = 2, 1
MOST_TERRAINS_SHOWN = 4  # one by one in Snakemake's report: each takes some 12 MB of it
# The index of a terrain's photos where the source has photos (cover photos are none), and materials where they are fitted.
PHOTOS_OF_TERRAIN = [] if KIND == "release" else "results/{run}/acquire/Terrain{terrain}/photos.parquet"
FITTED_MATERIALS = "results/{run}/renders/materials/Terrain{terrain}"
MATERIALS_OF_TERRAIN = FITTED_MATERIALS if CONFIG.render.materials_from_photos else []
LABEL_ROOT = CONFIG.annotated_root
SEEDS_TEXT = describe_seeds(CONFIG.labels.seeds)
ORIGIN = {"run": RUN, "source": KIND, "config": CONFIG.digest()}


def one_of(names, but=()):
    """A pattern of these names alone; of none it matches nothing that is there."""
    return "|".join(re.escape(name) for name in names if name not in but) or "none"


wildcard_constraints:
    run=re.escape(RUN),
    terrain=r"\d\d",
    position="[A-G]",
    domain=one_of(TRAINED, but=MIXES),
    mix=one_of(MIXES),
    trained=one_of(TRAINED),
    evaluated=one_of(DOMAINS),
    split=one_of(SPLITS),
    seed=r"\d+",
    form=one_of(FORM_NAMES),


def of_run(pattern, **wildcards):
    """Files of this run, one for each terrain or other wildcard value."""
    return expand(pattern, run=RUN, **wildcards)


def options(section):
    """A section of the configuration, such as `detect.split`, as plain values, for `params`."""
    chosen = operator.attrgetter(section)(CONFIG)
    return chosen.stage_options() if section == "labels" else chosen.model_dump(mode="json")


def validation_options(prediction=CONFIG.detect.prediction):
    """What a training's validation takes of how it looks; with the rest changed no detector is trained anew."""
    return prediction.model_dump(mode="json", include={"device", "confidence", "nms_iou"})


def shown(path, category, caption=None, **labels):
    """A file that Snakemake's report shows under labels; `workflow/report/` has its caption by the same name.

    Of `results/{run}/figures/meshes_Terrain{terrain}.png` that is `figures/meshes.rst`. The report holds pictures whole, so
    that of a large run has none of single terrains: `results.html` leads to them.
    """
    if "{terrain}" in path and len(TERRAINS) > MOST_TERRAINS_SHOWN:
        return path
    own = re.sub(r"results/{run}/|_Terrain{.*|_{.*|\.\w+$", "", path)
    return report(path, caption=f"../report/{caption or own}.rst", category=category, labels=labels or None)


def digest_of_packaged(training=CONFIG.detect.training):
    """Digest of the detector that comes with polarsim, where trainings start from it: it lies outside the run."""
    chosen = training.pretrained == "packaged"
    return hashlib.sha256(PACKAGED.read_bytes()).hexdigest()[:12] if chosen else ""


def growing(mem_mb):
    """Memory of a job, MB: twice as much each time that it is tried anew (`--retries`)."""

    def of_attempt(wildcards, attempt):
        return mem_mb * 2 ** (attempt - 1)

    return of_attempt


def gpus_of(section):
    """GPUs that a job asks a cluster for: one where a section of the configuration names a device other than the CPU."""
    return int(operator.attrgetter(section)(CONFIG).device not in ("auto", "cpu"))


@functools.cache
def code_of(script):
    """Digest of a rule's script and all of the library behind it: Snakemake watches the script, not what it imports."""
    return script_digest(Path(workflow.basedir) / "workflow/scripts" / f"{script}.py")


def positions_of(terrain):
    """Positions of the configuration that a terrain has."""
    return [position for position in positions_of_terrain(terrain) if position in CONFIG.positions]


def positions_here(wildcards):
    return positions_of(int(wildcards.terrain))


def raw_data(wildcards):
    """What must be there before a terrain can be indexed: a receipt of what was made or fetched, or local files."""
    return [str(path) for path in raw_inputs(int(wildcards.terrain), CONFIG.source, CONFIG.labels.seeds)]


def override_file(wildcards):
    """Cuboids that a person typed, where there are any."""
    path = Path(f"config/rocks/terrain{wildcards.terrain}.yaml")
    return str(path) if path.exists() else []


def corrections_of(wildcards):
    """Label files that people put right, so that a new edit is a new input."""
    folder = CONFIG.labels.corrections
    if folder is None:
        return []
    files = [*folder.rglob(f"{wildcards.terrain}_*.txt"), *folder.rglob("*.json")]
    return sorted(str(path) for path in files)


def pictures_of(wildcards):
    """Photos stand in a table, twins and novel views in folders."""
    if wildcards.domain == CONFIG.photo_domain:
        return [f"results/{wildcards.run}/acquire/photos.parquet"]
    if wildcards.domain == "views":
        return [f"{CONFIG.detect.views}/index.csv"]
    return of_run("results/{run}/renders/{model}/Terrain{terrain}", model=wildcards.domain, terrain=TERRAINS)


def pictures_folder(wildcards):
    """The table of photos, the folder above the terrains of a model's twins, or that of novel views."""
    if wildcards.domain == CONFIG.photo_domain:
        return f"results/{wildcards.run}/acquire/photos.parquet"
    if wildcards.domain == "views":
        return str(CONFIG.detect.views)
    return f"results/{wildcards.run}/renders/{wildcards.domain}"


def labels_of(domain):
    """Photos are evaluated by the labels that were propagated to them, twins by their exact ones."""
    stage = "labels" if domain == CONFIG.photo_domain else "renders"
    return of_run(f"results/{{run}}/{stage}/labels.parquet")


def labels_of_domain(wildcards):
    """Novel views have theirs beside them."""
    return [] if wildcards.domain == "views" else labels_of(wildcards.domain)


def masks_of_domain(wildcards):
    """Grey maps of photos, instance maps of twins, where detectors learn masks; those of novel views are not read."""
    learns = any(training.masks for training in (CONFIG.detect.training, *OTHERS.values()))
    if not learns or wildcards.domain == "views":
        return []
    kind = "labels/masks" if wildcards.domain == CONFIG.photo_domain else "renders/instances"
    return of_run(f"results/{{run}}/{kind}/Terrain{{terrain}}", terrain=TERRAINS)


def datasets_of_mix(wildcards):
    """Data sets of a split that a mix takes pictures from."""
    return expand("results/{{run}}/detect/{{split}}/datasets/{domain}", domain=MIXES[wildcards.mix])


def pictures_behind(domains):
    """Converted pictures that data sets of these domains link to."""
    single = {one for domain in domains for one in MIXES.get(domain, [domain])}
    return expand("results/{{run}}/detect/pictures/{domain}", domain=sorted(single))


def sand_in(stage, terrains=TERRAINS):
    """Poses or meshes that say where the sand lies in the photos of terrains; none where finds off it are kept."""
    folders = f"results/{{run}}/{stage}/Terrain{{terrain}}"
    return of_run(folders, terrain=terrains) if CONFIG.detect.prediction.sand_only else []


def pictures_behind_training(wildcards):
    return pictures_behind([wildcards.trained])


def weights_of_mix(wildcards):
    return MIXES[wildcards.mix]


def training_of_other(wildcards):
    return OTHERS[wildcards.other].model_dump(mode="json", exclude={"trained_on"})


def predictions_of_other(wildcards):
    """What another model's detectors, of the domains that it is trained on, see in the test pictures of every domain."""
    return expand(
        "results/{run}/detect/{split}/others/{other}/seed{seed}/predictions/{trained}_on_{evaluated}.parquet",
        trained=OTHERS[wildcards.other].trained_on or TRAINED,
        evaluated=DOMAINS,
        **wildcards,
    )


def packaged_of_other(wildcards):
    return digest_of_packaged(OTHERS[wildcards.other])


def truth_of(wildcards):
    """What only the analog knows; nothing elsewhere."""
    return f"{ROOT}/truth/Terrain{wildcards.terrain}" if KIND == "analog" else None


def annotated_labels(terrain):
    """The folder of boxes that people drew, where there is one; the analog's are made up."""
    annotated = label_folder(LABEL_ROOT, int(terrain))
    return str(annotated) if KIND != "analog" and annotated.is_dir() else None


def annotated_labels_of(wildcards):
    return annotated_labels(wildcards.terrain)


def annotated_polygons(terrain):
    """The folder of polygons that people drew, where there is one."""
    annotated = polygon_folder(LABEL_ROOT, int(terrain))
    return str(annotated) if KIND != "analog" and annotated.is_dir() else None


def annotated_polygons_of_covers():
    """Folders of the polygons that people drew of terrains with cover photos, where detectors make masks."""
    terrains = [t for t in CONFIG.terrains if cover_photos(LABEL_ROOT, t)] if CONFIG.detect.training.masks else []
    return list(filter(None, map(annotated_polygons, terrains)))


def true_labels_of(wildcards):
    """The analog's true boxes, or those that people drew; nothing where there is neither."""
    if KIND == "analog":
        return f"{truth_of(wildcards)}/labels.parquet"
    return annotated_labels_of(wildcards)


def can_score_labels(terrain):
    return KIND == "analog" or annotated_labels(terrain) is not None


SCORED_TERRAINS = list(filter(can_score_labels, TERRAINS))


def evaluation_parts(wildcards):
    """The evaluation of each stage and terrain; labels only where there is something to compare them with."""
    compared = {
        "labels": SCORED_TERRAINS,
        "outlines": list(filter(annotated_polygons, TERRAINS)),
        "materials": TERRAINS if KIND == "analog" and MATERIALS_OF_TERRAIN else [],
    }
    return [
        f"results/{wildcards.run}/evaluation/{stage}_Terrain{terrain}.csv"
        for terrain in TERRAINS
        for stage in ("cameras", "rocks", "consistency", "labels", "outlines", "twins", "materials")
        if terrain in compared.get(stage, TERRAINS)
    ]


def every_figure(name):
    """A figure of every terrain, and of every position where the name asks for it."""
    return [
        path
        for terrain in CONFIG.terrains
        for position in (positions_of(terrain) if "{position}" in name else [""])
        for path in of_run(f"results/{{run}}/figures/{name}.png", terrain=f"{terrain:02d}", position=position)
    ]


def of_first_training(name):
    """A file of the first split and seed: what figures show."""
    return f"results/{{run}}/detect/{SPLITS[0]}/seed{SEEDS[0]}/{name}"


def photos_and_twins():
    """Pictures of every domain that detectors are compared over, of all terrains."""
    twins = [domain for domain in DOMAINS if domain != CONFIG.photo_domain]
    photos = of_run("results/{run}/acquire/Terrain{terrain}/photos.parquet", terrain=TERRAINS)
    return photos + of_run("results/{run}/renders/{model}/Terrain{terrain}", model=twins, terrain=TERRAINS)


TABLES_OF_DETECTORS = ["detection", "differences", "detection_breakdown", "false_positives", "ipd"]


def tables_of_detectors():
    """Where detectors are trained."""
    names = [*TABLES_OF_DETECTORS, "ipd_rocks"] if DOMAINS else []
    return of_run("results/{run}/tables/{name}.csv", name=names)


def figures_of_detectors():
    """Where detectors are trained; a page of rocks for each."""
    names = ["detection", "precision_recall", "ipd", "ipd_histogram"]
    names += [f"{page}_{domain}" for page in ("seen", "gap_rocks") for domain in DOMAINS]
    names += ["opposition"]
    return of_run("results/{run}/figures/{name}.png", name=names if DOMAINS else [])


# A run of cover photos alone makes no stage but that.
ONLY_COVERS = CONFIG.covers.run and not DOMAINS


def tables_of_page():
    """Tables of the results page, in the form that it shows."""
    names = [] if ONLY_COVERS else ["evaluation", "cameras", "alignment", "rocks", "meshes", "render"]
    names += ["labels", "reliability"] if SCORED_TERRAINS and not ONLY_COVERS else []
    names += [*TABLES_OF_DETECTORS, "ipd_rocks"] if DOMAINS else []
    names += ["stereo"] if STEREO else []
    names += ["gap"] if CONFIG.gap.components and DOMAINS else []
    names += ["covers", *(["masks"] if annotated_polygons_of_covers() else [])] if CONFIG.covers.run else []
    return of_run("results/{run}/tables/{name}.md", name=names)


def figures_of_stages():
    """Figures of all stages but the detectors'."""
    names = ["comparison_Terrain{terrain}_Pos{position}", "contact_Terrain{terrain}_Pos{position}"]
    names += ["meshes_Terrain{terrain}", "crops_Terrain{terrain}", "residuals_Terrain{terrain}"]
    names += ["offsets_Terrain{terrain}"] if KIND == "analog" else []
    whole = ["reflectance", *(["reliability"] if SCORED_TERRAINS else [])]
    return [
        *of_run("results/{run}/figures/{name}.png", name=whole),
        *(path for name in names for path in every_figure(name)),
        *of_run("results/{run}/figures/label_errors_Terrain{terrain}.png", terrain=SCORED_TERRAINS),
    ]


def figures_of_page():
    """Figures of the results page."""
    real = of_run("results/{run}/figures/{name}.png", name=["covers", "scenes"] if CONFIG.covers.run else [])
    causes = of_run("results/{run}/figures/gap.png") if CONFIG.gap.components and DOMAINS else []
    return [*figures_of_detectors(), *causes, *real, *([] if ONLY_COVERS else figures_of_stages())]


def pages_beside():
    """Further pages of the run, by the way from its folder."""
    errata = {"errata.html": "Defects of the published labels"} if KIND == "release" and not ONLY_COVERS else {}
    return {"report.html": "Snakemake's report, made by polarsim report", **errata}


def predictions_of_strip():
    """What the detector of photos finds in photos, where it is trained."""
    photo = CONFIG.photo_domain
    return of_first_training(f"predictions/{photo}_on_{photo}.parquet") if photo in DOMAINS else []


def shown_photo(wildcards):
    """The photo that stands for a position in the report: Sun 30 if there, rover light off, Left, near 256 ms."""

    def rank(key):
        return key.azimuth != "30", key.light, key.camera, abs(log2(key.exposure_ms / USUAL_EXPOSURE_MS))

    return str(min(selected_grid(int(wildcards.terrain), [wildcards.position], CONFIG.grid), key=rank))
