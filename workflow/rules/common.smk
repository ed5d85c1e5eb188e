"""The checked configuration, wildcard constraints, and helpers of rules; paths that are computed: polarsim/paths.py."""

import re
import sys
from pathlib import Path

from polarsim.digest import script_digest
from polarsim.errors import PolarsimError
from polarsim.formats.yaml_files import read_yaml
from polarsim.paths import TABLES_OF_DETECTORS, CoverPaths, GapPaths, RoverPaths, RunPaths, growing
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

PATHS = RunPaths(CONFIG)
GAP, COVERS, DRIVES = GapPaths(PATHS), CoverPaths(PATHS), RoverPaths(PATHS)
SOURCE = CONFIG.data_source
RUN, TERRAINS, MODELS, ORIGIN = PATHS.run, PATHS.terrains, PATHS.models, PATHS.origin
DOMAINS, TRAINED, SPLITS, SEEDS, OTHERS = PATHS.domains, PATHS.trained, PATHS.splits, PATHS.seeds, PATHS.others
options = PATHS.options
SCRIPTS = Path(workflow.current_basedir.get_path_or_uri(secret_free=True)).parent / "scripts"
# Trainings are the longest jobs: what they wait for goes first, figures and scores fill the gaps.
TRAINING_WAITS, TWINS_WAIT = 2, 1
MAX_TERRAINS_SHOWN = 4  # one by one in Snakemake's report: each takes some 12 MB of it


def one_of(names, but=()):
    """A pattern of these names; of no name it matches nothing that exists."""
    return "|".join(re.escape(name) for name in names if name not in but) or "none"


wildcard_constraints:
    run=re.escape(RUN),
    terrain=r"\d\d",
    position="[A-G]",
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


def of_run(pattern, **wildcards):
    """Files of this run, one for each terrain or other wildcard value."""
    return expand(pattern, run=RUN, **wildcards)


def shown(path, category, caption=None, **labels):
    """A file that Snakemake's report shows under labels; `workflow/report/` has its caption by the same name.

    Of `results/{run}/figures/meshes_Terrain{terrain}.png` that is `figures/meshes.rst`. The report contains whole
    pictures, so that of a large run has none of single terrains: `results.html` links them.
    """
    if "_Terrain" in path and len(TERRAINS) > MAX_TERRAINS_SHOWN:
        return path
    own = re.sub(r"results/{run}/|_Terrain{.*|_{.*|\.\w+$", "", path)
    return report(path, caption=f"../report/{caption or own}.rst", category=category, labels=labels or None)


def complete(item):
    """Give a rule the items that all rules have in common.

    - the environment, with `--sdm conda`; otherwise jobs run in Snakemake's own
    - log and benchmark files, named by the rule file, the rule and the wildcards of its output
    - `params.code`: the digest of its script and of the library behind it; Snakemake tracks the script only
    """
    item.conda_env = "../envs/polarsim.yaml"
    named = dict.fromkeys(re.findall(r"{(\w+)", " ".join(item.output[:1])))  # in the order of the first output
    wildcards = [name for name in named if name != "run"]
    name = "_".join([item.name, *(f"seed{{{name}}}" if name == "seed" else f"{{{name}}}" for name in wildcards)])
    folder = "results/{run}" if "run" in item.wildcard_names else f"results/{RUN}"
    stage = Path(item.snakefile).stem
    item.log_modifier = item.benchmark_modifier = workflow.modifier.path_modifier
    item.set_log(f"{folder}/logs/{stage}/{name}.log")
    item.benchmark = f"{folder}/benchmarks/{stage}/{name}.tsv"
    item.set_params(code=script_digest(SCRIPTS / Path(item.script).name))
