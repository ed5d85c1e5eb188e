"""Validated configuration, wildcard constraints and helpers of rules. Computed paths: polarsim/paths."""

import os
import re
import sys
from importlib.util import find_spec
from pathlib import Path

if isinstance(workflow.current_basedir, os.PathLike):  # a clone, not a workflow at a hosting service
    CLONE = str(Path(workflow.current_basedir).parents[1])
    os.environ.update(POLARSIM_CLONE=CLONE)  # for workflow/envs
    if find_spec("polarsim") is None:  # a plan needs Snakemake alone
        sys.path.append(CLONE)

from polarsim.cover_photos.options import CARVED
from polarsim.digest import script_digest
from polarsim.errors import PolarsimError
from polarsim.formats.files import resolve_packaged
from polarsim.formats.yaml_files import read_yaml
from polarsim.paths import CoverPaths, GapPaths, RoverPaths, RunPaths, memory_per_attempt
from polarsim.photo import terrain_text
from polarsim.running.configuration import base_configuration, check_config, config_of_module, store_config
from polarsim.running.inputs import check_paths
from polarsim.running.site_stages import plan_lines

IS_MODULE = not workflow.modifier.is_main_snakefile()
CONFIG_FILES = workflow.config_settings.configfiles  # in a module: of the other workflow
try:
    BASE_FILES = [] if IS_MODULE else base_configuration(CONFIG_FILES)
except PolarsimError as error:
    sys.exit(f"error: {error}")

if BASE_FILES:  # overlays only, or no file: applied to the configuration of the demo

    configfile: str(resolve_packaged(BASE_FILES[0]))


# Returns a path below the `prefix` of a module, as Snakemake places inputs and outputs; after the parse, too, when
# `workflow.modifier` is that of the other workflow.
placed = workflow.modifier.path_modifier.replace_prefix

try:
    if IS_MODULE:
        CONFIG = config_of_module(config, placed)
    else:
        for _file in workflow.configfiles:  # unlike Snakemake, `read_yaml` rejects repeated keys and octal numbers
            read_yaml(_file)
        CONFIG = check_config(config, [*BASE_FILES, *CONFIG_FILES], workflow.config_settings.config)
    if workflow.is_main_process:  # not repeated by jobs
        check_paths(CONFIG)
        for line in plan_lines(CONFIG):
            print(line, file=sys.stderr)
except PolarsimError as error:
    sys.exit(f"error: {error}")

PATHS = RunPaths(CONFIG, placed)
GAP, COVERS, DRIVES = GapPaths(PATHS), CoverPaths(PATHS), RoverPaths(PATHS)
SOURCE = CONFIG.data_source
RUN, TERRAINS, MODELS, ORIGIN = PATHS.run, PATHS.terrains, PATHS.models, PATHS.origin
DOMAINS, TRAINED, SPLITS, SEEDS, OTHERS = PATHS.domains, PATHS.trained, PATHS.splits, PATHS.seeds, PATHS.others
options = PATHS.options
# Trainings are the longest jobs, so their inputs have priority over figures and scores. The last steps of a run depend
# on predictions, evaluations and scores of twins, figures of stages do not.
TRAINING_WAITS, TWINS_WAIT, TABLES_WAIT = 2, 1, 1
MAX_TERRAINS_SHOWN = 4  # with single figures in Snakemake's report: about 12 MB per terrain


def one_of(names, but=()):
    """Return a pattern that matches these names; `none` without names."""
    return "|".join(re.escape(name) for name in names if name not in but) or "none"


wildcard_constraints:
    run=re.escape(RUN),
    terrain=one_of([*TERRAINS, terrain_text(CARVED)]),
    position=one_of(CONFIG.positions),
    domain=one_of(TRAINED, but=CONFIG.detect.mixes),
    mix=one_of(CONFIG.detect.mixes),
    trained=one_of(TRAINED),
    evaluated=one_of(DOMAINS),
    split=one_of(SPLITS),
    seed=r"\d+",
    form="[a-z0-9-]+",
    component=one_of(GAP.rendered),
    fold=one_of([*COVERS.folds, *COVERS.not_tested]),
    cover_trained=one_of(COVERS.trainings),
    view=one_of(DRIVES.views),
    case=one_of(DRIVES.cases),
    drives="path|autonomy",


