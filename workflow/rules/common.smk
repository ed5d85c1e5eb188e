"""What every rule file uses: the checked configuration, wildcards, and functions that name files."""

import re
import sys
from math import log2
from pathlib import Path

from polarsim.acquire.inputs import raw_inputs
from polarsim.config import parse_config
from polarsim.digest import code_digest
from polarsim.errors import ConfigError
from polarsim.grid import selected_grid
from polarsim.photo import positions as positions_of_terrain
from polarsim.survey import terrain_folder

try:
    CONFIG = parse_config(config)
except ConfigError as error:
    sys.exit(f"error: configuration: {error}")

RUN = CONFIG.run
KIND = CONFIG.source.kind
ROOT = CONFIG.source.root
TERRAINS = [f"{terrain:02d}" for terrain in CONFIG.terrains]
DOMAINS = list(CONFIG.domains)
MODELS = list(CONFIG.render.models)
ORIGIN = {"run": RUN, "source": KIND, "config": CONFIG.digest()}


wildcard_constraints:
    run=re.escape(RUN),
    terrain=r"\d\d",
    position="[A-G]",
    model="|".join(map(re.escape, MODELS)),
    domain="|".join(map(re.escape, DOMAINS)) or "none",
    trained="|".join(map(re.escape, DOMAINS)) or "none",
    evaluated="|".join(map(re.escape, DOMAINS)) or "none",


def of_run(pattern, **wildcards):
    """Files of this run, one for each terrain or other wildcard value."""
    return expand(pattern, run=RUN, **wildcards)


def options(section):
    """A section of the configuration as plain values, for `params`."""
    chosen = getattr(CONFIG, section)
    return (
        chosen.stage_options()
        if section == "labels"
        else chosen.model_dump(mode="json")
    )


def code_of(*modules):
    """Digest of the library code behind a rule: Snakemake watches the script, not what it imports."""
    return code_digest(*(f"polarsim.{module}" for module in modules))


def positions_of(terrain):
    """Positions of the configuration that a terrain has."""
    return [
        position
        for position in positions_of_terrain(terrain)
        if position in CONFIG.positions
    ]


def positions_here(wildcards):
    return positions_of(int(wildcards.terrain))


def raw_data(wildcards):
    """What must be there before a terrain can be indexed: a receipt of what was made or fetched, or local files."""
    return [
        str(path)
        for path in raw_inputs(
            int(wildcards.terrain), CONFIG.source, CONFIG.labels.seeds
        )
    ]
