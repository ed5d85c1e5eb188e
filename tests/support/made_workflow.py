"""A workflow with three short jobs per terrain, for tests and benchmarks of `polarsim run`."""

from __future__ import annotations

from pathlib import Path

CONFIG = """
run: toy
terrains: [1, 2]
positions: [A]
source: {kind: analog, root: data/analog}
grid: {azimuths: ["30"], lights: ["off"], exposures_ms: [256]}
render: {models: [hapke]}
"""
SNAKEFILE = """
from polarsim.config import parse_config
from polarsim.running.configuration import base_configuration

if base_configuration(workflow.config_settings.configfiles):
    configfile: "config/config.yaml"

TERRAINS = [f"{terrain:02d}" for terrain in parse_config(config).terrains]

rule all:
    input:
        expand("results/toy/last/Terrain{terrain}.txt", terrain=TERRAINS),
        "results/toy/together.txt",

rule first:
    output: folder=directory("results/toy/first/Terrain{terrain}")
    log: "results/toy/logs/first_{terrain}.log"
    resources: mem_mb=500, runtime=5
    params: source="data/analog/Terrain{terrain}.txt"
    script: "scripts/first.py"

rule second:
    input: "results/toy/first/Terrain{terrain}"
    output: "results/toy/second/Terrain{terrain}.txt"
    log: "results/toy/logs/second_{terrain}.log"
    resources: mem_mb=500, runtime=5
    script: "scripts/second.py"

rule last:
    input: "results/toy/second/Terrain{terrain}.txt"
    output: "results/toy/last/Terrain{terrain}.txt"
    log: "results/toy/logs/last_{terrain}.log"
    resources: mem_mb=500, runtime=5
    script: "scripts/second.py"

rule together:
    input: expand("results/toy/last/Terrain{terrain}.txt", terrain=TERRAINS)
    output: "results/toy/together.txt"
    log: "results/toy/logs/together.log"
    resources: mem_mb=500, runtime=5
    script: "scripts/second.py"
"""
FIRST = """
import logging
import time
from pathlib import Path
from polarsim.errors import FormatError
from polarsim.formats.files import writing_folder
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]), writing_folder(snakemake.output.folder) as folder:
    text = Path(snakemake.params.source).read_text()
    if text == "broken":
        raise FormatError("no scan", path=snakemake.params.source)
    logging.getLogger("polarsim").warning("scan without date")
    for part in range(6):
        (folder / f"{part}.txt").write_text(text * 1000)
        time.sleep(PAUSE)
"""
SECOND = """
import time
from pathlib import Path
from polarsim.formats.files import writing
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]), writing(snakemake.output[0]) as path, path.open("w") as file:
    for source in snakemake.input:
        parts = sorted(Path(source).glob("*.txt")) if Path(source).is_dir() else [Path(source)]
        for part in parts:
            file.write(part.read_text() + "and so on\\n")
            time.sleep(PAUSE)
"""


def write_workflow(folder: Path, pause_s: float = 0.1) -> None:
    """Write the workflow and its inputs; every job pauses after each part of its output."""
    for part in ("config", "scripts", "data/analog"):
        (folder / part).mkdir(parents=True)
    (folder / "Snakefile").write_text(SNAKEFILE)
    (folder / "config/config.yaml").write_text(CONFIG)
    (folder / "scripts/first.py").write_text(FIRST.replace("PAUSE", str(pause_s)))
    (folder / "scripts/second.py").write_text(SECOND.replace("PAUSE", str(pause_s)))
    for terrain in (1, 2):
        (folder / f"data/analog/Terrain{terrain:02d}.txt").write_text(f"scan of {terrain}\n")