def of_run(pattern, **wildcards):
    """Return files of this run, one for each combination of wildcard values."""
    return expand(pattern, run=RUN, **wildcards)


def existing(files):
    """Return an input function of files, which ends the planning with one line if they do not exist."""

    def found(wildcards):
        try:
            return files()
        except PolarsimError as error:
            sys.exit(f"error: {error}")

    return found


def required(files, reason):
    """Return files, or an input function that ends the planning with a reason in one line if the list is empty."""

    def refuse(wildcards):
        sys.exit(f"error: {reason}")

    return files or refuse


def of_drives(pattern, **wildcards):
    """Return files of all drives of this run."""
    return of_run(pattern, seed=DRIVES.seeds, **wildcards)


def shown(path, category, caption=None, **labels):
    """Mark a file for Snakemake's report, with the caption of the same name in `workflow/report/`.

    The caption of `results/{run}/figures/meshes_Terrain{terrain}.png` is `figures/meshes.rst`. The report embeds
    images, so figures of single terrains are excluded for large runs; `results.html` links them.
    """
    if "_Terrain" in path and len(TERRAINS) > MAX_TERRAINS_SHOWN:
        return path
    name = re.sub(r"results/{run}/|_Terrain{.*|_{.*|\.\w+$", "", path)
    return report(path, caption=f"../report/{caption or name}.rst", category=category, labels=labels or None)


def converted_photos():
    """Return the folder of photos in polarsim's format; none for a site whose photos already have it."""
    folder = "results/{run}/acquire/Terrain{terrain}/photos"
    return {"converted": directory(folder)} if CONFIG.site.converts_photos and SOURCE.has_photos else {}


def of_positions(path, category, drawn):
    """Return a figure of each position of a terrain."""
    return [
        shown(path.replace("{position}", position), category, terrain="{terrain}", position=position)
        for position in drawn
    ]


def table_files(**titles):
    """Return the CSV files of tables, with titles for Snakemake's report, and the files written through the first."""
    files = {}
    for name, title in titles.items():
        path = f"results/{{run}}/tables/{name}.csv"
        files[name] = shown(path, "Tables", table=title) if title else path
    forms = ["md", "tex", "parquet"]
    return files | {"others": expand("results/{{run}}/tables/{name}.{form}", name=list(titles), form=forms)}


def position_figures(drawn):
    """Return the figures of the given positions of a terrain."""
    path = "results/{run}/figures/NAME_Terrain{terrain}_Pos{position}.png"
    return {
        "comparisons": of_positions(path.replace("NAME", "comparison"), "Photos and twins", drawn),
        "contacts": of_positions(path.replace("NAME", "contact"), "Contact sheets", drawn),
    }


def detector_figures(name, title):
    """Return a figure of the detector of each domain."""
    path = f"results/{{run}}/figures/{name}_DOMAIN.png"
    return [
        shown(
            path.replace("DOMAIN", trained), "Detection", f"figures/{name}", picture=f"{title}, detector of {trained}"
        )
        for trained in DOMAINS
    ]


def complete(rule_name, item):
    """Add the items that all rules have, unless a workflow that uses this one as a module has set them.

    - environment of `--sdm conda`; otherwise jobs use the environment of Snakemake
    - log file, named by rule file, rule and wildcards of the output; its last line states duration, CPU time and memory
    - `params.code`: digest of the script and the imported modules; Snakemake tracks only the script
    - `params.site`: the site
    """
    item.conda_env = item.conda_env or "../envs/polarsim.yaml"
    named = dict.fromkeys(re.findall(r"{(\w+)", " ".join(item.output[:1])))  # in the order of the first output
    wildcards = [name for name in named if name != "run"]
    name = "_".join([rule_name, *(f"seed{{{name}}}" if name == "seed" else f"{{{name}}}" for name in wildcards)])
    folder = "results/{run}" if "run" in item.wildcard_names else f"results/{RUN}"
    stage = re.search(r"([a-z_]+)\.smk", str(item.snakefile))[1]
    item.log_modifier = workflow.modifier.path_modifier
    if not item.log:
        item.set_log(f"{folder}/logs/{stage}/{name}.log")
    script = item.basedir.join(item.script)
    item.set_params(
        code=script_digest(script if isinstance(script, os.PathLike) else workflow.sourcecache.get_path(script)),
        site=PATHS.site,
    )
